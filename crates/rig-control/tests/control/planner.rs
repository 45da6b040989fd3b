//! The planner against its limits, and against the shortest time that these allow.

use crate::fixture::{constants, hanging};
use proptest::prelude::*;
use rig_control::TICK_S;
use rig_control::limits::Limits;
use rig_control::planner::{Motion, Planner, SetPoint};
use rig_link::messages::HomingResult;
use rsruckig::prelude::*;

const TICK: f64 = TICK_S as f64;
/// Time (s) in which the acceleration rises and falls again.
const RISE_S: f32 = 0.2;

fn run(planner: &mut Planner, limits: &Limits) -> (f32, u32) {
    let (mut fastest, mut ticks) = (0f32, 0);
    loop {
        let s = planner.step(limits);
        fastest = fastest.max(s.motion.speed.abs());
        ticks += 1;
        if s.done || ticks > 100_000 {
            return (fastest, ticks);
        }
    }
}

/// Shortest time (s) from a motion to rest at a target, by an independent planner in f64.
fn optimum_s(from: &SetPoint, target: f32, limits: &Limits) -> f64 {
    let mut input = InputParameter::<1>::new(None);
    input.current_position[0] = from.motion.position.into();
    input.current_velocity[0] = from.motion.speed.into();
    input.current_acceleration[0] = from.motion.acceleration.into();
    input.target_position[0] = target.into();
    input.max_velocity[0] = limits.speed.into();
    input.max_acceleration[0] = limits.acceleration.into();
    input.max_jerk[0] = limits.jerk.into();
    let mut trajectory = Trajectory::new(None);
    Ruckig::<1, ThrowErrorHandler>::new(None, TICK).calculate(&input, &mut trajectory).expect("a trajectory");
    trajectory.get_duration()
}

#[test]
fn a_move_takes_the_shortest_time_that_its_limits_allow() {
    let mut worst = 0f64;
    for (distance, speed, acceleration) in [
        (0.012f32, 0.002f32, 0.02f32),
        (0.012, 0.006, 0.02),
        (0.012, 0.05, 0.02),
        (0.001, 0.002, 0.02),
        (0.0005, 0.002, 0.02),
        (0.003, 0.01, 0.005),
        (-0.01, 0.003, 0.1),
    ] {
        let limits = Limits::new(speed, acceleration, RISE_S);
        let mut p = Planner::at(0.0);
        p.target_m = distance;
        let (fastest, ticks) = run(&mut p, &limits);
        let optimum = optimum_s(&SetPoint::at(0.0), distance, &limits);
        let seconds = f64::from(ticks) * TICK;
        assert!(fastest <= speed * 1.001, "{fastest}");
        let told_s = limits.duration_from_s(0.0, distance.abs(), distance.abs() / limits.speed, &limits);
        assert!((f64::from(told_s) / optimum - 1.0).abs() < 1e-3, "{distance}");
        assert!(seconds > optimum - 1.5 * TICK && seconds < 1.05 * optimum, "{distance}: {seconds} s of {optimum} s");
        assert_eq!(p.step(&limits).motion.position, distance);
        worst = worst.max(seconds / optimum);
    }
    std::println!("worst: {worst:.4} of the optimum");
}

#[test]
fn a_move_that_is_changed_under_way_takes_the_shortest_time_from_there() {
    let limits = Limits::new(0.002, 0.02, RISE_S);
    for before in [5, 14, 25, 220] {
        for target in [0.02f32, 0.006, 0.0042, 0.0040, 0.001, -0.004] {
            let mut p = Planner::at(0.0);
            p.target_m = 0.02;
            let from = (0..before).map(|_| p.step(&limits)).last().expect("a tick");
            let way = target - p.set_point_m();
            p.target_m = target;
            let sign = way.signum();
            let told = limits.duration_from_s(sign * p.speed_m_per_s(), way.abs(), way.abs() / limits.speed, &limits);
            let took = f64::from(run(&mut p, &limits).1) * TICK;
            let optimum = optimum_s(&from, target, &limits);
            assert!(
                took > optimum - 1.5 * TICK && took < 1.05 * optimum + 3.0 * TICK,
                "{before}, {target}: {took} s of {optimum} s"
            );
            // What is told takes the acceleration of the moment for none.
            let within = if from.motion.acceleration == 0.0 { 0.05 } else { 0.25 };
            assert!((f64::from(told) - took).abs() < within, "{before}, {target}: {told} s told, {took} s taken");
        }
    }
}

#[test]
fn the_time_from_a_motion_is_the_shortest_whether_or_not_it_passes_the_target() {
    let limits = Limits::new(0.004, 0.02, RISE_S);
    let from = SetPoint { motion: Motion { speed: 0.002, ..Motion::at(0.0) }, ..SetPoint::at(0.0) };
    // It needs 0.2 mm to stop.
    for way in [0.02e-3f32, 0.1e-3, 0.3e-3, 0.6e-3, 1.5e-3, 5e-3, -1e-3] {
        let told = limits.duration_from_s(way.signum() * 0.002, way.abs(), way.abs() / limits.speed, &limits);
        let optimum = optimum_s(&from, way, &limits);
        assert!((f64::from(told) / optimum - 1.0).abs() < 0.01, "{way}: {told} s of {optimum} s");
    }
    // A slower move is asked for, whose target is within the way that braking takes.
    let slow = Limits::new(0.001, 0.02, RISE_S);
    for way in [0.05e-3f32, 0.15e-3] {
        let told = slow.duration_from_s(0.002, way, way / slow.speed, &slow);
        let optimum = optimum_s(&from, way, &slow);
        assert!((f64::from(told) / optimum - 1.0).abs() < 0.1, "{way}: {told} s of {optimum} s");
    }
}

#[test]
fn a_set_point_that_waits_stands_and_is_not_at_its_target() {
    let mut p = Planner::at(1e-3);
    assert_eq!((p.setting_out(), p.wait()), (0.0, SetPoint::at(1e-3)));
    p.target_m = -1e-3;
    assert_eq!((p.setting_out(), p.wait()), (-1.0, SetPoint { done: false, ..SetPoint::at(1e-3) }));
    // It goes on from where the load is, if that lies on the way.
    p.set_out_from(2e-3);
    assert_eq!(p.set_point_m(), 1e-3);
    p.set_out_from(0.5e-3);
    assert_eq!(p.set_point_m(), 0.5e-3);
    let first = p.step(&Limits::new(0.002, 0.02, RISE_S));
    assert_eq!(p.setting_out(), 0.0, "under way");
    assert!(first.jerk < 0.0 && (first.motion.acceleration / TICK_S / first.jerk - 1.0).abs() < 1e-6);
}

#[test]
fn braking_stops_where_it_says_and_turning_round_works() {
    let limits = Limits::new(0.004, 0.02, RISE_S);
    let mut p = Planner::at(0.0);
    p.target_m = 0.02;
    for _ in 0..200 {
        p.step(&limits);
    }
    p.brake(&limits);
    let stop = p.target_m;
    let (_, ticks) = run(&mut p, &limits);
    assert!(ticks < 70 && stop < 0.02 && p.set_point_m() == stop);
    p.target_m = -0.001;
    run(&mut p, &limits);
    assert_eq!(p.step(&limits).motion.position, -0.001);
}

#[test]
fn a_stream_is_followed_within_micrometres_and_a_jump_without_overshoot() {
    let limits = Limits::new(0.008, 0.08, RISE_S);
    let (mut p, omega) = (Planner::at(0.0), core::f32::consts::TAU);
    let mut max = 0f32;
    for k in 1u16..400 {
        let t = f32::from(k) * TICK_S;
        // 1 mm at 1 Hz, from rest.
        let rise = (t / 1.0).min(1.0);
        let target = Motion {
            position: 1e-3 * rise * libm::sinf(omega * t),
            speed: 1e-3 * rise * omega * libm::cosf(omega * t),
            acceleration: -1e-3 * rise * omega * omega * libm::sinf(omega * t),
        };
        let (s, held_back) = p.follow(&target, &limits);
        if t > 1.5 {
            max = max.max((s.motion.position - target.position).abs());
            assert!(!held_back);
        }
    }
    assert!(max < 3e-6, "{max}");
    let stands = Motion { position: 5e-3, speed: 0.0, acceleration: 0.0 };
    let mut p = Planner::at(0.0);
    let ticks = (0..400).take_while(|_| {
        let (s, _) = p.follow(&stands, &limits);
        assert!(s.motion.position < 5e-3 + 20e-6 && s.motion.speed < 0.008 * 1.01, "{s:?}");
        !s.done
    });
    assert!(ticks.count() < 200, "it arrives, and stands");
    assert!(p.is_at_rest());
}

/// The set-point begins at rest in the middle of a sine that takes three quarters of the acceleration. It may not get ahead of its
/// target for good because its jerk does not suffice to catch up at once.
#[test]
fn a_sine_near_the_limits_is_not_exaggerated() {
    let limits = Limits::new(0.008, 0.042, 0.11);
    let omega = 2.0 * core::f32::consts::TAU;
    let sine_m = |t: f32| 0.2e-3 * libm::sinf(omega * t);
    let mut p = Planner::at(0.0);
    let mut farthest_m = 0f32;
    for k in 1u16..400 {
        let t = f32::from(k) * TICK_S;
        let target = Motion {
            position: sine_m(t),
            speed: 0.2e-3 * omega * libm::cosf(omega * t),
            acceleration: -omega * omega * sine_m(t),
        };
        let (s, held_back) = p.follow(&target, &limits);
        assert!(!held_back && s.motion.acceleration.abs() < 1.001 * limits.acceleration, "{s:?}");
        if t > 2.0 {
            farthest_m = farthest_m.max((s.motion.position - sine_m(t)).abs());
        }
    }
    assert!(farthest_m < 5e-6, "{farthest_m}");
}

#[test]
fn the_time_to_the_target_is_that_of_the_plan_step_by_step() {
    let rig = constants();
    for (from_rad, distance_m, asked) in
        [(4.0, 0.012, 0.002), (4.0, 0.012, 0.02), (40.0, -0.008, 0.02), (30.0, 5e-4, 0.01)]
    {
        let mut load = hanging(5.0, 0.0, from_rad);
        // The friction of a heavier load, which was homed, does not count.
        load.found = Box::leak(Box::new(HomingResult { friction_n: 2.0, ..*load.found }));
        let mut planner = Planner::at(0.0);
        planner.target_m = distance_m;
        let expected_s = planner.time_to_target_s(asked, &load);
        let (mut twist_rad, mut ticks, mut last_m) = (from_rad, 0u16, 0.0);
        while !planner.is_at_rest() {
            let point = load.mechanism.at(5.0, twist_rad);
            let set_point = planner.step(&Limits::for_motor(asked, &point, 5.0, &rig).0);
            twist_rad += (set_point.motion.position - last_m) * point.tr_rad_per_m();
            last_m = set_point.motion.position;
            ticks += 1;
        }
        let took_s = f32::from(ticks) * TICK_S;
        assert!((expected_s - took_s).abs() < 0.05 + 0.02 * took_s, "{expected_s} s expected, {took_s} s taken");
    }
}

proptest! {
    #[test]
    fn a_stream_of_whatever_is_followed_within_the_limits(
        targets in proptest::collection::vec((-0.02f32..0.02, -0.05f32..0.05, 1u32..60), 1..10),
        speed in 1e-3f32..0.02,
    ) {
        let limits = Limits::new(speed, 2.0 * speed / RISE_S, RISE_S);
        let mut p = Planner::at(0.0);
        let (mut last_speed, mut last_rise) = (0.0, 0.0);
        for (position_m, speed_m_per_s, ticks) in targets {
            let mut target = Motion { position: position_m, speed: speed_m_per_s, acceleration: 0.0 };
            for _ in 0..ticks {
                target.position += TICK_S * speed_m_per_s;
                let (s, _) = p.follow(&target, &limits);
                prop_assert!(s.motion.speed.abs() <= 1.05 * speed, "{s:?}");
                let rise = (s.motion.speed - last_speed) / TICK_S;
                prop_assert!(s.motion.acceleration.abs() <= limits.acceleration * 1.001);
                prop_assert!(s.done || (rise - last_rise).abs() <= 2.0 * limits.jerk * TICK_S * 1.05 + 4e-3);
                (last_speed, last_rise) = (s.motion.speed, if s.done { 0.0 } else { rise });
            }
        }
    }

    #[test]
    fn any_command_respects_the_limits(
        targets in proptest::collection::vec((-0.05f32..0.05, 1u32..300), 1..8),
        speed in 1e-4f32..0.02,
        acceleration in 1e-3f32..0.1,
    ) {
        // As `Limits::for_motor` makes them: no more acceleration than gets up to speed in the rise time.
        let limits = Limits::new(speed, acceleration.min(2.0 * speed / RISE_S), RISE_S);
        let mut p = Planner::at(0.0);
        let mut last = p.step(&limits);
        let mut last_rise = 0.0;
        for (target, ticks) in targets {
            p.target_m = target;
            for _ in 0..ticks {
                let s = p.step(&limits);
                prop_assert!(s.motion.speed.abs() <= speed * 1.001 + 1e-6);
                let rise = (s.motion.speed - last.motion.speed) / TICK_S;
                prop_assert!(rise.abs() <= acceleration * 1.01 + 2e-4, "{rise}");
                // Twice what the jerk allows in a tick, half as much again where it has just arrived and sets out again.
                prop_assert!((rise - last_rise).abs() <= 2.5 * limits.jerk * TICK_S * 1.05 + 4e-4);
                prop_assert!((s.motion.position - last.motion.position).abs() <= speed * TICK_S * 1.01 + 1e-7);
                (last, last_rise) = (s, rise);
            }
        }
        let (_, ticks) = run(&mut p, &limits);
        prop_assert!(ticks < 100_000);
    }

    /// Limits that fall under way, as they do where TR rises, are met as soon as the jerk allows.
    #[test]
    fn limits_may_change_under_way(fall in 0.2f32..1.0, at in 1u32..250) {
        let mut p = Planner::at(0.0);
        p.target_m = 0.02;
        let (before, after) = (Limits::new(0.006, 0.02, RISE_S), Limits::new(0.006 * fall, 0.02, RISE_S));
        for _ in 0..at {
            p.step(&before);
        }
        let soon = (0.006 / 0.02 + RISE_S) / TICK_S;
        for tick in 0..4000 {
            let s = p.step(&after);
            prop_assert!(tick < soon as u32 || s.motion.speed <= after.speed * 1.001);
            prop_assert!(s.motion.position <= 0.02 + 1e-6);
        }
        prop_assert_eq!(p.set_point_m(), 0.02);
    }
}
