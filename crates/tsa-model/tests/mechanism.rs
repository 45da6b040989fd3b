//! Derivatives, symmetry and limits of the mechanism.

use rig_config::Scene;
use tsa_model::rod::TipForce;
use tsa_model::scalar::{Dual, Scalar};
use tsa_model::{Geometry, Mechanism, PRETWIST_RAD, Parameters, SLACK_LOAD_N, SolveError, Warnings, twist_from_turns};

fn scene(name: &str) -> Scene {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    Scene::load(root.join(format!("{name}.toml"))).unwrap()
}

/// Sixth-order central difference.
fn slope(f: impl Fn(f64) -> f64, x: f64, h: f64) -> f64 {
    let d = |k: f64| f(x + k * h) - f(x - k * h);
    (45.0 * d(1.0) - 9.0 * d(2.0) + d(3.0)) / (60.0 * h)
}

#[test]
fn derivatives_agree_with_high_order_differences() {
    for name in ["default", "paper-printed", "niti-plateau", "paper-computed"] {
        let m = scene(name).mechanism().unwrap();
        for load in [0.6, 2.0, 7.5, 16.0] {
            for twist in [0.4, 1.5, 3.0, 4.0, 12.0, 30.0, 50.0] {
                let e = m.solve(load, twist).unwrap();
                let gap = |f: f64, t: f64| m.solve(f, t).unwrap().gap_m;
                let by_twist = slope(|t| gap(load, t), twist, 1e-2);
                let by_load = slope(|f| gap(f, twist), load, 1e-3 * load);
                let close = |a: f64, b: f64, scale: f64| (a - b).abs() < 1e-7 * b.abs() + 1e-10 * scale;
                assert!(
                    close(e.dgap_dtwist_m_per_rad, by_twist, 1e-2),
                    "{name} {load} {twist}: by twist {} {by_twist}",
                    e.dgap_dtwist_m_per_rad
                );
                assert!(
                    close(e.dgap_dload_m_per_n, by_load, 1e-1),
                    "{name} {load} {twist}: by load {} {by_load}",
                    e.dgap_dload_m_per_n
                );
            }
        }
    }
}

#[test]
fn the_gap_is_even_in_twist_and_greatest_at_zero_with_no_cusp() {
    for name in ["paper-identified", "default", "paper-printed", "niti-plateau"] {
        let m = scene(name).mechanism().unwrap();
        for load in [0.98, 4.9, 14.7] {
            let top = m.solve(load, 0.0).unwrap();
            assert!(top.dgap_dtwist_m_per_rad.abs() < 1e-15);
            let mut last = top.gap_m;
            for twist in [1e-3, 0.1, 0.5, 1.0, 2.0, 3.0, PRETWIST_RAD, 3.3, 4.0, 5.9, 10.0, 40.0] {
                let (up, down) = (m.solve(load, twist).unwrap(), m.solve(load, -twist).unwrap());
                assert_eq!((up.gap_m, up.alpha_rad, up.w_m), (down.gap_m, down.alpha_rad, down.w_m));
                assert_eq!(up.dgap_dtwist_m_per_rad, -down.dgap_dtwist_m_per_rad);
                assert_eq!(up.torque_nm, -down.torque_nm);
                assert_eq!(up.warnings.contains(Warnings::OPEN_STRINGS), twist < PRETWIST_RAD, "{twist}");
                assert!(up.gap_m < last, "{name} {load} N: gap rises at {twist} rad");
                last = up.gap_m;
            }
            // k4 makes the slope jump there.
            let slope = |twist: f64| m.solve(load, twist).unwrap().dgap_dtwist_m_per_rad;
            let jump = slope(PRETWIST_RAD - 1e-8) / slope(PRETWIST_RAD + 1e-8) - 1.0;
            assert!(name != "paper-identified" || jump.abs() < 1e-6, "{jump}");
        }
    }
}

#[test]
fn a_rigid_rod_and_a_stiff_string_are_the_textbook_actuator() {
    let mut s = scene("default");
    s.string.stiffness_n_per_m = 1e15;
    (s.string.k3, s.string.k4) = (0.0, 0.0);
    let rigid = Geometry { clamp_width_m: s.geometry.rod_span_m, ..s.geometry };
    let m = Mechanism::new(&rigid, &s.string, &s.material).unwrap();
    let r = (1.0 / (s.string.k1_per_n * 5.0) + s.string.k2) * s.string.diameter_m;
    for turns in [0.0, 1.0, 4.0, 7.5] {
        let twist = twist_from_turns(turns);
        let run = s.geometry.rod_span_m + twist * r;
        let length = (s.geometry.string_length_m.powi(2) - run * run).sqrt();
        let e = m.solve(5.0, twist).unwrap();
        assert!((e.gap_m - length).abs() < 1e-12);
        assert!((e.tr_rad_per_m() - length / (r * run)).abs() < 1e-6 * e.tr_rad_per_m());
        assert_eq!((e.u_m, e.w_m, e.bending_strain), (0.0, 0.0, 0.0));
    }
    // L² = X² + (D + θ r)², so that at a given twist X changes with L by L/X.
    let mut with = Parameters::<Dual<1>>::constant(m.parameters());
    with.string_length_m = Dual::parameter(s.geometry.string_length_m, 0);
    let e = Mechanism::of(with).solve(5.0, 20.0).unwrap();
    assert!((e.gap_m.by[0] - s.geometry.string_length_m / e.gap_m.value).abs() < 1e-9, "{:?}", e.gap_m);
    // A very short free rod tends to the same limit.
    let nearly = Geometry { clamp_width_m: s.geometry.rod_span_m - 1e-6, ..s.geometry };
    let near = Mechanism::new(&nearly, &s.string, &s.material).unwrap().solve(5.0, 20.0).unwrap();
    assert!((near.gap_m - m.solve(5.0, 20.0).unwrap().gap_m).abs() < 1e-9);
}

/// The terms of r/r0 against their closed forms, and r + θ ∂r/∂θ against differences that stay on one side of π.
#[test]
fn the_logarithm_of_the_twist_starts_where_the_strings_touch() {
    let scene = scene("paper-computed");
    let p = *scene.mechanism().unwrap().parameters();
    let (x, x0) = (0.08, p.start_length_m());
    let arc = |twist: f64| twist * p.radius(5.0, twist, x, x0).radius_m;
    let without = p.diameter_m * (1.0 / (p.k1_per_n * 5.0) + p.k2 + p.k3 * (x0 / x).sqrt());
    for twist in [0.0, 0.5, 3.0, PRETWIST_RAD - 1e-9, PRETWIST_RAD] {
        assert!((p.radius(5.0, twist, x, x0).radius_m - without).abs() < 1e-18, "{twist}");
    }
    for turns in [0.1, 1.0, 7.5] {
        let twist = twist_from_turns(turns);
        let expected = without + p.k4 * p.diameter_m * (2.0 * turns).ln_1p();
        assert!((p.radius(5.0, twist, x, x0).radius_m - expected).abs() < 1e-18, "{turns}");
    }
    for twist in [0.5, 3.0, 3.3, 12.0, 50.0] {
        let error = p.radius(5.0, twist, x, x0).arc_by_twist / slope(arc, twist, 1e-2) - 1.0;
        assert!(error.abs() < 1e-8, "{twist}: {error}");
    }
    // The gap is continuous at π; its slope jumps as that of the arc does.
    let m = scene.mechanism().unwrap();
    let (below, at) = (m.solve(5.0, PRETWIST_RAD - 1e-9).unwrap(), m.solve(5.0, PRETWIST_RAD).unwrap());
    assert!((below.gap_m - at.gap_m).abs() < 1e-12);
    let jump = p.k4 * p.diameter_m / at.r_m;
    assert!((at.dgap_dtwist_m_per_rad / below.dgap_dtwist_m_per_rad - 1.0 - jump).abs() < 1e-6);
}

#[test]
fn dual_numbers_give_the_derivatives_by_every_constant() {
    for name in ["default", "paper-printed", "niti-plateau", "paper-computed"] {
        let s = scene(name);
        let plain = Parameters::new(&s.geometry, &s.string, &s.material).unwrap();
        type D = Dual<13>;
        // Every constant as one of thirteen parameters; p has no effect under the length-ratio law.
        fn fields<T: Scalar>(p: &mut Parameters<T>) -> [&mut T; 13] {
            let [a1, _, a3, _, a5] = &mut p.stress_coefficients_pa;
            [
                &mut p.string_length_m,
                &mut p.rod_span_m,
                &mut p.rod_radius_m,
                &mut p.diameter_m,
                &mut p.stiffness_n_per_m,
                &mut p.k1_per_n,
                &mut p.k2,
                &mut p.k3,
                &mut p.k4,
                &mut p.twist_exponent,
                a1,
                a3,
                a5,
            ]
        }
        let mut with = Parameters::<D>::constant(&plain);
        for (k, field) in fields(&mut with).into_iter().enumerate() {
            *field = D::parameter(field.value, k);
        }
        let with = Mechanism::of(with);
        for (load, twist) in [(1.0, 30.0), (7.5, 20.0), (15.0, 45.0)] {
            let e = with.formal(load, twist).unwrap();
            let plain_e = Mechanism::of(plain).formal(load, twist).unwrap();
            assert!((e.gap_m.value - plain_e.gap_m).abs() < 1e-15);
            for k in 0..13 {
                let size = fields(&mut plain.clone())[k].abs();
                if size == 0.0 {
                    continue;
                }
                let at = |x: f64| {
                    let mut p = plain;
                    *fields(&mut p)[k] += x;
                    Mechanism::of(p).formal(load, twist).unwrap()
                };
                let h = 1e-4 * size;
                for (what, exact, difference) in [
                    ("gap", e.gap_m.by[k], slope(|x| at(x).gap_m, 0.0, h)),
                    ("TR", e.tr_rad_per_m().by[k], slope(|x| at(x).tr_rad_per_m(), 0.0, h)),
                    ("D", e.d_m.by[k], slope(|x| at(x).d_m, 0.0, h)),
                ] {
                    let scale = match what {
                        "TR" => plain_e.tr_rad_per_m(),
                        _ => plain_e.gap_m,
                    };
                    let error = (exact - difference).abs() * size / scale;
                    assert!(error < 1e-8, "{name} {load} N {twist} rad, parameter {k}, {what}: {exact}, {difference}");
                }
            }
        }
    }
}

/// The drawn line of a rod is integrated from the clamp by another way than the solver's.
#[test]
fn the_line_of_a_bent_rod_ends_where_the_equilibrium_has_its_tip() {
    for name in ["default", "niti-plateau", "paper-printed"] {
        let m = scene(name).mechanism().unwrap();
        for (load, twist) in [(1.0, 10.0), (7.5, 30.0), (15.0, 45.0)] {
            let e = m.solve(load, twist).unwrap();
            let (length_m, mut points) = (m.rod().length_m, [[f64::NAN; 2]; 21]);
            let tip = [length_m + e.u_m, e.w_m];
            m.rod().path(TipForce::of(&e), tip, &mut points).unwrap();
            assert_eq!(points[0], [0.0, 0.0]);
            let [x, w] = points[20];
            assert!((x - tip[0]).abs() + (w - tip[1]).abs() < 1e-9, "{name} {load} N {twist} rad: {x} {w}, {tip:?}");
            // Bent but hardly stretched, point by point.
            for pair in points.windows(2) {
                let chord = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
                assert!((chord * 20.0 / length_m - 1.0).abs() < 0.01, "{name} {load} N {twist} rad: {chord} m");
            }
        }
    }
}

/// ∂T/∂F = −∂G/∂θ; the quadrature has few nodes.
#[test]
fn the_torque_that_conserves_energy_grows_with_the_load_as_the_gap_falls_with_the_twist() {
    for name in ["default", "niti-plateau", "paper-computed"] {
        let m = scene(name).mechanism().unwrap();
        for (load, twist) in [(0.8, 5.0), (5.0, -20.0), (15.0, 35.0)] {
            let torque = |load: f64| m.conservative_torque_nm(load, twist).unwrap();
            let (found, expected) =
                (slope(torque, load, 1e-2 * load), -m.solve(load, twist).unwrap().dgap_dtwist_m_per_rad);
            assert!((found / expected - 1.0).abs() < 0.03, "{name} {load} N {twist} rad: {found} {expected}");
        }
        // Of slack strings it is in proportion to the load, and meets that of tight ones without a step.
        let torque = |load: f64| m.conservative_torque_nm(load, 10.0).unwrap();
        for load in [0.05, 0.1, 0.2] {
            let found = torque(load) / torque(SLACK_LOAD_N);
            assert!((found - load / SLACK_LOAD_N).abs() < 1e-12, "{name} {load} N: {found}");
        }
        assert!((torque(SLACK_LOAD_N * (1.0 + 1e-9)) / torque(SLACK_LOAD_N) - 1.0).abs() < 1e-6);
        assert!(matches!(m.conservative_torque_nm(0.04, 10.0), Err(SolveError::Slack { .. })));
    }
}
