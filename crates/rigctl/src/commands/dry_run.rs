//! `move --dry-run`: the plan of a move as the board would make it, without a board.

use super::motion::Move;
use crate::backup;
use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::plan::Plan;
use crate::units::{MM, MM_PER_S, NUMBER, RAD_PER_MM, S, TURNS};
use rig_control::limits::Limits;
use rig_control::move_check::MoveRequest;
use rig_control::planner::Planner;
use rig_control::{TICK_S, settings as rig_settings};
use rig_link::{Dropped, Kept, LoadChoice, SettingsReport};
use serde_json::json;
use std::f32::consts::PI;

/// Ticks between two printed rows.
const EVERY: u32 = 25;

/// Runs the command. Starts at the half-turn pre-twist.
///
/// # Errors
/// If the load is not given, the settings are wrong, or target or speed are outside what table and settings allow.
pub fn run(global: &Global, options: &Move, output: &mut Output) -> Result<(), Failure> {
    let Move { to, speed, load, ref settings, .. } = *options;
    let LoadChoice::Known(load_n) = load else {
        return Err(Failure::Usage("--dry-run has no device to weigh the load with: give --load L".into()));
    };
    let scene = global.scene()?;
    let as_built = scene.constants();
    let defaults = rig_settings::defaults(&as_built);
    let values = match settings {
        Some(file) => {
            let new = SettingsReport {
                values: defaults,
                defaults,
                constants: rig_settings::corrected(&as_built),
                kept: Kept::Nothing,
                dropped: Dropped::NONE,
            };
            let (values, dropped) = backup::load(file, &defaults)?.for_board(scene.rig_hash(), &new, file, false)?;
            backup::require_all(&dropped, file)?;
            values
        }
        None => defaults,
    };
    let plan = Plan::new(&scene, values, Some(load_n))?;
    let (rig, mechanism) = (&plan.rig, plan.mechanism());
    let request = MoveRequest { target_m: to as f32, speed_m_per_s: speed as f32, load }.with_speed_max(&values);
    plan.start().check(&request)?;
    let mut planner = Planner::at(plan.start().position_m);
    planner.target_m = to as f32;
    output.line("    t s   set-point mm   speed mm/s    turns   motor rpm   TR rad/mm")?;
    let (mut tick, mut held_back) = (0u32, None);
    loop {
        let (twist, point) = plan.at(planner.set_point_m())?;
        let tr = point.tr_rad_per_m();
        let (limits, limit) = Limits::for_motor(request.speed_m_per_s, &point, load_n, rig);
        let rest = mechanism.at(load_n, twist + tr * limits.stopping_m(planner.speed_m_per_s()));
        let limits = limits.braking_into(&Limits::for_motor(request.speed_m_per_s, &rest, load_n, rig).0);
        held_back = held_back.or(limit);
        let s = planner.step(&limits);
        if tick.is_multiple_of(EVERY) || s.done {
            let turns = (twist - PI) / std::f32::consts::TAU;
            let rpm = tr * s.motion.speed * rig.gear_ratio * 60.0 / std::f32::consts::TAU;
            let t_s = tick as f32 * TICK_S;
            output.object(&json!({"t_s": t_s, "setpoint_m": s.motion.position, "speed_m_per_s": s.motion.speed,
                "turns": turns, "motor_rpm": rpm, "tr_rad_per_m": tr, "limit": limit.map(|l| l.name())}))?;
            output.line(format!(
                "{:>7}   {:>12}   {:>10}   {:>6}   {:>9}   {:>9}",
                S.number(t_s, 0.1),
                MM.number(s.motion.position, 1e-5),
                MM_PER_S.number(s.motion.speed, 1e-5),
                TURNS.number(turns, 0.01),
                NUMBER.number(rpm, 10.0),
                RAD_PER_MM.number(tr, 10.0)
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
    if let Some(limit) = held_back {
        output.line(format!("limit: {limit} holds the load back on part of the way"))?;
    }
    Ok(())
}
