//! The mechanism as this rig's strings really are: the table, corrected by a scale of the twist.
//!
//! Twist acts through the arc θ r of the strings (docs/explanation/model.md 2), so a string a little thicker or thinner
//! than the scene says acts as one that is twisted a little more or less: G(F, s θ). This one number s stands for
//! everything that makes the radius wrong: spread of the braid, creep, temperature. What is left at the homed load is a
//! curve over the twist ([`rig_link::gap_curve`]), so that gap and TR are those that this rig showed.

use rig_link::messages::{GapCurve, Setting};
use tsa_table::{Point, Table};

/// The scale within its bounds: a string outside them is not the one that the table was made for.
pub(crate) fn bounded_scale(twist_scale: f32) -> f32 {
    let [min, max] = Setting::TwistScale.spec().range;
    twist_scale.clamp(min, max)
}

/// How far outside the table's twists a move may begin, a load is still estimated, and the strings may be without a fault (rad):
/// the half-turn pre-twist is the end of the range, and homing finds it within less.
pub const OUTSIDE_RAD: f32 = 0.3;

/// Minimum slope of the gap over the twist, as a fraction of the table's. Strings that are twisted always shorten; a residual curve
/// that says otherwise must not reverse the sign of TR, and with it the direction of the control.
const MIN_SLOPE: f32 = 0.25;

/// The table with the rig's own scale and curve.
#[derive(Clone, Copy, Debug)]
pub struct Mechanism<'t> {
    /// The table, with its metadata.
    pub table: Table<'t>,
    /// Twist in the table for each twist of this rig's strings.
    pub twist_scale: f32,
    /// Measured less modelled gap.
    pub curve: GapCurve,
}

impl Mechanism<'_> {
    /// Measured gap and its gradient at a load (N) and a twist (rad). Outside the table the gap follows the tangent at its edge.
    pub fn at(&self, load_n: f32, twist_rad: f32) -> Point {
        let m = &self.table.metadata;
        let scaled_rad = self.twist_scale * twist_rad;
        let inside_rad = scaled_rad.clamp(m.twist_min_rad, m.twist_max_rad);
        let mut point = self.table.point_inside(load_n, inside_rad);
        let beyond_n = load_n - load_n.clamp(m.load_min_n, m.load_max_n);
        point.gap_m += point.dgap_dtwist_m_per_rad * (scaled_rad - inside_rad) + point.dgap_dload_m_per_n * beyond_n;
        let (beside_m, slope_m_per_rad) = self.curve.at(twist_rad);
        point.gap_m += beside_m;
        let scaled = self.twist_scale * point.dgap_dtwist_m_per_rad;
        point.dgap_dtwist_m_per_rad = (scaled + slope_m_per_rad).min(MIN_SLOPE * scaled);
        point
    }

    /// Whether a load can be estimated at a twist (rad).
    pub fn covers(&self, twist_rad: f32) -> bool {
        let m = &self.table.metadata;
        (m.twist_min_rad - OUTSIDE_RAD..=m.twist_max_rad + OUTSIDE_RAD).contains(&twist_rad)
    }

    /// Maximum twist (rad) that both the strings and the table stand.
    pub fn twist_max_rad(&self) -> f32 {
        self.table.metadata.twist_max_rad / self.twist_scale.max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::homing::load_estimate::tests::table;

    /// A cubic through the residual of a homing may rise by more than the gap falls.
    #[test]
    fn no_curve_turns_the_slope_of_the_gap_around() {
        let curve = GapCurve { middle_rad: 20.0, half_rad: 15.0, coefficients_m: [0.0, 50e-3, 0.0, 0.0] };
        let mechanism = Mechanism { table: *table(), twist_scale: 1.1, curve };
        let bare = Mechanism { curve: GapCurve::constant(0.0), ..mechanism };
        for twist_rad in [6.0, 20.0, 34.0] {
            let [with, without] = [mechanism, bare].map(|mechanism| mechanism.at(5.0, twist_rad));
            assert_eq!(with.dgap_dtwist_m_per_rad, 0.25 * without.dgap_dtwist_m_per_rad, "{twist_rad}");
            assert!(with.tr_rad_per_m() > 0.0);
        }
    }
}
