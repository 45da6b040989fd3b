//! Methods against each other: where all agree, how fast they converge, and where each fails.

use baseline_methods::Method;
use rig_config::Scene;
use std::collections::HashMap;
use tsa_model::{Mechanism, SolveError, twist_from_turns};

fn root() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn scene(name: &str) -> Scene {
    Scene::load(root().join("scenes").join(format!("{name}.toml"))).unwrap()
}

#[test]
fn every_method_agrees_on_the_reference_states() {
    let mut reader = csv::Reader::from_path(root().join("host-tests/reference/equilibria.csv")).unwrap();
    let mut worst: HashMap<&str, f64> = HashMap::new();
    for row in reader.deserialize() {
        let row: HashMap<String, String> = row.unwrap();
        let number = |key: &str| row[key].parse::<f64>().unwrap();
        let m = scene(&row["scene"]).mechanism().unwrap();
        let (load, twist) = (number("load_n"), twist_from_turns(number("turns")));
        let reference = m.solve(load, twist).unwrap();
        for method in Method::ALL {
            let e = method.solve(&m, load, twist).unwrap_or_else(|e| panic!("{} {row:?}: {e}", method.name()));
            let gap = (e.gap_m - reference.gap_m).abs();
            assert!(gap < 2e-10, "{} {row:?}: gap differs by {gap}", method.name());
            for (a, b) in [
                (e.dgap_dtwist_m_per_rad, reference.dgap_dtwist_m_per_rad),
                (e.dgap_dload_m_per_n, reference.dgap_dload_m_per_n),
                (e.bending_strain, reference.bending_strain),
                (e.tip_angle_rad, reference.tip_angle_rad),
            ] {
                assert!((a / b - 1.0).abs() < 2e-7, "{} {row:?}: {a} against {b}", method.name());
            }
            assert!(e.iterations > 0 && e.evaluations > 0);
            let w = worst.entry(method.name()).or_default();
            *w = w.max(gap);
        }
    }
    println!("worst difference of the gap (m): {worst:?}");
}

/// Error of the gap against the default method, at rising effort.
fn errors(m: &Mechanism, load: f64, twist: f64, methods: &[Method]) -> Vec<f64> {
    let reference = m.solve(load, twist).unwrap().gap_m;
    methods.iter().map(|method| (method.solve(m, load, twist).unwrap().gap_m - reference).abs()).collect()
}

#[test]
fn methods_converge_as_fast_as_their_order_says() {
    let m = scene("default").mechanism().unwrap();
    let (load, twist) = (15.0, 40.0);
    let paper = |steps| Method::Paper { steps, relaxation: 0.5, tolerance: 1e-13 };
    let e = errors(&m, load, twist, &[paper(8), paper(16), paper(32)]);
    for pair in e.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((3.7..4.5).contains(&order), "Runge–Kutta: {e:?}");
    }
    let collocation = |intervals| Method::Collocation { intervals, tolerance: 1e-13 };
    let e = errors(&m, load, twist, &[collocation(4), collocation(8), collocation(16), collocation(32)]);
    for pair in e.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((3.7..4.5).contains(&order), "collocation: {e:?}");
    }
    // The quadrature converges faster than any order: two more nodes give two more digits.
    let nodes = |n| Method::FirstIntegral { points: Some(n) };
    let e = errors(&m, load, twist, &[nodes(2), nodes(4), nodes(6), nodes(8)]);
    assert!(e.windows(2).all(|pair| pair[1] < 1e-2 * pair[0]) && e[3] < 1e-11, "first integral: {e:?}");
    // The adaptive integrator reaches about its tolerance.
    for tolerance in [1e-4, 1e-7, 1e-10] {
        let e = errors(&m, load, twist, &[Method::AdaptiveShooting { tolerance }]);
        assert!(e[0] < 0.1 * tolerance, "adaptive at {tolerance}: {e:?}");
    }
}

/// The paper's rig with longer or thinner rods.
fn slender(rod_span_m: f64, rod_radius_m: f64) -> Mechanism {
    let mut s = scene("paper-identified");
    s.geometry.rod_span_m = rod_span_m;
    s.geometry.rod_radius_m = rod_radius_m;
    s.mechanism().unwrap()
}

#[test]
fn the_papers_relaxation_stops_converging_where_the_solution_exists() {
    // Slender rods: a change of the helix angle changes the span by more than itself, and the angle oscillates.
    for (span, radius, load, twist) in [(0.08, 0.0003, 2.0, 10.0), (0.08, 0.0005, 5.0, 20.0)] {
        let m = slender(span, radius);
        let solution = m.solve(load, twist).unwrap();
        let paper = |relaxation| Method::Paper { steps: 60, relaxation, tolerance: 1e-9 };
        let failed = paper(1.0).solve(&m, load, twist).unwrap_err();
        assert_eq!(failed, SolveError::Diverged { stage: "relaxation of the helix angle" });
        // Half the step damps the oscillation here; continuation needs no damping.
        for method in [paper(0.5), Method::Continuation { steps: 4 }] {
            let e = method.solve(&m, load, twist).unwrap();
            assert!((e.gap_m - solution.gap_m).abs() < 1e-6, "{}", method.name());
        }
    }
}

/// The shooting equation has three solutions or more; which one Newton's method finds is chance (crates/tsa-model/README.md 3).
#[test]
fn shooting_fails_or_finds_another_branch_on_slender_rods() {
    let paper = |steps| Method::Paper { steps, relaxation: 0.5, tolerance: 1e-9 };
    let check = |(span, radius): (f64, f64), load, twist, silent: bool, methods: &[Method]| {
        let m = slender(span, radius);
        let solution = m.solve(load, twist).unwrap();
        for method in methods {
            match method.solve(&m, load, twist) {
                Ok(e) => assert!((e.gap_m - solution.gap_m).abs() > if silent { 1e-3 } else { 1e-6 }, "{e:?}"),
                Err(
                    SolveError::Diverged { .. } | SolveError::SectionSingular { .. } | SolveError::NoEquilibrium { .. },
                ) if !silent => {}
                Err(e) => panic!("{}: {e}", method.name()),
            }
        }
        for steps in [8, 16] {
            let followed = Method::Continuation { steps }.solve(&m, load, twist).unwrap();
            assert!((followed.gap_m - solution.gap_m).abs() < 1e-12);
        }
        assert!(solution.tip_angle_rad < std::f64::consts::FRAC_PI_2 + solution.alpha_rad);
    };
    check((0.06, 0.0003), 2.0, 50.0, true, &[paper(60)]);
    // Load number 15 and more.
    check((0.09, 0.0004), 10.0, 4.0, false, &[paper(200), Method::AdaptiveShooting { tolerance: 1e-9 }]);
}

#[test]
fn asking_for_less_than_rounding_does_not_end_in_nan() {
    let m = scene("default").mechanism().unwrap();
    let reference = m.solve(10.0, 30.0).unwrap().gap_m;
    for method in [
        Method::Paper { steps: 512, relaxation: 0.5, tolerance: 1e-15 },
        Method::Collocation { intervals: 200, tolerance: 1e-15 },
        Method::AdaptiveShooting { tolerance: 1e-14 },
    ] {
        match method.solve(&m, 10.0, 30.0) {
            Ok(e) => assert!((e.gap_m - reference).abs() < 1e-11, "{}", method.name()),
            // Refusing is correct too.
            Err(e) => assert!(
                matches!(e, SolveError::Diverged { .. } | SolveError::NotConverged { .. }),
                "{}: {e}",
                method.name()
            ),
        }
    }
}

#[test]
fn names_lead_back_to_methods() {
    for method in Method::ALL {
        assert_eq!(Method::named(method.name()), Some(*method));
    }
    assert_eq!(Method::named("guess"), None);
}
