//! Short forms of `cargo xtask endurance`.

use host_tests::endurance::{moves, noise};
use rig_plant::RigPreset;

#[test]
fn moves_loads_and_incidents_leave_no_trace() {
    let run = moves(10, RigPreset::Nominal, 3);
    println!("{run}");
    assert!(run.incidents.values().sum::<u32>() >= 4 && run.resets == 0);
    assert_eq!((run.unannounced.0, run.faults_without_cause), (0, 0));
    assert!(run.longest_tick.instructions < 84_000);
}

#[test]
fn random_bytes_at_both_doors_do_nothing() {
    let run = noise(100_000, 4);
    println!("{run}");
    assert!(run.requests >= 15 && run.bytes[1] > 40_000);
}
