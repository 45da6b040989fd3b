//! The LVDT's correction at several points, as gauges measure them.

use crate::codes::CurveFlaw;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Maximum number of points.
pub const LVDT_POINTS_MAX: usize = 11;
/// Minimum distance of two neighbouring points (m): gauges are good to 20 µm, which is then 4 % of the slope between them.
pub const LVDT_APART_M: f32 = 1e-3;
/// Minimum and maximum change of the gap for a change of the sensor's reading by 1, between two points.
const SLOPE: [f32; 2] = [0.5, 2.0];
/// Maximum correction, and maximum error of the corrected gap, that is not a mistake (m).
const CORRECTION_MAX_M: f32 = 0.05;
const ERROR_MAX_M: f32 = 0.01;

/// What has to be added to the sensor's uncalibrated reading: linear between 2 to 11 points, constant beyond the ends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LvdtCurve {
    /// Uncalibrated reading and correction there (m), by rising readings; zeros behind the last one.
    points: [[f32; 2]; LVDT_POINTS_MAX],
    count: u8,
    error_m: f32,
}

impl LvdtCurve {
    /// A curve through points of uncalibrated reading and correction (m), by rising readings. `error_m` is half the width of
    /// the interval around a corrected gap that holds the true one in 90 of 100 cases (m).
    ///
    /// # Errors
    /// [`CurveFlaw`], as [`LvdtCurve::check`].
    pub fn new(points: &[[f32; 2]], error_m: f32) -> Result<Self, CurveFlaw> {
        let mut curve = Self { points: [[0.0; 2]; LVDT_POINTS_MAX], count: points.len().min(255) as u8, error_m };
        curve.points.get_mut(..points.len()).ok_or(CurveFlaw::Count)?.copy_from_slice(points);
        curve.check().map(|()| curve)
    }

    /// Uncalibrated reading and correction (m) of each point.
    pub fn points(&self) -> &[[f32; 2]] {
        self.points.get(..usize::from(self.count)).unwrap_or(&self.points)
    }

    /// Half the width of the interval around a corrected gap that holds the true one in 90 of 100 cases (m).
    pub fn error_m(&self) -> f32 {
        self.error_m
    }

    /// Mean distance of two neighbouring points (m).
    pub fn spacing_m(&self) -> f32 {
        match self.points() {
            [[first_m, _], between @ .., [last_m, _]] => (last_m - first_m) / (between.len() + 1) as f32,
            _ => LVDT_APART_M,
        }
    }

    /// Checks what came from outside.
    ///
    /// # Errors
    /// [`CurveFlaw`]: too few or too many points, a number that is none, points out of order or too close together, a gap
    /// that does not grow with the reading as a sensor's does, or a correction or an error that is too large.
    pub fn check(&self) -> Result<(), CurveFlaw> {
        if !(2..=LVDT_POINTS_MAX).contains(&usize::from(self.count)) {
            return Err(CurveFlaw::Count);
        }
        let points = self.points();
        if points.iter().flatten().any(|x| !x.is_finite()) {
            return Err(CurveFlaw::NotFinite);
        }
        let steps = || points.iter().zip(&points[1..]).map(|([from, a], [to, b])| [to - from, (to + b) - (from + a)]);
        if steps().all(|[sensor, gap]| sensor > 0.0 && gap < 0.0) {
            return Err(CurveFlaw::WrongSign);
        }
        if steps().any(|[sensor, gap]| sensor < 0.0 || gap < 0.0) {
            return Err(CurveFlaw::NotMonotonic);
        }
        // A millimetre as typed may be a little less after rounding.
        if steps().any(|[sensor, gap]| sensor.min(gap) < 0.99 * LVDT_APART_M) {
            return Err(CurveFlaw::TooClose);
        }
        if steps().any(|[sensor, gap]| !(SLOPE[0] * sensor..=SLOPE[1] * sensor).contains(&gap)) {
            return Err(CurveFlaw::Slope);
        }
        if points.iter().any(|[_, correction]| correction.abs() > CORRECTION_MAX_M) {
            return Err(CurveFlaw::Correction);
        }
        if !(0.0..=ERROR_MAX_M).contains(&self.error_m) {
            return Err(CurveFlaw::Error);
        }
        Ok(())
    }

    /// Gap (m) at an uncalibrated reading (m).
    pub fn gap_m(&self, sensor_m: f32) -> f32 {
        sensor_m + self.correction_m(sensor_m, |point| point)
    }

    /// Uncalibrated reading (m) at a gap (m): the inverse of [`LvdtCurve::gap_m`].
    pub fn sensor_m(&self, gap_m: f32) -> f32 {
        // Between two points the correction is linear in the gap, too.
        gap_m - self.correction_m(gap_m, |[sensor_m, correction_m]| [sensor_m + correction_m, correction_m])
    }

    /// The correction between points whose places are as `knot` has them.
    fn correction_m(&self, at: f32, knot: impl Fn([f32; 2]) -> [f32; 2]) -> f32 {
        let mut knots = self.points().iter().map(|point| knot(*point));
        let Some(mut low) = knots.next() else { return 0.0 };
        if at <= low[0] {
            return low[1];
        }
        for high in knots {
            if at < high[0] {
                return low[1] + (at - low[0]) / (high[0] - low[0]) * (high[1] - low[1]);
            }
            low = high;
        }
        low[1]
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// A sensor that deviates by 0.5 mm in a wave of 60 mm, at 11 points over 25 mm.
    fn bent(sensor_m: f32) -> f32 {
        0.5e-3 * (105.0 * f64::from(sensor_m)).sin() as f32
    }

    fn curve() -> LvdtCurve {
        let points: Vec<[f32; 2]> = (0..11).map(|k| 0.09 + 0.0025 * k as f32).map(|s| [s, bent(s)]).collect();
        LvdtCurve::new(&points, 2e-5).expect("a curve")
    }

    #[test]
    fn it_goes_through_its_points_and_is_continuous_and_rising() {
        let curve = curve();
        for [sensor_m, correction_m] in curve.points() {
            assert!((curve.gap_m(*sensor_m) - sensor_m - correction_m).abs() < 2e-8);
        }
        let gaps: Vec<f32> = (0..=4000).map(|k| curve.gap_m(0.085 + 1e-5 * k as f32)).collect();
        assert!(gaps.windows(2).all(|g| (0.9e-5..1.1e-5).contains(&(g[1] - g[0]))), "no jump, no step back");
    }

    #[test]
    fn between_points_it_follows_the_sensor_and_beyond_them_it_keeps_the_ends_correction() {
        let curve = curve();
        for k in 0..=250 {
            let sensor_m = 0.09 + 1e-4 * k as f32;
            // Chords of a sine: amplitude (wave number · spacing)² / 8.
            let chord_m = 0.5e-3 * (105.0f32 * 0.0025).powi(2) / 8.0 + 1e-7;
            assert!((curve.gap_m(sensor_m) - sensor_m - bent(sensor_m)).abs() < chord_m, "at {sensor_m} m");
        }
        for (sensor_m, end) in [(0.01, 0), (0.0899, 0), (0.116, 10), (0.2, 10)] {
            let correction_m = curve.points()[end][1];
            assert!((curve.gap_m(sensor_m) - sensor_m - correction_m).abs() < 2e-8, "at {sensor_m} m");
        }
        assert!(curve.gap_m(f32::NAN).is_nan());
    }

    #[test]
    fn the_spacing_is_the_mean_distance_of_neighbours_and_the_error_is_kept() {
        let curve = LvdtCurve::new(&[[0.1, 0.0], [0.102, 0.0], [0.105, 0.0], [0.112, 0.0]], 3e-5).unwrap();
        assert!((curve.spacing_m() - 0.004).abs() < 1e-7, "{} m", curve.spacing_m());
        assert_eq!(curve.error_m(), 3e-5);
    }

    #[test]
    fn the_reading_is_found_back_from_the_gap() {
        let curve = curve();
        for k in 0..=300 {
            let sensor_m = 0.08 + 1.5e-4 * k as f32;
            assert!((curve.sensor_m(curve.gap_m(sensor_m)) - sensor_m).abs() < 5e-8, "at {sensor_m} m");
        }
    }

    #[test]
    fn what_is_no_sensor_is_refused_by_name() {
        let flaw = |points: &[[f32; 2]]| LvdtCurve::new(points, 2e-5).err();
        let at = |points: &[[f32; 2]]| -> Vec<[f32; 2]> { points.iter().map(|[s, gap]| [*s, gap - s]).collect() };
        assert_eq!(flaw(&[[0.1, 0.0]]), Some(CurveFlaw::Count));
        let many: Vec<[f32; 2]> = (0..12).map(|k| [0.1 + 0.002 * k as f32, 0.0]).collect();
        assert_eq!((flaw(&many), flaw(&many[..11])), (Some(CurveFlaw::Count), None));
        assert_eq!(flaw(&[[0.1, f32::NAN], [0.11, 0.0]]), Some(CurveFlaw::NotFinite));
        assert_eq!(flaw(&at(&[[0.10, 0.12], [0.11, 0.11], [0.12, 0.10]])), Some(CurveFlaw::WrongSign));
        assert_eq!(flaw(&at(&[[0.10, 0.10], [0.11, 0.12], [0.12, 0.11]])), Some(CurveFlaw::NotMonotonic));
        assert_eq!(flaw(&[[0.11, 0.0], [0.1, 0.0]]), Some(CurveFlaw::NotMonotonic));
        assert_eq!(flaw(&at(&[[0.11, 0.10], [0.10, 0.12]])), Some(CurveFlaw::NotMonotonic), "readings out of order");
        assert_eq!(flaw(&[[0.1, 0.0], [0.1009, 0.0]]), Some(CurveFlaw::TooClose));
        // One reading for two gaps, or one gap for two readings.
        assert_eq!(flaw(&at(&[[0.10, 0.12], [0.10, 0.10]])), Some(CurveFlaw::NotMonotonic));
        assert_eq!(flaw(&at(&[[0.10, 0.10], [0.10, 0.12]])), Some(CurveFlaw::TooClose));
        assert_eq!(flaw(&at(&[[0.10, 0.10], [0.12, 0.10]])), Some(CurveFlaw::TooClose));
        assert_eq!(flaw(&[[0.1, 0.0], [0.101, 0.0]]), None, "1 mm");
        assert_eq!(flaw(&at(&[[0.10, 0.10], [0.11, 0.125]])), Some(CurveFlaw::Slope));
        assert_eq!(flaw(&[[0.1, 0.06], [0.11, 0.06]]), Some(CurveFlaw::Correction));
        assert_eq!(flaw(&[[0.1, 0.05], [0.11, 0.05]]), None, "50 mm");
        for error_m in [-1e-6, 0.011] {
            assert_eq!(LvdtCurve::new(&[[0.1, 0.0], [0.11, 0.0]], error_m).err(), Some(CurveFlaw::Error));
        }
        assert_eq!(LvdtCurve::new(&[[0.1, 0.0], [0.11, 0.0]], f32::NAN).err(), Some(CurveFlaw::Error));
        // An error that was computed from points which are no calibration does not hide what is wrong with them.
        assert_eq!(LvdtCurve::new(&at(&[[0.10, 0.10], [0.10, 0.12]]), f32::NAN).err(), Some(CurveFlaw::TooClose));
        // Any count may come over the link.
        let wild = LvdtCurve { count: 200, ..curve() };
        assert_eq!((wild.check(), wild.points().len()), (Err(CurveFlaw::Count), 11));
    }
}
