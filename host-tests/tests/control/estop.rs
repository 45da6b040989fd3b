//! The emergency stop in every state: a drive keeps its last target indefinitely (crates/rmds405/README.md 2.6), and must not go there
//! when the stop is released. `board/old_target.rs` has the same on the emulated board, with all that restarts.

use super::go;
use host_tests::ControlBench;
use rig_link::messages::{Request, State};
use rig_plant::RigFault;

/// A rig without the relay that takes the drive's power, or with it. The load untwists the strings when nothing holds them, so that
/// the old target is far away when the motor is back.
fn rig(relay: &str, twist: &str) -> ControlBench {
    ControlBench::new(&[("load", "1.8kg"), ("twist_at_boot", twist), ("relay_fitted", relay)], 3)
}

fn standing(relay: &str) -> ControlBench {
    let mut d = rig(relay, "12");
    assert!(d.until(6.0, |d| d.control.state() == State::Unhomed), "{:?}", d.control.fault());
    d
}

fn jogging() -> ControlBench {
    let mut d = standing("0");
    d.prove();
    d.tick(Some(Request::Jog { twist_speed_rad_per_s: 3.0 }));
    d.run(1.5);
    d
}

/// A state, and how a rig is brought there.
const STATES: [(State, fn() -> ControlBench); 6] = [
    (State::Boot, || {
        let mut d = rig("0", "12");
        d.run(1.0);
        d
    }),
    (State::Unhomed, || standing("0")),
    (State::Moving, jogging),
    (State::Homing, || {
        let mut d = standing("1");
        d.tick(Some(Request::HOME));
        d.run(3.0);
        d
    }),
    (State::Moving, || {
        let mut d = rig("0", "5");
        d.home().unwrap();
        d.tick(Some(go(0.008, 0.002)));
        d.run(2.0);
        d
    }),
    (State::Fault, || {
        let mut d = jogging();
        d.rig.set_fault(RigFault::LimitSwitch, true);
        d.run(1.2);
        d
    }),
];

#[test]
fn the_emergency_stop_released_moves_nothing() {
    for (state, reach) in STATES {
        let before = reach();
        assert_eq!(before.control.state(), state);
        for pressed_s in [0.05, 6.0] {
            let mut d = before.clone();
            d.rig.set_fault(RigFault::Estop, true);
            d.run(pressed_s);
            assert_eq!(d.control.state(), State::EStop, "pressed in {state}");
            d.rig.set_fault(RigFault::Estop, false);
            let before_rad = d.truth().driven_rad;
            d.run(10.0);
            let driven_rad = d.truth().driven_rad - before_rad;
            // A start that catches a falling load turns it back by a little, an old target by 0.35.
            assert!(driven_rad < 0.05, "pressed in {state} for {pressed_s} s: driven by {driven_rad} rad");
            assert_eq!(d.control.state(), State::EStop, "only `clear` ends it");
        }
    }
}
