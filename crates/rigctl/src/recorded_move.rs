//! A load that the firmware does not know, homed and moved on a fresh emulated board, with its telemetry; and such moves as a
//! picture: position, motor speed and TR over one time axis.

use crate::failure::Failure;
use crate::plot::{Axis, Block, Figure, GREY, Item, KeyRow, Panel, Pen, Sample, colour, extent};
use crate::session::Session;
use crate::session::homing::{HomeResult, home};
use crate::session::motion::{MoveResult, move_to};
use crate::session::row::Row;
use crate::session::sim::{Sim, SimOptions};
use crate::units::KG;
use rig_link::LoadChoice;
use rig_plant::units::STANDARD_GRAVITY as STANDARD_GRAVITY_M_PER_S2;
use rig_plant::{PlantChange, PlantKey};
use serde::Serialize;
use std::f64::consts::TAU;
use std::time::Instant;

/// Target of the move (m).
pub const TARGET_M: f64 = 0.012;
/// Its speed (m/s).
pub const SPEED_M_PER_S: f64 = 0.002;
/// How long the load is held and watched afterwards (s).
const HOLD_S: f64 = 2.0;
/// Limits that the demo must meet: measured error at rest (m), homing (s), share of busy time.
const FLOORS: (f64, f64, f64) = (50e-6, 45.0, 0.10);
/// Limit of a true error over the stated one, which holds 90 of 100 cases only: 3.3 standard errors.
const STATED: f64 = 2.0;

/// One load's result.
#[derive(Debug, Serialize)]
pub struct RecordedMove {
    /// Load (kg).
    pub load_kg: f64,
    /// Load (N).
    pub load_true_n: f64,
    /// How homing ended.
    pub home: HomeResult,
    /// How the move ended.
    #[serde(rename = "move")]
    pub travel: MoveResult,
    /// Turns of the motor shaft.
    pub motor_turns: f64,
    /// Largest true error while the load is held (m).
    pub true_error_at_rest_m: f64,
    /// Fraction of the time that the core was not asleep.
    pub core_busy: f64,
    /// Mean instructions of a control tick.
    pub instructions_per_tick_mean: f64,
    /// Maximum instructions of a control tick.
    pub instructions_per_tick_max: f64,
    /// Emulated time over wall-clock time.
    pub realtime_factor: f64,
    /// Whether every limit of the demo is met.
    pub floors_met: bool,
    /// Telemetry of the move and of the hold.
    #[serde(skip)]
    pub rows: Vec<Row>,
}

/// Boots a fresh board, homes, moves and holds; `twist_rad` is the twist of the strings at the start, `gear` the ratio of
/// the motor's gear.
///
/// # Errors
/// If there is no emulated board, or homing or the move fails.
pub fn record(options: &SimOptions, load_kg: f64, twist_rad: f64, gear: f64) -> Result<RecordedMove, Failure> {
    let load_true_n = load_kg * STANDARD_GRAVITY_M_PER_S2;
    let mut options = options.clone();
    options.plant.push(PlantChange { key: PlantKey::Load, value: load_true_n });
    options.plant.push(PlantChange { key: PlantKey::TwistAtBoot, value: twist_rad });
    let started = Instant::now();
    let mut session = Session::new(Box::new(Sim::start(&options)?));
    session.greet()?;
    let home = home(&mut session, LoadChoice::Auto, |_| {})?;
    let mut rows = Vec::new();
    let travel = move_to(&mut session, TARGET_M, SPEED_M_PER_S, LoadChoice::Auto, |row| rows.push(row.clone()))?;
    session.until(HOLD_S, |_| false)?;
    rows.extend(session.take_rows());
    let wall_s = started.elapsed().as_secs_f64();
    let emulated_s = session.now_s();
    let stats = session.emulated().ok_or_else(|| Failure::failed("not an emulated board"))?.stats()?;
    let at_rest = rows.iter().rev().take(100).filter_map(|r| r.true_position_m);
    let true_error_at_rest_m =
        at_rest.map(|p| p - TARGET_M).fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
    let covered =
        |error: f64, stated: Option<f32>| stated.is_some_and(|stated| error.abs() <= STATED * f64::from(stated));
    // Stiction may leave more than that, which the board tells.
    let left_m = session.sensors()?.rest_tolerance_m.map_or(0.0, f64::from);
    let floors_met = travel.error_m.abs() <= FLOORS.0.max(left_m)
        && covered(true_error_at_rest_m - travel.error_m, travel.position_error_m)
        && covered(travel.load_n - load_true_n, travel.load_error_n)
        && home.duration_s <= FLOORS.1
        && stats.core_busy <= FLOORS.2;
    Ok(RecordedMove {
        load_kg,
        load_true_n,
        home,
        motor_turns: travel.turns * gear,
        travel,
        true_error_at_rest_m,
        core_busy: stats.core_busy,
        instructions_per_tick_mean: stats.instructions_per_tick_mean,
        instructions_per_tick_max: stats.instructions_per_tick_max,
        realtime_factor: emulated_s / wall_s,
        floors_met,
        rows,
    })
}

const SET_POINT: Pen = Pen { colour: GREY, width: 1, dashed: true };

/// Moves, each with its load (kg), as a picture: SVG.
///
/// # Errors
/// If the drawing library fails.
pub fn draw(moves: &[(f64, &[Row])]) -> anyhow::Result<String> {
    let pen = |k| Pen::solid(colour(k, moves.len()));
    let load = |(k, (load_kg, _)): (usize, &(f64, &[Row]))| KeyRow::sample(Sample::Line(pen(k)), KG.exact(*load_kg));
    let mut key: Vec<KeyRow> = moves.iter().enumerate().map(load).collect();
    key.push(KeyRow::sample(Sample::Line(SET_POINT), "set-point"));
    // Time from the start of the move.
    let curve = |rows: &[Row], value: fn(&Row) -> Option<f64>| -> Vec<(f64, f64)> {
        let start_s = rows.first().map_or(0.0, |row| row.t_s);
        rows.iter().filter_map(|row| Some((row.t_s - start_s, value(row)?))).collect()
    };
    let panel = |title: &str, unit: &str, time: &str, value: fn(&Row) -> Option<f64>| {
        let curves: Vec<_> = moves.iter().map(|(_, rows)| curve(rows, value)).collect();
        let points = || curves.iter().flatten();
        Panel {
            title: title.into(),
            x: Axis::linear(time, extent(points().map(|p| p.0).chain([0.0]))),
            y: Axis::linear(unit, extent(points().map(|p| p.1).chain([0.0]))),
            items: curves.into_iter().enumerate().map(|(k, points)| Item::Line { points, pen: pen(k) }).collect(),
        }
    };
    let mut position = panel("Position of the load", "mm", "", |row| Some(row.true_position_m? * 1e3));
    if let Some((_, rows)) = moves.first() {
        let points = curve(rows, |row| Some(f64::from(row.setpoint_m?) * 1e3));
        position.items.insert(0, Item::Line { points, pen: SET_POINT });
    }
    let time = "time from the start of the move, s";
    Figure {
        heading: match moves.len() {
            1 => "A load that the firmware does not know: 12 mm at 2 mm/s (emulated board and rig)".into(),
            _ => "One firmware, three loads that it does not know: 12 mm at 2 mm/s (emulated board and rig)".into(),
        },
        rows: vec![
            vec![position],
            vec![panel("Motor speed", "rpm", "", |row| Some(f64::from(row.drive_speed_rad_per_s?) * 60.0 / TAU))],
            vec![panel("Transmission ratio at the estimated load", "rad/mm", time, |row| {
                Some(f64::from(row.tr_rad_per_m?) * 1e-3)
            })],
        ],
        panel_size: (1000, 300),
        // Side by side: one line of the picture.
        blocks: key.into_iter().map(|row| Block { rows: vec![row] }).collect(),
        notes: Vec::new(),
    }
    .svg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::telemetry;

    #[test]
    fn three_panels_and_a_key() {
        let row = |k: u32| Row {
            true_position_m: Some(0.01),
            setpoint_m: Some(0.01),
            tr_rad_per_m: Some(2000.0),
            ..Row::new(0.1 * f64::from(k), &telemetry(0), None, None)
        };
        let rows: Vec<Row> = (0..50).map(row).collect();
        let svg = draw(&[1.0, 2.0, 3.0].map(|load_kg| (load_kg, &rows[..]))).unwrap();
        for text in ["1 kg", "2 kg", "3 kg", "set-point", "Position", "Motor speed", "rad/mm", "time from the start"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
