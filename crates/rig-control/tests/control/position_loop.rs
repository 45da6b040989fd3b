//! One tick of the position loop, from its equations (docs/explanation/control.md 3).

use crate::fixture::hanging;
use rig_control::load_motion::AHEAD_S;
use rig_control::load_state::LoadState;
use rig_control::planner::{Motion, SetPoint};
use rig_control::position_loop::{FULL_PER_S, GAINS, PositionLoop, damping_fraction};
use rig_control::ramp::Ramp;
use rig_control::{RigConstants, TICK_S};
use rig_link::messages::HomingResult;

/// A load of 6 N without friction in the middle of its travel: it oscillates at some 30 rad/s.
fn load() -> LoadState<'static> {
    hanging(6.0, 0.0, 25.0)
}

/// On its way, so that the load is not taken for one at its target.
const PASSING: SetPoint = passing(0.0);

/// The same at a position (m).
const fn passing(position_m: f32) -> SetPoint {
    SetPoint { done: false, ..SetPoint::at(position_m) }
}

fn step(set_point: &SetPoint, load: &LoadState<'_>) -> f32 {
    PositionLoop::default().step(set_point, false, load)
}

/// Speed of the load (m/s) for which the strings turn.
fn load_speed(set_point: &SetPoint, load: &LoadState<'_>) -> f32 {
    step(set_point, load) / load.observation.point.tr_rad_per_m()
}

fn same(found: f32, expected: f32) -> bool {
    (found - expected).abs() <= 0.01 * expected.abs() + 1e-6
}

#[test]
fn a_load_on_its_path_is_led_by_feed_forward_alone() {
    let load = load();
    let omega2 = load.motion.frequency_squared();
    assert!(load_speed(&PASSING, &load).abs() < 1e-6);
    let (speed, jerk) = (3e-3, 0.5);
    // Where the load will be when the command acts: on the path, with its speed.
    let mut moving = load;
    moving.motion.speed_m_per_s = -speed;
    let set_point = SetPoint { motion: Motion { speed, ..Motion::at(-AHEAD_S * speed) }, jerk, ..PASSING };
    let found = load_speed(&set_point, &moving);
    assert!(same(found, speed + jerk / omega2), "{found}");
    // An acceleration of the path is a place of rest ahead of it.
    let acceleration = 0.05;
    let motion = Motion { acceleration, ..Motion::at(-0.5 * AHEAD_S * AHEAD_S * acceleration) };
    let ahead = SetPoint { motion, ..PASSING };
    let mut rising = load;
    rising.motion.speed_m_per_s = -AHEAD_S * acceleration;
    let [by_position, _, by_rest] = GAINS;
    let omega = omega2.sqrt();
    let place = omega.min(FULL_PER_S) * (by_position + by_rest) * acceleration / omega2;
    let damping = -damping_fraction(omega) * omega * by_position * acceleration / omega2;
    let expected = AHEAD_S * acceleration + place + damping;
    let found = load_speed(&ahead, &rising);
    assert!(same(found, expected), "{found} instead of {expected}");
}

#[test]
fn a_place_of_rest_that_is_off_is_brought_back_by_the_gains() {
    let load = load();
    let omega = load.motion.frequency_squared().sqrt();
    let [by_position, _, by_rest] = GAINS;
    for error_m in [0.1e-3f32, -0.2e-3] {
        // Load and place of rest are both below (or above) the set-point.
        let found = load_speed(&passing(error_m), &load);
        let expected = omega.min(FULL_PER_S) * (by_position + by_rest) * error_m;
        assert!(same(found, expected), "{found} instead of {expected}");
        let rig = RigConstants { loop_gain: 0.5, ..*load.rig };
        let half = LoadState { rig: &rig, ..load };
        assert!(same(load_speed(&passing(error_m), &half), 0.5 * expected));
    }
}

#[test]
fn a_swing_is_damped_against_its_speed_and_with_the_distance_from_its_middle() {
    let omega = load().motion.frequency_squared().sqrt();
    let [by_position, by_speed, _] = GAINS;
    let fraction = damping_fraction(omega);
    for speed in [2e-3f32, -2e-3] {
        let mut oscillations = load();
        oscillations.motion.speed_m_per_s = speed;
        // It sinks: the strings go up.
        assert!(same(load_speed(&PASSING, &oscillations), fraction * by_speed * speed));
    }
    for below_m in [0.2e-3f32, -0.2e-3] {
        let mut oscillations = load();
        oscillations.motion.gap_m += below_m;
        let found = load_speed(&PASSING, &oscillations);
        assert!(same(found, fraction * omega * by_position * below_m), "{found}");
    }
}

#[test]
fn damping_leaves_a_part_of_the_speed_for_the_way_back() {
    let mut fallen = load();
    let fastest = fallen.rig.twist_limits().speed / fallen.observation.point.tr_rad_per_m();
    fallen.motion.gap_m += 10e-3;
    let found = load_speed(&PASSING, &fallen);
    assert!(same(found, -0.8 * fastest), "{found} of {fastest}");
    // A load that has become heavier comes to rest 2 mm lower, and is just as far below that place: it is led back all the same.
    fallen = load();
    fallen.motion.gap_m += 4e-3;
    fallen.motion.weight_n += 2e-3 / fallen.observation.point.dgap_dload_m_per_n;
    assert!(load_speed(&PASSING, &fallen) > 0.0);
}

#[test]
fn a_load_that_waits_for_its_friction_gets_no_feedback() {
    let mut beside = hanging(6.0, 0.3, 25.0);
    beside.motion.gap_m -= 1e-3;
    let mut control = PositionLoop::default();
    // The friction of a load that last went up is taken up already.
    control.compensation.set_out(1.0);
    assert_eq!(control.step(&PASSING, true, &beside), 0.0);
    assert!(load_speed(&PASSING, &beside).abs() > 2e-3, "with feedback");
}

#[test]
fn a_load_that_stands_beside_its_target_is_approached_at_twice_its_error_per_second() {
    let load = load();
    for target_m in [1e-3, -1e-3] {
        let mut position_loop = PositionLoop::default();
        let mut speed = || {
            let output = position_loop.step(&SetPoint::at(target_m), false, &load);
            output / load.observation.point.tr_rad_per_m()
        };
        let moves = (0..7).map(|_| speed()).last().unwrap();
        assert!(moves / target_m > 5.0, "not known to stand yet: {moves}");
        let stands = speed();
        assert!(same(stands, 2.0 * target_m), "{stands}");
    }
}

#[test]
fn strings_turn_no_further_against_a_jammed_load_but_back() {
    let mut jammed = load();
    let mut control = PositionLoop::default();
    let up = passing(1e-3);
    assert!(control.step(&up, false, &jammed) > 0.0);
    // 0.5 N and 0.3 of 6 N more than it weighs.
    jammed.observation.pull_n = 6.0 + 2.4;
    assert_eq!(control.step(&up, false, &jammed), 0.0);
    let down = passing(-1e-3);
    assert!(control.step(&down, false, &jammed) < 0.0);
    jammed.observation.pull_n = 6.0 + 2.2;
    assert!(control.step(&up, false, &jammed) > 0.0);
    // Slack strings: the other way round.
    jammed.observation.pull_n = 6.0 - 2.4;
    assert_eq!(control.step(&down, false, &jammed), 0.0);
    // A load that travels with that weight is not jammed, one that quivers is.
    jammed.motion.weight_n = 3.6;
    jammed.observation.moved_m = 1e-6;
    assert_eq!(control.step(&down, false, &jammed), 0.0);
    jammed.observation.moved_m = jammed.moved_m();
    assert!(control.step(&down, false, &jammed) < 0.0);
    // Neither is one at its set-point.
    let mut lighter = load();
    lighter.motion.weight_n = 3.0;
    lighter.observation.pull_n = 3.0;
    lighter.position_m = down.motion.position;
    assert!(control.step(&down, false, &lighter) != 0.0);
}

#[test]
fn a_load_that_has_left_a_standing_set_point_is_not_jammed_until_the_set_point_moves() {
    let mut load = load();
    let mut control = PositionLoop::default();
    let stands = SetPoint::at(load.position_m);
    control.step(&stands, false, &load);
    // Another weight has pulled it down, and more and more is laid on while it stands there.
    load.position_m -= 0.4e-3;
    load.motion.gap_m += 0.4e-3;
    for weight_n in [7.0, 9.0, 12.0, 14.0] {
        (load.motion.weight_n, load.observation.pull_n) = (weight_n, weight_n);
        assert!(control.step(&stands, false, &load) > 0.0, "{weight_n} N");
    }
    // From now on it may have jammed, also once the set-point stands again.
    let moves = passing(1e-3);
    for (pull_n, set_point) in [(20.0, moves), (20.0, SetPoint::at(1e-3))] {
        (load.motion.weight_n, load.observation.pull_n) = (pull_n, pull_n);
        assert_eq!(control.step(&set_point, false, &load), 0.0);
    }
}

#[test]
fn the_shaft_turns_as_the_motor_can_and_as_far_as_the_strings_go() {
    let (load, zero_rad) = (load(), 7.0);
    let m = load.mechanism.table.metadata;
    let at = |twist_rad: f32, speed| Ramp { position: zero_rad + twist_rad, speed };
    // From rest no faster than its acceleration allows, and then no faster than its speed.
    let limits = load.rig.twist_limits();
    let (first, at_end) = load.turned(at(20.0, 0.0), zero_rad, 1e3);
    assert_eq!((first.speed, at_end), (limits.acceleration * TICK_S, false));
    assert!((first.position - zero_rad - 20.0 - first.speed * TICK_S).abs() < 1e-5);
    assert_eq!(load.turned(at(20.0, limits.speed), zero_rad, 1e3).0.speed, limits.speed);
    for (end_rad, outwards) in [(m.twist_max_rad, 1.0), (m.twist_min_rad - 0.15, -1.0)] {
        let (shaft, at_end) = load.turned(at(end_rad, outwards), zero_rad, outwards);
        assert!(at_end && shaft.speed == 0.0 && (shaft.position - zero_rad - end_rad).abs() < 1e-5, "{shaft:?}");
        let (shaft, at_end) = load.turned(at(end_rad, -outwards), zero_rad, -outwards);
        assert!(!at_end && shaft.speed == -outwards, "back: {shaft:?}");
    }
}

#[test]
fn a_load_that_is_left_alone_leaves_nothing_of_what_was_turned_for_it() {
    let plain = hanging(10.0, 2.0, 25.0);
    let found = HomingResult { jump_m: 10.4 * plain.found.gap_noise_m, ..*plain.found };
    let mut load = LoadState { found: &found, ..plain };
    let mut position_loop = PositionLoop::default();
    // It is approached, until it has crept near enough to be left alone.
    for noises in [6.0, 4.0] {
        load.position_m = noises * found.gap_noise_m;
        for _ in 0..9 {
            position_loop.step(&SetPoint::at(0.0), false, &load);
        }
    }
    let first_tick = |mut position_loop: PositionLoop| {
        position_loop.compensation.set_out(-1.0);
        let moves = PASSING;
        position_loop.step(&moves, true, &load)
    };
    assert_eq!(first_tick(position_loop), first_tick(PositionLoop::default()));
}
