//! Homing, from the request to its result.

use super::client::Session;
use super::motion::check_motion;
use super::row::Row;
use crate::failure::{Failure, HomingFailed};
use crate::output::progress;
use rig_link::{EventKind, LoadChoice, Request};
use serde::Serialize;

/// Longest homing (s), the drive's start-up included.
const HOMING_S: f64 = 60.0;

/// How a homing ended.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct HomeResult {
    /// Homing time, without the start-up of the drive (s).
    pub duration_s: f64,
    /// Load that was weighed (N).
    pub load_n: f32,
    /// Half the width of the interval around `load_n` that holds the true load in 90 of 100 cases (N).
    pub load_error_n: f32,
    /// Coulomb friction of the rail (N).
    pub friction_n: f32,
    /// Half the width of the interval around zero twist that holds the true one in 90 of 100 cases (rad).
    pub zero_error_rad: f32,
    /// Measured gap at position zero (m).
    pub reference_gap_m: f32,
}

impl HomeResult {
    /// A line for people.
    pub fn text(&self) -> String {
        format!(
            "homed in {:.1} s: load {:.3} N ± {:.3} N, friction {:.3} N, zero twist ± {:.4} rad",
            self.duration_s, self.load_n, self.load_error_n, self.friction_n, self.zero_error_rad
        )
    }
}

/// Homes; `load` is what the operator says of the load's weight, `each` gets every row of telemetry.
///
/// # Errors
/// The board's refusal or failure in words.
pub fn home(session: &mut Session, load: LoadChoice, mut each: impl FnMut(&Row)) -> Result<HomeResult, Failure> {
    session.wait_ready()?;
    let start_s = session.now_s();
    session.request(&Request::Home { load })?;
    let bar = progress(45, "homing");
    while session.now_s() < start_s + HOMING_S {
        session.step()?;
        bar.set_position((session.now_s() - start_s) as u64);
        session.take_rows().iter().for_each(&mut each);
        for (t_s, kind) in session.take_events() {
            match kind {
                EventKind::Homed(found) => {
                    bar.finish_and_clear();
                    return Ok(HomeResult {
                        duration_s: t_s - start_s,
                        load_n: found.load_n,
                        load_error_n: found.load_error_n,
                        friction_n: found.friction_n,
                        zero_error_rad: found.zero_error_rad,
                        reference_gap_m: found.reference_gap_m,
                    });
                }
                EventKind::HomingRefused(failure) => return Err(HomingFailed(failure).into()),
                kind => check_motion(&kind, "while homing")?,
            }
        }
    }
    Err(Failure::failed(format!("homing did not end within {HOMING_S} s")))
}
