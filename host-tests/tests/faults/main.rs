//! Every fault against the emulated rig: it fires, it stays until cleared, and what follows is as the table of policies says.
//! `crates/rig-control/tests/control/faults.rs` has thresholds and near misses; `crates/rigctl/tests/tool/faults.rs` plays faults on the
//! emulated board.

mod cases;
mod page;
mod pairs;

use cases::*;
use host_tests::{ControlBench, constants, scene, table};
use rig_control::supervisor::fault_policy::{After, Response, policy};
use rig_control::{Controller, DriveCommand, DriveReading};
use rig_link::messages::{Doubt, EventKind, Fault, Limit, Parameter, Refusal, Request, State};
use rig_plant::RigFault;

fn accepted(d: &mut ControlBench, request: Request) -> bool {
    d.tick(Some(request)).reply.is_some_and(|reply| reply.is_ok())
}

#[test]
fn each_fault_fires_and_stays_and_after_clear_nothing_moves_and_what_lost_the_position_is_homed_again() {
    for (fault, within_s, cause) in CASES {
        let mut d = moving();
        cause(&mut d);
        assert!(d.until(within_s, |d| d.control.fault().is_some()), "{fault} does not fire");
        assert_eq!(d.control.fault(), Some(fault));
        assert!(d.events.iter().any(|(_, e)| *e == EventKind::FaultRaised(fault)));
        // The strings stop; whatever the motor's own fault is, they do not go on.
        d.run(0.5);
        let twist = d.truth().twist_rad;
        let command = d.last.as_ref().map(|o| o.drive);
        let wanted = match policy(fault).response {
            Response::Hold | Response::HoldByDrive | Response::HoldIfHeard => {
                matches!(command, Some(DriveCommand::Follow { .. }))
            }
            Response::LetGo => command == Some(DriveCommand::LetGo),
            Response::Wait => command == Some(DriveCommand::Silence),
        };
        assert!(wanted, "{fault}: {command:?}");
        // The cause goes, the fault does not.
        mend(&mut d);
        d.run(1.5);
        if policy(fault).response < Response::LetGo && fault != Fault::StringBreak {
            let moved = (d.truth().twist_rad - twist).abs();
            assert!(moved < 0.1, "{fault}: the strings turn by {moved} rad in fault");
        }
        // A load that was jammed and falls free may look like a broken string as well.
        assert_eq!(d.control.state(), State::Fault, "{fault}");
        assert!(d.control.faults().contains(fault), "{fault}: {}", d.control.faults());
        let reply = d.tick(Some(Request::HOME)).reply;
        assert!(matches!(reply, Some(Err(Refusal::InFault { .. }))), "{fault}: {reply:?}");
        assert!(accepted(&mut d, Request::Stop), "stop is always taken");
        // A broken string does not come right by itself, and a drive that has not started has its own test.
        if matches!(fault, Fault::StringBreak | Fault::DriveStartUp) {
            continue;
        }
        assert!(accepted(&mut d, Request::Clear), "{fault}: {}", d.control.faults());
        assert!(d.events.iter().any(|(_, e)| *e == EventKind::FaultCleared(fault)));
        let lost = |(_, event): &(f64, EventKind)| matches!(event, EventKind::FaultRaised(fault) if policy(*fault).after != After::Nothing);
        let lost = d.events.iter().any(lost);
        let rest = if lost { State::Unhomed } else { State::Ready };
        assert!(d.until(6.0, |d| d.control.state() == rest), "{fault}: {:?} {:?}", d.control.state(), d.events);
        d.run(1.0);
        assert_eq!(d.control.state(), rest, "{fault}: {:?}", d.control.fault());
        let reply = d.tick(Some(go(0.003, 0.002))).reply;
        assert_eq!(reply == Some(Err(Refusal::NotHomed)), lost, "{fault}: {reply:?}");
        if !lost {
            assert!(d.until(30.0, |d| d.control.state() != State::Moving));
            assert_eq!(d.control.state(), State::Holding, "{fault}: {:?}", d.control.fault());
        }
    }
}

#[test]
fn a_start_that_was_no_power_up_waits_for_the_operator() {
    for fault in [Fault::WatchdogReset, Fault::UnexpectedReset, Fault::Panicked, Fault::SettingsCorrupt] {
        let control = Controller::new(table(), constants(), Some(fault));
        let mut d = ControlBench::with(scene(), control, &[("twist_at_boot", "20")], 3);
        d.run(5.0);
        assert_eq!((d.control.state(), d.control.fault()), (State::Fault, Some(fault)));
        assert_eq!(d.last.as_ref().unwrap().drive, DriveCommand::Silence);
        assert_eq!(d.tick(Some(Request::HOME)).reply, Some(Err(Refusal::InFault { fault })));
        assert!(accepted(&mut d, Request::Clear));
        assert!(d.until(6.0, |d| d.control.state() == State::Unhomed), "{fault}");
        assert_eq!(d.last.as_ref().unwrap().telemetry.twist_rad, None);
        d.run(1.0);
        assert_eq!(d.tick(Some(go(0.003, 0.002))).reply, Some(Err(Refusal::NotHomed)));
    }
}

#[test]
fn the_first_readings_after_power_up_are_not_believed() {
    let mut d = ControlBench::new(&[], 1);
    tamper(&mut d, |i| {
        if i.now_us < 3_200_000 {
            lvdt_mean(i, 0.0)
        }
    });
    d.run(3.2);
    assert_eq!((d.control.state(), d.control.fault()), (State::Boot, None));
    d.run(0.1);
    assert_eq!(d.control.state(), State::Boot, "not at the first good one");
    assert!(d.until(2.0, |d| d.control.state() == State::Unhomed), "{:?}", d.control.fault());
}

#[test]
fn the_twist_range_clips_and_outside_it_is_a_fault_with_the_way_back_free() {
    let mut d = moving();
    d.tick(Some(Request::Stop));
    assert!(d.until(5.0, |d| d.control.state() == State::Holding));
    let jog = |twist_speed_rad_per_s| Request::Jog { twist_speed_rad_per_s };
    assert!(accepted(&mut d, jog(4.0)));
    let clipped = |d: &ControlBench| d.last.as_ref().is_some_and(|o| o.telemetry.limit == Some(Limit::Travel));
    assert!(d.until(20.0, clipped));
    d.run(2.0);
    assert_eq!(d.control.fault(), None, "at the limit is not outside");
    d.tick(Some(Request::Stop));
    d.run(0.5);
    // The shaft is turned on by a hand, by 20 000 counts within 0.1 s: encoder and drive both see it, and the drive draws what it may
    // against it.
    let start_us = (d.time_s() * 1e6) as u64;
    tamper(&mut d, move |i| {
        let turned = (i.now_us.saturating_sub(start_us) as f64 * 0.2).min(20_000.0);
        i.encoder_counts += turned as i64;
        drive_position(i, |position_qc| *position_qc += turned as i32);
        if let DriveReading::Reports { current_ma, .. } = &mut i.drive {
            *current_ma = constants().current_limit_ma;
        }
    });
    assert!(d.until(0.5, |d| d.control.fault() == Some(Fault::TwistRange)), "{:?}", d.control.fault());
    d.run(1.0);
    assert!(accepted(&mut d, Request::Clear));
    d.run(0.5);
    assert_eq!(d.control.state(), State::Ready, "{:?}", d.control.fault());
    let reply = d.tick(Some(go(0.003, 0.002))).reply;
    assert!(matches!(reply, Some(Err(Refusal::OutOfRange { parameter: Parameter::Twist, .. }))), "{reply:?}");
    assert!(accepted(&mut d, jog(-3.0)));
    d.run(1.0);
    d.tick(Some(Request::Stop));
    d.run(0.5);
    assert_eq!(d.control.state(), State::Ready, "{:?}", d.control.fault());
}

/// The most that a healthy drive does while it is commanded to hold: it brakes from a fast move.
#[test]
fn a_shaft_that_is_stopped_from_a_fast_move_is_held() {
    for load in ["0.5kg", "1.7kg"] {
        let mut d = ControlBench::new(&[("load", load), ("twist_at_boot", "5")], 6);
        d.home().unwrap();
        d.tick(Some(go(0.012, 0.02)));
        // Of the motor's 1047 rad/s at most.
        assert!(d.until(5.0, |d| d.truth().motor_speed_rad_per_s > 800.0), "{load}: never that fast");
        d.rig.set_fault(RigFault::LimitSwitch, true);
        assert!(d.until(0.1, |d| d.control.fault() == Some(Fault::LimitSwitch)));
        let (held_rad, mut max_rad) = (d.truth().twist_rad, 0.0f64);
        d.watch(2.0, |d| max_rad = max_rad.max((d.truth().twist_rad - held_rad).abs()));
        assert!(max_rad < 0.4, "half of what is called not held: {load}, {max_rad} rad");
        assert!(!d.control.faults().contains(Fault::NotHeld), "{load}");
    }
}

#[test]
fn an_encoder_that_counts_no_number_stops_the_rig() {
    let mut bad = constants();
    bad.counts_per_rad = 0.0;
    let mut d = ControlBench::with(scene(), Controller::new(table(), bad, None), &[], 1);
    d.run(0.1);
    assert_eq!(d.control.fault(), Some(Fault::NotFinite));
    assert_eq!(d.last.as_ref().unwrap().drive, DriveCommand::Voltage { pwm: 0 });
}

/// From a heavy load: from a light one the load falls so far behind its set-point that this is said first.
#[test]
fn a_load_beyond_the_table_stops_a_motion_but_not_a_rig_at_rest() {
    let heavy = |load: &str, then: &str, moves: bool| {
        let mut d = ControlBench::new(&[("load", load), ("twist_at_boot", "5")], 6);
        d.home().unwrap();
        if moves {
            d.tick(Some(go(0.012, 0.001)));
            d.run(2.0);
        }
        d.rig.set_plant("load", then).unwrap();
        d.run(4.0);
        d
    };
    assert_eq!(heavy("1.7kg", "2.0kg", true).control.fault(), Some(Fault::LoadRange));
    assert_eq!(heavy("1.6kg", "1.75kg", true).control.fault(), None);
    // At rest weights are changed: it is only said.
    let d = heavy("1.7kg", "2.0kg", false);
    assert_eq!((d.control.state(), d.control.fault()), (State::Ready, None));
    assert!(d.last.unwrap().telemetry.doubts.contains(Doubt::LoadRange));
}
