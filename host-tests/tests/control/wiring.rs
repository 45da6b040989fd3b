//! A rig whose motor, encoders or LVDT are wired wrong: what turns, for how long, and what the fault says. The emulated drive
//! closes its loops on what its own encoder input counts, so with a wrong sign it runs away.

use host_tests::ControlBench;
use rig_link::messages::{EventKind, Fault, HomingFailure, LoadChoice, Request, State};
use rig_plant::RigFault;
use std::f64::consts::PI;

/// What a first homing of a rig does.
#[derive(Debug)]
struct Outcome {
    fault: Option<Fault>,
    state: State,
    /// From the first motion of the shaft until nothing drives it any more (s).
    torque_s: f64,
    /// Farthest that the strings have turned from where they were at power-on (rad).
    turned_rad: f64,
    last: Option<EventKind>,
}

fn first_homing(faults: &[RigFault], load: &str, seed: u64) -> Outcome {
    // Untwisted strings: a load on twisted ones turns the motor while it has no torque.
    let mut d = ControlBench::new(&[("load", load), ("twist_at_boot", "0rad")], seed);
    faults.iter().for_each(|&fault| d.rig.set_fault(fault, true));
    let start_rad = d.truth().twist_rad;
    let (mut turned_rad, mut torque_s, mut first_s) = (0f64, 0f64, None);
    let mut watch = |d: &ControlBench| {
        let truth = d.truth();
        turned_rad = turned_rad.max((truth.twist_rad - start_rad).abs());
        // A shorted motor brakes, and drives nothing.
        if truth.motor_current_a * truth.motor_speed_rad_per_s > 0.0 {
            let first_s = *first_s.get_or_insert(d.time_s());
            torque_s = d.time_s() - first_s;
        }
    };
    d.until(15.0, |d| {
        watch(d);
        matches!(d.control.state(), State::Unhomed | State::Fault)
    });
    let before_rad = (d.truth().twist_rad - start_rad).abs();
    assert!(before_rad < 0.05, "nothing turns before somebody asks for it: {faults:?}");
    if d.control.state() == State::Unhomed {
        d.tick(Some(Request::HOME));
    }
    d.until(60.0, |d| {
        watch(d);
        d.control.state() != State::Homing
    });
    // The motor may coast.
    d.watch(2.0, watch);
    let last = d.events.last().map(|(_, event)| *event);
    Outcome { fault: d.control.fault(), state: d.control.state(), torque_s, turned_rad, last }
}

/// Motor, drive's encoder, own encoder and LVDT, each as it should be or reversed.
const SIGNS: [RigFault; 4] =
    [RigFault::MotorSwapped, RigFault::DriveEncoderSwapped, RigFault::EncoderSwapped, RigFault::LvdtSwapped];

#[test]
fn no_combination_of_wrong_signs_turns_the_strings_by_more_than_a_radian() {
    for mask in 0..16u32 {
        let faults: Vec<RigFault> = (0..4).filter(|k| mask >> k & 1 == 1).map(|k| SIGNS[k as usize]).collect();
        let outcome = first_homing(&faults, "0.5kg", 7);
        let expected = match mask & 7 {
            0b000 | 0b111 => None,
            0b001 | 0b110 => Some(Fault::MotorDirection),
            0b010 | 0b101 => Some(Fault::DriveEncoder),
            _ => Some(Fault::EncoderDirection),
        };
        assert_eq!(outcome.fault, expected, "{faults:?} {outcome:?}");
        if expected.is_some() {
            assert!(outcome.turned_rad < 1.0 && outcome.torque_s < 0.3, "{faults:?} {outcome:?}");
        } else if mask & 8 == 0 {
            assert_eq!(outcome.state, State::Ready, "{faults:?} {outcome:?}");
        } else {
            // Motor and encoders are right. That the LVDT is reversed shows in how the gap changes over some turns.
            let failure = EventKind::HomingRefused(HomingFailure::LvdtReversed);
            assert_eq!(outcome.last, Some(failure), "{faults:?} {outcome:?}");
            assert!(outcome.turned_rad < 9.0 * PI, "{faults:?} {outcome:?}");
        }
    }
}

#[test]
fn each_dead_sensor_or_channel_is_named_before_the_strings_have_turned_by_a_radian() {
    for (fault, expected) in [
        (RigFault::DriveEncoderStuck, Fault::DriveEncoder),
        (RigFault::DriveEncoderChannel, Fault::DriveEncoder),
        (RigFault::DriveLines, Fault::EncoderDisagrees),
        (RigFault::EncoderStuck, Fault::EncoderStuck),
        (RigFault::EncoderChannel, Fault::EncoderStuck),
        (RigFault::EncoderSlip, Fault::EncoderDisagrees),
        (RigFault::EncoderUnpowered, Fault::MotorStill),
        (RigFault::MotorOpen, Fault::MotorStill),
        (RigFault::LvdtOpen, Fault::LvdtOpen),
        (RigFault::LvdtShort, Fault::LvdtShort),
    ] {
        for load in ["0.1kg", "1.5kg"] {
            let outcome = first_homing(&[fault], load, 11);
            assert_eq!(outcome.fault, Some(expected), "{fault:?} {load} {outcome:?}");
            assert!(outcome.turned_rad < 1.0 && outcome.torque_s < 0.3, "{fault:?} {load} {outcome:?}");
        }
    }
}

#[test]
fn a_shaft_that_never_stands_after_a_start_is_a_fault() {
    let mut d = ControlBench::new(&[("load", "0.1kg"), ("twist_at_boot", "0rad")], 3);
    // A hand turns it to and fro by a third of a radian, twice a second.
    d.tamper = Some(std::sync::Arc::new(|inputs| {
        let seconds = 1e-6 * inputs.now_us as f32;
        inputs.encoder_counts += (13_000.0 * (4.0 * std::f32::consts::PI * seconds).sin()) as i64;
    }));
    assert!(d.until(15.0, |d| d.control.fault().is_some()));
    assert_eq!(d.control.fault(), Some(Fault::ShaftUnsteady));
    assert!(d.time_s() > 10.0, "{} s", d.time_s());
}

/// The encoder that drive and board share loses its supply, or a channel before the lines part, while the strings turn: the drive's loop
/// runs after a count that stands.
#[test]
fn an_encoder_that_fails_while_the_strings_turn_ends_the_motion_before_the_drive_has_run_away() {
    let both = [RigFault::EncoderChannel, RigFault::DriveEncoderChannel];
    for faults in [&[RigFault::EncoderUnpowered][..], &both] {
        for (load, friction) in [("0.2kg", "0.5N"), ("0.5kg", "0.05N"), ("1.2kg", "0.5N")] {
            let mut ready = super::homed(&[], load, friction, 3);
            ready.move_to(0.008, 0.004, LoadChoice::Auto).unwrap();
            for request in [
                super::go(0.014, 0.002),
                super::go(0.002, 0.004),
                Request::Jog { twist_speed_rad_per_s: 2.0 },
                Request::Jog { twist_speed_rad_per_s: -4.0 },
                Request::HOME,
            ] {
                let mut d = ready.clone();
                d.tick(Some(request));
                d.run(0.5);
                faults.iter().for_each(|&fault| d.rig.set_fault(fault, true));
                let (from_s, from_rad) = (d.time_s(), d.truth().twist_rad);
                assert!(d.until(2.0, |d| d.control.fault().is_some()), "{faults:?} {load} {request:?}");
                let (after_s, turned_rad) = (d.time_s() - from_s, (d.truth().twist_rad - from_rad).abs());
                println!("{faults:?} {load} {request:?}: after {after_s:.2} s and {turned_rad:.1} rad");
                assert_eq!(d.control.fault(), Some(Fault::MotorStill), "{faults:?} {load} {request:?}");
                assert!(
                    turned_rad < 5.0 && d.truth().drive_mode == 0,
                    "{faults:?} {load} {request:?}: {turned_rad} rad"
                );
            }
        }
    }
}

/// The same where a fault has just stopped the strings: the set-point stands, and the count that stands as well is a little beside it.
#[test]
fn an_encoder_that_fails_while_a_fault_stops_the_strings_ends_the_hold() {
    for (load, friction) in [("0.2kg", "0.5N"), ("0.5kg", "0.05N"), ("1.2kg", "0.5N")] {
        let mut d = super::homed(&[], load, friction, 3);
        d.tick(Some(super::go(0.006, 0.003)));
        d.run(1.5);
        d.rig.set_fault(RigFault::LvdtOpen, true);
        d.run(0.1);
        assert_eq!(d.control.fault(), Some(Fault::LvdtOpen));
        d.rig.set_fault(RigFault::EncoderUnpowered, true);
        let from_rad = d.truth().driven_rad;
        d.run(10.0);
        let driven_rad = d.truth().driven_rad - from_rad;
        println!("{load}: {driven_rad:.1} rad, {:?}", d.control.fault());
        assert!(driven_rad < 5.0 && d.control.fault() == Some(Fault::MotorStill), "{load}: {driven_rad} rad");
    }
}

/// A drive whose line breaks in the check of the directions keeps its voltage.
#[test]
fn a_line_that_breaks_while_a_voltage_turns_the_motor_costs_the_drive_its_power() {
    let mut d = ControlBench::new(&[("load", "0.5kg"), ("twist_at_boot", "0rad")], 7);
    d.until(15.0, |d| d.control.state() == State::Unhomed);
    d.tick(Some(Request::HOME));
    assert!(d.until(1.0, |d| d.truth().motor_speed_rad_per_s.abs() > 1.0));
    d.rig.set_fault(RigFault::CanSilent, true);
    let from_rad = d.truth().twist_rad;
    d.run(3.0);
    let turned_rad = (d.truth().twist_rad - from_rad).abs();
    assert!(d.control.faults().contains(Fault::DriveSilent) && d.control.fault() == Some(Fault::NotHeld));
    assert!(turned_rad < 0.5 && d.truth().drive_mode == 0, "{turned_rad} rad, mode {}", d.truth().drive_mode);
}

/// A load on strings that turn easily untwists them while the drive starts again; a fault in that time does not keep it from being held.
#[test]
fn a_load_is_caught_when_the_drive_has_started_again_whatever_fault_came_meanwhile() {
    let keys = [("load", "1.2kg"), ("twist_at_boot", "45"), ("motor_friction", "0"), ("friction", "0.05N")];
    let mut d = ControlBench::new(&keys, 7);
    d.until(15.0, |d| d.control.state() == State::Unhomed);
    d.tick(Some(Request::HOME));
    assert!(d.until(3.0, |d| d.rig.drive().mode().is_none()), "the drive starts again");
    d.run(0.2);
    d.host_alive = false;
    assert!(d.until(1.0, |d| d.control.fault() == Some(Fault::HostSilent)));
    d.run(3.0);
    let held_rad = d.truth().twist_rad;
    d.run(3.0);
    assert!((d.truth().twist_rad - held_rad).abs() < 0.1, "from {held_rad} to {} rad", d.truth().twist_rad);
    // Without its motor's leads in order it is not held, and that is noticed.
    d.rig.set_fault(RigFault::MotorSwapped, true);
    d.run(3.0);
    assert_eq!(d.control.fault(), Some(Fault::NotHeld));
}
