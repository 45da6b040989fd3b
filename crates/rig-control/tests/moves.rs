//! Moves, holds, jogs and streams of a homed rig whose every number is known.

mod common;

use common::bench::Bench;
use common::{constants, table};
use rig_control::TICK_S;
use rig_link::messages::{
    Accepted, EventKind, Limit, LoadChoice, Parameter, Refusal, Request, Setting, State, StreamEnd,
};
use std::f32::consts::PI;

#[track_caller]
fn near(found: f32, expected: f32, error: f32) {
    assert!((found - expected).abs() <= error, "{found} instead of {expected}, within {error}");
}

const fn to(target_m: f32, speed_m_per_s: f32) -> Request {
    Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto }
}

#[test]
fn a_move_brings_the_load_to_its_target_in_the_time_that_is_told() {
    for (load_n, friction_n) in [(5.0, 0.01), (1.5, 0.03)] {
        let mut bench = Bench::new(load_n, friction_n, 9.0);
        bench.home();
        for (target_m, speed_m_per_s) in [(0.010, 0.002), (0.003, 0.004), (0.0035, 0.002), (0.012, f32::INFINITY)] {
            let from_m = bench.position_m();
            assert_eq!(bench.ask(to(target_m, speed_m_per_s)), Ok(Accepted::Started));
            let told_s = bench.shown().time_left_s.expect("it is planned");
            assert_eq!(bench.shown().target_m, Some(target_m));
            let (mut ticks, mut arrived, mut fastest) = (0u16, 0u16, 0f32);
            while bench.rig.state() == State::Moving && ticks < 3000 {
                let left_s = bench.shown().time_left_s.unwrap();
                bench.tick(None);
                ticks += 1;
                fastest = fastest.max(bench.gap_speed_m_per_s.abs());
                let shown = bench.shown();
                assert!(shown.time_left_s.unwrap() <= left_s + 1e-6);
                let set_point_m = shown.setpoint_m.unwrap();
                assert!((from_m.min(target_m) - 0.1e-3..from_m.max(target_m) + 0.1e-3).contains(&set_point_m));
                if set_point_m != target_m {
                    arrived = ticks;
                }
                // What is shown is what is: the position with the noise of one tick and its 6 ms of age.
                near(shown.position_m.unwrap(), bench.position_m(), 25e-6 + 7e-3 * bench.gap_speed_m_per_s.abs());
                near(shown.twist_rad.unwrap(), bench.twist_rad, 7e-3);
                near(shown.load_n.unwrap(), load_n, 0.07 * load_n);
                let [_, _, by_twist] = bench.gap_at(load_n, bench.twist_rad);
                near(shown.tr_rad_per_m.unwrap() * -by_twist, 1.0, 0.02);
            }
            assert_eq!(bench.rig.state(), State::Holding, "{:?}", bench.rig.fault());
            let took_s = TICK_S * f32::from(arrived);
            near(told_s, took_s, 0.1 + 0.05 * took_s);
            assert!(fastest < 1.35 * speed_m_per_s, "{fastest}");
            let Some(EventKind::MoveDone { error_m }) = bench.events.last() else { panic!("{:?}", bench.events) };
            assert!(error_m.abs() < 30e-6, "{error_m}");
            bench.run(100);
            near(bench.position_m(), target_m, 25e-6);
            assert_eq!((bench.shown().time_left_s, bench.shown().target_m), (Some(0.0), Some(target_m)));
            assert_eq!(bench.shown().setpoint_m, Some(target_m));
            near(bench.shown().load_n.unwrap(), load_n, 0.07 * load_n);
        }
    }
}

#[test]
fn as_fast_as_possible_is_as_fast_as_the_motor_turns_and_is_told() {
    let mut bench = Bench::homed();
    assert_eq!(bench.ask(to(0.014, f32::INFINITY)), Ok(Accepted::Started));
    let (mut fastest, mut limits) = (0f32, Vec::new());
    for _ in 0..3000 {
        let before_rad = bench.twist_rad;
        bench.tick(None);
        fastest = fastest.max((bench.twist_rad - before_rad) / TICK_S);
        limits.extend(bench.shown().limit);
        if bench.rig.state() != State::Moving {
            break;
        }
    }
    let most = constants().twist_speed_max();
    assert!((0.9 * most..1.001 * most).contains(&fastest), "{fastest} of {most}");
    assert!(limits.contains(&Limit::MotorSpeed), "{limits:?}");
    bench.run(50);
    assert_eq!(bench.shown().limit, None);
}

#[test]
fn a_load_that_becomes_heavier_or_lighter_is_brought_back_and_known() {
    for change_n in [0.6f32, -0.6] {
        let mut bench = Bench::homed();
        bench.move_to(0.008, 0.002);
        bench.run(100);
        let (before_n, held_m) = (bench.shown().load_n.unwrap(), bench.position_m());
        bench.load_n += change_n;
        bench.run(4);
        assert!((held_m - bench.position_m()) * change_n > 0.0, "it sinks under more");
        bench.run(296);
        // Position is counted from the gap at homing, which hung at the old load.
        let position_m = bench.shown().position_m.unwrap();
        near(position_m, 0.008, 40e-6);
        near(bench.shown().load_n.unwrap() - before_n, change_n, 0.15);
        // It differs by more than a tenth from what homing confirmed.
        assert_eq!(bench.shown().limit, Some(Limit::LoadUnknown));
        // A move up and a move down confirm it.
        bench.move_to(0.012, 0.004);
        bench.move_to(0.004, 0.004);
        bench.run(50);
        assert_eq!(bench.shown().limit, None);
    }
}

#[test]
fn a_stop_brakes_and_the_next_move_goes_on_from_there() {
    let mut bench = Bench::homed();
    assert_eq!(bench.ask(to(0.012, 0.004)), Ok(Accepted::Started));
    bench.run(150);
    let (at_m, speed) = (bench.position_m(), bench.gap_speed_m_per_s.abs());
    near(speed, 0.004, 0.4e-3);
    assert_eq!(bench.ask(Request::Stop), Ok(Accepted::Done));
    assert_eq!(bench.shown().time_left_s, None, "it is not known how long a stop takes");
    bench.while_in(State::Moving);
    assert_eq!(bench.events.last(), Some(&EventKind::Stopped));
    let braked_m = bench.position_m() - at_m;
    assert!((0.1e-3..1e-3).contains(&braked_m), "{braked_m}");
    bench.run(50);
    near(bench.shown().setpoint_m.unwrap(), bench.position_m(), 30e-6);
    bench.move_to(0.002, 0.004);
    near(bench.position_m(), 0.002, 30e-6);
    // A move that follows another one at once needs no rest between.
    assert_eq!(bench.ask(to(0.010, 0.004)), Ok(Accepted::Started));
    bench.run(100);
    assert_eq!(bench.ask(to(0.004, 0.004)), Ok(Accepted::Started));
    bench.while_in(State::Moving);
    near(bench.position_m(), 0.004, 30e-6);
}

#[test]
fn a_jog_turns_at_its_speed_within_the_strings_range() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.while_in(State::Boot);
    let jog = |twist_speed_rad_per_s| Request::Jog { twist_speed_rad_per_s };
    assert_eq!(bench.ask(jog(3.0)), Ok(Accepted::Started));
    assert_eq!(bench.rig.state(), State::Moving);
    // 20 rad/s²: at speed after 0.15 s.
    bench.run(100);
    near(bench.twist_rad, 9.0 + 3.0 * (1.0 - 0.075), 0.06);
    assert_eq!(bench.ask(jog(-2.0)), Ok(Accepted::Started), "it goes on from its speed");
    bench.run(50);
    let from_rad = bench.twist_rad;
    bench.run(50);
    near(bench.twist_rad - from_rad, -1.0, 0.01);
    assert_eq!(bench.ask(Request::Stop), Ok(Accepted::Done));
    // 2 rad/s at 20 rad/s² are ten ticks, of which that of the request is one.
    assert_eq!(bench.while_in(State::Moving), 9);
    assert_eq!((bench.rig.state(), bench.events.last()), (State::Unhomed, Some(&EventKind::Stopped)));
    for speed in [4.01, f32::NAN] {
        assert!(bench.ask(jog(speed)).is_err());
    }
    // A homed rig knows where its strings' range ends, either way.
    bench.home();
    assert_eq!(bench.ask(jog(4.0)), Ok(Accepted::Started));
    bench.run(2000);
    near(bench.twist_rad, table().metadata.twist_max_rad, 0.06);
    assert_eq!((bench.shown().limit, bench.rig.state()), (Some(Limit::Travel), State::Moving));
    assert_eq!(bench.ask(jog(-4.0)), Ok(Accepted::Started));
    bench.run(100);
    near(bench.twist_rad, table().metadata.twist_max_rad - 4.0 * (1.0 - 0.1), 0.1);
    assert_eq!(bench.shown().limit, None);
}

/// Set-points of a stream that swings by 1 mm about 6 mm with 0.5 Hz, each 20 ms, for so long (s); the greatest distance.
fn follow(bench: &mut Bench, seconds: f32) -> f32 {
    let mut farthest_m = 0f32;
    for k in 0..(seconds / TICK_S) as u16 {
        let phase = PI * TICK_S * f32::from(k);
        let (position_m, speed_m_per_s) = (0.006 + 1e-3 * phase.sin(), 1e-3 * PI * phase.cos());
        let request = (k % 2 == 0).then_some(Request::Track { position_m, speed_m_per_s, for_s: 0.1 });
        if let Some(reply) = bench.tick(request).reply {
            assert_eq!(reply, Ok(Accepted::Started));
        }
        if k > 100 {
            farthest_m = farthest_m.max((bench.position_m() - position_m).abs());
        }
    }
    farthest_m
}

#[test]
fn a_stream_is_followed_as_long_as_it_comes() {
    let mut bench = Bench::homed();
    bench.move_to(0.006, 0.004);
    let farthest_m = follow(&mut bench, 4.0);
    assert!(farthest_m < 0.1e-3, "{farthest_m}");
    assert_eq!(bench.rig.state(), State::Moving);
    // The last one holds for 0.1 s.
    let events = bench.events.len();
    bench.run(8);
    assert_eq!(bench.events.len(), events);
    bench.run(2);
    assert_eq!(bench.events.last(), Some(&EventKind::StreamEnded(StreamEnd::Late)));
    bench.while_in(State::Moving);
    assert_eq!((bench.rig.state(), bench.events.last()), (State::Holding, Some(&EventKind::Stopped)));
    follow(&mut bench, 1.0);
    assert_eq!(bench.ask(Request::Stop), Ok(Accepted::Done));
    bench.while_in(State::Moving);
    assert_eq!(bench.rig.state(), State::Holding);
}

#[test]
fn a_set_point_that_is_refused_or_out_of_reach_ends_a_stream() {
    let mut bench = Bench::homed();
    bench.move_to(0.006, 0.004);
    let at = |position_m, speed_m_per_s, for_s| Request::Track { position_m, speed_m_per_s, for_s };
    let tr_rad_per_m = bench.shown().tr_rad_per_m.unwrap();
    // Half a second at the motor's full speed.
    let reach_m = 0.5 * constants().twist_speed_max() / tr_rad_per_m;
    let refused = |reply: Result<Accepted, Refusal>| match reply {
        Err(Refusal::OutOfRange { parameter, .. } | Refusal::NotFinite { parameter }) => parameter,
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(bench.ask(at(0.006 + 1.03 * reach_m, 0.0, 0.1))), Parameter::Target);
    assert_eq!(refused(bench.ask(at(0.006 - 1.03 * reach_m, 0.0, 0.1))), Parameter::Target);
    assert_eq!(refused(bench.ask(at(0.006, 0.0, 0.019))), Parameter::HoldsFor);
    assert_eq!(refused(bench.ask(at(0.006, 0.0, 0.51))), Parameter::HoldsFor);
    let most = bench.rig.settings().get(Setting::SpeedMax);
    assert_eq!(refused(bench.ask(at(0.006, -1.01 * most, 0.1))), Parameter::Speed);
    assert_eq!(bench.rig.state(), State::Holding);
    assert_eq!(bench.ask(at(0.006 + 0.9 * reach_m, 0.0, 0.5)), Ok(Accepted::Started));
    bench.run(5);
    assert_eq!(refused(bench.ask(at(f32::NAN, 0.0, 0.1))), Parameter::Target);
    assert_eq!(bench.events.last(), Some(&EventKind::StreamEnded(StreamEnd::Refused)));
    bench.while_in(State::Moving);
    assert_eq!(bench.rig.state(), State::Holding);
    // A speed that leads out of reach before the next one comes.
    let here_m = bench.shown().setpoint_m.unwrap();
    assert_eq!(bench.ask(at(here_m - 0.98 * reach_m, -most, 0.5)), Ok(Accepted::Started));
    bench.run(10);
    assert_eq!(bench.events.last(), Some(&EventKind::StreamEnded(StreamEnd::TooFast)));
}

#[test]
fn settings_act_at_once_and_those_that_change_the_units_unhome() {
    let mut bench = Bench::homed();
    bench.move_to(0.006, 0.004);
    let set = |setting, value| Request::SetSetting { setting, value };
    // Zero is called another height: the load stays.
    assert_eq!(bench.ask(set(Setting::PositionZero, -0.002)), Ok(Accepted::Started));
    bench.run(100);
    near(bench.shown().position_m.unwrap(), 0.008, 30e-6);
    near(bench.position_m(), 0.006, 30e-6);
    assert_eq!(bench.rig.state(), State::Holding);
    assert_eq!(bench.shown().setpoint_m.map(|m| (1e6 * m).round()), Some(8000.0));
    assert_eq!(bench.ask(set(Setting::SpeedMax, 0.001)), Ok(Accepted::Started));
    assert!(bench.ask(to(0.010, 0.002)).is_err());
    assert_eq!(bench.ask(to(0.010, 0.001)), Ok(Accepted::Started));
    assert_eq!(bench.ask(set(Setting::SpeedMax, 0.002)), Err(Refusal::Busy { state: State::Moving }));
    bench.while_in(State::Moving);
    near(bench.position_m(), 0.008, 30e-6);
    assert!(bench.ask(set(Setting::SpeedMax, -1.0)).is_err());
    let twist_rad = bench.twist_rad;
    assert_eq!(bench.ask(set(Setting::LvdtGain, 1.01)), Ok(Accepted::Unhomed));
    assert_eq!(bench.rig.state(), State::Unhomed);
    bench.run(100);
    assert_eq!((bench.rig.fault(), bench.shown().position_m), (None, None));
    near(bench.twist_rad, twist_rad, 0.01);
}
