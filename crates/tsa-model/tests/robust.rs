//! 100 000 random scenes and states, far beyond any rig: solved, or refused by a name.

use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};
use rig_config::Scene;
use std::cell::Cell;
use tsa_model::helix::State;
use tsa_model::{Equilibrium, Geometry, Mechanism, RadiusLaw, SolveError, StringParameters};

/// Scenes, and states of each.
const CASES: u32 = 100_000;
/// Of these, every so many are also followed from the unloaded state in other steps.
const FOLLOWED: u32 = 5;

/// Random but reproducible: a test that fails by chance proves nothing.
fn runner(cases: u32, seed: u8) -> TestRunner {
    let config = ProptestConfig { cases, failure_persistence: None, ..Default::default() };
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]))
}

fn scenes() -> impl Strategy<Value = (Scene, f64, f64)> {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let base = Scene::load(root.join("scenes/default.toml")).unwrap();
    let law = prop_oneof![
        (0.0..1.0f64).prop_map(|p| (RadiusLaw::TwistPower, Some(p), 0.0)),
        Just((RadiusLaw::LengthRatio, None, 0.0)),
        (0.0..0.3f64).prop_map(|k4| (RadiusLaw::LengthRatio, None, k4)),
    ];
    // a_i over a1: straight, odd and plateau-like, anything, and the paper's.
    let curve = prop_oneof![
        Just([1.0, 0.0, 0.0, 0.0, 0.0]),
        (0.0..800.0f64, 0.0..1e5f64).prop_map(|(a3, a5)| [1.0, 0.0, -a3, 0.0, a5]),
        (-10.0..10.0f64, -300.0..300.0f64, -3e3..3e3f64, -1e4..1e5f64)
            .prop_map(|(a2, a3, a4, a5)| [1.0, a2, a3, a4, a5]),
        Just([1.0; 5]),
    ];
    (
        (0.02..0.5f64, 0.05..0.95f64, 0.0..1.0f64, 0.0001..0.003f64),
        (0.0002..0.004f64, 1.0..5.0f64, 0.5..20.0f64, 0.0..0.6f64, 0.0..0.4f64, law),
        (9.0..11.5f64, curve, 0.05..60.0f64, -90.0..90.0f64),
    )
        .prop_map(move |((l0, span, clamp, radius), (d, k, k1, k2, k3, law), (modulus, curve, load, twist))| {
            let mut s = base.clone();
            s.geometry = Geometry {
                string_length_m: l0,
                rod_span_m: span * l0,
                clamp_width_m: clamp * span * l0,
                rod_radius_m: radius,
            };
            s.string = StringParameters {
                diameter_m: d,
                stiffness_n_per_m: 10f64.powf(k),
                k1_per_n: k1,
                k2,
                k3,
                k4: law.2,
                radius_law: law.0,
                twist_exponent: law.1,
            };
            s.material.stress_coefficients_pa = curve.map(|a| a * 10f64.powf(modulus));
            (s, load, twist)
        })
}

/// Whether continuation in other steps reaches the same equilibrium; `None` if it ends before the state.
fn followed(m: &Mechanism, e: &Equilibrium) -> Option<bool> {
    let other = m.possible(m.continued(&State::new(e.load_n, e.twist_rad).ok()?, 8).ok()?).ok()?;
    Some((other.gap_m - e.gap_m).abs() < 1e-9 && (other.alpha_rad - e.alpha_rad).abs() < 1e-7)
}

/// How many of so many cases were solved, and how many of those that were followed stopped short.
fn solved_or_named(cases: u32, seed: u8) -> [u32; 2] {
    let (case, solved, short) = (Cell::new(0u32), Cell::new(0u32), Cell::new(0u32));
    runner(cases, seed)
        .run(&scenes(), |(s, load, twist)| {
            case.set(case.get() + 1);
            let m = s.mechanism().unwrap();
            match m.solve(load, twist) {
                Ok(e) => {
                    solved.set(solved.get() + 1);
                    prop_assert!(e.residual <= 1e-12);
                    let all = [e.gap_m, e.x_m, e.d_m, e.dgap_dtwist_m_per_rad, e.dgap_dload_m_per_n, e.torque_nm];
                    prop_assert!(all.iter().all(|x| x.is_finite()) && e.x_m > 0.0);
                    if case.get().is_multiple_of(FOLLOWED) {
                        match followed(&m, &e) {
                            Some(same) => prop_assert!(same, "another branch"),
                            None => short.set(short.get() + 1),
                        }
                    }
                }
                Err(e) => prop_assert!(!matches!(e, SolveError::NotConverged { .. }), "{e}"),
            }
            Ok(())
        })
        .unwrap();
    [solved.get(), short.get()]
}

#[test]
fn every_random_scene_is_solved_or_named() {
    let [a, b] = std::thread::scope(|scope| {
        [1, 2].map(|seed| scope.spawn(move || solved_or_named(CASES / 2, seed))).map(|half| half.join().unwrap())
    });
    let [solved, short] = [a[0] + b[0], a[1] + b[1]];
    println!("{solved} of {CASES} solved; of every {FOLLOWED}th, {short} could not be followed in other steps");
    assert!(solved > CASES / 2);
    // Some laws are almost flat somewhere: there the length of a step decides whether Newton's method converges.
    assert!(short <= solved / FOLLOWED / 1000, "{short}");
}
