//! The friction that is taken up before a load moves, from its contract (docs/explanation/control.md 4 and 5).

use crate::fixture::hanging;
use rig_control::TICK_S;
use rig_control::friction_compensation::FrictionCompensation;
use rig_control::load_motion::LoadMotion;
use rig_control::load_state::LoadState;
use rig_control::planner::{Motion, SetPoint};

const WAITING: SetPoint = SetPoint { done: false, ..SetPoint::at(0.0) };

/// A load of 6 N with 0.3 N of friction that has come down: its strings pull 5.7 N. A heavier one was homed with 0.5 N of friction.
fn came_down() -> LoadState<'static> {
    let mut load = hanging(6.0, 0.5, 25.0);
    load.observation.friction_n = 0.3;
    load.observation.pull_n = 5.7;
    load.observation.point = load.mechanism.at(5.7, 25.0);
    load.motion = LoadMotion::at_rest(&load.mechanism, load.observation.point.gap_m, 25.0, 5.7);
    load
}

/// Twist (rad) that takes the strings' pull from one end of the friction band to the other at a load that does not move.
fn band_rad(load: &LoadState<'_>) -> f32 {
    let high = load.mechanism.at(6.0 + load.observation.friction_n, load.twist_rad);
    (high.gap_m - load.mechanism.at(load.observation.pull_n, load.twist_rad).gap_m) * high.tr_rad_per_m()
}

/// Turns in the given number of ticks (rad).
fn turned(
    compensation: &mut FrictionCompensation,
    ticks: u32,
    set_point: &SetPoint,
    waits: bool,
    load: &LoadState<'_>,
) -> f32 {
    (0..ticks).map(|_| TICK_S * compensation.step(set_point, waits, 0.0, load)).sum()
}

/// What is turned before a move goes on (rad).
fn planned_rad(load: &LoadState<'_>) -> f32 {
    let mut compensation = FrictionCompensation::default();
    compensation.set_out(1.0);
    let first_rad = turned(&mut compensation, 1, &WAITING, true, load);
    assert!(first_rad > 0.0 && compensation.waiting);
    let ticks = (compensation.left_s / TICK_S).ceil() as u32;
    let rest_rad = turned(&mut compensation, ticks, &WAITING, true, load);
    assert!(compensation.left_s < TICK_S);
    turned(&mut compensation, 1, &WAITING, true, load);
    assert!(!compensation.waiting, "the planned time is over");
    first_rad + rest_rad
}

#[test]
fn a_move_the_other_way_turns_the_band_at_once_and_no_more_than_the_band_of_a_gap_that_is_off() {
    let load = came_down();
    assert!((planned_rad(&load) / band_rad(&load) - 1.0).abs() < 0.03, "{} of {}", planned_rad(&load), band_rad(&load));
    let mut off = came_down();
    off.motion.weight_n = 3.0;
    let (low, high) = (off.observation.point, off.mechanism.at(6.3, 25.0));
    let band_m = 0.6 * low.dgap_dload_m_per_n.max(high.dgap_dload_m_per_n);
    let max_rad = 1.25 * band_m * high.tr_rad_per_m();
    assert!((planned_rad(&off) / max_rad - 1.0).abs() < 0.05, "{} of {max_rad}", planned_rad(&off));
    // One that has not set out does not wait.
    let mut compensation = FrictionCompensation::default();
    turned(&mut compensation, 1, &WAITING, true, &came_down());
    assert!(!compensation.waiting);
}

#[test]
fn a_load_that_moves_ends_the_wait() {
    // Up along with its strings, and down because it has become heavier.
    for moved_m in [0.1e-3, -0.1e-3] {
        let mut load = came_down();
        let mut compensation = FrictionCompensation::default();
        compensation.set_out(1.0);
        turned(&mut compensation, 10, &WAITING, true, &load);
        assert!(compensation.waiting);
        load.position_m = moved_m;
        turned(&mut compensation, 2, &WAITING, true, &load);
        assert!(!compensation.waiting, "{moved_m}");
        // What was still to be turned is not: it only stops.
        let after_rad = turned(&mut compensation, 500, &WAITING, false, &load);
        assert!(after_rad >= 0.0 && after_rad < 0.5 * band_rad(&load), "{after_rad}");
    }
}

#[test]
fn motion_is_told_from_the_places_before_wherever_these_are() {
    for position_m in [5e-3, -3e-3] {
        let mut load = came_down();
        load.position_m = position_m;
        let mut compensation = FrictionCompensation::default();
        compensation.set_out(1.0);
        turned(&mut compensation, 10, &WAITING, true, &load);
        // One reading is half of what counts.
        load.position_m = position_m + 30e-6;
        turned(&mut compensation, 1, &WAITING, true, &load);
        assert!(compensation.waiting);
        turned(&mut compensation, 1, &WAITING, true, &load);
        assert!(!compensation.waiting);
    }
}

#[test]
fn a_move_that_goes_on_the_same_way_has_nothing_to_take_up() {
    let load = hanging(6.0, 0.3, 25.0);
    let mut compensation = FrictionCompensation::default();
    compensation.set_out(1.0);
    turned(&mut compensation, 1, &WAITING, true, &load);
    assert_eq!(compensation.left_s, 0.0);
    let mut compensation = FrictionCompensation::default();
    compensation.set_out(0.0);
    assert!(!compensation.waiting);
}

#[test]
fn a_set_point_that_turns_round_under_way_takes_it_up_the_other_way() {
    let load = hanging(6.0, 0.3, 25.0);
    let passing = |speed| SetPoint { motion: Motion { speed, ..Motion::at(0.0) }, ..WAITING };
    let mut compensation = FrictionCompensation::default();
    assert_eq!(turned(&mut compensation, 200, &passing(1e-3), false, &load), 0.0);
    let down_rad = turned(&mut compensation, 200, &passing(-1e-3), false, &load);
    let low = load.mechanism.at(5.7, load.twist_rad);
    let expected_rad = (low.gap_m - load.observation.point.gap_m) * low.tr_rad_per_m();
    assert!(down_rad < 0.0 && (down_rad / expected_rad - 1.0).abs() < 0.02, "{down_rad} of {expected_rad}");
    assert_eq!(turned(&mut compensation, 50, &passing(-1e-3), false, &load), 0.0, "once");
}

#[test]
fn at_rest_a_load_that_sticks_beside_its_place_by_more_than_noise_has_most_of_it_taken_up() {
    let load = came_down();
    let mut compensation = FrictionCompensation::default();
    let rest = SetPoint::at(0.0);
    let small: f32 = (0..200).map(|_| TICK_S * compensation.step(&rest, false, 19e-6, &load)).sum();
    assert_eq!(small, 0.0, "within noise");
    let turned: f32 = (0..200).map(|_| TICK_S * compensation.step(&rest, false, 50e-6, &load)).sum();
    assert!((turned / band_rad(&load) - 0.8).abs() < 0.02, "{turned} of {}", band_rad(&load));
}
