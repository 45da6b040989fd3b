//! Short forms of `cargo xtask endurance`.

use host_tests::endurance::{moves, noise};
use rig_plant::RigPreset;

#[test]
fn moves_loads_and_incidents_leave_no_trace() {
    let run = moves(6, RigPreset::Nominal, 3);
    println!("{run:?}");
    assert!(run["incidents"] >= 3.0 && run["resets"] == 0.0);
    assert_eq!((run["unannounced"], run["faults_without_cause"]), (0.0, 0.0));
    assert!(run["longest_tick_instructions"] < 84_000.0);
}

#[test]
fn random_bytes_at_both_doors_do_nothing() {
    let run = noise(100_000, 4);
    println!("{run:?}");
    assert!(run["good_requests_all_answered"] >= 15.0 && run["random_bytes_on_the_bus"] > 40_000.0);
}
