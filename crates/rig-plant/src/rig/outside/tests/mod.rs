//! Rigs whose plant is a program or measured data.

use super::Outside;
use super::measured::Measured;
use crate::bench::scene;
use crate::board::Board;
use crate::rig::{ChangeError, EmulatedRig, RigError};
use crate::{PlantChange, PlantSettings, RigFault, RigPreset};
use std::fmt::Write as _;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn from(outside: &Outside, preset: RigPreset, given: &[&str]) -> Result<EmulatedRig, RigError> {
    let given: Vec<PlantChange> = given.iter().map(|text| text.parse().unwrap()).collect();
    EmulatedRig::from_outside(scene(), preset, &given, 1, outside)
}

fn spring() -> Outside {
    Outside::Program(format!("python3 {ROOT}/docs/plants/linear_spring.py"))
}

#[test]
fn the_example_is_a_load_on_a_spring() {
    let mut rig = from(&spring(), RigPreset::Ideal, &["load=6N", "twist_at_boot=5"]).unwrap_or_else(|e| panic!("{e}"));
    rig.poll(2.0);
    let truth = rig.truth();
    // The constants of docs/plants/linear_spring.py: 95 mm, 1500 N/m, 6e-6 m/rad2.
    let rest_m = 0.095 - 6e-6 * truth.twist_rad.powi(2);
    assert!((truth.gap_m - rest_m - 6.0 / 1500.0).abs() < 1e-5, "{}", truth.gap_m);
    assert!((truth.pull_n - 6.0).abs() < 0.01, "{}", truth.pull_n);
    let torque_nm = -2.0 * 6e-6 * truth.twist_rad * truth.pull_n;
    assert!((truth.string_torque_nm - torque_nm).abs() < 1e-12);
    // The LVDT shows that gap: 200 mm are 0 to 3 V of 3.3 V.
    let code = f64::from(rig.adc(2.001, 0));
    assert!((code - truth.gap_m / 0.2 * 3.0 / 3.3 * 4096.0).abs() < 10.0, "{code}");
    // A heavier load while it runs.
    rig.set_plant("load", "9N").unwrap_or_else(|e| panic!("{e}"));
    rig.poll(4.0);
    assert!((rig.truth().pull_n - 9.0).abs() < 0.02, "{}", rig.truth().pull_n);
    assert!(rig.plant_failure().is_none());
    let copy = rig.clone();
    assert!(copy.plant_failure().is_some_and(|why| why.to_string().contains("another rig")));
}

#[test]
fn strings_between_leaf_springs_lose_a_little_work_in_a_cycle_and_gain_none() {
    let program = Outside::Program(format!("python3 {ROOT}/docs/plants/leaf_springs.py"));
    let keys = ["load=5N", "twist_at_boot=10"];
    let mut rig = from(&program, RigPreset::Ideal, &keys).unwrap_or_else(|e| panic!("{e}"));
    // What shaft and load put into it on the way from one twist to another (J): what the shaft did, and both.
    let mut work = |load: &str, from: f64, to: f64| {
        rig.set_plant("load", load).unwrap_or_else(|e| panic!("{e}"));
        let steps = 12_000;
        let by = (to - from) / f64::from(steps);
        let (mut by_shaft, mut by_load) = (0.0, 0.0);
        for k in 1..=steps {
            let before_m = rig.plant.gap_m();
            rig.plant.step(crate::rig::STEP_S, from + f64::from(k) * by);
            by_shaft -= by * rig.plant.state().torque_nm;
            by_load += rig.plant.state().pull_n * (rig.plant.gap_m() - before_m);
        }
        (by_shaft, by_shaft + by_load)
    };
    work("5N", 10.0, 10.0);
    let cycle = [("5N", 30.0), ("9N", 30.0), ("9N", 10.0), ("5N", 10.0)];
    let mut at = 10.0;
    let ways = cycle.map(|(load, to)| work(load, std::mem::replace(&mut at, to), to));
    let (taken, lost) = (ways[0].0, ways.iter().map(|(_, both)| both).sum::<f64>());
    assert!(taken > 0.03, "{taken} J: about the load's weight times its way of 7 mm");
    // Friction of the strings on each other, and dampers when the load changes at once: without the work of squeezing the
    // pair in the torque it would be 19 %.
    assert!(lost > 0.0 && lost < 0.12 * taken, "{lost} J of {taken} J are lost in a cycle");
}

#[test]
fn keys_are_told_to_the_program_and_faults_of_the_strings_refused() {
    // The preset's keys need not be known; a given one must.
    let mut rig = from(&spring(), RigPreset::Hard, &["current_offset=1mA"]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(rig.settings().current_offset_a, 1e-3);
    let own = PlantSettings::preset(RigPreset::Hard, 1);
    assert_eq!(rig.settings().motor_friction_nm, own.motor_friction_nm, "motor and sensors are the emulator's");
    let error = from(&spring(), RigPreset::Ideal, &["string_creep=10%"]).err().unwrap().to_string();
    assert!(error.contains("`string_creep`") && error.contains("linear_spring.py"), "{error}");
    assert!(matches!(rig.set_plant("friction", "0.1"), Err(ChangeError::Program(_))));
    assert!(rig.set_plant("load", "-1").is_err(), "no load at all, whatever the program says");
    assert!(rig.set_plant("lvdt_noise", "1mm").is_ok());
    let error = rig.try_fault(RigFault::StringBreak, true).unwrap_err().to_string();
    assert!(error.contains("string-break"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_program_that_fails_stops_the_plant_and_is_named_with_its_line() {
    let file = std::env::temp_dir().join(format!("plant-of-rig-{}.sh", std::process::id()));
    let body = "n=0\nwhile read -r word rest; do case $word in start|set) echo ok ;; quit) exit ;;\n\
                step) n=$((n + 1)); if [ $n -gt 100 ]; then exit 3; else echo 0.1 0 5; fi ;; esac; done";
    std::fs::write(&file, body).unwrap();
    let program = Outside::Program(format!("sh {}", file.display()));
    let mut rig = from(&program, RigPreset::Ideal, &["load=5N"]).unwrap_or_else(|e| panic!("{e}"));
    rig.poll(0.02);
    assert!(rig.plant_failure().is_none());
    rig.poll(0.1);
    let failure = rig.plant_failure().expect("it has ended").to_string();
    assert!(failure.contains("plant-of-rig") && failure.contains("`step 1`"), "{failure}");
    assert_eq!((rig.truth().gap_m, rig.truth().string_torque_nm), (0.1, 0.0));
    assert!(rig.set_plant("load", "6N").is_err());
    std::fs::remove_file(file).unwrap();
}

/// The default scene's own gaps as measured data, twisting up `loop_m` above and down as much below them.
fn data(loop_m: f64) -> String {
    let mechanism = scene().mechanism().unwrap();
    let mut text = String::from("load_n,twist_rad,gap_m,direction\n");
    for k in 0..14 {
        let load_n = 0.6 * f64::powf(1.3, f64::from(k));
        for j in 0..=35 {
            let twist_rad = 3.0 + f64::from(j);
            let gap_m = mechanism.formal(load_n, twist_rad).unwrap().gap_m;
            let _ = writeln!(text, "{load_n},{twist_rad},{},up", gap_m + loop_m);
            let _ = writeln!(text, "{load_n},{twist_rad},{},down", gap_m - loop_m);
        }
    }
    text
}

#[test]
fn measured_gaps_make_the_rig_that_they_were_taken_from() {
    let outside = Outside::Measured(Measured::parse(&data(0.0)).unwrap());
    for (load, twist) in [("load=1N", "twist_at_boot=8"), ("load=5N", "twist_at_boot=30")] {
        let keys = [load, twist, "friction=0"];
        let here = from(&outside, RigPreset::Ideal, &keys).unwrap_or_else(|e| panic!("{e}")).truth();
        let mechanism = scene().mechanism().unwrap();
        let solved = mechanism.solve(here.load_n, here.twist_rad).unwrap();
        assert!((here.gap_m - solved.gap_m).abs() < 20e-6, "{} and {} m", here.gap_m, solved.gap_m);
        let model_nm = mechanism.conservative_torque_nm(here.load_n, here.twist_rad).unwrap();
        // The lightest loads are the measured ones continued.
        assert!((here.string_torque_nm / -model_nm - 1.0).abs() < 0.1, "{here:?} {model_nm}");
    }
    let error = from(&outside, RigPreset::Ideal, &["k2_scale=1.1"]).err().unwrap().to_string();
    assert!(error.contains("`k2_scale`") && error.contains("measured gaps"), "{error}");
    assert!(matches!(from(&outside, RigPreset::Ideal, &["load=100N"]), Err(RigError::Load { .. })));
    assert!(from(&outside, RigPreset::Hard, &["string_creep=10%"]).is_ok());
}

#[test]
fn two_ways_of_measured_gaps_are_a_loop() {
    let outside = Outside::Measured(Measured::parse(&data(50e-6)).unwrap());
    let mut rig = from(&outside, RigPreset::Ideal, &["load=5N", "twist_at_boot=10", "friction=0"])
        .unwrap_or_else(|e| panic!("{e}"));
    let mut at = |path: &[f64]| {
        for twist_rad in path {
            for _ in 0..4000 {
                rig.plant.step(1e-3, *twist_rad);
            }
        }
        rig.plant.gap_m()
    };
    let (up, down) = (at(&[15.0, 20.0]), at(&[25.0, 20.0]));
    assert!((up - down - 100e-6).abs() < 2e-6, "{} m", up - down);
}
