//! The load observer, tick by tick, on the default scene's mechanism.

use crate::fixture::{HOMED, hanging, near, table};
use rig_control::TICK_S;
use rig_control::adaptation::Adaptation;
use rig_control::load_motion::{LoadMotion, Measured};
use rig_control::mechanism::Mechanism;
use rig_control::observer::{LoadObserver, Observation};
use rig_link::messages::{GapCurve, HomingResult, LoadChoice};
use tsa_table::Uncertainty;

const TWIST_RAD: f32 = 25.0;
const LOAD_N: f32 = 5.0;
const FRICTION_N: f32 = 0.1;

fn mechanism() -> Mechanism<'static> {
    Mechanism { table: *table(), twist_scale: 1.0, curve: GapCurve::constant(0.0) }
}

/// Homed with 5 N on a rail with 0.1 N of friction, after a way down.
fn observer() -> LoadObserver {
    let homed = HomingResult { load_n: LOAD_N, friction_n: FRICTION_N, ..HOMED };
    let known = Uncertainty { twist_scale: 0.01, gap_zero_m: 1e-4, load_shape: 0.03, rod_memory: 1e-6 };
    LoadObserver::new(&homed, &known, 0.0)
}

/// A gap that is measured a tick after the one before.
fn measured(gap_m: f32) -> Measured {
    Measured { gap_m, step_s: TICK_S }
}

fn gap_m(pull_n: f32) -> f32 {
    mechanism().at(pull_n, TWIST_RAD).gap_m
}

/// The given number of ticks with strings that pull so much (N); the last observation.
fn pulls(observer: &mut LoadObserver, pull_n: f32, ticks: u32) -> Observation {
    let step = |_| observer.step(&mechanism(), TWIST_RAD, Some(&measured(gap_m(pull_n))));
    (0..ticks).map(step).last().expect("a tick")
}

#[test]
fn a_pull_anywhere_in_the_friction_band_says_nothing_of_a_load_at_rest() {
    for pull_n in [LOAD_N - FRICTION_N, LOAD_N, LOAD_N + FRICTION_N] {
        let mut observer = observer();
        let seen = pulls(&mut observer, pull_n, 200);
        near(seen.mechanism_load_n, LOAD_N, 0.02);
        near(seen.pull_n, pull_n, 0.005);
        assert!(!seen.changing && seen.confirmed && !seen.at_range_end && seen.moved_m == 0.0);
        // How the radius depends on the load, and a little for what drifts and for friction.
        near(seen.load_error_n, 0.25, 0.05);
    }
}

/// Of the friction under the homed load a part grows with the load (0.4 N and 3 %, as on a hard plant).
#[test]
fn a_light_load_that_moves_is_not_taken_for_one_with_all_the_friction_of_the_heavy_one_before() {
    let friction_n = |load_n: f32| 0.4 + 0.03 * load_n;
    let homed = HomingResult { load_n: 12.0, friction_n: friction_n(12.0), ..HOMED };
    let known = Uncertainty { twist_scale: 0.01, gap_zero_m: 1e-4, load_shape: 0.03, rod_memory: 1e-6 };
    let mut observer = LoadObserver::new(&homed, &known, 0.0);
    pulls(&mut observer, homed.load_n - homed.friction_n, 50);
    // It springs up, and is brought down by strings that untwist.
    let (load_n, friction_n) = (1.5, friction_n(1.5));
    pulls(&mut observer, load_n + friction_n, 100);
    let mut at = |twist_rad: f32| {
        let gap_m = mechanism().at(load_n - friction_n, twist_rad).gap_m;
        observer.step(&mechanism(), twist_rad, Some(&measured(gap_m)))
    };
    let seen = (0..=200u8).map(|k| at(TWIST_RAD - 0.05 * f32::from(k))).last().expect("a tick");
    near(seen.mechanism_load_n, load_n, 0.1);
    near(seen.friction_n, friction_n, 0.1);
}

#[test]
fn a_pull_beyond_the_band_is_another_load_that_is_followed_in_the_time_constant() {
    for (load_n, end_n) in [(7.0f32, 7.0 - FRICTION_N), (3.5, 3.5 + FRICTION_N)] {
        let mut observer = observer();
        pulls(&mut observer, LOAD_N - FRICTION_N, 50);
        // The load sinks or rises at once; then nothing moves.
        let first = pulls(&mut observer, end_n, 1);
        assert!(first.changing && first.moved_m > 0.0);
        near(first.moved_m, (gap_m(end_n) - gap_m(LOAD_N - FRICTION_N)).abs(), 31e-6);
        // Once the motion is known, the error that is stated holds the load, and what is left falls by e in 0.15 s.
        let mut left_n = 2.0;
        for k in 1..=40u8 {
            let seen = pulls(&mut observer, end_n, 1);
            left_n = (seen.mechanism_load_n - load_n).abs();
            assert!(k < 10 || seen.load_error_n > left_n, "tick {k}: {} for {left_n}", seen.load_error_n);
        }
        assert!(left_n < 0.25 * (load_n - LOAD_N).abs(), "{left_n}");
        let seen = pulls(&mut observer, end_n, 170);
        // What is left is no more than noise and a fraction of the load may make.
        near(seen.mechanism_load_n, load_n, 0.3);
        assert!(!seen.changing && !seen.confirmed, "settled, but not what homing found");
    }
}

/// 8 N in the place of 5 N, let go of at once: they fall past their place and swing. The pulls here have no friction in them.
#[test]
fn rods_remember_half_of_what_a_load_pulls_beyond_its_weight_while_it_swings() {
    let mut observer = observer();
    let seen = pulls(&mut observer, LOAD_N - FRICTION_N, 200);
    near(observer.memory.heaviest_n, seen.mechanism_load_n, 0.02);
    let mut most_n = 0.0f32;
    for k in 0..100u8 {
        let seconds = f32::from(k) * TICK_S;
        let pull_n = 8.0 - 3.0 * (15.0 * seconds).cos() * (-2.0 * seconds).exp();
        most_n = most_n.max(pull_n);
        pulls(&mut observer, pull_n, 1);
    }
    let load_n = pulls(&mut observer, 8.0, 200).mechanism_load_n;
    assert!(most_n > load_n + 1.5);
    near(observer.memory.heaviest_n, load_n + 0.5 * (most_n - load_n), 0.15);
    // A sensor that shifted shows the same at first. Nothing is remembered before the load stands.
    let mut observer = self::observer();
    pulls(&mut observer, LOAD_N - FRICTION_N, 200);
    pulls(&mut observer, 12.0, 20);
    near(observer.memory.heaviest_n, LOAD_N, 0.05);
}

/// Beyond the band by the motion that is noise (20 um of the gap) and a hundredth of the load.
#[test]
fn a_pull_beyond_the_band_by_no_more_than_noise_is_no_other_load() {
    let slack_n = 20e-6 / mechanism().at(LOAD_N, TWIST_RAD).dgap_dload_m_per_n + 0.01 * LOAD_N;
    assert!(0.01 * LOAD_N < 0.9 * slack_n, "both count");
    for (fraction, changing) in [(0.95, false), (1.5, true)] {
        let mut observer = observer();
        pulls(&mut observer, LOAD_N - FRICTION_N, 50);
        assert_eq!(pulls(&mut observer, LOAD_N - FRICTION_N - fraction * slack_n, 40).changing, changing, "{fraction}");
    }
}

#[test]
fn moves_up_and_down_find_the_load_in_the_middle_of_the_band_and_confirm_it() {
    let mut observer = observer();
    let load_n = 4.0;
    // Up and down by 6 rad in a second each; the strings pull the load and friction, or less friction.
    let sweep = |observer: &mut LoadObserver, up: bool| {
        let seen = (0..=100u8).map(|k| {
            let fraction = f32::from(k) / 100.0;
            let twist_rad = 20.0 + 6.0 * if up { fraction } else { 1.0 - fraction };
            let pull_n = if up { load_n + FRICTION_N } else { load_n - FRICTION_N };
            observer.step(&mechanism(), twist_rad, Some(&measured(mechanism().at(pull_n, twist_rad).gap_m)))
        });
        seen.last().expect("a tick")
    };
    for up in [true, false, true] {
        sweep(&mut observer, up);
    }
    near(observer.load_n(), load_n, 0.02);
    assert!(!sweep(&mut observer, false).confirmed);
    observer.end_move(true);
    assert!(!sweep(&mut observer, true).confirmed, "one way is not enough");
    observer.end_move(true);
    assert!(sweep(&mut observer, false).confirmed);
    // A move along which the load was not the same takes its way back, and a load outside the table's twists is not known.
    observer.lose();
    let lost = sweep(&mut observer, true);
    assert!(!lost.confirmed);
    observer.end_move(true);
    sweep(&mut observer, false);
    observer.end_move(false);
    assert!(!sweep(&mut observer, true).confirmed);
    // The way up pulls more: friction is on the other side.
    near(lost.pull_n, load_n + FRICTION_N, 0.01);
    near(lost.point.gap_m, mechanism().at(load_n + FRICTION_N, 26.0).gap_m, 1e-5);
}

/// A rail whose friction has grown since homing, and a weight that was changed at rest by less than friction hides: the estimate
/// comes to what hangs along the move.
#[test]
fn a_short_move_does_not_take_the_lag_of_the_estimate_for_a_drift() {
    for (load_n, friction_n) in [(LOAD_N, 1.6 * FRICTION_N), (LOAD_N - FRICTION_N, FRICTION_N)] {
        let (mut observer, mut adaptation, mut scale) = (observer(), Adaptation::new(1.0), 1.0);
        pulls(&mut observer, LOAD_N - FRICTION_N, 50);
        // Up by 6 rad in two seconds.
        for k in 0..=200u8 {
            let twist_rad = TWIST_RAD + 3.0 * (1.0 - (core::f32::consts::PI * f32::from(k) / 200.0).cos());
            let gap_m = mechanism().at(load_n + friction_n, twist_rad).gap_m;
            let seen = observer.step(&mechanism(), twist_rad, Some(&measured(gap_m)));
            assert!(!seen.changing, "{k}");
            adaptation.step(&mut scale, &mut observer, &seen, twist_rad, k == 200);
        }
        near(scale, 1.0, 1e-4);
        near(observer.apparent_n, load_n + friction_n - FRICTION_N, 0.01);
    }
}

#[test]
fn the_pull_does_not_jump_when_the_load_turns_round() {
    let mut observer = observer();
    let before = pulls(&mut observer, LOAD_N - FRICTION_N, 50);
    let turned = observer.step(&mechanism(), TWIST_RAD, Some(&measured(gap_m(LOAD_N - FRICTION_N) - 30e-6)));
    assert!(turned.moved_m > 0.0);
    near(turned.pull_n, before.pull_n, 0.05);
    let after = observer.step(&mechanism(), TWIST_RAD, Some(&measured(gap_m(LOAD_N - FRICTION_N) - 30e-6)));
    near(after.point.gap_m, gap_m(after.mechanism_load_n + FRICTION_N), 1e-6);
}

#[test]
fn a_load_that_has_moved_is_at_an_end_of_the_friction_band() {
    let mut observer = observer();
    observer.lose();
    let rest_n = pulls(&mut observer, LOAD_N - FRICTION_N, 2).load_error_n;
    // Down by 2 rad in 0.5 s, which is more than a third of a millimetre.
    let mut moved_n = 0.0;
    for k in 1..=50u8 {
        let twist_rad = TWIST_RAD - 0.04 * f32::from(k);
        let gap_m = mechanism().at(LOAD_N - FRICTION_N, twist_rad).gap_m;
        moved_n = observer.step(&mechanism(), twist_rad, Some(&measured(gap_m))).load_error_n;
    }
    // A load that may be anywhere within the band: 1/√3 of the friction.
    let expected_n2 = (1.645 * FRICTION_N).powi(2) / 3.0;
    near(rest_n * rest_n - moved_n * moved_n, expected_n2, 0.1 * expected_n2);
}

#[test]
fn without_a_gap_the_estimate_stays_and_a_given_load_is_used_as_it_is() {
    let mut observer = observer();
    pulls(&mut observer, LOAD_N - FRICTION_N, 50);
    let before_n = observer.load_n();
    let blind = observer.step(&mechanism(), TWIST_RAD, None);
    assert_eq!((blind.mechanism_load_n, blind.moved_m), (before_n, 0.0));
    observer.source = LoadChoice::Known(6.0);
    let given = observer.step(&mechanism(), TWIST_RAD, None);
    assert_eq!(given.mechanism_load_n, 6.0);
    assert_eq!(given.point, mechanism().at(6.0 - FRICTION_N, TWIST_RAD));
    observer.source = LoadChoice::Known(1e3);
    assert_eq!(observer.step(&mechanism(), TWIST_RAD, None).mechanism_load_n, table().metadata.load_max_n);
}

#[test]
fn the_ends_of_the_table_are_told_at_once_where_it_is_heavy_and_beyond_the_error_where_it_is_light() {
    let m = &table().metadata;
    let beyond = |pull_n: f32| {
        let inside_n = pull_n.clamp(m.load_min_n, m.load_max_n);
        let point = mechanism().at(inside_n, TWIST_RAD);
        point.gap_m + (pull_n - inside_n) * point.dgap_dload_m_per_n
    };
    let ends = |pull_n: f32| {
        let mut observer = observer();
        (0..400)
            .fold(false, |_, _| observer.step(&mechanism(), TWIST_RAD, Some(&measured(beyond(pull_n)))).at_range_end)
    };
    assert!(ends(m.load_max_n + 1.0) && !ends(m.load_max_n - 0.5));
    assert!(ends(0.2 * m.load_min_n) && !ends(m.load_min_n + 0.1));
}

#[test]
fn another_load_may_look_like_a_drift_by_its_fraction_of_the_homed_one() {
    for change_n in [0.0f32, 2.0, -2.0] {
        let mut observer = observer();
        let seen = pulls(&mut observer, LOAD_N + change_n, 200);
        assert!((seen.mechanism_load_n - LOAD_N).abs() >= 0.9 * change_n.abs(), "{seen:?}");
        near(observer.known_errors().change, 0.03 * (seen.mechanism_load_n - LOAD_N).abs() / LOAD_N, 1e-6);
    }
}

#[test]
fn the_error_grows_with_the_time_since_homing() {
    let mut observer = observer();
    let early = pulls(&mut observer, LOAD_N - FRICTION_N, 2).load_error_n;
    // Ten minutes.
    let late = pulls(&mut observer, LOAD_N - FRICTION_N, (600.0 / TICK_S) as u32).load_error_n;
    let later = pulls(&mut observer, LOAD_N - FRICTION_N, 1000).load_error_n;
    let drift = |fraction: f32| (1.645 * fraction * LOAD_N).powi(2);
    near(late * late - early * early, drift(0.012) - drift(0.003), 2e-4);
    near(later, late, 1e-4);
}

#[test]
fn a_measurement_that_comes_again_changes_nothing_and_one_after_a_gap_begins_anew() {
    let load = hanging(LOAD_N, 0.0, TWIST_RAD);
    let mut motion = LoadMotion::at_rest(&mechanism(), gap_m(LOAD_N), TWIST_RAD, LOAD_N);
    let before = motion;
    // ω² = k/m = g/(W ∂G/∂F)
    let expected = 9.806_65 / (LOAD_N * load.observation.point.dgap_dload_m_per_n);
    near(before.frequency_squared(), expected, 1e-3 * expected);
    motion.step(&mechanism(), TWIST_RAD, &Measured { gap_m: gap_m(LOAD_N) + 1e-3, step_s: 0.0 });
    assert_eq!(motion, before);
    motion.step(&mechanism(), TWIST_RAD, &Measured { gap_m: gap_m(LOAD_N) + 1e-3, step_s: 0.01 });
    assert!(motion.speed_m_per_s > 0.0 && motion.weight_n > LOAD_N);
    motion.step(&mechanism(), TWIST_RAD, &Measured { gap_m: gap_m(4.0), step_s: 0.056 });
    assert_eq!((motion.gap_m, motion.speed_m_per_s), (gap_m(4.0), 0.0));
    near(motion.weight_n, 4.0, 0.01);
    // After no more than 0.055 s it goes on: half a newton more is not taken for granted.
    motion.step(&mechanism(), TWIST_RAD, &Measured { gap_m: gap_m(4.5), step_s: 0.055 });
    assert!((4.0..4.3).contains(&motion.weight_n), "{}", motion.weight_n);
    // However light it seems, it has a weight: 0.3 of the table's least load.
    for _ in 0..200 {
        motion.step(&mechanism(), TWIST_RAD, &Measured { gap_m: 0.05, step_s: 0.01 });
    }
    near(motion.weight_n, 0.3 * table().metadata.load_min_n, 1e-6);
}
