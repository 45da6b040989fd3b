//! The shaft's set-point, one tick after another, within what the motor can do and the strings' travel.

use crate::fixture::{hanging, near, table};
use rig_control::TICK_S;
use rig_control::ramp::Ramp;

const ZERO_RAD: f32 = 100.0;

/// The set-point of strings at a twist (rad) that are to turn at a speed (rad/s) for a second, and whether they are at the end of
/// their travel then. No tick asks for more than the motor can do.
fn turned_for_a_second(twist_rad: f32, speed_rad_per_s: f32) -> (Ramp, bool) {
    turned_with_scale(1.0, twist_rad, speed_rad_per_s)
}

fn turned_with_scale(twist_scale: f32, twist_rad: f32, speed_rad_per_s: f32) -> (Ramp, bool) {
    let mut load = hanging(6.0, 0.0, 25.0);
    load.mechanism.twist_scale = twist_scale;
    let mut shaft = Ramp::at(ZERO_RAD + twist_rad);
    let mut at_end = false;
    for _ in 0..100 {
        let before = shaft;
        (shaft, at_end) = load.turned(shaft, ZERO_RAD, speed_rad_per_s);
        let change = (shaft.speed - before.speed).abs();
        assert!(change <= 1.001 * load.rig.twist_limits().acceleration * TICK_S, "{before:?} {shaft:?}");
        near(shaft.position - before.position, shaft.speed * TICK_S, 1e-4);
    }
    (shaft, at_end)
}

#[test]
fn a_set_point_brakes_into_the_ends_of_travel() {
    let range = &table().metadata;
    let (lowest_rad, highest_rad) = (range.twist_min_rad - 0.15, range.twist_max_rad);
    for (start_rad, speed, end_rad) in [
        (lowest_rad + 5.0, -16.0, lowest_rad),
        (lowest_rad + 0.1, -16.0, lowest_rad),
        (highest_rad - 5.0, 16.0, highest_rad),
        (highest_rad - 0.1, 3.0, highest_rad),
    ] {
        let (shaft, at_end) = turned_for_a_second(start_rad, speed);
        near(shaft.position - ZERO_RAD, end_rad, 5e-3);
        near(shaft.speed, 0.0, 1e-3);
        assert!(at_end, "{start_rad}");
    }
}

#[test]
fn a_set_point_that_does_not_come_to_an_end_of_travel_is_free() {
    let (shaft, at_end) = turned_for_a_second(25.0, 2.0);
    near(shaft.position - ZERO_RAD, 27.0, 0.05);
    assert!(shaft.speed == 2.0 && !at_end);
    // From an end of travel, and from beyond it, it turns back.
    for twist_rad in [table().metadata.twist_max_rad, table().metadata.twist_max_rad + 0.2] {
        assert!(!turned_for_a_second(twist_rad, -1.0).1);
        let (shaft, at_end) = turned_for_a_second(twist_rad, 1.0);
        assert!(shaft == Ramp::at(ZERO_RAD + twist_rad) && at_end, "{shaft:?}");
    }
}

#[test]
fn thicker_strings_are_twisted_no_further_than_the_table_goes_and_thinner_ones_than_they_stand() {
    let highest_rad = table().metadata.twist_max_rad;
    for (twist_scale, end_rad) in [(1.05, highest_rad / 1.05), (0.95, highest_rad)] {
        let (shaft, at_end) = turned_with_scale(twist_scale, end_rad - 1.0, 16.0);
        near(shaft.position - ZERO_RAD, end_rad, 5e-3);
        assert!(at_end, "{twist_scale}");
    }
}
