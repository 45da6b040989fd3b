//! The LVDT's calibration by points that callipers measure.

use crate::failure::Failure;
use crate::units::{self, Quantity};
use rig_link::{Setting, SettingValues};

/// Least distance of two points (m): callipers read to 20 µm, which is then 0.4 % of gain.
pub const APART_M: f64 = 5e-3;

/// A true gap, and the sensor's uncalibrated reading there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// By callipers (m).
    pub gap_m: f64,
    /// By the sensor, uncalibrated (m).
    pub sensor_m: f64,
}

impl std::str::FromStr for Point {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (gap, sensor) = text.split_once(':').ok_or_else(|| format!("`{text}` is not GAP:SENSOR"))?;
        let length = |text| units::parse("point", Quantity::Length, text).map_err(|e| e.to_string());
        Ok(Self { gap_m: length(gap)?, sensor_m: length(sensor)? })
    }
}

/// Offset (m) and gain that make the sensor show these points; with one point the gain stays.
///
/// # Errors
/// If two points are too near to each other.
pub fn fit(point: Point, other: Option<Point>, gain: f64) -> Result<(f64, f64), Failure> {
    let gain = match other {
        None => gain,
        Some(other) => {
            let (gaps_m, sensor_m) = (point.gap_m - other.gap_m, point.sensor_m - other.sensor_m);
            if gaps_m.abs().min(sensor_m.abs()) < APART_M {
                return Err(Failure::failed(format!(
                    "--point is {:.2} mm from here by callipers and {:.2} mm by the sensor: for the gain they must be {} mm \
                     apart or more",
                    gaps_m.abs() * 1e3,
                    sensor_m.abs() * 1e3,
                    APART_M * 1e3
                )));
            }
            gaps_m / sensor_m
        }
    };
    Ok((point.gap_m - gain * point.sensor_m, gain))
}

/// The sensor's reading by the scene's numbers (m) where the board reports a calibrated gap.
pub fn uncalibrated(gap_m: f64, values: &SettingValues) -> f64 {
    let corrected_m = (gap_m - f64::from(values.get(Setting::LvdtOffset))) / f64::from(values.get(Setting::LvdtGain));
    values.lvdt_curve.map_or(corrected_m, |curve| f64::from(curve.sensor_m(corrected_m as f32)))
}

/// The point with its reading corrected by the points that the board keeps, on which offset and gain are put.
pub fn corrected(point: Point, values: &SettingValues) -> Point {
    let sensor_m = values.lvdt_curve.map_or(point.sensor_m, |curve| f64::from(curve.gap_m(point.sensor_m as f32)));
    Point { sensor_m, ..point }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_link::LvdtCurve;

    #[test]
    fn two_points_undo_offset_and_gain_and_one_the_offset() {
        let sensor = |gap_m: f64| Point { gap_m, sensor_m: 1.01 * (gap_m + 1e-3) };
        let (offset_m, gain) = fit(sensor(0.16), Some(sensor(0.145)), 1.0).unwrap_or_else(|_| panic!("apart"));
        for gap_m in [0.14, 0.15, 0.165] {
            assert!((offset_m + gain * sensor(gap_m).sensor_m - gap_m).abs() < 1e-12);
        }
        let (offset_m, gain) = fit(sensor(0.16), None, 1.0).unwrap_or_else(|_| panic!("one"));
        assert!(gain == 1.0 && (offset_m + sensor(0.16).sensor_m - 0.16).abs() < 1e-12);
        let near = fit(sensor(0.16), Some(sensor(0.158)), 1.0).expect_err("2 mm").message();
        assert!(near.is_some_and(|message| message.contains("--point") && message.contains("2.00 mm")));
        assert!(
            fit(sensor(0.16), Some(Point { gap_m: 0.14, ..sensor(0.16) }), 1.0).is_err(),
            "a sensor that stands still"
        );
    }

    #[test]
    fn a_reading_is_found_back_through_offset_gain_and_points() {
        let values = SettingValues {
            lvdt_curve: LvdtCurve::new(&[[0.1, 1e-4], [0.12, -2e-4]], 2e-5).ok(),
            ..SettingValues::ZERO
        }
        .with(Setting::LvdtOffset, 1e-3)
        .with(Setting::LvdtGain, 1.02);
        let reading = Point { gap_m: 0.0, sensor_m: 0.105 };
        // A quarter of the way from +0.1 to -0.2 mm.
        let corrected_m = corrected(reading, &values).sensor_m;
        assert!((corrected_m - 0.105025).abs() < 2e-8, "{corrected_m}");
        assert!((uncalibrated(1e-3 + 1.02 * corrected_m, &values) - 0.105).abs() < 3e-8);
    }

    #[test]
    fn points_are_read() {
        assert_eq!("160mm:0.1612".parse(), Ok(Point { gap_m: 160.0 * 1e-3, sensor_m: 0.1612 }));
        for text in ["160mm", "160mm:x", "1kg:2mm"] {
            assert!(text.parse::<Point>().is_err(), "{text}");
        }
    }
}
