//! The steps of load control that need a table, each held against its equation: whether a move is possible, the position
//! loop, friction take-up, and the time to the target.

use host_tests::{constants, table};
use rig_control::friction_takeup::FrictionTakeup;
use rig_control::limits::Limits;
use rig_control::load_motion::{AHEAD_S, MotionObserver};
use rig_control::load_state::LoadState;
use rig_control::mechanism::{Mechanism, OUTSIDE_RAD};
use rig_control::move_check::{MoveRequest, MoveStart, SPEED_MIN_M_PER_S};
use rig_control::observer::LoadObserver;
use rig_control::planner::{Planner, SetPoint};
use rig_control::position_loop::{GAINS, PositionLoop, gain_share};
use rig_control::rest::{AT_REST_NOISES, JUMP_SHARE, Rest, Standing};
use rig_control::time_to_target::time_to_target_s;
use rig_control::{TICK_S, settings};
use rig_link::messages::{GapCurve, HomingResult, LoadChoice, Parameter, Refusal, Setting, SettingValues};
use std::f32::consts::PI;

const LOAD_N: f32 = 5.0;
const FRICTION_N: f32 = 0.2;
/// Gap (m) that the LVDT shows too much.
const OFFSET_M: f32 = 1e-3;

fn mechanism() -> Mechanism<'static> {
    Mechanism { table: table(), twist_scale: 1.0, curve: GapCurve::constant(OFFSET_M) }
}

/// At the half-turn pre-twist, after homing's way down.
fn start(settings: &SettingValues) -> MoveStart<'_> {
    let hangs_m = -settings.get(Setting::PositionZero);
    MoveStart {
        mechanism: mechanism(),
        load_n: LOAD_N,
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
        (m.twist_max_rad + 1.1 * OUTSIDE_RAD, false),
    ] {
        let checked = MoveStart { twist_rad, ..start }.check(&request(0.005));
        assert_eq!(checked.is_ok(), possible, "{twist_rad} rad");
        assert!(possible || range_of(checked).0 == Parameter::Twist);
    }
}

/// A homing that found the load and this friction (N), with the scale known to 1 % and the gap's zero to 0.1 mm.
fn homed(friction_n: f32) -> HomingResult {
    HomingResult {
        zero_error_rad: 0.01,
        load_n: LOAD_N,
        load_error_n: 0.2,
        twist_scale: 1.0,
        curve: GapCurve::constant(OFFSET_M),
        covariance: [1e-4, 0.0, 1e-8],
        friction_n,
        reference_gap_m: 0.1,
        gap_noise_m: 4e-6,
        jump_m: 0.0,
        drive_lag_s: 0.05,
    }
}

/// A load at rest at a twist, whose strings pull load less friction, as after a way down.
fn load_at(twist_rad: f32, friction_n: f32) -> LoadState<'static> {
    let mut observer = LoadObserver::new(&homed(friction_n), &table().metadata.uncertainty);
    let gap_m = mechanism().at(LOAD_N - friction_n, twist_rad).gap_m;
    let observation = observer.step(&mechanism(), twist_rad, Some(gap_m));
    assert!((observation.pull_n - LOAD_N + friction_n).abs() < 1e-3, "{observation:?}");
    LoadState {
        mechanism: mechanism(),
        observation,
        position_m: 0.005,
        motion: MotionObserver::at_rest(&mechanism(), gap_m, twist_rad, LOAD_N).now(),
        reference_gap_m: gap_m + 0.005,
        gap_noise_m: 4e-6,
        jump_m: 0.0,
        twist_rad,
        twist_limits: constants().twist_limits(),
    }
}

#[test]
fn the_loop_turns_speed_and_error_into_twist_speed_by_tr() {
    let load = load_at(15.0, 0.0);
    let tr_rad_per_m = load.observation.point.tr_rad_per_m();
    // Where the set-point goes evenly and the load is where it will be, only its speed is missing.
    let moving = SetPoint { speed_m_per_s: 0.002, done: false, ..SetPoint::at(0.005 - AHEAD_S * 0.002) };
    let frequency = load.motion.frequency_squared().sqrt();
    let [by_position, by_speed, by_rest] = GAINS.map(|gain| gain * gain_share(frequency));
    let output = PositionLoop::default().step(&moving, None, &load);
    let wanted = tr_rad_per_m * 0.002 * (1.0 + by_speed);
    assert!(output.error_m.abs() < 1e-8);
    assert!((output.twist_speed_rad_per_s / wanted - 1.0).abs() < 1e-2, "{output:?}, wanted {wanted} rad/s");
    // No feedback while friction is taken up.
    let waits = SetPoint { done: false, ..SetPoint::at(0.006) };
    assert_eq!(PositionLoop::default().step(&waits, Some(0.002), &load).twist_speed_rad_per_s, 0.0);
    // At rest, an error of 10 um: too little to take up friction for.
    let at_rest = SetPoint::at(0.00501);
    let output = PositionLoop::default().step(&at_rest, None, &load);
    let wanted = tr_rad_per_m * frequency * (by_position + by_rest) * 1e-5;
    assert!((output.twist_speed_rad_per_s / wanted - 1.0).abs() < 5e-2, "{output:?}, wanted {wanted} rad/s");
    // Within an eighth of an LVDT count it is left alone once it stands.
    let mut position_loop = PositionLoop::default();
    let last = (0..30).map(|_| position_loop.step(&SetPoint::at(0.005_005), None, &load)).last().unwrap();
    assert_eq!(last.twist_speed_rad_per_s, 0.0);
}

/// What a load does that stays so long (ticks) at an error (m).
fn stays(rest: &mut Rest, ticks: u8, error_m: f32, load: &LoadState<'_>) -> Standing {
    (0..ticks).map(|_| rest.step(true, error_m, load)).last().expect("some ticks")
}

#[test]
fn a_load_that_stands_beside_its_target_is_told_from_one_that_moves() {
    let load = load_at(15.0, FRICTION_N);
    assert_eq!(stays(&mut Rest::default(), 5, 30e-6, &load), Standing::Moves);
    assert_eq!(stays(&mut Rest::default(), 6, 30e-6, &load), Standing::Beside(30e-6));
    assert_eq!(stays(&mut Rest::default(), 6, 5e-6, &load), Standing::LeftAlone);
    let mut rest = Rest::default();
    stays(&mut rest, 20, 30e-6, &load);
    assert_eq!(stays(&mut rest, 2, 60e-6, &load), Standing::Moves);
    let (mut moving, mut under_way) = (load, Rest::default());
    moving.motion.speed_m_per_s = 2e-3;
    assert_eq!(stays(&mut under_way, 11, 5e-6, &moving), Standing::Moves);
    // The observer takes a load that sticks for one that moves with its strings: its place tells.
    assert_eq!(stays(&mut under_way, 1, 5e-6, &moving), Standing::LeftAlone);
    assert_eq!((0..20).map(|_| rest.step(false, 5e-6, &load)).last(), Some(Standing::Moves));
}

#[test]
fn half_of_a_jump_is_left_alone_and_no_way_that_the_strings_have_turned_for() {
    let load = load_at(15.0, FRICTION_N);
    let mut rest = Rest::default();
    stays(&mut rest, 10, 60e-6, &load);
    // Past the target, with the strings where they were.
    stays(&mut rest, 10, -40e-6, &load);
    assert!(
        (rest.tolerance_m(load.jump_m) / (JUMP_SHARE * 100e-6) - 1.0).abs() < 0.05,
        "{}",
        rest.tolerance_m(load.jump_m)
    );
    assert_eq!(stays(&mut rest, 1, -40e-6, &load), Standing::LeftAlone);
    assert_eq!(
        rest.left_alone_m(4e-6, 0.0),
        rest.tolerance_m(0.0),
        "what stiction leaves is more than what noise does"
    );
    assert_eq!(Rest::default().left_alone_m(10e-6, 0.0), 10e-6 * AT_REST_NOISES);
    let mut rest = Rest::default();
    stays(&mut rest, 10, 60e-6, &load);
    let turned = LoadState { twist_rad: 15.0 + 100e-6 * load.observation.point.tr_rad_per_m(), ..load };
    assert!(matches!(stays(&mut rest, 10, -40e-6, &turned), Standing::Beside(_)));
    assert!(rest.tolerance_m(load.jump_m) < 5e-6, "{}", rest.tolerance_m(load.jump_m));
}

#[test]
fn a_move_up_after_a_way_down_first_turns_across_the_friction_band() {
    let load = load_at(15.0, FRICTION_N);
    let mut takeup = FrictionTakeup::default();
    takeup.set_out(1.0);
    let waits = SetPoint { done: false, ..SetPoint::at(0.005) };
    let turned_rad = |takeup: &mut FrictionTakeup| {
        (0..200).map(|_| TICK_S * takeup.step(&waits, takeup.is_waiting().then_some(0.002), 0.0, &load)).sum::<f32>()
    };
    let m = mechanism();
    let (below, above) = (m.at(LOAD_N - FRICTION_N, 15.0), m.at(LOAD_N + FRICTION_N, 15.0));
    let band_rad = (above.gap_m - below.gap_m) * above.tr_rad_per_m();
    let mut first = takeup;
    first.step(&waits, Some(0.002), 0.0, &load);
    assert!(first.left_s() > 0.0 && first.left_s() < 0.5, "known in the first tick: {} s", first.left_s());
    // Most of the band at once; a load that is not seen to move is then crept to for half a band more.
    let turned_rad = turned_rad(&mut takeup);
    assert!((1.3..1.8).contains(&(turned_rad / band_rad)), "{turned_rad} of {band_rad} rad");
    assert!(!takeup.is_waiting() && takeup.left_s() == 0.0);
    // One that moves ends it.
    let mut takeup = FrictionTakeup::default();
    takeup.set_out(1.0);
    (0..35).for_each(|_| _ = takeup.step(&waits, Some(0.002), 0.0, &load));
    assert!(takeup.is_waiting());
    let moved = LoadState { position_m: load.position_m + 0.2e-3, ..load };
    (0..3).for_each(|_| _ = takeup.step(&waits, Some(0.002), 0.0, &moved));
    assert!(!takeup.is_waiting());
    // Down again the pull is already at that end, and there is only the creep.
    let mut takeup = FrictionTakeup::default();
    takeup.set_out(-1.0);
    let crept_rad =
        (0..200).map(|_| TICK_S * takeup.step(&waits, takeup.is_waiting().then_some(0.002), 0.0, &load)).sum::<f32>();
    assert!(crept_rad < 0.0 && -crept_rad / band_rad < 0.85, "{crept_rad} of {band_rad} rad");
}

#[test]
fn the_time_to_the_target_is_that_of_the_plan_step_by_step() {
    let (rig, m) = (constants(), mechanism());
    for (from_rad, way_m, asked) in [(4.0, 0.012, 0.002), (4.0, 0.012, 0.02), (40.0, -0.008, 0.02), (30.0, 5e-4, 0.01)]
    {
        let load = load_at(from_rad, 0.0);
        let mut planner = Planner::at(0.0);
        planner.go_to(way_m);
        let expected_s = time_to_target_s(&planner, asked, &load, &rig);
        let (mut twist_rad, mut ticks, mut last_m) = (from_rad, 0u16, 0.0);
        while !planner.is_at_rest() {
            let point = m.at(LOAD_N, twist_rad);
            let set_point = planner.step(&Limits::for_motor(asked, &point, LOAD_N, &rig).0);
            twist_rad += (set_point.position_m - last_m) * point.tr_rad_per_m();
            last_m = set_point.position_m;
            ticks += 1;
        }
        let took_s = f32::from(ticks) * TICK_S;
        println!("{way_m} m at {asked} m/s: {expected_s:.3} s expected, {took_s:.3} s taken");
        assert!((expected_s - took_s).abs() < 0.05 + 0.02 * took_s, "{expected_s} s expected, {took_s} s taken");
    }
}
