//! The control code alone against the emulated rig: homing, moving, the estimated load and wrong wires over many plants.
//! What needs no plant is in `crates/rig-control/tests/`.

mod estop;
mod homing;
mod load;
mod moving;
mod scenes;
mod stream;
mod wiring;

use host_tests::ControlBench;
use rig_link::messages::{LoadChoice, Request, State};

type Keys = &'static [(&'static str, &'static str)];

fn go(target_m: f32, speed_m_per_s: f32) -> Request {
    Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto }
}

/// A rig that has homed from 6 rad.
fn homed(keys: &[(&str, &str)], load: &str, friction: &str, seed: u64) -> ControlBench {
    let all = [keys, &[("load", load), ("friction", friction), ("twist_at_boot", "6")]].concat();
    let mut d = ControlBench::new(&all, seed);
    d.home().unwrap_or_else(|e| panic!("{keys:?} {load}: {e}"));
    d
}

/// Moves at 2 mm/s; the maximum distance from the set-point on the way (m).
fn track(d: &mut ControlBench, target_m: f32) -> f64 {
    d.tick(Some(go(target_m, 0.002)));
    let mut worst = 0.0f64;
    while d.control.state() == State::Moving {
        let set_point_m = d.tick(None).telemetry.setpoint_m;
        worst = worst.max((d.true_position_m() - f64::from(set_point_m.unwrap_or(f32::NAN))).abs());
    }
    assert_eq!(d.control.state(), State::Holding, "{:?}", d.control.fault());
    worst
}

/// The reported load.
fn load_n(d: &ControlBench) -> f64 {
    d.last.as_ref().and_then(|last| last.telemetry.load_n).expect("a load").into()
}

/// Relative error of the reported load.
fn load_error(d: &ControlBench) -> f64 {
    load_n(d) / d.truth().load_n - 1.0
}
