//! The project's other scenes: strings that are shorter, longer and thinner than the default's.

use host_tests::{ControlBench, root};
use rig_config::Scene;
use rig_control::Controller;
use rig_control::mechanism::Mechanism;
use rig_link::gap_curve::GapCurve;
use rig_link::messages::LoadChoice;
use rig_plant::PlantSettings;
use rig_plant::rig::EmulatedRig;
use std::f32::consts::PI;
use tsa_table::Table;
use tsa_table::fit::OwnedTable;

/// Homes from almost the last turn, and moves there and back, under a light and a heavy load.
#[test]
fn every_scene_is_homed_from_its_last_turn_and_moves_back_there() {
    for name in ["demonstration", "finger", "long-string", "niti-plateau"] {
        let scene = Scene::load(root().join(format!("scenes/{name}.toml"))).expect("a scene");
        let owned: &OwnedTable = Box::leak(Box::new(scene.fit_table().expect("a table").table));
        let table: &Table<'_> = Box::leak(Box::new(owned.table()));
        let m = table.metadata;
        for (part, sign) in [(0.1, -1.0), (0.9, 1.0)] {
            let load_n = m.load_min_n * (m.load_max_n / m.load_min_n).powf(part);
            let mechanism = Mechanism { table: *table, twist_scale: 1.0, curve: GapCurve::constant(0.0) };
            let [low_m, high_m] = [PI, m.twist_max_rad].map(|twist_rad| mechanism.at(load_n, twist_rad).gap_m);
            let settings = PlantSettings {
                load_n: load_n.into(),
                twist_at_boot_rad: sign * 0.95 * f64::from(m.twist_max_rad),
                ..PlantSettings::default()
            };
            let rig = EmulatedRig::new(&scene, settings, 7).expect("a rig");
            let mut d = ControlBench::on(rig, Controller::new(table, scene.constants(), None));
            d.home().unwrap_or_else(|e| panic!("{name} under {load_n} N: {e}"));
            for part in [0.95, 0.05] {
                let target_m = part * (low_m - high_m);
                let speed_m_per_s = 0.2 * (low_m - high_m);
                d.move_to(target_m, speed_m_per_s, LoadChoice::Auto)
                    .unwrap_or_else(|e| panic!("{name} under {load_n} N to {target_m} m: {e}"));
                d.run(1.0);
                let off_m = (d.true_position_m() - f64::from(target_m)).abs();
                assert!(off_m < 50e-6, "{name} under {load_n} N: {off_m} m beside {target_m} m");
            }
        }
    }
}
