//! Streams of set-points on a homed rig whose every number is known.

use crate::bench::{Bench, to};
use crate::fixture::{constants, near};
use rig_control::TICK_S;
use rig_link::messages::{Accepted, EventKind, LoadChoice, Parameter, Refusal, Request, Setting, State, StreamEnd};
use std::f32::consts::PI;

/// Set-points of a stream that oscillates by 1 mm about 6 mm with 0.5 Hz, each 20 ms, for so long (s); the maximum distance.
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
fn a_stream_that_was_stopped_begins_again_only_after_half_a_second_without_set_points() {
    let mut bench = Bench::homed();
    bench.move_to(0.006, 0.004);
    let point = Request::Track { position_m: 0.006, speed_m_per_s: 0.0, for_s: 0.1 };
    let sent = |bench: &mut Bench, ticks: u16, expected: Result<Accepted, Refusal>| {
        for k in 0..ticks {
            let reply = bench.tick((k % 2 == 0).then_some(point)).reply;
            assert!(reply.is_none_or(|reply| reply == expected), "{reply:?} in tick {k}, not {expected:?}");
        }
    };
    sent(&mut bench, 50, Ok(Accepted::Started));
    assert_eq!(bench.ask(Request::Stop), Ok(Accepted::Done));
    // Whoever has not read of the stop goes on, for longer than half a second.
    sent(&mut bench, 100, Err(Refusal::Stopped));
    assert_eq!((bench.rig.state(), bench.events.last()), (State::Holding, Some(&EventKind::Stopped)));
    bench.run(40);
    sent(&mut bench, 1, Err(Refusal::Stopped));
    bench.run(50);
    sent(&mut bench, 50, Ok(Accepted::Started));
    // A fault ends it as well, and a `clear` does not let it go on.
    bench.tamper = crate::faults::tamper(|inputs| inputs.lvdt = None);
    sent(&mut bench, 7, Ok(Accepted::Started));
    bench.run(1);
    bench.tamper = None;
    let fault = bench.rig.fault().expect("no gap for 80 ms");
    sent(&mut bench, 100, Err(Refusal::InFault { fault }));
    assert_eq!(bench.ask(Request::Clear), Ok(Accepted::Done));
    sent(&mut bench, 100, Err(Refusal::Stopped));
}

#[test]
fn a_stream_that_interrupts_a_move_goes_on_with_the_load_that_is_seen_and_teaches_nothing() {
    let mut bench = Bench::homed();
    let twist_scale = bench.shown().twist_scale;
    bench.begin(Request::Move { target_m: 0.012, speed_m_per_s: 0.004, load: LoadChoice::Known(8.0) });
    bench.run(20);
    bench.begin(to(0.012, 0.004));
    bench.run(150);
    // The load is changed while the set-point stands.
    let position_m = bench.shown().setpoint_m.unwrap();
    for k in 0..400 {
        bench.load_n += if k < 300 { 0.5e-2 } else { 0.0 };
        let request = (k % 5 == 0).then_some(Request::Track { position_m, speed_m_per_s: 0.0, for_s: 0.1 });
        assert!(bench.tick(request).reply.is_none_or(|reply| reply.is_ok()));
    }
    bench.while_in(State::Moving);
    assert_eq!((bench.rig.state(), bench.shown().twist_scale), (State::Holding, twist_scale));
    // One that follows a move under a given load does not keep that load.
    bench.begin(Request::Move { target_m: 0.008, speed_m_per_s: 0.004, load: LoadChoice::Known(9.0) });
    bench.while_in(State::Moving);
    let position_m = bench.shown().setpoint_m.unwrap();
    bench.begin(Request::Track { position_m, speed_m_per_s: 0.0, for_s: 0.1 });
    bench.run(5);
    let [_, _, by_twist] = bench.gap_at(bench.load_n, bench.twist_rad);
    near(bench.shown().tr_rad_per_m.unwrap() * -by_twist, 1.0, 0.02);
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
    bench.begin(at(0.006 + 0.9 * reach_m, 0.0, 0.5));
    bench.run(5);
    assert_eq!(refused(bench.ask(at(f32::NAN, 0.0, 0.1))), Parameter::Target);
    assert_eq!(bench.events.last(), Some(&EventKind::StreamEnded(StreamEnd::Refused)));
    bench.while_in(State::Moving);
    assert_eq!(bench.rig.state(), State::Holding);
    // A speed that leads out of reach before the next one comes.
    let here_m = bench.shown().setpoint_m.unwrap();
    bench.begin(at(here_m - 0.98 * reach_m, -most, 0.5));
    bench.run(10);
    assert_eq!(bench.events.last(), Some(&EventKind::StreamEnded(StreamEnd::TooFast)));
}

#[test]
fn a_move_goes_on_from_a_stream_and_other_motions_must_end_first() {
    let mut bench = Bench::homed();
    bench.move_to(0.006, 0.004);
    // At 0.85 s it goes down by 2.8 mm/s.
    follow(&mut bench, 0.85);
    assert_eq!(bench.shown().limit, None, "the load follows");
    let before_m = bench.shown().setpoint_m.unwrap();
    bench.begin(to(0.002, 0.004));
    near(bench.shown().setpoint_m.unwrap() - before_m, -2.8e-5, 0.6e-5);
    bench.while_in(State::Moving);
    near(bench.position_m(), 0.002, 30e-6);
    bench.begin(Request::Jog { twist_speed_rad_per_s: 1.0 });
    assert_eq!(bench.ask(to(0.004, 0.004)), Err(Refusal::Busy { state: State::Moving }));
    assert_eq!(bench.ask(Request::HOME), Err(Refusal::Busy { state: State::Moving }));
}
