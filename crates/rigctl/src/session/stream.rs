//! A trajectory that is streamed to the board as set-points.

use super::client::Session;
use super::motion::{ended, move_to};
use super::row::Row;
use crate::failure::Failure;
use crate::output::progress;
use crate::statistics::Errors;
use crate::trajectory::{HOLDS_FOR_S, Trajectory};
use crate::units::PERCENT;
use rig_link::{Limit, LoadChoice, Request, State};
use serde::Serialize;

/// Speed of the way to where a trajectory begins (m/s).
const APPROACH_M_PER_S: f64 = 2e-3;
/// Time for the load to come to rest after the last set-point (s).
const REST_S: f64 = 0.5;
/// Longest time until it holds (s).
const HOLDS_S: f64 = 10.0;

/// How a stream went.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct StreamResult {
    /// Duration of the trajectory (s).
    pub duration_s: f64,
    /// Distance of the measured position from the trajectory on the way (m): rms and maximum.
    pub following_rms_m: f64,
    /// The maximum.
    pub following_most_m: f64,
    /// The same of the true position, emulated rigs only (m).
    pub true_following_rms_m: Option<f64>,
    /// Fraction of the way on which the motor's speed held the load back.
    pub held_back_share: f64,
    /// Measured position at rest less the end of the trajectory (m).
    pub error_m: f64,
}

impl StreamResult {
    /// On how much of the way the motor's speed held the load back; empty if it did not.
    pub fn limit_text(&self) -> String {
        let share = Some(self.held_back_share).filter(|share| *share > 0.0);
        share.map_or(String::new(), |share| format!("motor-speed on {} of the way", PERCENT.show(share)))
    }
}

/// Brings the load to where a trajectory begins, then leads it along; `each` gets every row of telemetry. It ends at rest.
///
/// # Errors
/// The board's refusal, or why it ended the stream, in words.
pub fn track(
    session: &mut Session,
    trajectory: &Trajectory,
    mut each: impl FnMut(&Row),
) -> Result<StreamResult, Failure> {
    move_to(session, trajectory.start_m(), APPROACH_M_PER_S, LoadChoice::Auto, &mut each)?;
    session.take_replies();
    session.take_events();
    let bar = progress(1000, "tracking");
    let (mut measured_m, mut true_m, mut held_back) = (Vec::new(), Vec::new(), 0);
    let (end_m, _) = trajectory.at(trajectory.duration_s());
    let rest = Request::Track { position_m: end_m as f32, speed_m_per_s: 0.0, for_s: HOLDS_FOR_S };
    let mut points = trajectory.set_points().peekable();
    let start_s = session.now_s();
    while session.now_s() < start_s + trajectory.duration_s() + REST_S {
        let t_s = session.now_s() - start_s;
        // After a delay only the newest one counts.
        let mut due = None;
        while let Some((_, point)) = points.next_if(|(at_s, _)| *at_s <= t_s + 1e-9) {
            due = Some(point);
        }
        match due {
            Some(point) => _ = session.post(&point)?,
            // The last one holds until the load is at rest.
            None if points.peek().is_none() => _ = session.post(&rest)?,
            None => {}
        }
        session.step()?;
        for row in session.take_rows() {
            if row.state == State::Moving
                && t_s < trajectory.duration_s()
                && let Some((target_m, position_m)) = row.target_m.zip(row.position_m)
            {
                let distance_m = |position_m: f64| position_m - f64::from(target_m);
                measured_m.push(distance_m(position_m.into()));
                true_m.extend(row.true_position_m.map(distance_m));
                held_back += usize::from(row.limit == Some(Limit::MotorSpeed));
            }
            each(&row);
        }
        bar.set_position((1000.0 * t_s / trajectory.duration_s().max(1e-9)) as u64);
        for (_, reply) in session.take_replies() {
            reply.map_err(|refusal| Failure::of_kind("refused", format!("refused: {refusal}")))?;
        }
        ended(session, &rest, "on the way")?;
    }
    bar.finish_and_clear();
    session.request(&Request::Stop)?;
    if !session.until(HOLDS_S, |s| !s.is_moving())? {
        return Err(Failure::failed("the load did not come to rest"));
    }
    let position_m = session.telemetry().and_then(|t| t.position_m).map_or(f64::NAN, f64::from);
    let (followed, truly) = (Errors::over(measured_m), Errors::over(true_m));
    Ok(StreamResult {
        duration_s: trajectory.duration_s(),
        following_rms_m: followed.rms,
        following_most_m: followed.worst,
        true_following_rms_m: (truly.count > 0).then_some(truly.rms),
        held_back_share: held_back as f64 / followed.count as f64,
        error_m: position_m - end_m,
    })
}
