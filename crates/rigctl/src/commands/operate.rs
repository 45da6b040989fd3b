//! The rig's commands, on the emulated board or a real one.

use crate::cli::Global;
use crate::failure::Failure;
use crate::output::{Output, progress};
use crate::session::port::Port;
use crate::session::row::Row;
use crate::session::serial::Serial;
use crate::session::sim::{Gdb, Sim, SimOptions};
use crate::session::{Session, client, interrupt};
use rig_link::{EventKind, HomingFailure, LoadChoice, Request, State};
use serde::Serialize;

/// Longest homing (s), the drive's start-up included.
pub const HOMING_S: f64 = 60.0;
/// Longest move past what distance and speed need (s).
const MOVE_SLACK_S: f64 = 30.0;

/// Whether the port is the emulated board.
pub fn is_sim(global: &Global) -> bool {
    global.port == "sim"
}

/// Options of the emulated board.
///
/// # Errors
/// If there is no such scene file.
pub fn sim_options(global: &Global) -> Result<SimOptions, Failure> {
    super::scene_file(global.plant_scene.as_ref().unwrap_or(&global.scene))?;
    Ok(SimOptions {
        firmware: global.firmware.clone(),
        scene: global.plant_scene.clone().unwrap_or_else(|| global.scene.clone()),
        plant: global.plant.clone(),
        seed: global.seed,
        flash: global.flash.clone(),
        gdb: global.gdb.clone().map(|address| Gdb { address, wait: global.gdb_wait }),
    })
}

/// Opens the port and greets the board.
///
/// # Errors
/// If the scene is of a rig that cannot work, the port cannot be opened, nobody answers, or the board's scene is not the
/// host's.
pub fn connect(global: &Global) -> Result<Session, Failure> {
    super::rig_scene(global)?;
    let session = meet(global)?;
    same_scene(global, &session)?;
    Ok(session)
}

/// Whether the board's table is for the operator's scene.
///
/// # Errors
/// Naming both, and what to do.
pub(super) fn same_scene(global: &Global, session: &Session) -> Result<(), Failure> {
    let scene = super::scene(global)?.hash();
    let board = session.identity().map_or(0, |id| id.scene_hash);
    if board == scene {
        return Ok(());
    }
    Err(Failure::failed(format!(
        "the board's table is for another scene ({board:08x}) than {} ({scene:08x}): name the board's with --scene, have it \
         make one for this (`table --board`), or build and flash",
        global.scene.display(),
    )))
}

/// Greets the board, whatever scene its table is for.
///
/// # Errors
/// If there is no board, or it speaks another message table.
pub fn meet(global: &Global) -> Result<Session, Failure> {
    interrupt::watch();
    let port: Box<dyn Port> = if is_sim(global) {
        Box::new(Sim::start(&sim_options(global)?)?)
    } else {
        for (given, name) in [
            (!global.plant.is_empty(), "--plant"),
            (global.plant_scene.is_some(), "--plant-scene"),
            (global.flash.is_some(), "--flash"),
            (global.firmware.is_some(), "--firmware"),
            (global.gdb.is_some(), "--gdb"),
        ] {
            if given {
                return Err(Failure::Usage(format!(
                    "{name} is for the emulated board, not for --port {}",
                    global.port
                )));
            }
        }
        Box::new(Serial::open(&global.port)?)
    };
    let mut session = Session::new(port);
    session.hello()?;
    Ok(session)
}

/// An event that ends no motion.
///
/// # Errors
/// The fault or emergency stop that did, and when in the operator's words.
pub(super) fn not_broken_off(kind: &EventKind, when: &str) -> Result<(), Failure> {
    match kind {
        EventKind::FaultRaised(fault) => Err(Failure::failed(format!("fault {fault} {when}"))),
        EventKind::EStopOpened => Err(Failure::failed(format!("emergency stop {when}"))),
        _ => Ok(()),
    }
}

/// A homing that failed, by the name that `docs/faults.md` explains.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("homing failed: {0} (docs/faults.md, \"Homing that fails\")")]
pub struct HomingFailed(pub HomingFailure);

/// How a homing ended.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct HomeResult {
    /// Homing time, start-up of the drive not counted (s).
    pub duration_s: f64,
    /// Load that was weighed (N).
    pub load_n: f32,
    /// The board's own estimate of its error of zero twist (rad).
    pub twist_error_estimate_rad: f32,
    /// Measured less modelled gap (m).
    pub gap_offset_m: f32,
}

/// Homes; `each` sees every row.
///
/// # Errors
/// The board's refusal or failure in words.
pub fn home_session(session: &mut Session, mut each: impl FnMut(&Row)) -> Result<HomeResult, Failure> {
    session.wait_ready()?;
    let start_s = session.now_s();
    session.request(&Request::Home)?;
    let bar = progress(45, "homing");
    while session.now_s() < start_s + HOMING_S {
        session.step()?;
        bar.set_position((session.now_s() - start_s) as u64);
        session.take_rows().iter().for_each(&mut each);
        for (t_s, kind) in session.take_events() {
            match kind {
                EventKind::Homed { twist_error_estimate_rad, load_n, gap_offset_m } => {
                    bar.finish_and_clear();
                    let duration_s = t_s - start_s;
                    return Ok(HomeResult { duration_s, load_n, twist_error_estimate_rad, gap_offset_m });
                }
                EventKind::HomingRefused(failure) => {
                    return Err(HomingFailed(failure).into());
                }
                kind => not_broken_off(&kind, "while homing")?,
            }
        }
    }
    Err(Failure::failed(format!("homing did not end within {HOMING_S} s")))
}

/// How a move ended.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MoveResult {
    /// Where it was to go (m).
    pub target_m: f64,
    /// Where the LVDT sees it at rest (m).
    pub position_m: f64,
    /// Measured position less target (m).
    pub error_m: f64,
    /// True position less target, emulated rigs only (m).
    pub true_error_m: Option<f64>,
    /// Load estimate at rest (N).
    pub load_n: f64,
    /// TR at the start (rad/m).
    pub tr_start_rad_per_m: f64,
    /// TR at the end (rad/m).
    pub tr_end_rad_per_m: f64,
    /// Turns of the strings' motor side, before the gear's ratio is counted: turns of the output.
    pub turns: f64,
    /// From the request to rest (s).
    pub duration_s: f64,
}

/// Moves; `each` sees every row.
///
/// # Errors
/// The board's refusal or failure in words.
pub fn move_session(
    session: &mut Session,
    to_m: f64,
    speed_m_per_s: f64,
    load: LoadChoice,
    mut each: impl FnMut(&Row),
) -> Result<MoveResult, Failure> {
    // The tick that ended a homing does not know TR yet.
    session.until(5.0 * client::STEP_S, |_| false)?;
    session.take_rows();
    let before = session.telemetry().copied();
    let known = |v: Option<f32>, what: &str| {
        v.map(f64::from).ok_or_else(|| Failure::failed(format!("the board knows no {what}: is it homed?")))
    };
    let start_s = session.now_s();
    let request = Request::Move { target_m: to_m as f32, speed_m_per_s: speed_m_per_s as f32, load };
    session.request(&request)?;
    let from_m = known(before.and_then(|t| t.position_m), "position")?;
    let distance = (to_m - from_m).abs();
    let bar = progress(1000, "moving");
    let limit_s = distance / speed_m_per_s.abs().max(1e-6) + MOVE_SLACK_S;
    // A heavy load may be slower than asked: the motor has its own limit. Four times is more than TR varies.
    while session.now_s() < start_s + 4.0 * limit_s {
        session.step()?;
        for row in session.take_rows() {
            if let Some(position) = row.position_m {
                let share = (f64::from(position) - from_m).abs() / distance.max(1e-9);
                bar.set_position((1000.0 * share.min(1.0)) as u64);
                bar.set_message(format!("{:.3} mm", f64::from(position) * 1e3));
            }
            each(&row);
        }
        for (_, kind) in session.take_events() {
            match kind {
                EventKind::MoveDone { .. } => {
                    bar.finish_and_clear();
                    return settle(session, to_m, start_s, before, &mut each);
                }
                EventKind::Stopped => return Err(Failure::failed("stopped before the target")),
                kind => not_broken_off(&kind, "on the way")?,
            }
        }
    }
    Err(Failure::failed("the move did not end"))
}

fn settle(
    session: &mut Session,
    to_m: f64,
    start_s: f64,
    before: Option<rig_link::Telemetry>,
    each: &mut impl FnMut(&Row),
) -> Result<MoveResult, Failure> {
    let duration_s = session.now_s() - start_s;
    // The mean of 0.3 s at rest: one block of the LVDT is noisier than where the load stands.
    let (mut sum, mut true_sum, mut count) = (0.0, 0.0, 0.0);
    let mut last = None;
    for _ in 0..30 {
        session.step()?;
        for row in session.take_rows() {
            sum += f64::from(row.position_m.unwrap_or(f32::NAN));
            true_sum += row.true_position_m.unwrap_or(f64::NAN);
            count += 1.0;
            each(&row);
            last = Some(row);
        }
    }
    let last = last.ok_or_else(|| Failure::failed("the board went silent"))?;
    let before = before.ok_or_else(|| Failure::failed("the board went silent"))?;
    let position_m = sum / count;
    let number = |v: Option<f32>| v.map_or(f64::NAN, f64::from);
    Ok(MoveResult {
        target_m: to_m,
        position_m,
        error_m: position_m - to_m,
        true_error_m: Some(true_sum / count - to_m).filter(|e| e.is_finite()),
        load_n: number(last.load_n),
        tr_start_rad_per_m: number(before.tr_rad_per_m),
        tr_end_rad_per_m: number(last.tr_rad_per_m),
        turns: (number(last.twist_rad) - number(before.twist_rad)) / std::f64::consts::TAU,
        duration_s,
    })
}

/// `home`.
///
/// # Errors
/// As [`home_session`].
pub fn home(global: &Global, output: &mut Output) -> Result<(), Failure> {
    let mut session = connect(global)?;
    let result = home_session(&mut session, |_| {})?;
    output.object(&result)?;
    print_home(&result, output)
}

pub(super) fn print_home(result: &HomeResult, output: &mut Output) -> Result<(), Failure> {
    output.line(format!(
        "homed in {:.1} s: load {:.3} N, zero twist to about {:.4} rad, LVDT offset {:+.3} mm",
        result.duration_s,
        result.load_n,
        result.twist_error_estimate_rad,
        f64::from(result.gap_offset_m) * 1e3
    ))?;
    Ok(())
}

/// `move`.
///
/// # Errors
/// As [`move_session`].
pub fn travel(global: &Global, to: f64, speed: f64, load: LoadChoice, output: &mut Output) -> Result<(), Failure> {
    let mut session = connect(global)?;
    if is_sim(global) {
        eprintln!("the emulated board starts afresh and is not homed: homing first");
        let result = home_session(&mut session, |_| {})?;
        print_home(&result, output)?;
    }
    let r = move_session(&mut session, to, speed, load, |_| {})?;
    output.object(&r)?;
    output.line(format!("target        {:9.4} mm", r.target_m * 1e3))?;
    output.line(format!("measured      {:9.4} mm   error {:+.1} um", r.position_m * 1e3, r.error_m * 1e6))?;
    if let Some(error) = r.true_error_m {
        output.line(format!("true (emulated rig)         error {:+.1} um", error * 1e6))?;
    }
    output.line(format!("load estimate {:9.3} N", r.load_n))?;
    output.line(format!(
        "TR            {:9.3} -> {:.3} rad/mm",
        r.tr_start_rad_per_m * 1e-3,
        r.tr_end_rad_per_m * 1e-3
    ))?;
    output.line(format!("turns         {:9.3}", r.turns))?;
    output.line(format!("time          {:9.2} s", r.duration_s))?;
    Ok(())
}

/// `jog`.
///
/// # Errors
/// The board's refusal in words.
pub fn jog(global: &Global, speed: f64, seconds: f64, output: &mut Output) -> Result<(), Failure> {
    if !(0.0..=600.0).contains(&seconds) {
        return Err(Failure::Usage(format!("--seconds {seconds}: must be from 0 to 600")));
    }
    let mut session = connect(global)?;
    session.wait_ready()?;
    session.take_events();
    session.request(&Request::Jog { twist_speed_rad_per_s: speed as f32 })?;
    let end_s = session.now_s() + seconds;
    while session.now_s() < end_s {
        session.step()?;
        for (_, kind) in session.take_events() {
            not_broken_off(&kind, "while turning")?;
        }
    }
    session.request(&Request::Stop)?;
    session.until(5.0, |s| s.telemetry().is_some_and(|t| t.state != State::Moving))?;
    session.take_events().iter().try_for_each(|(_, kind)| not_broken_off(kind, "while stopping"))?;
    show_last(&mut session, output)
}

/// `stop`, `hold`, `clear`: of any board, whatever scene it is for, and in any fault.
///
/// # Errors
/// The board's refusal in words.
pub fn simple(global: &Global, request: &Request, output: &mut Output) -> Result<(), Failure> {
    let mut session = meet(global)?;
    if is_sim(global) {
        session.wait_started()?;
    }
    session.request(request)?;
    session.until(0.2, |_| false)?;
    show_last(&mut session, output)
}

fn show_last(session: &mut Session, output: &mut Output) -> Result<(), Failure> {
    session.until(10.0 * client::STEP_S, |_| false)?;
    if let Some(row) = session.take_rows().last() {
        output.object(row)?;
        output.line(row.text())?;
    }
    Ok(())
}
