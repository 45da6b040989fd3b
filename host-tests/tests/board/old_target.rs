//! A drive keeps its last target indefinitely, and has no time-out of its own (crates/rmds405/README.md 2.6). Here is every
//! way in which it may still hold one when the board no longer means it, on the emulated board: in the ten seconds
//! after each, the drive turns the strings by nothing, whatever becomes of the load.

use host_tests::board::Bench;
use rig_link::messages::{Fault, Request, State};
use rig_plant::RigFault;

/// A load that untwists the strings when nothing holds them, so that the old target is far away when the motor is back.
const LOAD: (&str, &str) = ("load", "1.8kg");
/// What the drive may still turn (rad): a start that catches a falling load turns it back by a little, an old target by 0.35.
const STILL_RAD: f64 = 0.05;

/// How the board's relay feeds the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Relay {
    /// It drops in 20 ms, longer than a reset takes.
    Slow,
    /// None is fitted: the drive has power all the while.
    Absent,
}

const RELAYS: [Relay; 2] = [Relay::Slow, Relay::Absent];

fn fault(b: &mut Bench, fault: RigFault, on: bool) {
    b.machine.board_mut().set_fault(fault, on);
}

fn jogging(relay: Relay) -> Bench {
    let fitted = if relay == Relay::Absent { "0" } else { "1" };
    let mut b = Bench::new(&[LOAD, ("twist_at_boot", "12"), ("relay_fitted", fitted)], 3);
    b.ready();
    b.prove();
    b.ask(&Request::Jog { twist_speed_rad_per_s: 3.0 }).unwrap();
    b.run(1.5);
    assert_eq!(b.state(), State::Moving);
    b
}

/// Way that the drive has turned the strings (rad).
fn driven_rad(b: &Bench) -> f64 {
    b.machine.board().truth().driven_rad
}

/// The next ten seconds: how far the drive turns the strings (rad).
fn driven_in_ten_seconds(b: &mut Bench) -> f64 {
    let before_rad = driven_rad(b);
    b.run(10.0);
    driven_rad(b) - before_rad
}

/// A name, and what happens to a board.
type Happens = (&'static str, fn(&mut Bench));

/// While the strings turn; `control/estop.rs` has every state.
#[test]
fn the_emergency_stop_released_moves_nothing() {
    for pressed_s in [0.05, 6.0] {
        let mut b = jogging(Relay::Absent);
        fault(&mut b, RigFault::Estop, true);
        b.run(pressed_s);
        assert_eq!(b.state(), State::EStop);
        fault(&mut b, RigFault::Estop, false);
        let driven_rad = driven_in_ten_seconds(&mut b);
        assert!(driven_rad < STILL_RAD, "pressed for {pressed_s} s: driven by {driven_rad} rad");
        assert_eq!(b.state(), State::EStop, "only `clear` ends it");
    }
}

/// The wires to the drive are off while the stop is pressed, so that no Reset reaches it: the relay takes its power.
#[test]
fn a_drive_that_cannot_be_heard_loses_its_power_with_the_emergency_stop() {
    let mut b = jogging(Relay::Slow);
    fault(&mut b, RigFault::CanSilent, true);
    fault(&mut b, RigFault::Estop, true);
    b.run(3.0);
    let before_rad = driven_rad(&b);
    fault(&mut b, RigFault::Estop, false);
    b.run(1.0);
    fault(&mut b, RigFault::CanSilent, false);
    b.run(9.0);
    let driven_rad = driven_rad(&b) - before_rad;
    assert!(driven_rad < STILL_RAD, "driven by {driven_rad} rad");
}

#[test]
fn a_board_that_restarts_under_the_emergency_stop_moves_nothing_on_release() {
    for relay in RELAYS {
        let mut b = jogging(relay);
        fault(&mut b, RigFault::Estop, true);
        b.run(0.5);
        b.machine.crash().unwrap();
        b.run(4.0);
        fault(&mut b, RigFault::Estop, false);
        let driven_rad = driven_in_ten_seconds(&mut b);
        println!("relay {relay:?}: driven by {driven_rad:.4} rad");
        assert!(driven_rad < STILL_RAD, "relay {relay:?}: driven by {driven_rad} rad");
        assert_eq!(b.state(), State::EStop, "{:?}", b.last);
    }
}

/// How the microcontroller restarts with the drive powered all the while.
const RESTARTS: [Happens; 4] = [
    ("a hard fault", |b| b.machine.crash().unwrap()),
    ("a watchdog bite", |b| {
        b.machine.hang(true);
        b.run(1.2);
        b.machine.hang(false);
    }),
    ("a brown-out of the board", |b| b.machine.brown_out()),
    ("a power cycle of the board", |b| {
        b.machine.board_mut().power_cycle();
        b.machine.power_cycle();
    }),
];

#[test]
fn a_board_that_restarts_beside_a_drive_that_goes_on_moves_nothing() {
    for relay in RELAYS {
        for (name, restart) in RESTARTS {
            let mut b = jogging(relay);
            let mode = |b: &Bench| b.machine.board().truth().drive_mode;
            assert_eq!(mode(&b), 8);
            restart(&mut b);
            // The drive comes to rest at its last target, and the first frame is a Reset.
            b.run(0.1);
            assert_ne!(mode(&b), 8, "relay {relay:?}, {name}: the drive still follows its old target");
            let driven_rad = driven_in_ten_seconds(&mut b);
            println!("relay {relay:?}, {name:26}: driven by {driven_rad:.4} rad, {:?}", b.state());
            // The brown-out reset is off, as delivered: only the RAM tells the dip from power-on.
            let dip = name == "a brown-out of the board";
            assert!(!dip || b.last.is_some_and(|t| t.fault == Some(Fault::UnexpectedReset)), "{:?}", b.last);
            assert!(driven_rad < STILL_RAD, "relay {relay:?}, {name}: driven by {driven_rad} rad");
        }
    }
}

/// What becomes of the drive alone, and of the host.
#[test]
fn a_drive_that_restarts_and_a_host_that_vanishes_move_nothing() {
    let happens: [Happens; 3] = [
        ("drive's brown-out", |b| {
            fault(b, RigFault::DriveReset, true);
            b.run(0.2);
        }),
        ("drive restarted by hand", |b| {
            b.machine.board_mut().set_plant("supply_voltage", "0V").unwrap();
            b.run(1.0);
            b.machine.board_mut().set_plant("supply_voltage", "24V").unwrap();
        }),
        ("host gone", |b| {
            b.heartbeat = false;
            b.run(0.8);
            assert_eq!(b.state(), State::Fault);
        }),
    ];
    for (name, happens) in happens {
        let mut b = jogging(Relay::Absent);
        happens(&mut b);
        let driven_rad = driven_in_ten_seconds(&mut b);
        assert!(driven_rad < STILL_RAD, "{name}: {driven_rad} rad");
    }
}
