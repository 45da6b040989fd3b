//! Streamed set-points: how well they are followed, and how a stream ends.

use host_tests::rigs::subject::Subject;
use host_tests::{ControlBench, constants, load_changes, table};
use rig_control::Rig as Control;
use rig_link::messages::{EventKind, Limit, LoadChoice, Parameter, Refusal, Request, State, StreamEnd};
use rig_plant::RigPreset;
use rigctl::course::Course;
use std::path::Path;

/// A rig of its own model, homed under a load (kg), at a position (m).
fn at(load_kg: f64, position_m: f32) -> ControlBench {
    let mut bench = load_changes::homed_under(&Subject::new(RigPreset::Ideal, 5), load_kg).unwrap();
    bench.move_to(position_m, 0.003, LoadChoice::Auto).unwrap();
    bench
}

fn point(position_m: f32, speed_m_per_s: f32) -> Request {
    Request::Track { position_m, speed_m_per_s, for_s: 0.2 }
}

fn refused(bench: &mut ControlBench, request: Request) -> Refusal {
    match bench.tick(Some(request)).reply {
        Some(Err(refusal)) => refusal,
        other => panic!("{request:?}: {other:?}"),
    }
}

fn accepted(bench: &mut ControlBench, request: Request) {
    let reply = bench.tick(Some(request)).reply;
    assert!(matches!(reply, Some(Ok(_))), "{request:?}: {reply:?}");
}

fn ended(bench: &ControlBench) -> Vec<StreamEnd> {
    let end = |(_, kind): &(f64, EventKind)| if let EventKind::StreamEnded(end) = kind { Some(*end) } else { None };
    bench.events.iter().filter_map(end).collect()
}

/// Streams a course: rms and greatest distance from it on the way (m), and whether the motor's speed held it back.
fn follow(bench: &mut ControlBench, course: &Course) -> (f64, f64, bool) {
    let (mut square, mut most_m, mut count, mut held_back) = (0.0, 0f64, 0.0, false);
    let mut points = course.set_points().peekable();
    let ticks = (100.0 * course.duration_s()) as u32;
    for k in 0..ticks {
        let t_s = 0.01 * f64::from(k);
        let due = points.next_if(|(at_s, _)| *at_s <= t_s + 1e-9).map(|(_, request)| request);
        let tick = bench.tick(due);
        assert!(!matches!(tick.reply, Some(Err(_))), "{:?}", tick.reply);
        held_back |= tick.telemetry.limit == Some(Limit::MotorSpeed);
        let distance_m = bench.true_position_m() - course.at(t_s + 0.01).0;
        square += distance_m * distance_m;
        most_m = most_m.max(distance_m.abs());
        count += 1.0;
    }
    ((square / count).sqrt(), most_m, held_back)
}

#[test]
fn courses_of_the_scenarios_are_followed() {
    for (name, load_kg, rms_m) in
        [("sine", 0.5, 80e-6), ("sine", 1.2, 80e-6), ("chirp", 0.5, 80e-6), ("hand", 0.5, 150e-6)]
    {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenarios/{name}.csv"));
        let course = Course::load(&file).unwrap_or_else(|e| panic!("{:?}", e.message()));
        let mut bench = at(load_kg, course.start_m() as f32);
        let (rms, most, held_back) = follow(&mut bench, &course);
        println!("{name} under {load_kg} kg: {:.0} um rms, {:.0} um at most, {held_back}", rms * 1e6, most * 1e6);
        assert!(rms < rms_m, "{name} under {load_kg} kg: {rms} m");
        accepted(&mut bench, Request::Stop);
        assert!(bench.until(5.0, |d| d.control.state() == State::Holding));
        assert_eq!(ended(&bench), []);
    }
}

#[test]
fn a_stream_that_dries_up_ends_in_a_hold_with_its_reason() {
    let mut bench = at(0.5, 0.006);
    accepted(&mut bench, point(0.006, 0.002));
    assert_eq!(bench.control.state(), State::Moving);
    bench.run(0.15);
    assert!(ended(&bench).is_empty(), "it goes on at its speed");
    bench.run(0.1);
    assert_eq!(ended(&bench), [StreamEnd::Late]);
    assert!(bench.until(5.0, |d| d.control.state() == State::Holding));
    assert!(bench.events.iter().any(|(_, kind)| *kind == EventKind::Stopped));
    let rest_m = bench.true_position_m();
    assert!((0.0062..0.0072).contains(&rest_m), "{rest_m}: braked where the stream ended");
    bench.run(2.0);
    assert!((bench.true_position_m() - rest_m).abs() < 60e-6, "and held there");
}

#[test]
fn a_set_point_that_is_refused_ends_the_stream() {
    let mut bench = at(0.5, 0.006);
    for (request, parameter) in [
        (point(0.016, 0.0), Parameter::Target),
        (point(0.0, 0.0), Parameter::Target),
        (point(f32::NAN, 0.0), Parameter::Target),
        (point(0.006, 0.06), Parameter::Speed),
        (point(0.006, f32::INFINITY), Parameter::Speed),
        (Request::Track { position_m: 0.006, speed_m_per_s: 0.0, for_s: 2.0 }, Parameter::HoldsFor),
        (Request::Track { position_m: 0.006, speed_m_per_s: 0.0, for_s: 0.0 }, Parameter::HoldsFor),
    ] {
        let named = |refusal: Refusal| match refusal {
            Refusal::OutOfRange { parameter, .. } | Refusal::NotFinite { parameter } => parameter,
            other => panic!("{other:?}"),
        };
        // At the beginning nothing happens but the refusal.
        assert_eq!(named(refused(&mut bench, request)), parameter, "{request:?}");
        assert_eq!(bench.control.state(), State::Holding);
        // On the way it is the end.
        accepted(&mut bench, point(0.006, 0.0));
        assert_eq!(named(refused(&mut bench, request)), parameter, "{request:?}");
        assert_eq!(ended(&bench).last(), Some(&StreamEnd::Refused));
        assert!(bench.until(5.0, |d| d.control.state() == State::Holding), "{request:?}");
        assert!((bench.true_position_m() - 0.006).abs() < 0.1e-3);
    }
    let mut unhomed = ControlBench::on(
        Subject::new(RigPreset::Ideal, 1).switched_on(5.0).unwrap(),
        Control::new(table(), constants(), None),
    );
    unhomed.until(10.0, |d| d.control.state() == State::Unhomed);
    assert_eq!(refused(&mut unhomed, point(0.0, 0.0)), Refusal::NotHomed);
}

#[test]
fn a_stream_that_runs_away_ends_and_the_load_is_held() {
    let mut bench = at(1.2, 0.003);
    accepted(&mut bench, Request::Track { position_m: 0.003, speed_m_per_s: 0.02, for_s: 0.5 });
    assert!(bench.until(1.0, |d| !ended(d).is_empty()));
    assert_eq!(ended(&bench), [StreamEnd::TooFast]);
    assert!(bench.until(5.0, |d| d.control.state() == State::Holding));
    assert!(bench.true_position_m() < 0.008, "{}", bench.true_position_m());
}

#[test]
fn a_stream_can_be_stopped_and_a_move_goes_on_from_it() {
    let mut bench = at(0.5, 0.006);
    for k in 0..20u16 {
        accepted(&mut bench, point(0.006 + 2e-5 * f32::from(k), 0.002));
    }
    accepted(&mut bench, Request::Stop);
    assert!(bench.until(5.0, |d| d.control.state() == State::Holding));
    assert!(ended(&bench).is_empty());
    let here_m = bench.true_position_m() as f32;
    for k in 0..20u16 {
        accepted(&mut bench, point(here_m + 2e-5 * f32::from(k), 0.002));
    }
    bench.move_to(0.010, 0.003, LoadChoice::Auto).unwrap();
    assert!((bench.true_position_m() - 0.010).abs() < 60e-6);
    // And a stream from a move.
    accepted(&mut bench, Request::Move { target_m: 0.005, speed_m_per_s: 0.002, load: LoadChoice::Auto });
    bench.run(0.5);
    let set_point_m = bench.last.as_ref().and_then(|last| last.telemetry.setpoint_m).unwrap();
    accepted(&mut bench, point(set_point_m, -0.002));
    for k in 1..40u16 {
        accepted(&mut bench, point(set_point_m - 2e-5 * f32::from(k), -0.002));
    }
    let behind_m = bench.true_position_m() - f64::from(set_point_m - 2e-5 * 39.0);
    assert!(behind_m.abs() < 0.1e-3, "{behind_m}");
}
