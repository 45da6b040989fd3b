//! `demo`: three loads that the firmware does not know, each on a fresh emulated board, homed and moved to the same
//! position at the same speed.

use crate::failure::Failure;
use crate::options::Global;
use crate::out_file::{folder, write_file};
use crate::output::Output;
use crate::recorded_move::{RecordedMove, SPEED_M_PER_S, TARGET_M, draw, record};
use crate::session::sim::SimOptions;
use clap::Args;
use rig_plant::PlantKey;
use std::path::PathBuf;

/// Loads (kg) and the twist that the strings have when the board starts (rad).
const LOADS: [(f64, f64); 3] = [(0.1, -20.0), (0.5, 8.0), (1.5, 30.0)];

/// Home and move three loads, each on an emulated board: a table and a picture
#[derive(Debug, Args)]
pub struct Demo {
    /// Folder for demo.svg and demo.csv
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// If anything fails, or a floor is missed.
pub fn run(global: &Global, Demo { out }: &Demo, output: &mut Output) -> Result<(), Failure> {
    global.never_a_device()?;
    let scene = global.rig_config()?;
    if let Some(own) = global.board.plant.iter().find(|s| [PlantKey::Load, PlantKey::TwistAtBoot].contains(&s.key)) {
        return Err(Failure::Usage(format!("--plant {}: the demo has its own", own.key)));
    }
    let options = global.emulated()?;
    folder(out)?;
    let mut outcomes = Vec::new();
    for (load_kg, twist_rad) in LOADS {
        output.line(format!(
            "{load_kg} kg: booting the firmware on a fresh emulated board, strings twisted by {twist_rad} rad …"
        ))?;
        output.flush()?;
        outcomes.push(record(&options, load_kg, twist_rad, scene.rig.gear())?);
    }
    output.line("")?;
    output.line(format!(
        "moved to {} mm at {} mm/s; everything below was EMULATED: the firmware's ELF on an {options}",
        TARGET_M * 1e3,
        SPEED_M_PER_S * 1e3
    ))?;
    output.line(
        "load    true N     estimate N    (error)  TR start  TR end rad/mm  motor turns  homing s  move s  \
         rest error um: measured, true  core busy  instr/tick mean, max  x real time",
    )?;
    for o in &outcomes {
        let m = &o.travel;
        output.line(format!(
            "{:3.1} kg {:7.3}  {:6.3} ± {:5.3}  {:+6.1} %  {:8.3}  {:13.3}  {:11.1}  {:8.1}  {:6.2}  {:+12.1} ± {:3.0}, {:+9.1}  {:7.2} %  {:12.0}, {:6.0}  {:11.1}",
            o.load_kg,
            o.load_true_n,
            m.load_n,
            m.load_error_n.unwrap_or(f32::NAN),
            100.0 * (m.load_n / o.load_true_n - 1.0),
            m.tr_start_rad_per_m * 1e-3,
            m.tr_end_rad_per_m * 1e-3,
            o.motor_turns,
            o.home.duration_s,
            m.duration_s,
            m.error_m * 1e6,
            1e6 * m.position_error_m.unwrap_or(f32::NAN),
            o.true_error_at_rest_m * 1e6,
            100.0 * o.core_busy,
            o.instructions_per_tick_mean,
            o.instructions_per_tick_max,
            o.realtime_factor
        ))?;
        output.object(o)?;
    }
    output.line(
        "± is the error that the board states: it holds the truth in 90 of 100 cases. Constants and LVDT are not calibrated \
         on this rig; docs/how-to/calibrate.md does that.",
    )?;
    let moves: Vec<_> = outcomes.iter().map(|outcome| (outcome.load_kg, &outcome.rows[..])).collect();
    write_file(out, "demo.svg", &draw(&moves)?)?;
    write_file(out, "demo.csv", &csv(&outcomes, &options)?)?;
    output.line(format!("picture: {}   data: {}", out.join("demo.svg").display(), out.join("demo.csv").display()))?;
    if outcomes.iter().all(|o| o.floors_met) {
        Ok(())
    } else {
        Err(Failure::failed("an error is larger than what is stated, or a limit was missed: see the table"))
    }
}

fn csv(outcomes: &[RecordedMove], options: &SimOptions) -> Result<String, Failure> {
    let mut rows = csv::Writer::from_writer(Vec::new());
    for (load_kg, r) in outcomes.iter().flat_map(|o| o.rows.iter().map(|r| (o.load_kg, r))) {
        let (t_s, measured) = (format!("{:.6}", r.t_s), (r.setpoint_m, r.position_m, r.true_position_m, r.twist_rad));
        rows.serialize((load_kg, t_s, measured, r.load_n, r.tr_rad_per_m, r.drive_speed_rad_per_s))?;
    }
    let rows = String::from_utf8(rows.into_inner().map_err(csv::IntoInnerError::into_error)?)?;
    let names = "load_kg,t_s,setpoint_m,position_m,true_position_m,twist_rad,load_n,tr_rad_per_m,drive_speed_rad_per_s";
    Ok(format!("# emulated: firmware ELF on an {options}\n{names}\n{rows}"))
}
