//! The rigid case against another implementation: the Python package `twisted-strings` 0.0.2.
//!
//! Its actuator is two strings of fixed length L and radius r that meet at both ends, x = L − √(L² − (θ r)²). Of the
//! package, its kinematics (`contraction`, `jacobian`) and its `static` torque are compared. It has no offset between
//! the strings: a rigid rod of span D0 is matched by twisting theirs D0/r further, which makes the same horizontal run
//! θ r + D0 (from the half-turn on; below it the package has no counterpart). It has no law of the radius (here
//! 1/(k1 F) and k3 vanish), no stretch and no rods, so nothing of these is tested here; its compliance term (`jamming`)
//! and its dynamics are another model than eqs 5, 6 and 9, and are not compared.
//!
//! `host-tests/peers/twisted-strings.py` wrote the numbers.

use rig_config::Scene;
use tsa_model::{Geometry, Mechanism, PRETWIST_RAD, RadiusLaw, StringParameters};

/// The package computes in doubles; the smallest contraction has lost the last four digits to cancellation.
const RELATIVE: f64 = 1e-9;

#[derive(Clone, Copy, serde::Deserialize)]
struct Row {
    length_m: f64,
    radius_m: f64,
    angle_rad: f64,
    contraction_m: f64,
    jacobian_m_per_rad: f64,
    torque_nm_per_n: f64,
}

fn root() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn rows() -> Vec<Row> {
    let mut reader = csv::Reader::from_path(root().join("host-tests/reference/twisted-strings.csv")).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

/// Strings of the row on rigid rods of this span.
fn rigid(row: &Row, span_m: f64) -> Mechanism {
    let scene = Scene::load(root().join("scenes/default.toml")).unwrap();
    let geometry = Geometry {
        string_length_m: row.length_m,
        rod_span_m: span_m,
        // No free rod is left outside the clamp.
        clamp_width_m: span_m,
        ..scene.geometry
    };
    let string = StringParameters {
        diameter_m: 2.0 * row.radius_m,
        stiffness_n_per_m: 1e15,
        k1_per_n: 1e30,
        k2: 0.5,
        k3: 0.0,
        k4: 0.0,
        radius_law: RadiusLaw::LengthRatio,
        twist_exponent: None,
    };
    Mechanism::new(&geometry, &string, &scene.material).unwrap()
}

fn assert_close(what: &str, ours: f64, theirs: f64, row: &Row) {
    let error = (ours / theirs - 1.0).abs();
    let Row { length_m, radius_m, angle_rad, .. } = row;
    assert!(error < RELATIVE, "{what} at L {length_m}, r {radius_m}, {angle_rad} rad: {ours} against {theirs}");
}

#[test]
fn without_a_span_it_is_their_actuator() {
    let rows = rows();
    assert_eq!(rows.len(), 40);
    for row in &rows {
        // Negligible: the scene needs a span above 0.
        let m = rigid(row, 1e-15);
        for load in [1.0, 7.5] {
            let (start, e) = (m.solve(load, 0.0).unwrap(), m.solve(load, row.angle_rad).unwrap());
            assert_close("contraction", start.gap_m - e.gap_m, row.contraction_m, row);
            assert_close("1/TR", 1.0 / e.tr_rad_per_m(), row.jacobian_m_per_rad, row);
            assert_close("torque", e.torque_nm, load * row.torque_nm_per_n, row);
        }
    }
}

#[test]
fn a_span_is_so_much_more_twist() {
    let mut compared = 0;
    for row in &rows() {
        for fraction in [0.1, 0.5] {
            let twist = row.angle_rad * (1.0 - fraction);
            if twist < PRETWIST_RAD {
                continue;
            }
            let e = rigid(row, fraction * row.angle_rad * row.radius_m).solve(5.0, twist).unwrap();
            assert_close("length", e.gap_m, row.length_m - row.contraction_m, row);
            assert_close("1/TR", 1.0 / e.tr_rad_per_m(), row.jacobian_m_per_rad, row);
            assert_close("torque", e.torque_nm, 5.0 * row.torque_nm_per_n, row);
            compared += 1;
        }
    }
    // All but the smallest angles.
    assert!(compared >= 70, "{compared}");
}
