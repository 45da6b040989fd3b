//! The comparison on a few plants, so that it cannot rot: the benchmark proper is `cargo xtask compare`.

use host_tests::compare::baseline::{Law, Loop, PAPER_SPEED};
use host_tests::compare::play;
use host_tests::compare::score::{Score, Summary};
use host_tests::compare::{Comparison, Entry, untuned};
use host_tests::rigs::commission::Firmware;
use host_tests::rigs::subject::Subject;
use host_tests::scenario;
use rig_plant::PlantKey;

/// What `cargo xtask compare` found for the fixed ratio: with the least error, and with the most settled moves.
const MIN_ERROR: Loop =
    Loop { tr_rad_per_m: Some(2860.0), gain_per_s: 6.0, corner_rad_per_s: 38.4, breakaway_rad: 0.0 };
const MAX_SETTLED: Loop =
    Loop { tr_rad_per_m: Some(2860.0), gain_per_s: 6.0, corner_rad_per_s: 30.0, breakaway_rad: 0.0 };

/// Of the moves without load steps, and of those with.
fn summaries(entries: &[Entry]) -> [Summary; 2] {
    [false, true].map(|changed| Summary::new(entries.iter().filter(|e| e.changed == changed).map(|e| &e.score)))
}

#[test]
fn every_scenario_is_a_script_and_the_comparisons_hold_what_it_needs() {
    let names: Vec<String> = scenario::scripts().unwrap().into_iter().map(|(name, _)| name).collect();
    assert!(names.contains(&"example".to_owned()), "{names:?}");
    let scenarios = scenario::comparison().unwrap();
    let loads_kg = scenarios.iter().map(|s| (100.0 * s.load_n / 9.80665).round());
    assert!(loads_kg.eq([10.0, 50.0, 100.0, 150.0]));
    for s in &scenarios {
        assert!(s.moves.iter().all(|m| m.ticks >= 600), "{}: time to settle", s.name);
        assert_eq!(s.moves.iter().filter(|m| !m.changes.is_empty()).count(), 3, "{}: load steps", s.name);
    }
    // A script with anything else in it is refused by its line.
    let example = scenario::scripts().unwrap().into_iter().find(|(name, _)| name == "example").unwrap().1;
    let error = scenario::Scenario::new("example", &example).unwrap_err().to_string();
    assert!(error.contains("example, line"), "{error}");
}

#[test]
fn this_controller_beats_what_is_usual() {
    let scenarios = scenario::comparison().unwrap();
    let comparison = Comparison::new(&scenarios, &[Subject::random(1)]).unwrap();
    assert!(comparison.failures.is_empty(), "{:?}", comparison.failures);
    let play = |law| summaries(&comparison.play(law));
    let ours = play(None);
    println!("a: {ours:#?}");
    assert!(ours.iter().all(|s| s.settled == 1.0), "a settles everywhere, whatever the load does");
    let against = |what: &str, law: Law| {
        let theirs = play(Some(law));
        let [steady, steps] = [0, 1].map(|k| theirs[k].rms_m / ours[k].rms_m);
        println!("{what}: {steady:.2} and {steps:.2} times the rms error, {theirs:#?}");
        (steady, steps, theirs)
    };
    // The fixed ratios that the searches on fifty plants found; the one with the least error rings when the load changes.
    let (steady, ..) = against("b", Law::Loop(MAX_SETTLED));
    assert!(steady > 5.0, "{steady}");
    let (steady, worth, [_, steps]) = against("b'", Law::Loop(MIN_ERROR));
    assert!(steady > 5.0, "{steady}");
    // A load that changes on the way falls by millimetres under any controller, and damping its oscillation must not delay its return.
    assert!(worth > 1.0, "{worth}");
    assert!(steps.overshoot_m > 2.0 * ours[1].overshoot_m, "{steps:?}");
    let (steady, ..) = against("c", Law::OpenLoop);
    assert!(steady > 2.0, "{steady}");
    for (law, at_least) in [(Law::MatchedSpeed, 3.0), (Law::ConstantSpeed(PAPER_SPEED), 15.0)] {
        let (steady, steps, _) = against("d", law);
        assert!(steady > at_least && steps > 1.5, "{law:?}: {steady} and {steps}");
    }
}

/// The plant of the fifty whose friction and stiff rods, both unknown, make a light load's friction band look too wide.
#[test]
fn a_light_load_is_crept_up_to_not_pushed() {
    let light = &scenario::comparison().unwrap()[0];
    let (records, failure) = play::firmware(light, &Subject::random(26), &Firmware::as_built());
    assert_eq!((failure, records.len()), (None, light.moves.len()));
    let steady = records.iter().filter(|r| !r.changed).map(|r| Score::new(r).max_m);
    let max_m = steady.fold(0.0, f64::max);
    assert!(max_m < 0.2e-3, "{:.0} um", max_m * 1e6);
}

#[test]
fn without_friction_the_ratio_is_worth_five_times_the_error() {
    // The lightest and the heaviest load.
    let mut scenarios = scenario::comparison().unwrap();
    scenarios.drain(1..3);
    let smooth = |seed| {
        let mut plant = Subject::random(seed);
        let friction = plant.changes.iter_mut().find(|change| change.key == PlantKey::Friction).unwrap();
        friction.value = 0.0;
        plant
    };
    let comparison = Comparison::new(&scenarios, &[1, 2].map(smooth)).unwrap();
    assert!(comparison.failures.is_empty(), "{:?}", comparison.failures);
    let rms_m = |law| summaries(&comparison.play(law))[0].rms_m;
    let ours = rms_m(None);
    for law in [untuned(), MAX_SETTLED, MIN_ERROR] {
        let theirs = rms_m(Some(Law::Loop(law)));
        println!("{:.1} um against {:.1} um", ours * 1e6, theirs * 1e6);
        assert!(theirs > 5.0 * ours, "{ours} against {theirs} of {law:?}");
    }
}

#[cfg(unix)]
#[test]
fn a_controller_in_a_program_is_asked_each_tick_and_named_when_it_fails() {
    let scenarios = &scenario::comparison().unwrap()[1..2];
    let comparison = Comparison::new(scenarios, &[Subject::random(1)]).unwrap();
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    let pi: &str = format!("python3 {root}/docs/controllers/pi.py").leak();
    let (entries, failures) = comparison.played(Some(Law::Program(pi)));
    assert!(failures.is_empty() && entries.iter().all(|e| e.score.made), "{failures:?}");
    // It has the ratio and the gain of the fixed ratio with the least error.
    let [theirs, like] = [entries, comparison.play(Some(Law::Loop(MIN_ERROR)))].map(|e| summaries(&e)[0].rms_m);
    println!("{:.0} um by the program, {:.0} um by the same law in Rust", theirs * 1e6, like * 1e6);
    assert!((0.5..2.0).contains(&(theirs / like)), "{theirs} against {like}");

    let still = r#"echo '{"twist_rad_per_s": 0}'"#;
    for (name, body, why) in [
        ("ends", format!("read -r line; {still}"), "it ended instead of answering"),
        ("silent", format!("read -r line; {still}; cat > /dev/null"), "within 2 s"),
        ("words", "while read -r line; do echo fast; done".into(), "with `fast`, not with"),
        ("nothing", r#"while read -r line; do echo '{"twist_rad_per_s": null}'; done"#.into(), "a finite number"),
        ("infinite", r#"while read -r line; do echo '{"twist_rad_per_s": 1e60}'; done"#.into(), "a finite number"),
    ] {
        let file = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("controller-{name}.sh"));
        std::fs::write(&file, body).unwrap();
        let (entries, failures) = comparison.played(Some(Law::Program(format!("sh {}", file.display()).leak())));
        assert!(entries.iter().all(|e| !e.score.made) && entries.len() == scenarios[0].moves.len(), "{name}");
        let [failure] = &failures[..] else { panic!("{name}: {failures:?}") };
        assert!(failure.starts_with(&scenarios[0].name) && failure.contains("plant 1: "), "{failure}");
        assert!(failure.contains(why), "{name}: {failure}");
    }
    let (_, failures) = comparison.played(Some(Law::Program("no-such-program-anywhere")));
    assert!(failures[0].contains("cannot be started"), "{failures:?}");
}
