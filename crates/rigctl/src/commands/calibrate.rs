//! `calibrate`: the LVDT against callipers, and where position 0 is.

use super::config::{all, hints};
use super::operate::{connect, home_session, is_sim, print_home};
use crate::cli::{Calibrate, Global};
use crate::failure::Failure;
use crate::output::Output;
use crate::session::Session;
use crate::settings::decimal;
use crate::units::{self, Quantity};
use rig_link::{Request, Setting, SettingValues};
use serde_json::json;

/// Least distance of two points (m): callipers read to 20 µm, which is then 0.4 % of gain.
const APART_M: f64 = 5e-3;
/// Telemetry messages that the present position is the mean of.
const POSITIONS: f64 = 30.0;

/// A true gap, and what the sensor showed there by the scene's numbers.
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
fn fit(point: Point, other: Option<Point>, gain: f64) -> Result<(f64, f64), Failure> {
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

/// The command.
///
/// # Errors
/// The board's refusal in words, or points that make no calibration.
pub fn run(global: &Global, what: &Calibrate, output: &mut Output) -> Result<(), Failure> {
    match what {
        Calibrate::Lvdt { gap, point } => lvdt(global, *gap, *point, output),
        Calibrate::Zero => zero(global, output),
    }
}

/// What the sensor shows by the scene's numbers (m), where the board shows a gap.
fn uncalibrated(gap_m: f64, values: &SettingValues) -> f64 {
    (gap_m - f64::from(values.get(Setting::LvdtOffset))) / f64::from(values.get(Setting::LvdtGain))
}

fn lvdt(global: &Global, gap: Option<f64>, other: Option<Point>, output: &mut Output) -> Result<(), Failure> {
    let mut session = connect(global)?;
    session.wait_started()?;
    let values = session.settings()?.values;
    let shown_m = session.gap_m()?;
    let sensor_m = uncalibrated(shown_m, &values);
    let truth_m = session.true_gap_m();
    let Some(gap_m) = gap else {
        output.object(&json!({"gap_m": shown_m, "sensor_m": sensor_m, "true_gap_m": truth_m}))?;
        output.line(format!(
            "gap {:.3} mm as calibrated, {:.3} mm uncalibrated; nothing changed",
            shown_m * 1e3,
            sensor_m * 1e3
        ))?;
        if let Some(truth_m) = truth_m {
            output.line(format!("true (emulated rig) {:.3} mm", truth_m * 1e3))?;
        }
        output.line("measure the gap between the clamps with callipers, then: rigctl calibrate lvdt --gap GAP")?;
        return Ok(());
    };
    let point = Point { gap_m, sensor_m };
    let (offset_m, gain) = fit(point, other, f64::from(values.get(Setting::LvdtGain)))?;
    let new = values.with(Setting::LvdtOffset, offset_m as f32).with(Setting::LvdtGain, gain as f32);
    let unhomed = session.set(&Request::SetSettings(new))?;
    let after_m = session.gap_m()?;
    output.object(&json!({
        "gap_m": gap_m, "sensor_m": sensor_m, "error_before_m": shown_m - gap_m, "error_after_m": after_m - gap_m,
        "lvdt_offset_m": decimal(new.get(Setting::LvdtOffset)), "lvdt_gain": decimal(new.get(Setting::LvdtGain)),
        "true_gap_m": truth_m, "kept": true, "unhomed": unhomed, "settings": all(&new),
    }))?;
    output.line(format!(
        "the board showed {:.3} mm at {:.3} mm ({:+.3} mm), now {:.3} mm: lvdt-offset {:+.3} mm, lvdt-gain {:.5}, kept in flash",
        shown_m * 1e3,
        gap_m * 1e3,
        (shown_m - gap_m) * 1e3,
        after_m * 1e3,
        offset_m * 1e3,
        gain
    ))?;
    if other.is_none() {
        output.line(format!(
            "one point gives the offset. For the gain too bring the load to a gap {} mm or more from this one (`rigctl jog`),\n\
             measure there, and: rigctl calibrate lvdt --gap GAP --point {:.6}m:{:.6}m",
            APART_M * 1e3,
            gap_m,
            sensor_m
        ))?;
    }
    hints(global, &session, unhomed, output)
}

fn position(session: &mut Session) -> Result<f64, Failure> {
    session.take_rows();
    session.until(0.01 * (POSITIONS + 0.5), |_| false)?;
    let positions: Vec<f64> = session.take_rows().iter().filter_map(|row| row.position_m.map(f64::from)).collect();
    if positions.is_empty() {
        return Err(Failure::failed("the position is not known: `rigctl home` first"));
    }
    Ok(positions.iter().sum::<f64>() / positions.len() as f64)
}

fn zero(global: &Global, output: &mut Output) -> Result<(), Failure> {
    let mut session = connect(global)?;
    session.wait_ready()?;
    if is_sim(global) {
        eprintln!("the emulated board starts afresh and is not homed: homing first");
        let result = home_session(&mut session, |_| {})?;
        print_home(&result, output)?;
    }
    let before_m = position(&mut session)?;
    let old_m = f64::from(session.settings()?.values.get(Setting::PositionZero));
    let value = (old_m + before_m) as f32;
    session.set(&Request::SetSetting { setting: Setting::PositionZero, value })?;
    let after_m = position(&mut session)?;
    output.object(&json!({"position_before_m": before_m, "position_m": after_m, "position_zero_m": decimal(value),
        "kept": true}))?;
    output.line(format!(
        "position was {:.3} mm and is {:+.3} mm now: 0 is {:+.3} mm from where the load hangs at the half-turn pre-twist; \
         kept in flash",
        before_m * 1e3,
        after_m * 1e3,
        f64::from(value) * 1e3
    ))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn points_are_read() {
        assert_eq!("160mm:0.1612".parse(), Ok(Point { gap_m: 160.0 * 1e-3, sensor_m: 0.1612 }));
        for text in ["160mm", "160mm:x", "1kg:2mm"] {
            assert!(text.parse::<Point>().is_err(), "{text}");
        }
    }
}
