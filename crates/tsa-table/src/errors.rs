//! Errors of a lookup against the solver.

use crate::arc::Point;
use crate::reference::Exact;
use crate::table_spec::Accuracy;
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
    /// Whether the largest errors are within this fraction of an accuracy.
    pub fn meets(&self, accuracy: &Accuracy, fraction: f64) -> bool {
        self.contraction_max_m <= fraction * accuracy.contraction_m && self.tr_max <= fraction * accuracy.tr_relative
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A gap that falls by 1 mm/rad, looked up with an error of the contraction and of TR that grow with the load.
    fn look_up(load_n: f32, twist_rad: f32) -> Point {
        let twisted = twist_rad - PRETWIST_RAD as f32;
        let gap_m = 0.1 - 1e-3 * twisted - if twisted > 0.0 { 1e-4 * load_n } else { 0.0 };
        Point { gap_m, dgap_dtwist_m_per_rad: -1e-3 / (1.0 + 0.01 * load_n), dgap_dload_m_per_n: 0.0 }
    }

    fn exact(load_n: f64) -> Exact {
        // The gap itself is 2 mm off everywhere, which is no error of a contraction.
        let start_gap_m = 0.102;
        Exact { load_n, twist_rad: PRETWIST_RAD + 20.0, gap_m: start_gap_m - 0.02, by_twist: -1e-3, start_gap_m }
    }

    #[test]
    fn errors_are_of_contraction_and_relative_of_tr() {
        let (contraction_m, tr) = error_at(look_up, &exact(4.0));
        assert!((contraction_m - 4e-4).abs() < 1e-7 && (tr - 0.04).abs() < 1e-6, "{contraction_m} {tr}");
        let nothing = |_, _| Point { gap_m: f32::NAN, dgap_dtwist_m_per_rad: f32::NAN, dgap_dload_m_per_n: f32::NAN };
        assert_eq!(error_at(nothing, &exact(4.0)), (f64::INFINITY, f64::INFINITY));
    }

    #[test]
    fn over_points_the_largest_and_the_mean_square_count() {
        let errors = errors_over(look_up, &[exact(3.0), exact(4.0)]);
        let rms = 12.5f64.sqrt();
        for (found, expected) in [
            (errors.contraction_max_m, 4e-4),
            (errors.contraction_rms_m, rms * 1e-4),
            (errors.tr_max, 0.04),
            (errors.tr_rms, rms * 0.01),
        ] {
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
        }
    }

    #[test]
    fn both_largest_errors_must_be_within_their_share() {
        let errors = Errors { contraction_max_m: 4e-6, tr_max: 1e-3, ..Errors::default() };
        let meets =
            |contraction_m, tr_relative, fraction| errors.meets(&Accuracy { contraction_m, tr_relative }, fraction);
        assert!(meets(4e-6, 1e-3, 1.0) && meets(8e-6, 2e-3, 0.5));
        assert!(!meets(3.9e-6, 1e-3, 1.0) && !meets(4e-6, 0.9e-3, 1.0));
        assert!(!meets(7.9e-6, 2e-3, 0.5) && !meets(8e-6, 1.9e-3, 0.5));
    }
}
