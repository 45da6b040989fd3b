//! The limits of the model (docs/explanation/model.md section 5): each limit named, and the nearest good case solved.

use rig_config::Scene;
use tsa_model::rod::TipForce;
use tsa_model::{Material, Mechanism, RadiusLaw, SolveError, Warnings, twist_from_turns};

fn scene(name: &str) -> Scene {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    Scene::load(root.join(format!("{name}.toml"))).unwrap()
}

/// The last good and the first bad value between a good and a bad one, to a part in 10⁹.
fn edge(good: f64, bad: f64, solve: impl Fn(f64) -> Result<tsa_model::Equilibrium, SolveError>) -> (f64, f64) {
    let (mut good, mut bad) = (good, bad);
    assert!(solve(good).is_ok() && solve(bad).is_err());
    while (bad - good).abs() > 1e-9 * bad.abs() {
        let mid = 0.5 * (good + bad);
        if solve(mid).is_ok() { good = mid } else { bad = mid }
    }
    (good, bad)
}

#[test]
fn numbers_that_are_not_finite() {
    let m = scene("paper-identified").mechanism().unwrap();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(matches!(m.solve(bad, 4.0), Err(SolveError::NotFinite { parameter: "load", .. })));
        assert!(matches!(m.solve(1.0, bad), Err(SolveError::NotFinite { parameter: "twist", .. })));
    }
    assert!(m.solve(1.0, 4.0).is_ok());
}

#[test]
fn a_vanishing_load() {
    let m = scene("paper-identified").mechanism().unwrap();
    for load in [-1.0, 0.0, 0.0499] {
        assert!(matches!(m.solve(load, 4.0), Err(SolveError::Slack { .. })), "{load} N");
    }
    assert!(m.solve(0.05, 4.0).unwrap().warnings.contains(Warnings::LIGHT_LOAD));
    assert!(m.solve(0.4999, 4.0).unwrap().warnings.contains(Warnings::LIGHT_LOAD));
    assert!(m.solve(0.5, 4.0).unwrap().warnings.is_empty());
}

#[test]
fn overtwist() {
    let s = scene("paper-identified");
    let m = s.mechanism().unwrap();
    let (good, bad) = edge(9.0, 10.0, |turns| m.solve(1.0, twist_from_turns(turns)));
    let Err(SolveError::Overtwist { length_m, needed_m }) = m.solve(1.0, twist_from_turns(bad)) else {
        panic!("{bad} turns")
    };
    assert!(length_m < needed_m && needed_m - length_m < 1e-6);
    // At the edge the two helices fill the length exactly: X = 2 r0 θ/2π.
    let last = m.solve(1.0, twist_from_turns(good)).unwrap();
    assert!((last.x_m - s.string.diameter_m * last.twist_rad / std::f64::consts::PI).abs() < 1e-6);
    // Beyond, the formal root of the equations is there for comparison, marked.
    assert!(m.formal(1.0, twist_from_turns(bad)).unwrap().warnings.contains(Warnings::OVERTWIST));
}

#[test]
fn no_equilibrium() {
    // The printed law at 1 N: the helix runs away; at 31π of twist none exists (crates/tsa-model/README.md 3).
    let m = scene("paper-printed").mechanism().unwrap();
    assert!(matches!(m.formal(1.0, 40.0 * std::f64::consts::TAU), Err(SolveError::NoEquilibrium { .. })));
    assert!(m.solve(1.0, twist_from_turns(7.5)).is_ok());
    let (good, _) = edge(twist_from_turns(7.5), 40.0 * std::f64::consts::TAU, |twist| m.formal(1.0, twist));
    // Just before it the branch folds back: the gap falls without bound for a little more twist, long past overtwist.
    let last = m.formal(1.0, good).unwrap();
    assert!(last.dgap_dtwist_m_per_rad < -1.0 && last.warnings.contains(Warnings::OVERTWIST), "{last:?}");
}

#[test]
fn a_falling_stress_strain_curve() {
    // The law is flat at 2.5 % strain and falls beyond: it carries a light load, but not a heavy one.
    let mut s = scene("niti-plateau");
    s.material = Material { stress_coefficients_pa: [2.4e10, 0.0, -1.3e13, 0.0, 0.0] };
    let m = s.mechanism().unwrap();
    let (good, bad) = edge(3.0, 30.0, |load| m.solve(load, 20.0));
    let error = m.solve(bad, 20.0).unwrap_err();
    assert!(
        matches!(error, SolveError::SectionSingular { .. } | SolveError::Fold { .. } | SolveError::Unresolved { .. }),
        "{error}"
    );
    // The moment has its maximum value where 1 + 12·4 w4 y = 0: κR = √(−2/(3 a3/a1)) = 0.0351.
    let strain = m.solve(good, 20.0).unwrap().bending_strain;
    assert!(strain < 0.0351 && strain > 0.034, "{strain}");
}

#[test]
fn the_range_of_the_polynomial() {
    let mut s = scene("paper-identified");
    s.geometry.rod_radius_m = 0.00035;
    let m = s.mechanism().unwrap();
    assert!(m.solve(3.0, 20.0).unwrap().warnings.is_empty());
    assert!(m.solve(15.0, 20.0).unwrap().warnings.contains(Warnings::STRAIN_RANGE));
    let (good, bad) = edge(15.0, 60.0, |load| m.solve(load, 20.0));
    assert!(matches!(m.solve(bad, 20.0), Err(SolveError::StrainRange { limit: 0.12, .. })));
    assert!(m.solve(good, 20.0).unwrap().bending_strain <= 0.12);
}

#[test]
fn rods_without_free_length() {
    let mut s = scene("paper-identified");
    s.geometry.clamp_width_m = s.geometry.rod_span_m;
    let rigid = s.mechanism().unwrap().solve(5.0, 20.0).unwrap();
    assert_eq!((rigid.u_m, rigid.w_m, rigid.bending_strain, rigid.tip_angle_rad), (0.0, 0.0, 0.0, 0.0));
    // Strings that only reach from one end of a rod to the other cannot hang.
    let string_length_m = s.geometry.rod_span_m;
    assert!(tsa_model::Geometry { string_length_m, ..s.geometry }.validate().is_err());
    // And the limit is reached without a step: the deflection falls with the cube of the free length.
    for free in [1e-3, 1e-4, 1e-5, 1e-8] {
        s.geometry.clamp_width_m = s.geometry.rod_span_m - free;
        let near = s.mechanism().unwrap().solve(5.0, 20.0).unwrap();
        assert!((near.gap_m - rigid.gap_m).abs() < 1e-3 * free, "{free}: {}", near.gap_m - rigid.gap_m);
    }
}

#[test]
fn more_than_one_equilibrium() {
    // |n| l²/EI beyond π²/4: solved on the branch that the unloaded state leads to, with a warning.
    let mut s = scene("paper-identified");
    s.geometry.rod_span_m = 0.06;
    let m = s.mechanism().unwrap();
    let heavy = m.solve(10.0, 15.0).unwrap();
    assert!(heavy.warnings.contains(Warnings::NOT_UNIQUE), "{heavy:?}");
    assert!(!m.solve(1.0, 15.0).unwrap().warnings.contains(Warnings::NOT_UNIQUE));
    // A law that is a straight line softens nowhere: the warning begins at π²/4 itself.
    let [modulus, ..] = s.material.stress_coefficients_pa;
    s.material = Material { stress_coefficients_pa: [modulus, 0.0, 0.0, 0.0, 0.0] };
    let m = s.mechanism().unwrap();
    let number = |load| m.rod().load_number(TipForce::of(&m.solve(load, 15.0).unwrap()));
    let warned = |load| m.solve(load, 15.0).unwrap().warnings.contains(Warnings::NOT_UNIQUE);
    let (mut without, mut with) = (1.0, 10.0);
    while with - without > 1e-9 {
        let middle = 0.5 * (without + with);
        if warned(middle) { with = middle } else { without = middle }
    }
    let limit = std::f64::consts::PI.powi(2) / 4.0;
    assert!(number(without) < limit && number(with) >= limit && number(with) - limit < 1e-6, "{}", number(with));
}

#[test]
fn a_plateau_too_flat_to_resolve() {
    // The bending stiffness of the section, E I (1 + 3/2 a3 y + 25/16 a5 y²) with y = (κR)², falls to a fraction of itself
    // at a bending strain of 4 %.
    let mut s = scene("niti-plateau");
    let at = |fraction: f64| {
        let (e, y) = (2.4e10, 0.04f64.powi(2));
        let depth = 1.0 - fraction;
        [e, 0.0, -2.0 * depth / (1.5 * y) * e, 0.0, depth / (25.0 / 16.0 * y * y) * e]
    };
    let (mut solved, mut refused) = (0, Vec::new());
    for fraction in [0.3, 0.1, 0.01, 1e-4] {
        s.material = Material { stress_coefficients_pa: at(fraction) };
        let m: Mechanism = s.mechanism().unwrap();
        for load in [2.0, 5.0, 8.0, 11.0, 14.0] {
            match m.solve(load, 30.0) {
                Ok(e) => {
                    assert!(e.residual <= 1e-12 && e.gap_m.is_finite());
                    solved += 1;
                }
                Err(e) => refused.push((fraction, load, e.kind())),
            }
        }
    }
    println!("{solved} solved, {refused:?}");
    assert!(solved >= 12 && !refused.is_empty(), "{refused:?}");
    // Below the plateau everything is solved, and with a third of the stiffness left the plateau is, too.
    assert!(refused.iter().all(|r| r.0 <= 0.1 && r.1 >= 8.0 && r.2 == "unresolved"), "{refused:?}");
    s.string.radius_law = RadiusLaw::LengthRatio;
    s.string.twist_exponent = None;
    assert!(s.mechanism().unwrap().solve(2.0, 30.0).is_ok());
}
