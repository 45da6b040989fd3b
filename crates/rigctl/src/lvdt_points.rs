//! The LVDT's calibration by points that callipers or gauges measure: one or two give offset and gain, several a curve, which is
//! read from a file and stands as text in files of settings.

use crate::csv_text::columns;
use crate::failure::Failure;
use crate::units::{self, Quantity};
use crate::units::{MM, UM};
use rig_config::RigConfig;
use rig_link::{CurveFlaw, LVDT_POINTS_MAX, LvdtCurve, Setting, SettingValues};
use serde_json::{Value, json};
use std::path::Path;

/// The name of the points among the settings.
pub const NAME: &str = rig_link::board_settings::LVDT_POINTS;
/// Half width of the interval that holds 90 of 100 normally distributed errors, over their standard deviation.
const HALF_WIDTH: f64 = 1.645;

/// Minimum distance of two points (m): callipers read to 20 µm, which is then 0.4 % of gain.
pub const APART_M: f64 = 5e-3;

/// To this (m) a gap is shown: what the sensor resolves.
pub const GAP_M: f64 = 10e-6;

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
                    "--point is {} from here by callipers and {} by the sensor: for the gain they must be {} apart or more",
                    MM.show(gaps_m.abs()),
                    MM.show(sensor_m.abs()),
                    MM.exact(APART_M)
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

/// Reads a file with the columns `gap_m` (by gauges) and `sensor_m` (uncalibrated) for a rig whose gauges are good to
/// `gauge_error_m` (m, half the width of the interval that holds the truth in 90 of 100 cases).
///
/// # Errors
/// Naming the file, and where it can the lines: it cannot be read, is of another kind, or its points are no calibration of
/// this sensor.
pub fn load(path: &Path, rig: &RigConfig, gauge_error_m: f64) -> Result<LvdtCurve, Failure> {
    let text = rig_config::files::read_to_string(path).map_err(|e| e.to_string());
    let curve = text.and_then(|text| parse(&text)).and_then(|points| curve(points, rig, gauge_error_m));
    curve.map_err(|e| Failure::failed(format!("points file {}: {e}", path.display())))
}

/// The points of a text, each with its line.
fn parse(text: &str) -> Result<Vec<(usize, Point)>, String> {
    let rows = columns(text, ["gap_m", "sensor_m"])?;
    rows.into_iter().map(|(line, row)| row.map(|[gap_m, sensor_m]| (line, Point { gap_m, sensor_m }))).collect()
}

/// The curve through points, each with the line that it stands in; as [`load`].
///
/// # Errors
/// In words, naming the lines where it can.
pub fn curve(mut points: Vec<(usize, Point)>, rig: &RigConfig, gauge_error_m: f64) -> Result<LvdtCurve, String> {
    let ends = [rig.lvdt_gap_at_zero_m, rig.lvdt_gap_at_zero_m + rig.lvdt_stroke_m];
    for (line, point) in &points {
        if !(ends[0]..=ends[1]).contains(&point.sensor_m) {
            let (sensor_m, stroke) = (point.sensor_m, MM.range(ends));
            return Err(format!("line {line}: sensor_m {sensor_m} lies outside the sensor's stroke, {stroke}"));
        }
    }
    points.sort_by(|(_, a), (_, b)| a.sensor_m.total_cmp(&b.sensor_m));
    let pairs: Vec<[f32; 2]> = points.iter().map(|(_, p)| [p.sensor_m as f32, (p.gap_m - p.sensor_m) as f32]).collect();
    let error_m = gauge_error_m.hypot(HALF_WIDTH * between(&points)) as f32;
    LvdtCurve::new(&pairs, error_m).map_err(|flaw| match flaw {
        CurveFlaw::Count => format!("{flaw}, and there are {}", points.len()),
        flaw => {
            // Where it is wrong: at the first two neighbours that are no calibration by themselves.
            let wrong = pairs.windows(2).position(|pair| LvdtCurve::new(pair, error_m).is_err());
            wrong.map_or(flaw.to_string(), |k| format!("lines {} and {}: {flaw}", points[k].0, points[k + 1].0))
        }
    })
}

/// Standard deviation (m) of what the points cannot show between them. A point is predicted from its two neighbours; over
/// half of that distance a smooth curve deviates by a quarter.
fn between(points: &[(usize, Point)]) -> f64 {
    let off = |w: &[(usize, Point)]| {
        let [low, here, high] = [w[0].1, w[1].1, w[2].1];
        let correction = |p: Point| p.gap_m - p.sensor_m;
        let fraction = (here.sensor_m - low.sensor_m) / (high.sensor_m - low.sensor_m);
        correction(here) - correction(low) - fraction * (correction(high) - correction(low))
    };
    let squares: Vec<f64> = points.windows(3).map(|w| (0.25 * off(w)).powi(2)).collect();
    if squares.is_empty() { 0.0 } else { (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() }
}

/// The points as text: `READING:CORRECTION` of each, then `error` and the stated error; all in metres.
pub fn text(curve: &LvdtCurve) -> String {
    let points = curve.points().iter().map(|[sensor_m, correction_m]| format!("{sensor_m}:{correction_m} "));
    format!("{}error {}", points.collect::<String>(), curve.error_m())
}

/// The points of such a text.
///
/// # Errors
/// In words, if it is none.
pub fn from_text(text: &str) -> Result<LvdtCurve, String> {
    let number = |text: &str| text.trim().parse::<f32>().map_err(|_| format!("{NAME}: `{text}` is not a number"));
    let (points, error) = text.rsplit_once("error").ok_or_else(|| format!("{NAME}: `{text}` has no `error`"))?;
    let points: Vec<[f32; 2]> = points
        .split_whitespace()
        .map(|point| {
            let (sensor, correction) = point.split_once(':').ok_or_else(|| format!("{NAME}: `{point}` has no `:`"))?;
            Ok([number(sensor)?, number(correction)?])
        })
        .collect::<Result<_, String>>()?;
    LvdtCurve::new(&points, number(error)?).map_err(|flaw| format!("{NAME}: {flaw}"))
}

/// The points for machines.
pub fn object(curve: &LvdtCurve) -> Value {
    let decimal = crate::output::decimal;
    let points = curve.points().iter().map(
        |[sensor_m, correction_m]| json!({"sensor_m": decimal(*sensor_m), "correction_m": decimal(*correction_m)}),
    );
    json!({"points": points.collect::<Vec<_>>(), "lvdt_error_m": decimal(curve.error_m())})
}

/// The points in words.
pub fn words(curve: &LvdtCurve) -> String {
    let points = curve.points();
    let max_m = points.iter().map(|[_, correction_m]| correction_m.abs()).fold(0.0, f32::max);
    format!(
        "{} of at most {LVDT_POINTS_MAX}, readings of {}, corrected by up to {}",
        points.len(),
        MM.range([points.first(), points.last()].map(|point| point.map(|p| p[0]))),
        UM.within(max_m, curve.error_m())
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<LvdtCurve, String> {
        curve(parse(text)?, &RigConfig::default(), 20e-6)
    }

    #[test]
    fn a_file_in_any_order_becomes_a_curve_through_its_points() {
        let curve = read("sensor_m,gap_m,note\n0.11,0.1102,b\n0.1,0.1001,a\n0.12,0.1199,c\n").expect("a curve");
        for (sensor_m, gap_m) in [(0.1f32, 0.1001f32), (0.11, 0.1102), (0.12, 0.1199)] {
            assert!((curve.gap_m(sensor_m) - gap_m).abs() < 2e-8, "{sensor_m}");
        }
    }

    /// Straight between them: the gauges' error alone. A bend of 0.2 mm off the neighbours' line: a quarter of it as well.
    #[test]
    fn the_stated_error_is_that_of_the_gauges_and_of_what_lies_between() {
        let straight = read("gap_m,sensor_m\n0.1,0.1\n0.11,0.11\n0.12,0.12\n").expect("a curve");
        assert!((straight.error_m() - 20e-6).abs() < 1e-9);
        let bent = read("gap_m,sensor_m\n0.1,0.1\n0.1102,0.11\n0.12,0.12\n").expect("a curve");
        assert!((f64::from(bent.error_m()) - 20e-6f64.hypot(1.645 * 50e-6)).abs() < 1e-8, "{}", bent.error_m());
    }

    #[test]
    fn what_is_no_calibration_is_refused_by_name() {
        let many: String = (0..12).map(|k| format!("{0},{0}\n", 0.1 + 0.002 * f64::from(k))).collect();
        for (rows, named) in [
            ("0.1,0.1\n", &["2 to 11", "there are 1"][..]),
            (&many, &["2 to 11", "there are 12"]),
            ("0.1,0.1\n0.12,0.11\n0.115,0.12\n", &["lines 3 and 4", "not monotonic"]),
            ("0.12,0.1\n0.11,0.11\n0.1,0.12\n", &["lines 2 and 3", "wrong sign"]),
            ("0.12,0.12\n0.1,0.1\n0.1005,0.1005\n", &["lines 3 and 4", "less than 1 mm apart"]),
            ("0.1,0.1\n0.205,0.201\n", &["line 3", "outside the sensor's stroke", "200 mm"]),
            ("101.0,0.1\n102.0,0.11\n", &["more than twice"]),
            ("0.1,0.1\nten,0.11\n", &["line 3", "gap_m `ten`"]),
            ("nan,0.1\n0.11,0.11\n", &["not finite"]),
            ("0.1,0.1,0.1\n", &["line 2", "3 cells"]),
        ] {
            let error = read(&format!("gap_m,sensor_m\n{rows}")).expect_err(rows);
            assert!(named.iter().all(|part| error.contains(part)), "{rows}: {error}");
        }
        for other in ["", "load_n,turns\n1,2\n", "# format = tsa-log 1\nt_s,state\n"] {
            assert!(read(other).expect_err(other).contains("no column `gap_m`"), "{other}");
        }
    }

    #[test]
    fn text_is_read_back_to_the_last_bit() {
        let curve = read("gap_m,sensor_m\n0.1000123,0.1\n0.11017,0.1100007\n0.12,0.12\n").expect("a curve");
        assert_eq!(from_text(&text(&curve)), Ok(curve));
        for (wrong, named) in [
            ("0.1:0 0.11:0", "no `error`"),
            ("0.1 0.11:0 error 0", "has no `:`"),
            ("0.1:x 0.11:0 error 0", "`x`"),
            ("0.1:0 error 0", "2 to 11"),
            ("0.1:0 0.11:0 error", "not a number"),
        ] {
            assert!(from_text(wrong).expect_err(wrong).contains(named), "{wrong}");
        }
    }

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
        assert!(near.is_some_and(|message| message.contains("--point") && message.contains("2.000 mm")));
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
