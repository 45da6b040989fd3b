//! What this rig's gap is beside the table's, as a curve over the twist.
//!
//! Homing measures the gap over most of the travel under one load. What the table misses there, whether the string's
//! radius grows by another law, the LVDT is not straight or its zero is elsewhere, is a smooth curve. With the curve
//! added, gap and TR are those of this rig at the homed load, whichever law is true.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Coefficients of the curve: a constant, and the powers up to the third.
pub const TERMS: usize = 4;

/// Measured less modelled gap over the twist.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[serde(deny_unknown_fields)]
pub struct GapCurve {
    /// Middle of the measured twists (rad).
    pub middle_rad: f32,
    /// Half the width of the measured twists (rad); positive.
    pub half_rad: f32,
    /// Coefficients (m) of the powers 0 to 3 of the place in the measured twists, −1 to 1.
    pub coefficients_m: [f32; TERMS],
}

impl GapCurve {
    /// The same difference (m) at each twist.
    pub const fn constant(offset_m: f32) -> Self {
        Self { middle_rad: 0.0, half_rad: 1.0, coefficients_m: [offset_m, 0.0, 0.0, 0.0] }
    }

    /// Difference (m) and its slope (m/rad) at a twist (rad). Beyond the measured twists the difference stays.
    pub fn at(&self, twist_rad: f32) -> (f32, f32) {
        let place = (twist_rad - self.middle_rad) / self.half_rad;
        let inside = place.clamp(-1.0, 1.0);
        let [c0, c1, c2, c3] = self.coefficients_m;
        let value_m = c0 + inside * (c1 + inside * (c2 + inside * c3));
        let slope_m = c1 + inside * (2.0 * c2 + inside * 3.0 * c3);
        (value_m, if place == inside { slope_m / self.half_rad } else { 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CURVE: GapCurve = GapCurve { middle_rad: 20.0, half_rad: 15.0, coefficients_m: [1e-3, -2e-4, 3e-4, 5e-5] };

    #[test]
    fn the_slope_is_the_derivative_of_the_value() {
        for twist_rad in [6.0f32, 12.5, 20.0, 33.0] {
            let step = 0.05;
            let by_differences = (CURVE.at(twist_rad + step).0 - CURVE.at(twist_rad - step).0) / (2.0 * step);
            assert!((CURVE.at(twist_rad).1 - by_differences).abs() < 1e-7, "at {twist_rad}");
        }
    }

    #[test]
    fn the_place_is_zero_in_the_middle_and_one_at_the_ends() {
        let [c0, c1, c2, c3] = CURVE.coefficients_m;
        for (twist_rad, value_m) in [(5.0, c0 - c1 + c2 - c3), (20.0, c0), (35.0, c0 + c1 + c2 + c3)] {
            assert!((CURVE.at(twist_rad).0 - value_m).abs() < 1e-9, "at {twist_rad}");
        }
    }

    #[test]
    fn it_ends_flat_where_the_measurement_ends() {
        assert_eq!(CURVE.at(50.0), (CURVE.at(35.0).0, 0.0));
        assert_eq!(CURVE.at(-50.0), (CURVE.at(5.0).0, 0.0));
        assert_eq!(GapCurve::constant(2e-3).at(9.0), (2e-3, 0.0));
    }
}
