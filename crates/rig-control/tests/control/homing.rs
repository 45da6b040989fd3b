//! Homing on a rig whose every number is known: zero twist, load, friction, string radius, the LVDT's zero, the drive's lag.

use crate::bench::Bench;
use crate::fixture::{constants, near, table};
use rig_control::homing::{NINETY_PERCENT, SPEED};
use rig_control::hysteresis::{MEMORY_ERROR, RodMemory};
use rig_control::mechanism::Mechanism;
use rig_control::{RigConstants, TICK_S};
use rig_link::messages::{Accepted, EventKind, HomingFailure, LoadChoice, LvdtCurve, Request, Setting, State};
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

#[test]
fn all_that_a_move_needs_is_found_from_any_twist() {
    for (load_n, friction_n, twist_rad, twist_scale, offset_m) in [
        (5.0, 0.01, 9.0, 1.0, 0.0),
        (1.5, 0.05, -20.0, 1.0, 0.2e-3),
        (3.0, 0.02, 1.0, 0.99, 0.0),
        (1.5, 0.01, -2.0, 1.01, -0.1e-3),
        (8.0, 0.005, 30.0, 1.0, 0.0),
    ] {
        let mut bench = Bench::new(load_n, friction_n, twist_rad);
        (bench.twist_scale, bench.offset_m, bench.friction_a) = (twist_scale, offset_m, 5e-3);
        bench.settle();
        let found = bench.home();
        let zero_rad = bench.rig.homed().unwrap().zero_rad;
        near(zero_rad, bench.zero_rad(), 6e-3);
        assert!((0.05 * friction_n..0.05).contains(&found.zero_error_rad), "{}", found.zero_error_rad);
        near(bench.twist_rad, PI, 0.01);
        // The gap's shape alone says load and radius within some per cent.
        near(found.load_n, load_n, 0.065 * load_n);
        assert!((0.05..0.35).contains(&(found.load_error_n / load_n)), "{}", found.load_error_n);
        near(found.friction_n, friction_n, 0.05 * friction_n + 3e-3);
        // What the LVDT shows where the load has come to rest after its way down, and how much that differs from tick to tick.
        near(found.reference_gap_m, bench.gap_at(load_n - friction_n, PI)[0] + offset_m, 10e-6);
        near(found.gap_noise_m, bench.noise_m, 0.2 * bench.noise_m);
        assert_eq!(found.jump_m, 0.0);
        near(found.drive_lag_s, TICK_S, 1e-4);
        // Load, scale and curve together give the gap of this rig at each twist.
        let mechanism = Mechanism { table: *table(), twist_scale: found.twist_scale, curve: found.curve };
        for twist_rad in [4.0f32, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0] {
            near(mechanism.at(found.load_n, twist_rad).gap_m, bench.gap_at(load_n, twist_rad)[0] + offset_m, 8e-6);
        }
        let seconds = 1e-6 * bench.now_us as f32;
        assert!((18.0..28.0).contains(&seconds), "{seconds} s");
    }
}

#[test]
fn a_weight_that_is_given_leaves_the_radius_to_be_found() {
    let mut bench = Bench::new(4.0, 0.01, 9.0);
    bench.twist_scale = 0.99;
    bench.settle();
    bench.while_in(State::Boot);
    bench.begin(Request::Home { load: LoadChoice::Known(4.0) });
    bench.while_in(State::Homing);
    let found = bench.rig.homed().expect("homed").found;
    near(found.load_n, 4.0, 0.01);
    near(found.load_error_n, 1.645 * 0.005 * 4.0, 0.1 * 1.645 * 0.005 * 4.0);
    near(found.twist_scale, 0.99, 2e-3);
}

#[test]
fn a_rig_that_is_wired_the_other_way_round_is_homed_alike() {
    let turned = RigConstants { counts_per_rad: -constants().counts_per_rad, ..constants() };
    let mut bench = Bench::of(turned, 3.0, 0.01, 9.0);
    let found = bench.home();
    near(bench.rig.homed().unwrap().zero_rad, bench.zero_rad(), 6e-3);
    near(found.load_n, 3.0, 0.2);
    near(bench.twist_rad, PI, 0.01);
}

#[test]
fn the_lag_of_the_drive_is_measured_and_made_up_for() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.drive_lag_s = 0.02;
    let found = bench.home();
    // Of a first-order lag of 20 ms in steps of a tick, with the tick itself: 1/(1 − exp(−1/2)) ticks.
    near(found.drive_lag_s, TICK_S / (1.0 - (-0.5f32).exp()), 1e-3);
    bench.move_to(0.008, 0.002);
    near(bench.position_m(), 0.008, 30e-6);
}

/// Homes with a gap (m) that is a function of the shaft's angle (rad) and the time (s) alone; how that fails, and after what time (s).
fn failure(mut bench: Bench, gap_m: fn(f32, f32) -> f32) -> (HomingFailure, f32) {
    let constants = bench.constants;
    bench.tamper = Some(Arc::new(move |inputs| {
        let shaft_rad = inputs.encoder_counts as f32 / constants.counts_per_rad;
        if let Some(block) = &mut inputs.lvdt {
            block.mean_code = constants.lvdt_mean_code(gap_m(shaft_rad, 1e-6 * inputs.now_us as f32));
        }
    }));
    bench.while_in(State::Boot);
    // From another angle than that of the start.
    bench.begin(Request::Jog { twist_speed_rad_per_s: 2.0 });
    bench.run(200);
    assert_eq!(bench.ask(Request::Stop), Ok(Accepted::Done));
    bench.while_in(State::Moving);
    bench.begin(Request::HOME);
    let ticks = bench.while_in(State::Homing);
    match bench.events.last() {
        Some(EventKind::HomingRefused(failure)) => (*failure, TICK_S * ticks as f32),
        other => panic!("{other:?} {:?}", bench.rig.fault()),
    }
}

#[test]
fn the_load_is_weighed_over_six_turns_at_one_speed() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.while_in(State::Boot);
    bench.begin(Request::HOME);
    let mut twists_rad = vec![bench.twist_rad];
    while bench.rig.state() == State::Homing && twists_rad.len() < 5000 {
        bench.tick(None);
        twists_rad.push(bench.twist_rad);
    }
    // From where it is at rest at the half-turn pre-twist before the sweeps.
    let top = twists_rad.iter().copied().fold(0.0, f32::max);
    near(top, 13.0 * PI, 0.02);
    let up = twists_rad.iter().position(|twist_rad| *twist_rad >= top - 1e-3).expect("it is there");
    let below = twists_rad[..up].iter().rposition(|twist_rad| *twist_rad < PI + 0.02).expect("it starts there");
    assert!(twists_rad[below - 45..].iter().all(|twist_rad| *twist_rad > PI - 0.03), "rests before, and goes no lower");
    let speed_at = |ticks: &[f32], fraction: f32| {
        let place = PI + 12.0 * PI * fraction;
        let pair = ticks.windows(2).find(|pair| (pair[0] - place) * (pair[1] - place) <= 0.0).expect("on its way");
        (pair[1] - pair[0]) / TICK_S
    };
    for (way, sign) in [(&twists_rad[below..=up], 1.0), (&twists_rad[up..], -1.0)] {
        for fraction in [0.1, 0.5, 0.9] {
            near(sign * speed_at(way, fraction), SPEED, 0.1);
        }
    }
}

#[test]
fn a_gap_that_is_no_mechanisms_is_refused_after_as_much_probing_and_searching_as_there_is_to_it() {
    // Quiet for 0.4 s, then 18 rad.
    let probe_s = 0.4 + 18.0 / SPEED;
    type Gap = fn(f32, f32) -> f32;
    let cases: [(Gap, HomingFailure, f32, f32); 6] = [
        (|_, _| 0.09, HomingFailure::NoPretwist, probe_s, 0.4),
        // A tenth of what decides is enough at the probe's end; then 18 rad without a rise are too many.
        (|shaft_rad, _| 0.09 + 1.2e-6 * shaft_rad, HomingFailure::NoPretwist, probe_s, 0.4),
        (|shaft_rad, _| 0.09 + 1.8e-6 * shaft_rad, HomingFailure::NoPretwist, probe_s + 18.0 / SPEED, 0.8),
        // No maximum: 3.1 rad of the probe, and 0.98 of 93.4 rad.
        (|shaft_rad, _| 0.08 + 1e-4 * shaft_rad, HomingFailure::TravelEnd, 0.4 + (3.1 + 0.98 * 93.4) / SPEED, 0.4),
        // A gap that falls whichever way the strings turn is never quiet: 10 s of patience, and 0.3 s until the probe has seen
        // 0.3 mm. Then it turns round, and 18 rad or 3 mm are enough.
        (|_, seconds| 0.09 - 1e-3 * seconds, HomingFailure::NoPretwist, 10.0 + 0.3 + 18.0 / SPEED, 0.6),
        (|_, seconds| 0.09 - 2e-3 * seconds, HomingFailure::NoPretwist, 10.0 + 0.15 + 0.2 + 1.5, 0.2),
    ];
    for (gap_m, refused, seconds, error_s) in cases {
        let found = failure(Bench::new(5.0, 0.0, 9.0), gap_m);
        assert_eq!(found.0, refused);
        near(found.1, seconds, error_s);
    }
}

/// Lets the LVDT show a gap (m) that depends on the true one (m) and the time (s).
fn show(bench: &mut Bench, gap_m: fn(f32, f32) -> f32) {
    let constants = bench.constants;
    bench.tamper = Some(Arc::new(move |inputs| {
        if let Some(block) = &mut inputs.lvdt {
            let true_m = constants.lvdt_gap_m(block.mean_code);
            block.mean_code = constants.lvdt_mean_code(gap_m(true_m, 1e-6 * inputs.now_us as f32));
        }
    }));
}

#[test]
fn a_gap_that_goes_up_and_down_with_the_time_is_waited_for_and_then_probed() {
    let mut bench = Bench::new(5.0, 0.0, 9.0);
    // 1 mm at 1 Hz is never quiet.
    show(&mut bench, |_, seconds| 0.09 + 1e-3 * (TAU * seconds).sin());
    bench.start();
    bench.begin(Request::HOME);
    let still = bench.twist_rad;
    bench.run(995);
    assert_eq!(bench.twist_rad, still);
    bench.run(15);
    assert!(bench.twist_rad > still);
}

#[test]
fn a_rig_that_shakes_is_waited_for_once_and_homed() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    show(&mut bench, |gap_m, seconds| gap_m + 0.15e-3 * (25.0 * seconds).sin());
    bench.start();
    let from_us = bench.now_us;
    let found = bench.home();
    let seconds = 1e-6 * (bench.now_us - from_us) as f32;
    assert!((28.0..36.0).contains(&seconds), "{seconds} s");
    near(found.gap_noise_m, 0.15e-3 / 2f32.sqrt(), 0.02e-3);
    near(found.load_n, 5.0, 0.3);
}

#[test]
fn strings_that_are_closed_are_turned_back_at_once() {
    let mut bench = Bench::new(3.0, 0.01, 9.0);
    bench.start();
    (bench.friction_n, bench.closed_at_rad) = (100.0, 9.1);
    bench.begin(Request::HOME);
    // Quiet for 0.4 s, then 0.6 rad; then back.
    bench.run(100);
    assert!(bench.twist_rad < 9.1, "{}", bench.twist_rad);
    bench.run(100);
    assert!(bench.twist_rad < 8.0, "{}", bench.twist_rad);
    assert_eq!(bench.rig.state(), State::Homing, "{:?}", bench.rig.fault());
}

/// Ticks that a homing of this bench takes if nothing disturbs it.
fn undisturbed_ticks(mut bench: Bench) -> u32 {
    bench.begin(Request::HOME);
    bench.while_in(State::Homing)
}

#[test]
fn a_string_that_slips_after_the_sweeps_is_noticed() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.start();
    // The gap becomes greater by a millimetre, slowly, within the last second.
    let ticks = undisturbed_ticks(bench.clone());
    bench.begin(Request::HOME);
    bench.run(ticks - 100);
    for _ in 0..100 {
        bench.offset_m += 1e-5;
        bench.tick(None);
    }
    bench.while_in(State::Homing);
    assert_eq!(bench.events, [EventKind::HomingRefused(HomingFailure::Shifted)]);
}

#[test]
fn a_weight_that_changes_while_the_reference_is_taken_does_not_spoil_it() {
    let mut bench = Bench::new(5.0, 0.01, 9.0);
    bench.start();
    let ticks = undisturbed_ticks(bench.clone());
    // Changes that move the gap by less than what counts as a string that has slipped.
    for (lighter_n, before_the_end) in [(0.5f32, 90), (0.5, 60), (-0.5, 40), (0.5, 20), (-0.5, 5)] {
        let mut bench = bench.clone();
        bench.begin(Request::HOME);
        bench.run(ticks - before_the_end);
        bench.load_n -= lighter_n;
        bench.while_in(State::Homing);
        let found = bench.rig.homed().unwrap_or_else(|| panic!("{lighter_n} N: {:?}", bench.events)).found;
        near(found.reference_gap_m, bench.gap_m, 2e-6);
        near(found.gap_noise_m, bench.noise_m, 0.2 * bench.noise_m);
    }
}

#[test]
fn rods_remember_what_the_setting_says_until_a_heavier_load_has_hung_or_new_ones_are_fitted() {
    let homed = |bench: &mut Bench| {
        bench.home();
        bench.run(60);
        bench.rig.homed().expect("homed").found.load_n
    };
    let mut bench = Bench::new(5.0, 0.0, 9.0);
    bench.noise_m = 0.0;
    let fresh_n = homed(&mut bench);
    let set = |value| Request::SetSetting { setting: Setting::HeaviestLoad, value };
    assert_eq!(bench.ask(set(10.0)), Ok(Accepted::Unhomed));
    bench.run(30);
    let after_n = homed(&mut bench);
    let memory = RodMemory { light: table().metadata.uncertainty.rod_memory, heaviest_n: 10.0 };
    near(memory.apparent_n(after_n), fresh_n, 0.01);
    // A board that starts with it.
    let kept = *bench.rig.settings();
    let mut started = Bench::new(5.0, 0.0, 9.0);
    started.noise_m = 0.0;
    started.rig.set_up(&kept);
    near(homed(&mut started), after_n, 0.01);
    assert_eq!(bench.ask(set(0.0)), Ok(Accepted::Unhomed));
    bench.run(30);
    near(homed(&mut bench), fresh_n, 0.01);
    // Less than has hung since power-up changes nothing.
    assert_eq!(bench.ask(set(1.0)), Ok(Accepted::Unhomed));
    bench.run(30);
    near(homed(&mut bench), fresh_n, 0.01);
}

/// The strings of this rig hang on rods without hysteresis, so that a load seems as heavy after a heavier one as before.
#[test]
fn a_load_that_is_homed_after_a_heavier_one_is_reported_lighter_and_less_certain_unless_it_is_given() {
    let found = |before_n: f32, load| {
        let mut bench = Bench::new(before_n, 0.0, 9.0);
        bench.noise_m = 0.0;
        bench.home();
        bench.run(60);
        bench.load_n = 5.0;
        bench.run(500);
        bench.begin(Request::Home { load });
        bench.while_in(State::Homing);
        bench.rig.homed().unwrap_or_else(|| panic!("{before_n} N: {:?}", bench.events)).found
    };
    let [fresh, after] = [5.0, 10.0].map(|before_n| found(before_n, LoadChoice::Auto));
    let memory = RodMemory { light: table().metadata.uncertainty.rod_memory, heaviest_n: 10.0 };
    near(memory.apparent_n(after.load_n), fresh.load_n, 0.01);
    let [fresh_share, after_share] = [fresh, after].map(|found| found.load_error_n / found.load_n);
    near(after_share, fresh_share.hypot(NINETY_PERCENT * MEMORY_ERROR * memory.excess(after.load_n)), 0.01);
    let [fresh, after] = [5.0, 10.0].map(|before_n| found(before_n, LoadChoice::Known(5.0)));
    near(after.load_n, fresh.load_n, 0.01);
    assert!((after.load_error_n / fresh.load_error_n - 1.0).abs() < 0.2, "{after:?} {fresh:?}");
}

#[test]
fn a_sensor_without_a_stated_error_is_no_obstacle() {
    let places = [[0.05, 0.0], [0.06, 0.0], [0.1, 0.0]];
    let curve = LvdtCurve::new(&places, 0.0).expect("a curve");
    for constants in
        [RigConstants { lvdt_linearity_m: 0.0, ..constants() }, RigConstants { lvdt_curve: Some(curve), ..constants() }]
    {
        near(Bench::of(constants, 5.0, 0.01, 9.0).home().load_n, 5.0, 0.1);
    }
}
