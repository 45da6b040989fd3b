//! The comparison on a few plants, so that it cannot rot: the benchmark proper is `cargo xtask compare`.

use host_tests::compare::baseline::{Law, Loop, PAPER_SPEED};
use host_tests::compare::plants::RandomPlant;
use host_tests::compare::score::Summary;
use host_tests::compare::{Comparison, Controller, Entry};
use host_tests::scenario;

/// What the search of `cargo xtask compare` found for the fixed ratio.
const FIXED: Loop = Loop { tr_rad_per_m: Some(2757.0), gain_per_s: 4.8, corner_rad_per_s: 14.4 };

#[test]
fn every_scenario_is_a_script_and_the_comparisons_hold_what_it_needs() {
    let names: Vec<String> = scenario::scripts().unwrap().into_iter().map(|(name, _)| name).collect();
    assert!(names.contains(&"example".to_owned()), "{names:?}");
    let scenarios = scenario::comparison().unwrap();
    assert_eq!(scenarios.len(), 4);
    for s in &scenarios {
        assert_eq!(s.plant.len(), 1, "{}: a load", s.name);
        assert!(s.moves.iter().all(|m| m.ticks >= 600), "{}: time to settle", s.name);
        assert_eq!(s.moves.iter().filter(|m| !m.changes.is_empty()).count(), 3, "{}: load steps", s.name);
    }
    // A script with anything else in it is refused by its line.
    let example = scenario::scripts().unwrap().into_iter().find(|(name, _)| name == "example").unwrap().1;
    let error = scenario::Scenario::new("example", &example).unwrap_err().to_string();
    assert!(error.contains("example, line"), "{error}");
}
