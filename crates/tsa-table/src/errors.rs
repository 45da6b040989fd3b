//! Errors of a lookup against the solver.

use crate::demand::Accuracy;
use crate::point::Point;
use crate::reference::Exact;
use tsa_model::PRETWIST_RAD;

/// Errors of a table against the full solver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Largest error of the contraction (m).
    pub contraction_max_m: f64,
    /// Root mean square error of the contraction (m).
    pub contraction_rms_m: f64,
    /// Largest relative error of TR.
    pub tr_max: f64,
    /// Root mean square relative error of TR.
    pub tr_rms: f64,
}

impl Errors {
    /// Whether the largest errors are within this share of an accuracy.
    pub fn meets(&self, accuracy: &Accuracy, share: f64) -> bool {
        self.contraction_max_m <= share * accuracy.contraction_m && self.tr_max <= share * accuracy.tr_relative
    }
}

/// Error of the contraction (m) and relative error of TR at one point, by a lookup that limits load and twist to its
/// range.
pub fn error_at(look_up: impl Fn(f32, f32) -> Point, exact: &Exact) -> (f64, f64) {
    let load_n = exact.load_n as f32;
    let (start, at) = (look_up(load_n, PRETWIST_RAD as f32), look_up(load_n, exact.twist_rad as f32));
    let contraction_m = f64::from(start.gap_m - at.gap_m);
    // A rough table may have no gap at all somewhere: NaN counts as an infinite error, because a maximum ignores NaN.
    let error = |e: f64| if e.is_nan() { f64::INFINITY } else { e.abs() };
    (
        error(contraction_m - (exact.start_gap_m - exact.gap_m)),
        error(exact.by_twist / f64::from(at.dgap_dtwist_m_per_rad) - 1.0),
    )
}

/// Errors over points, see [`error_at`].
pub fn errors_over(look_up: impl Fn(f32, f32) -> Point, points: &[Exact]) -> Errors {
    let mut errors = Errors::default();
    for p in points {
        let (contraction, tr) = error_at(&look_up, p);
        errors.contraction_max_m = errors.contraction_max_m.max(contraction);
        errors.tr_max = errors.tr_max.max(tr);
        errors.contraction_rms_m += contraction * contraction;
        errors.tr_rms += tr * tr;
    }
    errors.contraction_rms_m = (errors.contraction_rms_m / points.len() as f64).sqrt();
    errors.tr_rms = (errors.tr_rms / points.len() as f64).sqrt();
    errors
}
