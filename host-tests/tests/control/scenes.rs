//! The project's other scenes: strings that are shorter, longer and thinner than the default's.

use host_tests::{ControlBench, root};
use rig_config::Scene;
use rig_control::Controller;
use rig_control::mechanism::Mechanism;
use rig_link::gap_curve::GapCurve;
use rig_link::messages::LoadChoice;
use rig_plant::rig::EmulatedRig;
use rig_plant::{PlantSettings, RigPreset};
use std::f32::consts::PI;
use tsa_table::Table;
use tsa_table::fit::OwnedTable;

/// A scene of the project, with its table for good.
fn scene(name: &str) -> (Scene, &'static Table<'static>) {
    with_table(Scene::load(root().join(format!("scenes/{name}.toml"))).expect("a scene"))
}

fn with_table(scene: Scene) -> (Scene, &'static Table<'static>) {
    let owned: &OwnedTable = Box::leak(Box::new(scene.fit_table().expect("a table").table));
    (scene, Box::leak(Box::new(owned.table())))
}

/// A rig that has just been switched on, with a load (N) at a twist (rad).
fn rig(scene: &Scene, table: &'static Table<'static>, load_n: f64, twist_at_boot_rad: f64) -> ControlBench {
    let settings = PlantSettings { load_n, twist_at_boot_rad, ..PlantSettings::default() };
    let rig = EmulatedRig::new(scene, settings, 7).expect("a rig");
    ControlBench::on(rig, Controller::new(table, scene.constants(), None))
}

/// Homes from almost the last turn, and moves there and back, under a light and a heavy load.
#[test]
fn every_scene_is_homed_from_its_last_turn_and_moves_back_there() {
    for name in ["demonstration", "finger", "long-string", "niti-plateau"] {
        let (scene, table) = scene(name);
        let m = table.metadata;
        for (part, sign) in [(0.1, -1.0), (0.9, 1.0)] {
            let load_n = m.load_min_n * (m.load_max_n / m.load_min_n).powf(part);
            let mechanism = Mechanism { table: *table, twist_scale: 1.0, curve: GapCurve::constant(0.0) };
            let [low_m, high_m] = [PI, m.twist_max_rad].map(|twist_rad| mechanism.at(load_n, twist_rad).gap_m);
            let mut d = rig(&scene, table, load_n.into(), sign * 0.95 * f64::from(m.twist_max_rad));
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

/// A load turns the shorted motor back, by more than the first pulse of voltage turns it on, or before the drive has reported that.
#[test]
fn strings_that_turn_a_low_gear_back_are_no_wrong_wire() {
    for (gear, load_n, twist_rad) in [(8, 17.5, 2.0), (12, 10.0, 2.0), (15, 10.0, 6.0), (19, 15.0, 6.0)] {
        let mut scene = host_tests::scene().clone();
        scene.rig.gear_ratio = [gear, 1];
        let homed = rig(&scene, host_tests::table(), load_n, twist_rad).home();
        homed.unwrap_or_else(|e| panic!("{gear}:1 under {load_n} N: {e}"));
    }
}

/// Strings that let go of a load which has become too light for its place take longer than 3 s for their whole way.
#[test]
fn a_load_that_is_suddenly_too_light_for_its_place_is_let_go_as_far_as_a_high_gear_takes() {
    let (mut scene, table) = scene("long-string");
    scene.rig.gear_ratio = [103, 1];
    let mut d = rig(&scene, table, 12.0, 6.0);
    d.home().expect("it homes");
    d.move_to(0.01, 0.01, LoadChoice::Auto).expect("it moves");
    d.rig.set_plant("load", "2N").expect("a load");
    d.run(15.0);
    assert_eq!(d.control.fault(), None);
}

/// Strings of half a millimetre on soft rods: friction holds the load while they are turned by 18 rad.
#[test]
fn a_load_on_thin_strings_is_probed_for_as_much_longer_as_they_have_more_turns() {
    let thin = "
        geometry = { string_length_m = 0.2, rod_span_m = 0.0465, clamp_width_m = 0.0088, rod_radius_m = 0.49e-3 }
        string = { diameter_m = 0.5e-3, stiffness_n_per_m = 99.0, k1_per_n = 6.522, k2 = 0.127, k3 = 0.06878, k4 = 0.09601 }
        material = { stress_coefficients_pa = [3.51e10, 0.0, 0.0, 0.0, 0.0] }
        envelope = { load_n = [1.0, 5.0], turns = [0.0, 36.0] }
        accuracy = { contraction_m = 1e-4, tr_relative = 2e-2 }
        rig = { lvdt_gap_at_zero_m = 0.05 }";
    let (scene, table) = with_table(Scene::from_toml_str(thin).expect("a scene"));
    scene.check_rig().expect("a rig that can be");
    for seed in 1..5 {
        let settings =
            PlantSettings { load_n: 1.8, twist_at_boot_rad: 72.0, ..PlantSettings::preset(RigPreset::Nominal, seed) };
        let rig = EmulatedRig::new(&scene, settings, seed).expect("a rig");
        let mut d = ControlBench::on(rig, Controller::new(table, scene.constants(), None));
        d.home().unwrap_or_else(|why| panic!("seed {seed}: {why}"));
    }
}
