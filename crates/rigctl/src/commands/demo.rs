//! `demo`: the main job. Three loads that the firmware is not told of, each on a fresh emulated board, homed and moved to
//! the same position at the same speed.

use super::operate::{HomeResult, MoveResult, home_session, move_session, sim_options};
use crate::cli::Global;
use crate::failure::Failure;
use crate::output::{Output, folder, write_file};
use crate::session::Session;
use crate::session::row::Row;
use crate::session::sim::{Sim, SimOptions};
use lab::STANDARD_GRAVITY_M_PER_S2;
use lab::csv_text::{csv_text, optional};
use lab::move_figure::{Curve, draw};
use rig_link::LoadChoice;
use serde::Serialize;
use sim_link::{PlantChange, PlantKey};
use std::path::Path;
use std::time::Instant;

/// Loads (kg) and the twist that the strings have when the board starts (rad).
const LOADS: [(f64, f64); 3] = [(0.1, -20.0), (0.5, 8.0), (1.5, 30.0)];
const TARGET_M: f64 = 0.012;
const SPEED_M_PER_S: f64 = 0.002;
/// How long the load is held and watched afterwards (s).
const HOLD_S: f64 = 2.0;

/// Floors: true error at rest (m), load estimate, homing (s), core busy.
const FLOORS: (f64, f64, f64, f64) = (50e-6, 0.08, 45.0, 0.10);

/// One load's result.
#[derive(Debug, Serialize)]
struct Outcome {
    load_kg: f64,
    load_true_n: f64,
    home: HomeResult,
    #[serde(rename = "move")]
    travel: MoveResult,
    motor_turns: f64,
    true_error_at_rest_m: f64,
    core_busy: f64,
    instructions_per_tick_mean: f64,
    instructions_per_tick_max: f64,
    realtime_factor: f64,
    floors_met: bool,
    #[serde(skip)]
    rows: Vec<Row>,
}

/// Runs the command.
///
/// # Errors
/// If anything fails, or a floor is missed.
pub fn run(global: &Global, out: &Path, output: &mut Output) -> Result<(), Failure> {
    let scene = super::rig_scene(global)?;
    if let Some(own) = global.plant.iter().find(|s| [PlantKey::Load, PlantKey::TwistAtBoot].contains(&s.key)) {
        return Err(Failure::Usage(format!("--plant {}: the demo has its own", own.key)));
    }
    folder(out)?;
    let mut outcomes = Vec::new();
    for (load_kg, twist_rad) in LOADS {
        output.line(format!(
            "{load_kg} kg: booting the firmware on a fresh emulated board, strings twisted by {twist_rad} rad …"
        ))?;
        output.flush()?;
        outcomes.push(one(global, load_kg, twist_rad, scene.rig.gear())?);
    }
    output.line("")?;
    output.line(format!(
        "moved to {} mm at {} mm/s; everything below was EMULATED: the firmware's ELF on an emulated board and rig",
        TARGET_M * 1e3,
        SPEED_M_PER_S * 1e3
    ))?;
    output.line(
        "load    true N  estimate N   (error)  TR start  TR end rad/mm  motor turns  homing s  move s  \
         rest error um (true, measured)  core busy  instr/tick mean, max  x real time",
    )?;
    for o in &outcomes {
        let m = &o.travel;
        output.line(format!(
            "{:3.1} kg {:7.3}  {:10.3}  {:+6.1} %  {:8.3}  {:13.3}  {:11.1}  {:8.1}  {:6.2}  {:+15.1}  {:+13.1}  {:7.2} %  {:12.0}, {:6.0}  {:11.1}",
            o.load_kg,
            o.load_true_n,
            m.load_n,
            100.0 * (m.load_n / o.load_true_n - 1.0),
            m.tr_start_rad_per_m * 1e-3,
            m.tr_end_rad_per_m * 1e-3,
            o.motor_turns,
            o.home.duration_s,
            m.duration_s,
            o.true_error_at_rest_m * 1e6,
            m.error_m * 1e6,
            100.0 * o.core_busy,
            o.instructions_per_tick_mean,
            o.instructions_per_tick_max,
            o.realtime_factor
        ))?;
        output.object(o)?;
    }
    let curves: Vec<Curve> = outcomes.iter().map(curve).collect();
    write_file(out, "demo.svg", &draw(&curves)?)?;
    write_file(out, "demo.csv", &csv(&outcomes)?)?;
    output.line(format!("picture: {}   data: {}", out.join("demo.svg").display(), out.join("demo.csv").display()))?;
    if outcomes.iter().all(|o| o.floors_met) {
        Ok(())
    } else {
        Err(Failure::failed("a floor was missed: see the table"))
    }
}

fn one(global: &Global, load_kg: f64, twist_rad: f64, gear: f64) -> Result<Outcome, Failure> {
    let load_true_n = load_kg * STANDARD_GRAVITY_M_PER_S2;
    let mut plant = global.plant.clone();
    plant.push(PlantChange { key: PlantKey::Load, value: load_true_n });
    plant.push(PlantChange { key: PlantKey::TwistAtBoot, value: twist_rad });
    let options = SimOptions { plant, ..sim_options(global)? };
    let started = Instant::now();
    let mut session = Session::new(Box::new(Sim::start(&options)?));
    session.hello()?;
    let home = home_session(&mut session, |_| {})?;
    let mut rows = Vec::new();
    let travel = move_session(&mut session, TARGET_M, SPEED_M_PER_S, LoadChoice::Auto, |row| rows.push(row.clone()))?;
    session.until(HOLD_S, |_| false)?;
    rows.extend(session.take_rows());
    let wall_s = started.elapsed().as_secs_f64();
    let emulated_s = session.now_s();
    let stats = session.emulated().ok_or_else(|| Failure::failed("not an emulated board"))?.stats()?;
    let at_rest = rows.iter().rev().take(100).filter_map(|r| r.true_position_m);
    let true_error_at_rest_m =
        at_rest.map(|p| p - TARGET_M).fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
    let share = (travel.load_n / load_true_n - 1.0).abs();
    let floors_met = true_error_at_rest_m.abs() <= FLOORS.0
        && share <= FLOORS.1
        && home.duration_s <= FLOORS.2
        && stats.core_busy <= FLOORS.3;
    Ok(Outcome {
        load_kg,
        load_true_n,
        home,
        travel,
        motor_turns: travel.turns * gear,
        true_error_at_rest_m,
        core_busy: stats.core_busy,
        instructions_per_tick_mean: stats.instructions_per_tick_mean,
        instructions_per_tick_max: stats.instructions_per_tick_max,
        realtime_factor: emulated_s / wall_s,
        floors_met,
        rows,
    })
}

/// One move of the demo as a picture, with its figures.
///
/// # Errors
/// If there is no emulated board, or the move fails.
pub(super) fn recorded(global: &Global, load_kg: f64, twist_rad: f64) -> Result<(String, Vec<String>), Failure> {
    let o = one(global, load_kg, twist_rad, super::scene(global)?.rig.gear())?;
    let said = vec![
        format!("EMULATED: the firmware's ELF on an emulated board and rig, {load_kg} kg that it was not told of"),
        format!(
            "load estimated {:.3} N, true {:.3} N; homed in {:.1} s",
            o.travel.load_n, o.load_true_n, o.home.duration_s
        ),
        format!("error at rest {:+.1} um; core busy {:.2} %", o.true_error_at_rest_m * 1e6, 100.0 * o.core_busy),
    ];
    Ok((draw(&[curve(&o)])?, said))
}

fn curve(o: &Outcome) -> Curve {
    let start_s = o.rows.first().map_or(0.0, |r| r.t_s);
    let t = |r: &Row| r.t_s - start_s;
    Curve {
        label: format!("{} kg", o.load_kg),
        position_mm: o.rows.iter().filter_map(|r| r.true_position_m.map(|p| (t(r), p * 1e3))).collect(),
        set_point_mm: o.rows.iter().filter_map(|r| r.setpoint_m.map(|p| (t(r), f64::from(p) * 1e3))).collect(),
        motor_rpm: o
            .rows
            .iter()
            .map(|r| (t(r), f64::from(r.drive_speed_rad_per_s) * 60.0 / std::f64::consts::TAU))
            .collect(),
        tr_rad_per_mm: o.rows.iter().filter_map(|r| r.tr_rad_per_m.map(|v| (t(r), f64::from(v) * 1e-3))).collect(),
    }
}

fn csv(outcomes: &[Outcome]) -> Result<String, Failure> {
    let header = [
        "load_kg",
        "t_s",
        "setpoint_m",
        "position_m",
        "true_position_m",
        "twist_rad",
        "load_n",
        "tr_rad_per_m",
        "drive_speed_rad_per_s",
    ];
    let number = |v: Option<f32>| optional(v.map(f64::from));
    let lines = outcomes.iter().flat_map(|o| {
        o.rows.iter().map(move |r| {
            vec![
                o.load_kg.to_string(),
                format!("{:.6}", r.t_s),
                number(r.setpoint_m),
                number(r.position_m),
                optional(r.true_position_m),
                number(r.twist_rad),
                number(r.load_n),
                number(r.tr_rad_per_m),
                r.drive_speed_rad_per_s.to_string(),
            ]
        })
    });
    Ok(format!("# emulated: firmware ELF on an emulated board and rig\n{}", csv_text(&header, lines)?))
}
