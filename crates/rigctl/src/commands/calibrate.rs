//! `calibrate`: the LVDT against callipers, and where position 0 is.

use super::motion::home_first;
use crate::board_settings::{self, all};
use crate::failure::Failure;
use crate::lvdt_points::{self, APART_M, GAP_M, Point, corrected, fit, uncalibrated};
use crate::options::Global;
use crate::options::values::{self, gauge_error};
use crate::output::{Output, decimal};
use crate::session::{Session, Wanted};
use crate::units::{MM, NUMBER, Quantity};
use clap::Subcommand;
use rig_config::RigConfig;
use rig_link::{LoadChoice, LvdtCurve, Request, Setting, SettingValues};
use serde_json::json;
use std::path::PathBuf;

/// Telemetry messages over which the present position is averaged.
const POSITIONS: f64 = 30.0;

/// What to calibrate.
#[derive(Debug, Clone, Subcommand)]
pub enum Calibrate {
    /// The LVDT, by the gap between the clamps as callipers measure it: one gap gives the offset, a second one the gain;
    /// or by up to 11 gaps in a file. Without options it only prints the reading
    Lvdt {
        /// The true gap now (m, mm)
        #[arg(long, value_name = "GAP", allow_hyphen_values = true, value_parser = values::of("gap", Quantity::Length))]
        gap: Option<f64>,
        /// A gap that was measured before (m, mm), and the uncalibrated reading of the sensor there: the first call prints both
        #[arg(long, value_name = "GAP:SENSOR", requires = "gap")]
        point: Option<Point>,
        /// Gauges' gaps at 2 to 11 places, at least 1 mm apart: a file with the columns gap_m and sensor_m (uncalibrated, as
        /// this command prints it without options). Between them the board interpolates; offset and gain become 0 and 1
        #[arg(long, value_name = "FILE.csv", conflicts_with = "gap")]
        points: Option<PathBuf>,
        /// How far a gap of --points may be from the true one: half the width of the interval that holds the truth in 90 of
        /// 100 cases (m, mm, µm)
        #[arg(long, value_name = "E", default_value = "20um", requires = "points", value_parser = gauge_error)]
        gauge_error: f64,
        /// Forget the points of --points
        #[arg(long, conflicts_with_all = ["gap", "points"])]
        no_points: bool,
    },
    /// The present position becomes 0, now and whenever the rig is homed
    Zero,
}

/// Runs the command.
///
/// # Errors
/// The board's refusal in words, or points that make no calibration.
pub fn run(global: &Global, what: &Calibrate, output: &mut Output) -> Result<(), Failure> {
    let scene = global.scene()?;
    if let Calibrate::Lvdt { points: Some(file), gauge_error, .. } = what {
        // Before a board is asked: a file that is no calibration.
        lvdt_points::load(file, &scene.rig, *gauge_error)?;
    }
    if let Calibrate::Lvdt { gap: Some(gap_m), .. } = what
        && *gap_m <= 0.0
    {
        return Err(Failure::Usage(format!("--gap {}: must be above 0", MM.exact(*gap_m))));
    }
    let mut session = global.target()?.connect(Wanted::OfScene)?;
    session.wait_started()?;
    if matches!(what, Calibrate::Zero) && global.is_emulated() {
        home_first(&mut session, LoadChoice::Auto, output)?;
    }
    of(&mut session, &scene.rig, what, global.flash_lasts(), output)
}

/// The same in a session that has begun; `lasts`: the board's flash outlives it.
///
/// # Errors
/// As [`run`].
pub fn of(
    session: &mut Session,
    rig: &RigConfig,
    what: &Calibrate,
    lasts: bool,
    output: &mut Output,
) -> Result<(), Failure> {
    match what {
        Calibrate::Lvdt { points: Some(file), gauge_error, .. } => {
            let curve = lvdt_points::load(file, rig, *gauge_error)?;
            points(session, Some(curve), lasts, output)
        }
        Calibrate::Lvdt { no_points: true, .. } => points(session, None, lasts, output),
        Calibrate::Lvdt { gap, point, .. } => lvdt(session, *gap, *point, lasts, output),
        Calibrate::Zero => zero(session, lasts, output),
    }
}

fn lvdt(
    session: &mut Session,
    gap: Option<f64>,
    other: Option<Point>,
    lasts: bool,
    output: &mut Output,
) -> Result<(), Failure> {
    let values = session.settings()?.values;
    let shown_m = session.gap_m()?;
    let sensor_m = uncalibrated(shown_m, &values);
    let truth_m = session.truth.newest().map(|t| t.gap_m);
    let Some(gap_m) = gap else {
        output.object(&json!({"gap_m": shown_m, "sensor_m": sensor_m, "true_gap_m": truth_m}))?;
        output.line(format!(
            "gap {} as calibrated, {} uncalibrated; nothing changed",
            shown(shown_m),
            shown(sensor_m)
        ))?;
        if let Some(curve) = &values.lvdt_curve {
            output.line(format!("{}: {}", lvdt_points::NAME, lvdt_points::words(curve)))?;
        }
        if let Some(truth_m) = truth_m {
            output.line(format!("true (emulated) {}", shown(truth_m)))?;
        }
        output.line("measure the gap between the clamps with callipers, then: rigctl calibrate lvdt --gap GAP")?;
        return Ok(());
    };
    let point = Point { gap_m, sensor_m };
    let on_curve = |point: Point| corrected(point, &values);
    let gain = f64::from(values.get(Setting::LvdtGain));
    let (offset_m, gain) = fit(on_curve(point), other.map(on_curve), gain)?;
    let new = values.with(Setting::LvdtOffset, offset_m as f32).with(Setting::LvdtGain, gain as f32);
    let unhomed = session.set(&Request::SetSettings(new))?;
    let after_m = session.gap_m()?;
    output.object(&json!({
        "gap_m": gap_m, "sensor_m": sensor_m, "error_before_m": shown_m - gap_m, "error_after_m": after_m - gap_m,
        "lvdt_offset_m": decimal(new.get(Setting::LvdtOffset)), "lvdt_gain": decimal(new.get(Setting::LvdtGain)),
        "true_gap_m": truth_m, "kept": true, "unhomed": unhomed, "settings": all(&new),
    }))?;
    output.line(format!(
        "the board showed {} at {} (off by {}), now {}: lvdt-offset {}, lvdt-gain {}, kept in flash",
        shown(shown_m),
        shown(gap_m),
        shown(shown_m - gap_m),
        shown(after_m),
        shown(offset_m),
        NUMBER.exact(gain)
    ))?;
    if other.is_none() {
        output.line(format!(
            "one point gives the offset. For the gain too bring the load to a gap {} or more from this one (`rigctl jog`),\n\
             measure there, and: rigctl calibrate lvdt --gap GAP --point {}mm:{}mm",
            MM.exact(APART_M),
            MM.number(gap_m, GAP_M),
            MM.number(sensor_m, GAP_M)
        ))?;
    }
    Ok(board_settings::next_steps(session, lasts, unhomed, output)?)
}

/// Stores points, or forgets them.
fn points(session: &mut Session, curve: Option<LvdtCurve>, lasts: bool, output: &mut Output) -> Result<(), Failure> {
    let mut values = session.settings()?.values;
    if curve.is_some() {
        values = values.with(Setting::LvdtOffset, 0.0).with(Setting::LvdtGain, 1.0);
    }
    let before_m = session.gap_m()?;
    let unhomed = session.set(&Request::SetSettings(SettingValues { lvdt_curve: curve, ..values }))?;
    let after_m = session.gap_m()?;
    let truth_m = session.truth.newest().map(|t| t.gap_m);
    let mut object = curve.as_ref().map_or(json!({"points": []}), lvdt_points::object);
    for (key, value) in [
        ("gap_before_m", json!(before_m)),
        ("gap_m", json!(after_m)),
        ("true_gap_m", json!(truth_m)),
        ("kept", json!(true)),
        ("unhomed", json!(unhomed)),
    ] {
        object[key] = value;
    }
    output.object(&object)?;
    output.line(format!(
        "{}: {}; kept in flash. The board showed {}, now {}",
        lvdt_points::NAME,
        curve.as_ref().map_or("none".to_owned(), lvdt_points::words),
        shown(before_m),
        shown(after_m)
    ))?;
    Ok(board_settings::next_steps(session, lasts, unhomed, output)?)
}

/// A gap for people, as far as the sensor resolves it.
fn shown(gap_m: f64) -> String {
    MM.rounded(gap_m, GAP_M)
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

fn zero(session: &mut Session, lasts: bool, output: &mut Output) -> Result<(), Failure> {
    session.wait_ready()?;
    let before_m = position(session)?;
    let old_m = f64::from(session.settings()?.values.get(Setting::PositionZero));
    let value = (old_m + before_m) as f32;
    let unhomed = session.set(&Request::SetSetting { setting: Setting::PositionZero, value })?;
    let after_m = position(session)?;
    output.object(&json!({"position_before_m": before_m, "position_m": after_m, "position_zero_m": decimal(value),
        "kept": true}))?;
    output.line(format!(
        "position was {} and is {} now: position 0 is {} above where the load hangs at the half-turn pre-twist; kept in flash",
        shown(before_m),
        shown(after_m),
        shown(value.into())
    ))?;
    Ok(board_settings::next_steps(session, lasts, unhomed, output)?)
}
