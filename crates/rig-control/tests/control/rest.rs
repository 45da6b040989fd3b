//! A load at its target: when it stands, what stiction leaves, and how its jumps are learned
//! (docs/explanation/control.md 4).

use crate::fixture::{HOMED, hanging};
use rig_control::homing::NINETY_PERCENT;
use rig_control::load_state::LoadState;
use rig_control::rest::{Rest, Standing};
use rig_link::messages::HomingResult;

/// Neither noise nor jumps at homing.
const SILENT: HomingResult = HomingResult { gap_noise_m: 0.0, ..HOMED };

/// 10 N with 2 N of friction: a jump as long as friction over stiffness is some millimetres.
fn load() -> LoadState<'static> {
    hanging(10.0, 2.0, 25.0)
}

/// The load at an error (m) for the given number of ticks; what it is in the last one.
fn at(rest: &mut Rest, error_m: f32, ticks: u32, load: &LoadState<'_>) -> Standing {
    (0..ticks).fold(Standing::Moves, |_, _| rest.step(true, error_m, load))
}

/// It stands at one error (m) and then, without its strings having turned, at another.
fn jumps(rest: &mut Rest, errors_m: &[f32], load: &LoadState<'_>) -> Standing {
    errors_m.iter().fold(Standing::Moves, |_, error_m| at(rest, *error_m, 40, load))
}

#[test]
fn a_load_stands_once_it_has_not_left_its_place() {
    let mut load = load();
    let mut rest = Rest::default();
    // Its observer takes it for one that moves with its strings, but it stays where it is.
    load.motion.speed_m_per_s = 0.01;
    assert_eq!(at(&mut rest, 1e-3, 7, &load), Standing::Moves);
    assert_eq!(at(&mut rest, 1e-3, 1, &load), Standing::Beside(1e-3));
    // One that has left its place begins again, and so does one whose set-point moves.
    assert_eq!(at(&mut rest, 0.9e-3, 2, &load), Standing::Moves);
    at(&mut rest, 0.9e-3, 20, &load);
    assert_eq!(rest.step(false, 0.9e-3, &load), Standing::Moves);
    assert_eq!(at(&mut rest, 0.9e-3, 7, &load), Standing::Moves);
}

#[test]
fn noise_of_the_gap_widens_what_is_left_alone() {
    let load = load();
    for noise_m in [5e-6, 20e-6] {
        let found = HomingResult { gap_noise_m: noise_m, ..*load.found };
        let load = LoadState { found: &found, ..load };
        let least_m = NINETY_PERCENT * noise_m;
        assert_eq!(at(&mut Rest::default(), 0.98 * least_m, 20, &load), Standing::LeftAlone);
        assert!(matches!(at(&mut Rest::default(), 1.02 * least_m, 20, &load), Standing::Beside(_)));
    }
}

#[test]
fn half_of_a_jump_that_homing_saw_is_left_alone() {
    let found = HomingResult { jump_m: 0.4e-3, ..*load().found };
    let load = LoadState { found: &found, ..load() };
    assert_eq!(at(&mut Rest::default(), 0.19e-3, 20, &load), Standing::LeftAlone);
    assert!(matches!(at(&mut Rest::default(), 0.21e-3, 20, &load), Standing::Beside(_)));
    assert_eq!(at(&mut Rest::default(), -0.19e-3, 20, &load), Standing::LeftAlone);
}

#[test]
fn what_is_left_alone_is_taken_care_of_when_it_has_crept_away() {
    let found = HomingResult { jump_m: 0.4e-3, ..*load().found };
    let load = LoadState { found: &found, ..load() };
    let mut rest = Rest::default();
    assert_eq!(at(&mut rest, 0.18e-3, 40, &load), Standing::LeftAlone);
    // Slower than what counts as motion.
    let creep = |rest: &mut Rest, to_m: f32| {
        (0..400u16)
            .fold(Standing::Moves, |_, k| rest.step(true, 0.18e-3 + (to_m - 0.18e-3) * f32::from(k) / 399.0, &load))
    };
    assert_eq!(creep(&mut rest, 0.19e-3), Standing::LeftAlone);
    assert!(matches!(creep(&mut rest, 0.23e-3), Standing::Beside(_) | Standing::Moves));
}

#[test]
fn a_way_past_the_target_is_a_jump_whatever_the_strings_have_turned_and_a_way_short_of_it_is_none() {
    for turned_m in [0.0, 0.4e-3] {
        let mut load = load();
        let mut rest = Rest::default();
        jumps(&mut rest, &[0.3e-3, 0.2e-3], &load);
        assert_eq!(rest.left_alone_m(&SILENT), 0.0);
        load.twist_rad += turned_m * load.observation.point.tr_rad_per_m();
        at(&mut rest, -0.1e-3, 40, &load);
        assert!((rest.left_alone_m(&SILENT) / (0.5 * 0.3e-3) - 1.0).abs() < 1e-3, "{}", rest.left_alone_m(&SILENT));
    }
}

#[test]
fn a_load_that_jumps_past_its_target_ends_on_the_nearer_side() {
    let load = load();
    assert_eq!(jumps(&mut Rest::default(), &[0.2e-3, -0.1e-3], &load), Standing::LeftAlone);
    assert!(matches!(jumps(&mut Rest::default(), &[0.1e-3, -0.2e-3], &load), Standing::Beside(_)));
    assert_eq!(jumps(&mut Rest::default(), &[0.1e-3, -0.2e-3, 0.1e-3], &load), Standing::LeftAlone);
}

#[test]
fn a_load_that_moves_within_what_is_left_alone_stays_left_alone() {
    let found = HomingResult { jump_m: 0.4e-3, ..*load().found };
    let load = LoadState { found: &found, ..load() };
    let mut rest = Rest::default();
    assert_eq!(at(&mut rest, 0.19e-3, 40, &load), Standing::LeftAlone);
    assert_eq!(at(&mut rest, -0.19e-3, 1, &load), Standing::LeftAlone);
    assert_eq!(at(&mut rest, -0.19e-3, 40, &load), Standing::LeftAlone);
    // Two readings outside are motion, at once.
    at(&mut rest, -0.5e-3, 2, &load);
    assert_eq!(at(&mut rest, -0.5e-3, 1, &load), Standing::Moves);
}

#[test]
fn a_load_that_has_been_brought_to_its_target_between_its_ways_does_not_go_back_and_forth() {
    let mut load = load();
    let mut rest = Rest::default();
    for error_m in [0.1e-3, -0.1e-3, 0.1e-3, -0.1e-3, 0.1e-3, -0.1e-3, 0.1e-3, -0.1e-3f32] {
        // The strings turn for every way, to the target and away from it.
        load.twist_rad -= 2.0 * error_m * load.observation.point.tr_rad_per_m();
        at(&mut rest, error_m, 40, &load);
        load.twist_rad += 2.0 * error_m * load.observation.point.tr_rad_per_m();
        at(&mut rest, 0.0, 40, &load);
    }
    assert!(rest.left_alone_m(&SILENT) < NINETY_PERCENT * load.found.gap_noise_m, "{}", rest.left_alone_m(&SILENT));
}

#[test]
fn a_way_to_another_target_is_no_jump_and_another_target_has_jumps_of_its_own() {
    let load = load();
    let mut rest = Rest::default();
    for errors_m in [[0.3e-3, -0.1e-3], [-0.2e-3, 0.1e-3]] {
        jumps(&mut rest, &errors_m, &load);
        assert!(rest.left_alone_m(&SILENT) > 0.1e-3);
        rest.step(false, 0.0, &load);
        assert_eq!(rest.left_alone_m(&SILENT), 0.0);
    }
}

#[test]
fn a_way_that_friction_does_not_explain_is_no_jump() {
    // Another load: with 0.01 N of friction nothing jumps by half a millimetre.
    let load = hanging(10.0, 0.01, 25.0);
    let mut rest = Rest::default();
    jumps(&mut rest, &[0.5e-3, -0.1e-3], &load);
    assert_eq!(rest.left_alone_m(&SILENT), 0.0);
}
