//! `demo`: three loads that the firmware does not know, each on a fresh emulated board, homed and moved to the same
//! position at the same speed.

use crate::csv_text::below;
use crate::failure::Failure;
use crate::options::Global;
use crate::out_file::{folder, write_file};
use crate::output::Output;
use crate::recorded_move::{RecordedMove, SPEED_M_PER_S, TARGET_M, draw, record};
use crate::session::sim::SimOptions;
use crate::units::{KG, MM, MM_PER_S, N, NUMBER, PERCENT, RAD, RAD_PER_MM, S, UM};
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
    let global = &global.always_emulated()?;
    let scene = global.rig_config()?;
    if let Some(own) = global.board.plant.iter().find(|s| [PlantKey::Load, PlantKey::TwistAtBoot].contains(&s.key)) {
        return Err(Failure::Usage(format!("--plant {}: the demo has its own", own.key)));
    }
    let options = global.emulated()?;
    folder(out)?;
    let mut outcomes = Vec::new();
    for (load_kg, twist_rad) in LOADS {
        let (load, twist) = (KG.exact(load_kg), RAD.exact(twist_rad));
        output.line(format!("{load}: booting the firmware on a fresh emulated board, strings twisted by {twist} …"))?;
        output.flush()?;
        outcomes.push(record(&options, load_kg, twist_rad, scene.rig.gear())?);
    }
    output.line("")?;
    let (target, speed) = (MM.exact(TARGET_M), MM_PER_S.exact(SPEED_M_PER_S));
    output
        .line(format!("moved to {target} at {speed}; everything below was EMULATED: the firmware on an {options}"))?;
    outcomes.iter().try_for_each(|o| output.object(o))?;
    let row = |name: &str, value: &dyn Fn(&RecordedMove) -> String| {
        outcomes.iter().fold(format!("{name:<26}"), |line, o| line + &format!("{:>20}", value(o)))
    };
    for line in [
        row("load", &|o| KG.exact(o.load_kg)),
        row("true load", &|o| N.show(o.load_true_n)),
        row("estimated load", &|o| N.within(o.travel.load_n, o.travel.load_error_n)),
        row("its error", &|o| PERCENT.error(o.travel.load_n / o.load_true_n - 1.0)),
        row("TR at the start", &|o| RAD_PER_MM.show(o.travel.tr_start_rad_per_m)),
        row("TR at the end", &|o| RAD_PER_MM.show(o.travel.tr_end_rad_per_m)),
        row("turns of the motor", &|o| NUMBER.show(o.motor_turns)),
        row("homing", &|o| S.show(o.home.duration_s)),
        row("move", &|o| S.show(o.travel.duration_s)),
        row("error at rest, measured", &|o| UM.within(o.travel.error_m, o.travel.position_error_m)),
        row("error at rest, true", &|o| UM.rounded(o.true_error_at_rest_m, o.travel.position_error_m)),
        row("core busy", &|o| PERCENT.show(o.core_busy)),
        row("instructions a tick, mean", &|o| NUMBER.number(o.instructions_per_tick_mean, 10.0)),
        row("instructions a tick, max", &|o| NUMBER.number(o.instructions_per_tick_max, 10.0)),
        row("times real time", &|o| NUMBER.show(o.realtime_factor)),
    ] {
        output.line(line)?;
    }
    output.line(
        "± is the 90 % uncertainty that the board states. Constants and LVDT of this actuator are not calibrated; \
         docs/how-to/calibrate.md does that.",
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
    let rows = outcomes.iter().flat_map(|o| o.rows.iter().map(|r| (o.load_kg, r))).map(|(load_kg, r)| {
        let (t_s, measured) = (format!("{:.6}", r.t_s), (r.setpoint_m, r.position_m, r.true_position_m, r.twist_rad));
        (load_kg, t_s, measured, r.load_n, r.tr_rad_per_m, r.drive_speed_rad_per_s)
    });
    let names = "load_kg,t_s,setpoint_m,position_m,true_position_m,twist_rad,load_n,tr_rad_per_m,drive_speed_rad_per_s";
    Ok(format!("# emulated: firmware ELF on an {options}\n{}", below(names, rows)?))
}
