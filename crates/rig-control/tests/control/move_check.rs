//! Whether a move is possible, and which parameter of it is refused.

use crate::fixture::{constants, table};
use rig_control::mechanism::{Mechanism, OUTSIDE_RAD};
use rig_control::move_check::{MoveRequest, MoveStart, SPEED_MIN_M_PER_S};
use rig_control::observer::TRAVEL_M;
use rig_control::settings;
use rig_link::messages::{GapCurve, LoadChoice, Parameter, Refusal, Setting, SettingValues};
use std::f32::consts::PI;

const LOAD_N: f32 = 5.0;
const FRICTION_N: f32 = 0.2;
/// Gap (m) that the LVDT shows too much.
const OFFSET_M: f32 = 1e-3;

fn mechanism() -> Mechanism<'static> {
    Mechanism { table: *table(), twist_scale: 1.0, curve: GapCurve::constant(OFFSET_M) }
}

/// At the half-turn pre-twist, after homing's way down.
fn start(settings: &SettingValues) -> MoveStart<'_> {
    let hangs_m = -settings.get(Setting::PositionZero);
    MoveStart {
        mechanism: mechanism(),
        mechanism_load_n: LOAD_N,
        friction_n: FRICTION_N,
        twist_rad: PI,
        position_m: hangs_m,
        zero_gap_m: mechanism().at(LOAD_N - FRICTION_N, PI).gap_m + hangs_m,
        settings,
    }
}

fn request(target_m: f32) -> MoveRequest {
    MoveRequest { target_m, speed_m_per_s: 0.002, load: LoadChoice::Auto }
}

fn range_of(result: Result<(), Refusal>) -> (Parameter, f32, f32) {
    match result {
        Err(Refusal::OutOfRange { parameter, min, max, .. }) => (parameter, min, max),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_move_is_possible_as_far_as_the_strings_pull_load_and_friction() {
    let defaults = settings::defaults(&constants());
    let start = start(&defaults);
    // Up, the strings pull the load and friction: the gap at the last twist is larger by that.
    let (m, twist_max_rad) = (mechanism(), table().metadata.twist_max_rad);
    let highest_m = start.zero_gap_m - m.at(LOAD_N + FRICTION_N, twist_max_rad).gap_m;
    assert_eq!(start.check(&request(highest_m)), Ok(()));
    let (parameter, min, max) = range_of(start.check(&request(highest_m + 1e-6)));
    assert_eq!((parameter, max), (Parameter::Target, highest_m));
    assert!(min >= 0.0 && start.check(&request(0.0)).is_ok());
    assert_eq!(range_of(start.check(&request(-1e-6))).0, Parameter::Target, "no load is let down below the pre-twist");
    let without = MoveStart { friction_n: 0.0, ..start };
    assert!(without.check(&request(highest_m + 1e-5)).is_ok(), "friction costs travel");
    // A heavier load cannot be brought up as far.
    let heavier = MoveRequest { load: LoadChoice::Known(15.0), ..request(highest_m) };
    assert_eq!(range_of(start.check(&heavier)).0, Parameter::Target);
    // Where zero is another place, so are the ends.
    let raised = defaults.with(Setting::PositionZero, 0.002);
    let raised = self::start(&raised);
    assert!(raised.check(&request(-0.002)).is_ok() && raised.check(&request(highest_m - 0.0021)).is_ok());
    assert_eq!(range_of(raised.check(&request(highest_m - 0.0019))).0, Parameter::Target);
}

/// A load that is much heavier than the homed one hangs below position 0, some however far the strings are twisted.
#[test]
fn what_a_refusal_allows_is_possible_for_a_load_that_hangs_below_zero() {
    let defaults = settings::defaults(&constants());
    for (lower_m, load_n, twist_rad) in [(0.0, 17.0, 10.0), (2e-3, 17.0, 10.0), (2e-3, 17.0, 40.0)] {
        let zero_gap_m = mechanism().at(0.8, PI).gap_m - lower_m;
        let position_m = zero_gap_m - mechanism().at(load_n, twist_rad).gap_m;
        let start = MoveStart { mechanism_load_n: load_n, twist_rad, position_m, zero_gap_m, ..start(&defaults) };
        let (parameter, min_m, max_m) = range_of(start.check(&request(0.05)));
        assert_eq!((parameter, min_m), (Parameter::Target, position_m));
        for target_m in [0.5 * (min_m + max_m), max_m] {
            assert_eq!(start.check(&request(target_m)), Ok(()), "{load_n} N at {position_m} m: {min_m} to {max_m}");
        }
        assert_eq!(range_of(start.check(&request(max_m + 1e-6))), (Parameter::Target, min_m, max_m));
    }
    // A load at the lower end, but for noise, has the lower end.
    let start = start(&defaults);
    let noisy = MoveStart { position_m: -5e-6, ..start };
    assert_eq!(range_of(noisy.check(&request(0.05))), range_of(start.check(&request(0.05))));
}

/// Friction holds a heavy load above what the strings could raise it to, or all that it reaches is below position 0.
#[test]
fn what_a_refusal_allows_is_possible_for_a_load_that_cannot_be_raised() {
    let defaults = settings::defaults(&constants());
    let twist_rad = table().metadata.twist_max_rad;
    for (light_n, load_n, friction_n) in [(0.8, 16.5, 1.2), (0.3, 17.0, 1.0), (0.3, 16.5, 3.0)] {
        let hangs_m = mechanism().at(load_n, twist_rad).gap_m;
        for lifted_m in [0.0, 0.5e-3, 2e-3, 8e-3] {
            // Homing saw the light load this much higher than the table has it.
            let zero_gap_m = mechanism().at(light_n, PI).gap_m - lifted_m;
            let position_m = zero_gap_m - hangs_m;
            let start = MoveStart {
                mechanism_load_n: load_n,
                friction_n,
                twist_rad,
                position_m,
                zero_gap_m,
                ..start(&defaults)
            };
            let (parameter, min_m, max_m) = range_of(start.check(&request(0.05)));
            assert!(parameter == Parameter::Target && min_m <= max_m, "{min_m} to {max_m}");
            assert!(max_m >= position_m - TRAVEL_M, "{position_m} m, where it hangs: {min_m} to {max_m}");
            assert_eq!(range_of(start.check(&request(-0.05))), (parameter, min_m, max_m));
            // Below position 0 it can only stay where it hangs.
            for target_m in [min_m, 0.5 * (min_m + max_m), max_m].into_iter().filter(|_| position_m >= 0.0) {
                assert_eq!(start.check(&request(target_m)), Ok(()), "{load_n} N at {position_m} m: {min_m} to {max_m}");
            }
        }
    }
}

#[test]
fn each_parameter_of_a_move_is_refused_by_name() {
    let defaults = settings::defaults(&constants()).with(Setting::SpeedMax, 0.01);
    let start = start(&defaults);
    let m = &table().metadata;
    let speed = |speed_m_per_s| start.check(&MoveRequest { speed_m_per_s, ..request(0.005) });
    assert_eq!(range_of(speed(0.0101)), (Parameter::Speed, SPEED_MIN_M_PER_S, 0.01));
    assert!(speed(0.01).is_ok() && speed(SPEED_MIN_M_PER_S).is_ok());
    assert_eq!(speed(f32::NAN), Err(Refusal::NotFinite { parameter: Parameter::Speed }));
    let load = |load_n| start.check(&MoveRequest { load: LoadChoice::Known(load_n), ..request(0.001) });
    assert_eq!(range_of(load(0.9 * m.load_min_n)), (Parameter::Load, m.load_min_n, m.load_max_n));
    assert_eq!(load(f32::INFINITY), Err(Refusal::NotFinite { parameter: Parameter::Load }));
    for target_m in [f32::NAN, f32::INFINITY] {
        assert_eq!(start.check(&request(target_m)), Err(Refusal::NotFinite { parameter: Parameter::Target }));
    }
    for (twist_rad, possible) in [
        (m.twist_min_rad - 0.9 * OUTSIDE_RAD, true),
        (m.twist_min_rad - 1.1 * OUTSIDE_RAD, false),
        (m.twist_max_rad + 0.9 * OUTSIDE_RAD, true),
        (m.twist_max_rad + 1.1 * OUTSIDE_RAD, false),
    ] {
        let checked = MoveStart { twist_rad, ..start }.check(&request(0.005));
        assert_eq!(checked.is_ok(), possible, "{twist_rad} rad");
        assert!(possible || range_of(checked).0 == Parameter::Twist);
    }
}
