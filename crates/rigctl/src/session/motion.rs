//! Motions: when one has ended, a move to a position, a jog, a turn to a twist.

use super::client::Session;
use super::link::STEP_S;
use super::row::{RangeEnd, Row};
use crate::failure::{Failure, HomingFailed};
use crate::output::progress;
use crate::units::{MM, TURNS_OF_RAD, UM};
use rig_link::{Accepted, EventKind, Fault, HomingFailure, LoadChoice, Request, StreamEnd, Telemetry};
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// Longest move beyond what distance and speed need (s).
const MOVE_SLACK_S: f64 = 30.0;
/// Speed that every motor is expected to reach (m/s).
const SLOWEST_MAX_M_PER_S: f64 = 1e-4;
/// Longest turn beyond its length at its speed (s).
const TURN_SLACK_S: f64 = 10.0;
/// How long before the end of a turn the motor is stopped (s): the delay of the link and the ramp.
const TURN_AHEAD_S: f64 = 0.05;
/// Longest check of the directions, with the start of the drive after it (s).
const CHECK_S: f64 = 20.0;
/// Longest ramp down after a stop (s).
const STOP_S: f64 = 5.0;

/// Why a motion ended before its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Cut {
    /// By a stop.
    #[error("stopped before its end")]
    Stopped,
    /// Homing failed.
    #[error("{0}")]
    Homing(HomingFailure),
    /// By a fault.
    #[error("{0}")]
    Fault(Fault),
    /// A stream of set-points ended by itself.
    #[error("the stream ended ({0}); the load is held")]
    Stream(StreamEnd),
    /// By the emergency stop.
    #[error("the emergency stop was pressed")]
    EStop,
}

impl Cut {
    /// The kind that clients of `serve` compare.
    pub fn kind(self) -> &'static str {
        match self {
            Self::Homing(_) => "homing-failed",
            Self::Fault(_) => "fault",
            Self::EStop => "estop",
            Self::Stopped | Self::Stream(_) => "stopped",
        }
    }

    /// The failure of a command; `when` is part of the message.
    pub fn failure(self, when: &str) -> Failure {
        match self {
            Self::Stopped => Failure::of_kind(self.kind(), "stopped before the target"),
            Self::Homing(failure) => HomingFailed(failure).into(),
            Self::Stream(_) => Failure::of_kind(self.kind(), self.to_string()),
            Self::Fault(fault) => Failure::of_kind(self.kind(), format!("fault {fault} {when}")),
            Self::EStop => Failure::of_kind(self.kind(), format!("emergency stop {when}")),
        }
    }
}

/// What an event means for the motion that a request has begun: nothing, its end, or why it has ended early.
pub fn end_of(request: &Request, event: &EventKind) -> Option<Result<(), Cut>> {
    match (event, request) {
        (EventKind::Homed(_), Request::Home { .. })
        | (EventKind::MoveDone { .. }, Request::Move { .. })
        | (EventKind::DirectionProven, Request::CheckDirection)
        // A jog has no other end.
        | (EventKind::Stopped, Request::Jog { .. }) => Some(Ok(())),
        (EventKind::Stopped, _) => Some(Err(Cut::Stopped)),
        (EventKind::StreamEnded(end), Request::Track { .. }) => Some(Err(Cut::Stream(*end))),
        (EventKind::HomingRefused(failure), _) => Some(Err(Cut::Homing(*failure))),
        (EventKind::FaultRaised(fault), _) => Some(Err(Cut::Fault(*fault))),
        (EventKind::EStopOpened, _) => Some(Err(Cut::EStop)),
        _ => None,
    }
}

/// The event with which a motion has ended, and its time (s), if it has.
///
/// # Errors
/// What has ended it early; `when` is part of the message.
pub fn ended(session: &mut Session, request: &Request, when: &str) -> Result<Option<(f64, EventKind)>, Failure> {
    for (t_s, event) in session.take_events() {
        if let Some(end) = end_of(request, &event) {
            return end.map(|()| Some((t_s, event))).map_err(|cut| cut.failure(when));
        }
    }
    Ok(None)
}

/// How a move ended.
#[derive(Clone, Debug, Serialize)]
pub struct MoveResult {
    /// Target (m).
    pub target_m: f64,
    /// Position at rest by the LVDT (m).
    pub position_m: f64,
    /// Measured position less target (m).
    pub error_m: f64,
    /// True position less target, emulated rigs only (m).
    pub true_error_m: Option<f64>,
    /// Half the width of the interval around `position_m` that holds the true position in 90 of 100 cases (m).
    pub position_error_m: Option<f32>,
    /// Load estimate at rest (N).
    pub load_n: f64,
    /// Half the width of the interval around `load_n` that holds the true load in 90 of 100 cases (N).
    pub load_error_n: Option<f32>,
    /// The end of the table's range that `load_n` stands at.
    pub load_at_range_end: Option<RangeEnd>,
    /// TR at the start (rad/m).
    pub tr_start_rad_per_m: f64,
    /// TR at the end (rad/m).
    pub tr_end_rad_per_m: f64,
    /// Turns of the strings.
    pub turns: f64,
    /// From the request to rest (s).
    pub duration_s: f64,
    /// Why the load rests beside its target; nothing where it does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub off_target: Option<String>,
}

impl MoveResult {
    /// Of a load at rest, from the telemetry before the move and the rows at rest, over which positions are averaged: one block of
    /// the LVDT is noisier than where the load stands. `None` without a row.
    pub fn at_rest(to_m: f64, before: &Telemetry, rest: &[Row], duration_s: f64) -> Option<Self> {
        let (last, count) = (rest.last()?, rest.len() as f64);
        let number = |v: Option<f32>| v.map_or(f64::NAN, f64::from);
        let position_m = rest.iter().map(|row| number(row.position_m)).sum::<f64>() / count;
        let true_m = rest.iter().map(|row| row.true_position_m.unwrap_or(f64::NAN)).sum::<f64>() / count;
        Some(Self {
            target_m: to_m,
            position_m,
            error_m: position_m - to_m,
            true_error_m: Some(true_m - to_m).filter(|e| e.is_finite()),
            position_error_m: last.position_error_m,
            load_n: number(last.load_n),
            load_error_n: last.load_error_n,
            load_at_range_end: last.load_at_range_end,
            tr_start_rad_per_m: number(before.tr_rad_per_m),
            tr_end_rad_per_m: number(last.tr_rad_per_m),
            turns: (number(last.twist_rad) - number(before.twist_rad)) / TAU,
            duration_s,
            off_target: None,
        })
    }
}

/// Rows at rest that a position is averaged over.
pub const REST_ROWS: usize = 30;

/// From which error (m) on the mean of 0.3 s is beside its target: above the noise of that mean on a noisy LVDT.
const OFF_TARGET_M: f64 = 30e-6;

/// Why a load rests beside its target by an error (m), from what the board says of itself.
fn off_target(error_m: f64, row: &Row, rest_tolerance_m: Option<f32>) -> Option<String> {
    if error_m.abs() < OFF_TARGET_M {
        return None;
    }
    Some(match (row.limit, rest_tolerance_m, &row.doubts) {
        (Some(limit), ..) => format!("limit {limit}"),
        (_, Some(tolerance_m), _) if error_m.abs() <= f64::from(tolerance_m) => {
            format!("stick-slip: within {}, a correction would make the load jump farther", UM.error(tolerance_m))
        }
        (_, _, Some(doubts)) => format!("doubt {doubts}"),
        _ => "not known".into(),
    })
}

/// Moves; `each` gets every row of telemetry.
///
/// # Errors
/// The board's refusal or failure in words.
pub fn move_to(
    session: &mut Session,
    to_m: f64,
    speed_m_per_s: f64,
    load: LoadChoice,
    mut each: impl FnMut(&Row),
) -> Result<MoveResult, Failure> {
    // The tick that ended a homing does not know TR yet.
    session.until(5.0 * STEP_S, |_| false)?;
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
    let limit_s = distance / speed_m_per_s.abs().clamp(1e-6, SLOWEST_MAX_M_PER_S) + MOVE_SLACK_S;
    // A heavy load may be slower than requested, because the motor has its own limit: four times is more than TR varies.
    while session.now_s() < start_s + 4.0 * limit_s {
        session.step()?;
        for row in session.take_rows() {
            if let Some(position) = row.position_m {
                let fraction = (f64::from(position) - from_m).abs() / distance.max(1e-9);
                bar.set_position((1000.0 * fraction.min(1.0)) as u64);
                bar.set_message(MM.show(position));
            }
            each(&row);
        }
        if ended(session, &request, "on the way")?.is_some() {
            bar.finish_and_clear();
            return settle(session, to_m, start_s, before, each);
        }
    }
    Err(Failure::failed("the move did not end"))
}

fn settle(
    session: &mut Session,
    to_m: f64,
    start_s: f64,
    before: Option<Telemetry>,
    mut each: impl FnMut(&Row),
) -> Result<MoveResult, Failure> {
    let duration_s = session.now_s() - start_s;
    let mut rest = Vec::new();
    for _ in 0..REST_ROWS {
        session.step()?;
        for row in session.take_rows() {
            each(&row);
            rest.push(row);
        }
    }
    let moved = before.and_then(|before| MoveResult::at_rest(to_m, &before, &rest, duration_s)).zip(rest.last());
    let (mut moved, last) = moved.ok_or_else(|| Failure::failed("the board went silent"))?;
    let tolerance_m = if moved.error_m.abs() < OFF_TARGET_M { None } else { session.sensors()?.rest_tolerance_m };
    moved.off_target = off_target(moved.error_m, last, tolerance_m);
    Ok(moved)
}

/// Turns the shaft by about 0.06 rad of the strings each way and back, to see that motor and encoders turn the same way. Nothing
/// turns if the board has seen that since the drive has started; the first homing or jog does the same.
///
/// # Errors
/// The board's refusal, or the fault that it found.
pub fn check_direction(session: &mut Session) -> Result<(), Failure> {
    session.wait_ready()?;
    session.take_events();
    if matches!(session.request(&Request::CheckDirection)?, Accepted::Done) {
        return Ok(());
    }
    // This machine may be busy: the board's clock counts.
    let end_s = session.board_s() + CHECK_S;
    while session.board_s() < end_s {
        session.step()?;
        if ended(session, &Request::CheckDirection, "while the directions were checked")?.is_some() {
            return Ok(());
        }
    }
    Err(Failure::failed(format!("the check of the directions did not end within {CHECK_S} s")))
}

/// Turns the strings at a constant speed (rad/s) for a time (s), then ramps down.
///
/// # Errors
/// The board's refusal or failure in words.
pub fn jog(session: &mut Session, speed_rad_per_s: f64, seconds: f64) -> Result<(), Failure> {
    check_direction(session)?;
    let request = Request::Jog { twist_speed_rad_per_s: speed_rad_per_s as f32 };
    session.request(&request)?;
    let end_s = session.now_s() + seconds;
    while session.now_s() < end_s {
        session.step()?;
        ended(session, &request, "while turning")?;
    }
    session.request(&Request::Stop)?;
    if !session.until(STOP_S, |s| !s.is_moving())? {
        return Err(Failure::failed("the strings did not come to rest"));
    }
    ended(session, &request, "while stopping").map(drop)
}

/// Turns the strings from one twist to another (rad) at a constant speed (rad/s); `each` is called after every step.
///
/// # Errors
/// The board's refusal or failure in words, or that of `each`.
pub fn turn(
    session: &mut Session,
    [from, to]: [f64; 2],
    speed_rad_per_s: f64,
    mut each: impl FnMut(&mut Session) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let sign = (to - from).signum();
    session.take_events();
    let request = Request::Jog { twist_speed_rad_per_s: (sign * speed_rad_per_s) as f32 };
    session.request(&request)?;
    let end_s = session.now_s() + (to - from).abs() / speed_rad_per_s + TURN_SLACK_S;
    let bar = progress(1000, if sign > 0.0 { "turning up" } else { "turning back" });
    let mut stopping = false;
    while session.now_s() < end_s {
        session.step()?;
        each(session)?;
        let twist = session.telemetry().and_then(|t| t.twist_rad).map_or(from, f64::from);
        bar.set_position((1000.0 * ((twist - from) / (to - from)).clamp(0.0, 1.0)) as u64);
        bar.set_message(TURNS_OF_RAD.show(twist - PI));
        if !stopping && sign * (to - twist) < speed_rad_per_s * TURN_AHEAD_S {
            session.request(&Request::Stop)?;
            stopping = true;
        }
        ended(session, &request, "while turning")?;
        if stopping && !session.is_moving() {
            bar.finish_and_clear();
            return Ok(());
        }
    }
    let end = TURNS_OF_RAD.show(to - PI);
    Err(Failure::failed(format!("the strings did not reach {end}: is the load stuck or too heavy?")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::telemetry;
    use rig_link::Limit;
    use rig_link::messages::{Doubt, Doubts};

    #[test]
    fn a_move_beside_its_target_says_why() {
        let row = |limit, doubts| Row::new(1.0, &rig_link::Telemetry { limit, doubts, ..telemetry(100) }, None, None);
        let plain = row(None, Doubts::NONE);
        assert_eq!(off_target(29e-6, &plain, Some(1e-4)), None);
        let why = |error_m, row: &Row, tolerance_m| off_target(error_m, row, tolerance_m).expect("it is off");
        assert_eq!(why(-2e-3, &row(Some(Limit::Travel), Doubts::NONE), Some(1e-4)), "limit travel");
        assert!(why(80e-6, &plain, Some(1e-4)).starts_with("stick-slip: within"));
        assert_eq!(why(2e-4, &row(None, Doubts::of(&[Doubt::LoadRange])), Some(1e-4)), "doubt load-range");
        assert_eq!(why(2e-4, &plain, None), "not known");
    }
}
