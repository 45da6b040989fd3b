use lab::chart::margin::{Controller, Hung};
use tsa_model::Mechanism;
fn main() {
    let scene = rig_scene::Scene::load("scenes/default.toml").unwrap();
    let m: Mechanism = scene.mechanism().unwrap();
    let c = Controller::damped();
    for kg in [0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.2] {
        for turns in [1.0, 3.0, 5.0] {
            let twist = 3.14159 + turns * 6.28318;
            match Hung::at(&m, kg * 9.80665, twist) {
                Ok(h) => println!(
                    "{kg} kg {turns} turns: omega {:.0} gain margin {:.1} delay margin {:.0} ms decay {:.1}/s; 10 ms more: {:.2}/s",
                    h.resonance_rad_per_s(),
                    h.gain_margin(&c),
                    1e3 * h.delay_margin(&c, 0.3),
                    -h.growth(&c).ln() / 0.01,
                    -h.growth(&Controller { delay_s: 0.01, ..c }).ln() / 0.01
                ),
                Err(e) => println!("{kg} {turns} {e}"),
            }
        }
    }
}
