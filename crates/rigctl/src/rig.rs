//! Homing and moving, from request to rest.

use crate::record::Row;
use crate::session::{Happening, Session, SessionError};
use rig_link::{EventKind, Fault, HomingFailure, LoadChoice, Request};
use serde::Serialize;

/// How long homing may take (s): it is promised in 45, and the firmware itself gives up before this.
const HOMING_TIMEOUT_S: f64 = 60.0;

/// How long the load is watched at rest after a move, for the mean of what is measured (s).
const REST_S: f64 = 0.5;

/// Why the rig did not do it.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The conversation failed, or the board refused.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Homing did not come to an end.
    #[error("homing failed: {0}")]
    Homing(HomingFailure),
    /// A fault stopped the rig.
    #[error("stopped by fault {0}")]
    Fault(Fault),
    /// Somebody stopped the rig.
    #[error("stopped before the target")]
    Stopped,
    /// Emergency stop.
    #[error("the emergency stop was pressed")]
    EStop,
    /// The board started anew in the middle.
    #[error("the board restarted: its twist is no longer known, `home` again")]
    Rebooted,
    /// It did not end in time.
    #[error("{what} did not end within {timeout_s:.0} s")]
    TimeOut {
        /// What.
        what: &'static str,
        /// Allowed (s).
        timeout_s: f64,
    },
    /// There was no measurement to end with.
    #[error("the board gave no {0}")]
    Unmeasured(&'static str),
}

/// Takes every row as it comes.
pub type Watch<'a> = &'a mut dyn FnMut(&Row);

/// How homing ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Homed {
    /// Time that it took (s).
    pub duration_s: f64,
    /// Twist found (rad).
    pub twist_rad: Option<f32>,
    /// The firmware's own estimate of its error (rad).
    pub twist_error_estimate_rad: f32,
    /// On the emulated board: twist found minus true twist (rad).
    pub true_twist_error_rad: Option<f64>,
    /// Load (N).
    pub load_n: f32,
    /// The plant's load (N).
    pub true_load_n: Option<f64>,
    /// Measured minus modelled gap (m).
    pub gap_offset_m: f32,
}

/// How a move ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moved {
    /// Wanted (m).
    pub target_m: f64,
    /// Measured at rest (m).
    pub position_m: f64,
    /// Measured minus wanted (m).
    pub error_m: f64,
    /// The plant's position minus wanted, at rest (m).
    pub true_error_m: Option<f64>,
    /// Load, as estimated at the end (N).
    pub load_n: Option<f32>,
    /// The plant's load (N).
    pub true_load_n: Option<f64>,
    /// TR at the start (rad/m).
    pub tr_start_rad_per_m: Option<f32>,
    /// TR at the end (rad/m).
    pub tr_end_rad_per_m: Option<f32>,
    /// Turns of the strings that the move used.
    pub motor_turns: Option<f64>,
    /// From request to rest (s).
    pub duration_s: f64,
}

/// What a wait is for.
enum Ended {
    Homed { t_s: f64, twist_error_estimate_rad: f32, load_n: f32, gap_offset_m: f32 },
    Moved { t_s: f64 },
}

/// Lets `seconds` pass; a fault on the way is an error.
///
/// # Errors
/// [`RigError`] if a fault comes or the conversation fails.
pub fn rest(session: &mut Session, seconds: f64, watch: Watch<'_>) -> Result<(), RigError> {
    let end_s = session.now_s() + seconds;
    while session.now_s() < end_s - 1e-9 {
        for happening in session.step()? {
            look(happening, watch)?;
        }
    }
    Ok(())
}

/// Homes the rig.
///
/// # Errors
/// [`RigError`] with the firmware's reason.
pub fn home(session: &mut Session, watch: Watch<'_>) -> Result<Homed, RigError> {
    let mut last = None;
    let mut keep = |row: &Row| {
        last = Some(row.clone());
        watch(row);
    };
    let start_s = session.now_s();
    session.request(&Request::Home)?;
    let ended = wait(session, "homing", HOMING_TIMEOUT_S, &mut keep)?;
    let Ended::Homed { t_s, twist_error_estimate_rad, load_n, gap_offset_m } = ended else {
        return Err(RigError::Unmeasured("homing result"));
    };
    // One more row tells the twist that was found.
    rest(session, 0.05, &mut keep)?;
    let row = last.ok_or(RigError::Unmeasured("telemetry"))?;
    let serial = row.true_twist_rad.is_none();
    Ok(Homed {
        duration_s: if serial { session.now_s() - start_s } else { t_s - start_s },
        twist_rad: row.twist_rad,
        twist_error_estimate_rad,
        true_twist_error_rad: row.true_twist_rad.zip(row.twist_rad).map(|(truth, found)| f64::from(found) - truth),
        load_n,
        true_load_n: row.true_load_n,
        gap_offset_m,
    })
}

/// Moves the load and watches it come to rest.
///
/// # Errors
/// [`RigError`] with the firmware's reason.
pub fn move_to(
    session: &mut Session,
    target_m: f64,
    speed_m_per_s: f64,
    load: LoadChoice,
    watch: Watch<'_>,
) -> Result<Moved, RigError> {
    let mut rows: Vec<Row> = Vec::new();
    let mut keep = |row: &Row| {
        rows.push(row.clone());
        watch(row);
    };
    // Where it starts from; telemetry comes every 10 ms.
    rest(session, 0.05, &mut keep)?;
    let request =
        Request::Move { target_m: target_m as f32, speed_m_per_s: speed_m_per_s as f32, load };
    let start_s = session.now_s();
    session.request(&request)?;
    // The firmware may slow down for a limit; whatever takes ten times as long as asked will not end.
    let timeout_s = 30.0 + 10.0 * target_m.abs().max(0.05) / speed_m_per_s.abs().max(1e-5);
    let ended = wait(session, "the move", timeout_s, &mut keep)?;
    let done_s = match ended {
        Ended::Moved { t_s } => t_s,
        Ended::Homed { .. } => return Err(RigError::Unmeasured("end of the move")),
    };
    let waited_s = session.now_s();
    rest(session, REST_S, &mut keep)?;

    let first = rows.first().ok_or(RigError::Unmeasured("telemetry"))?.clone();
    let last = rows.last().ok_or(RigError::Unmeasured("telemetry"))?;
    let from_s = last.t_s - REST_S;
    let at_rest = || rows.iter().filter(move |r| r.t_s > from_s);
    let position_m = mean(at_rest().filter_map(|r| r.position_m.map(f64::from)))
        .ok_or(RigError::Unmeasured("position"))?;
    let serial = last.true_twist_rad.is_none();
    Ok(Moved {
        target_m,
        position_m,
        error_m: position_m - target_m,
        true_error_m: mean(at_rest().filter_map(|r| r.true_position_m)).map(|p| p - target_m),
        load_n: last.load_n,
        true_load_n: last.true_load_n,
        tr_start_rad_per_m: first.tr_rad_per_m,
        tr_end_rad_per_m: last.tr_rad_per_m,
        motor_turns: first
            .twist_rad
            .zip(last.twist_rad)
            .map(|(a, b)| f64::from(b - a) / std::f64::consts::TAU),
        duration_s: if serial { waited_s - start_s } else { done_s - start_s },
    })
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    (count > 0.0).then_some(sum / count)
}

/// Steps until homing or a move ends.
fn wait(
    session: &mut Session,
    what: &'static str,
    timeout_s: f64,
    watch: Watch<'_>,
) -> Result<Ended, RigError> {
    let give_up_s = session.now_s() + timeout_s;
    while session.now_s() < give_up_s {
        let mut ended = None;
        for happening in session.step()? {
            ended = look(happening, watch)?.or(ended);
        }
        if let Some(ended) = ended {
            return Ok(ended);
        }
    }
    // The board may still be moving: we no longer know why.
    session.request(&Request::Stop)?;
    Err(RigError::TimeOut { what, timeout_s })
}

fn look(happening: Happening, watch: Watch<'_>) -> Result<Option<Ended>, RigError> {
    match happening {
        Happening::Row(row) => watch(&row),
        Happening::Rebooted => return Err(RigError::Rebooted),
        Happening::Reply { .. } | Happening::Identity(_) => {}
        Happening::Event { t_s, kind } => match kind {
            EventKind::Homed { twist_error_estimate_rad, load_n, gap_offset_m } => {
                return Ok(Some(Ended::Homed { t_s, twist_error_estimate_rad, load_n, gap_offset_m }));
            }
            EventKind::MoveDone { .. } => return Ok(Some(Ended::Moved { t_s })),
            EventKind::HomingRefused(reason) => return Err(RigError::Homing(reason)),
            EventKind::FaultRaised(fault) => return Err(RigError::Fault(fault)),
            EventKind::Stopped => return Err(RigError::Stopped),
            EventKind::EStopOpened => return Err(RigError::EStop),
            EventKind::FaultCleared(_) | EventKind::EStopClosed => {}
        },
    }
    Ok(None)
}
