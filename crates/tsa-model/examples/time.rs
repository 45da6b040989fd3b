use std::time::Instant;
use tsa_model::*;
fn main() {
    for name in ["default", "niti-plateau", "paper-printed"] {
        let m = Scene::load(format!("scenes/{name}.toml")).unwrap().mechanism().unwrap();
        let mut best = f64::INFINITY;
        let (mut ev, mut it, mut n, mut fails) = (0u64, 0u64, 0u64, 0);
        let mut worst = 0.0f64;
        for _ in 0..5 {
            let t = Instant::now();
            (ev, it, n, fails) = (0, 0, 0, 0);
            for i in 0..64 {
                for j in 0..128 {
                    let load = 1.0 * (17.0f64).powf(i as f64 / 63.0);
                    match m.solve(load, twist_from_turns(7.5 * j as f64 / 127.0)) {
                        Ok(e) => {
                            ev += e.evaluations as u64;
                            it += e.iterations as u64;
                            worst = worst.max(e.residual);
                        }
                        Err(_) => fails += 1,
                    }
                    n += 1;
                }
            }
            best = best.min(t.elapsed().as_secs_f64());
        }
        println!(
            "{name}: {:.2} us, evals {:.1} its {:.1} residual {worst:.1e} fails {fails}",
            best / n as f64 * 1e6,
            ev as f64 / n as f64,
            it as f64 / n as f64
        );
    }
}
