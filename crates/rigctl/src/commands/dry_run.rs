//! `move --dry-run`: what the board would plan and look up, without a board.

use crate::cli::Global;
use crate::failure::Failure;
use crate::output::Output;
use rig_control::TICK_S;
use rig_control::limits::{LOAD_ACCELERATION, Limits, PLANNED_SHARE};
use rig_control::planner::Planner;
use rig_link::LoadChoice;
use serde_json::json;

/// Ticks between two printed rows.
const EVERY: u32 = 25;

/// Runs the command. Starts at the half-turn pre-twist.
///
/// # Errors
/// If the load is not given, or target or speed are outside what the table covers.
pub fn run(global: &Global, to: f64, speed: f64, load: LoadChoice, output: &mut Output) -> Result<(), Failure> {
    let LoadChoice::Known(load_n) = load else {
        return Err(Failure::Usage("--dry-run has no device to weigh the load with: give --load L".into()));
    };
    let scene = super::scene(global)?;
    let fit = tsa_table::fit::fit(&scene)?;
    let table = fit.table.table();
    let start = table.look_up(load_n, table.metadata.twist_min_rad)?;
    let end = table.look_up(load_n, table.metadata.twist_max_rad)?;
    let travel = f64::from(start.gap_m - end.gap_m);
    if !(0.0..=travel).contains(&to) {
        return Err(Failure::failed(format!("to is {to} m, this load can go from 0 to {travel:.5} m")));
    }
    if !(1e-5..=0.05).contains(&speed) {
        return Err(Failure::failed(format!("speed is {speed} m/s, allowed are 0.00001 to 0.05 m/s")));
    }
    let gear = scene.rig.gear();
    let planned = |motor_limit: f64| PLANNED_SHARE * (motor_limit / gear) as f32;
    let twist_speed_max = planned(scene.rig.motor_speed_max_rad_per_s);
    let twist_acceleration_max = planned(scene.rig.motor_acceleration_max_rad_per_s2);
    let mut planner = Planner::at(0.0);
    planner.go_to(to as f32);
    output.line("    t s   set-point mm   speed mm/s    turns   motor rpm   TR rad/mm")?;
    let mut tick = 0u32;
    let mut limited = false;
    loop {
        let gap = start.gap_m - planner.set_point_m();
        let twist = table.twist_from_gap(load_n, gap)?;
        let point = table.look_up(load_n, twist)?;
        let tr = point.tr_rad_per_m();
        let allowed = twist_speed_max / tr;
        limited |= allowed < speed as f32;
        let s =
            planner.step(&Limits::new(allowed.min(speed as f32), LOAD_ACCELERATION.min(twist_acceleration_max / tr)));
        if tick.is_multiple_of(EVERY) || s.done {
            let turns = (twist - table.metadata.twist_min_rad) / std::f32::consts::TAU;
            let rpm = f64::from(tr * s.speed_m_per_s) * gear * 60.0 / std::f64::consts::TAU;
            let t_s = tick as f32 * TICK_S;
            output.object(&json!({"t_s": t_s, "setpoint_m": s.position_m, "speed_m_per_s": s.speed_m_per_s,
                "turns": turns, "motor_rpm": rpm, "tr_rad_per_m": tr}))?;
            output.line(format!(
                "{t_s:7.2}   {:12.3}   {:10.3}   {turns:6.3}   {rpm:9.0}   {:9.3}",
                s.position_m * 1e3,
                s.speed_m_per_s * 1e3,
                tr * 1e-3
            ))?;
        }
        if s.done {
            break;
        }
        tick += 1;
        if tick > 1_000_000 {
            return Err(Failure::failed("the planned move does not end"));
        }
    }
    if limited {
        output.line("limit: the motor's speed holds the load back on part of the way")?;
    }
    Ok(())
}
