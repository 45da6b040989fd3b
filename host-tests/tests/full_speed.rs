//! Moves as fast as the motor allows, while the load changes.

use host_tests::full_speed;
use host_tests::rigs::subject::Subject;
use sim_link::RigPreset;

/// On this rig a load that became a quarter lighter on its way down jumped up so far that the strings, which already turned as fast
/// as they can, could not follow the set-point any more.
#[test]
fn a_set_point_waits_for_strings_that_cannot_follow() {
    let moves = full_speed::under_steps(&Subject::new(RigPreset::Nominal, 1003));
    let failed: Vec<_> = moves.iter().filter_map(|o| o.failure.as_ref().map(|why| (&o.what, why))).collect();
    assert!(failed.is_empty(), "{failed:?}");
}
