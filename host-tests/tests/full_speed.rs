//! Moves as fast as the motor allows, while the load changes.

use host_tests::full_speed;
use host_tests::rigs::subject::Subject;
use rig_plant::RigPreset;

fn all_arrive(rig: RigPreset, seed: u64) {
    let moves = full_speed::under_steps(&Subject::new(rig, seed));
    let failed: Vec<_> = moves.iter().filter_map(|o| o.failure.as_ref().map(|why| (&o.what, why))).collect();
    assert!(failed.is_empty(), "{failed:?}");
}

/// On this rig a load that became a quarter lighter on its way down jumped up so far that the strings, which already turned as fast
/// as they can, could not follow the set-point any more.
#[test]
fn a_set_point_waits_for_strings_that_cannot_follow() {
    all_arrive(RigPreset::Nominal, 1003);
}

/// On this rig a load jumped up by 2 mm, because it had become lighter, while a move waited for its friction to be taken up: it went
/// on waiting for a load that sticks, until the position was too far off for too long.
#[test]
fn a_move_does_not_wait_for_a_load_that_has_left_its_place() {
    all_arrive(RigPreset::Hard, 2002);
}
