//! The checks of `doctor`: is the rig well, and if not, what to do.
//!
//! [`board`]: the board's identity, table and settings; [`sensors`]: LVDT, encoder, supply; here: state, drive, ticks and link.

pub mod board;
pub mod sensors;

use crate::failure::Failure;
use crate::session::{Session, homing, motion};
use crate::units::{A, PERCENT};
use rig_config::Scene;
use rig_control::TICK_US;
use rig_link::{Counters, Fault, Faults, LoadChoice, State, Telemetry};
use serde::Serialize;

/// How long to listen (s).
const LISTEN_S: f64 = 2.0;
/// How long the drive's start may take (s).
const START_S: f64 = 10.0;
/// Fraction of a tick's period that the longest tick may take.
const TICK_FRACTION: f64 = 0.5;

/// Minimum rate of the telemetry (Hz).
const RATE_HZ: f64 = 95.0;

/// One check, with its result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What is checked.
    pub name: &'static str,
    /// Whether it is well.
    pub ok: bool,
    /// What was found.
    pub seen: String,
    /// What to do, if it is not well.
    pub advice: Option<String>,
}

/// A check with its result, and the advice for the case that it is not well.
pub fn check(name: &'static str, ok: bool, seen: impl Into<String>, advice: impl Into<String>) -> Check {
    Check { name, ok, seen: seen.into(), advice: (!ok).then(|| advice.into()) }
}

/// Examines a board; with `turn` the shaft is turned a little to compare the directions of motor and encoders, with `home` the
/// rig is homed, and its strings are turned by a third of a turn and back.
///
/// # Errors
/// If the board does not answer, or the scene has no equilibria to compare with.
pub fn examine(session: &mut Session, scene: &Scene, turn: bool, home: bool) -> Result<Vec<Check>, Failure> {
    session.until(START_S, |s| s.state() != State::Boot)?;
    let mut checks = Vec::new();
    let mut turned = None;
    if turn {
        checks.push(match motion::check_direction(session) {
            Ok(()) => check("direction", true, "motor, drive's encoder and own encoder turn the same way", ""),
            Err(failure) => check(
                "direction",
                false,
                failure.message().unwrap_or_default(),
                "docs/reference/faults.md has the wires to look at for this fault; then `clear`",
            ),
        });
    }
    if home {
        match homing::home(session, LoadChoice::Auto, |_| {}) {
            Ok(_) => turned = Some(sensors::turn(session, scene.rig.gear())?),
            Err(failure) => checks.push(check(
                "homing",
                false,
                failure.message().unwrap_or_default(),
                "see docs/reference/faults.md; is the load hung, does it move freely?",
            )),
        }
        session.until(1.0, |_| false)?;
    }
    session.take_rows();
    let mut heard: Vec<Telemetry> = Vec::new();
    session.until(LISTEN_S, |s| {
        heard.extend(s.telemetry().filter(|t| heard.last().is_none_or(|l: &Telemetry| l.t_us != t.t_us)));
        false
    })?;
    let messages = session.take_rows().len();
    let id = session.require_identity()?.clone();
    let Some(last) = heard.last().copied() else { return Err(Failure::failed("no telemetry from the board")) };
    let mut all = board::checks(&id, scene)?;
    all.push(board::settings(&session.settings()?));
    all.append(&mut checks);
    all.push(faults(&last));
    all.push(drive(&heard, scene));
    all.push(sensors::lvdt(&heard, &id, scene, session)?);
    let readings = session.sensors()?;
    all.push(sensors::encoder(turned, &last, &readings));
    all.push(sensors::supply(&last, scene, &readings));
    all.extend(timing(&readings.counters, session, messages));
    Ok(all)
}

fn faults(last: &Telemetry) -> Check {
    let fault = last.fault.map_or("no fault".to_owned(), |_| format!("fault {}", last.faults));
    let advice = match (last.state, last.fault) {
        (State::EStop, _) => "release the emergency stop, then `clear` and `home`".to_owned(),
        (_, Some(fault)) => format!("docs/reference/faults.md, `{fault}`: remove the cause, then `clear`"),
        _ => "the drive does not start: see `drive`".to_owned(),
    };
    let well = last.fault.is_none() && !matches!(last.state, State::EStop | State::Boot);
    check("state", well, format!("{}, {fault}", last.state), advice)
}

fn drive(heard: &[Telemetry], scene: &Scene) -> Check {
    let last = heard.last();
    let gone = Faults::of(&[
        Fault::DriveSilent,
        Fault::CanBusOff,
        Fault::DriveStartUp,
        Fault::DriveReset,
        Fault::DriveStall,
        Fault::NotHeld,
    ]);
    let online = last.is_some_and(|t| t.state != State::Boot && !t.faults.meets(gone));
    let max_a = heard.iter().map(|t| f64::from(t.drive_current_a).abs()).fold(0.0, f64::max);
    let limit_a = f64::from(scene.rig.drive_current_limit_ma()) * 1e-3;
    let online_text = if online { "online" } else { "not online" };
    let seen = format!("{online_text}, at most {}, allowed below {}", A.rounded(max_a, 10e-3), A.exact(limit_a));
    let advice = if online {
        "the motor is at its current limit at rest: is the load too heavy, or stuck?"
    } else {
        "power, CAN wiring and termination, group and number of the drive (docs/reference/faults.md)"
    };
    check("drive", online && max_a < limit_a, seen, advice)
}

/// Control ticks and link.
fn timing(c: &Counters, session: &Session, messages: usize) -> [Check; 2] {
    let fraction = f64::from(c.longest_tick_us) / TICK_US as f64;
    let rate_hz = messages as f64 / LISTEN_S;
    let damaged = session.link.damaged_frames();
    let lost = session.link.lost_frames();
    [
        check(
            "ticks",
            c.late_ticks == 0 && fraction < TICK_FRACTION,
            format!(
                "{} late, allowed 0; the longest took {} µs of {TICK_US} µs, margin {}, allowed above {}",
                c.late_ticks,
                c.longest_tick_us,
                PERCENT.rounded(1.0 - fraction, 0.1),
                PERCENT.exact(1.0 - TICK_FRACTION)
            ),
            "the core is held up: a debugger halting it, a build without optimisation? Then power-cycle to count from zero",
        ),
        check(
            "link",
            rate_hz > RATE_HZ && c.link_errors == 0 && damaged == 0 && lost == 0 && c.unsent == 0,
            format!(
                "telemetry at {rate_hz:.0} Hz, allowed above {RATE_HZ}; damaged {} at the board, {damaged} here; {lost} lost, {} \
                 unsent, allowed 0 of each; {} foreign frames on the bus",
                c.link_errors, c.unsent, c.foreign_frames
            ),
            "cable, ground and baud rate of the host link; another program on the port?",
        ),
    ]
}
