//! Short forms of `cargo xtask endurance`.

use host_tests::endurance::{moves, noise};

#[test]
fn moves_loads_and_faults_leave_no_trace() {
    let run = moves(8, 3);
    println!("{run}");
    assert!(run.faults >= 1 && run.resets == 0);
    assert!(run.worst.error_m.abs() < 60e-6 && run.ticks_missing < 5.0);
    assert_eq!(run.unannounced.0, 0);
    assert!(run.longest_tick.instructions < 84_000);
    assert!(run.telemetry_per_s > 95.0);
}

#[test]
fn random_bytes_at_both_doors_do_nothing() {
    let run = noise(100_000, 4);
    println!("{run}");
    assert!(run.requests >= 15 && run.bytes[1] > 40_000);
}
