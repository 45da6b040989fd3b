//! The position loop: where the load should be and where it is, to how fast the strings turn.
//!
//! θ̇ = TR(F, θ) · (v* + K e): the transmission ratio at the estimated load turns a wanted load speed into twist speed,
//! so feedforward is right and the loop's bandwidth K does not depend on load or twist. The error is smoothed by two
//! poles below the load's resonance (20 rad/s at 1.5 kg deeply twisted, damping ratio a few percent), so that the loop
//! gain there stays below one.
//!
//! What friction holds back is not left to the error either, see [`crate::crossing`].

use crate::TICK_S;
use crate::crossing::{Crossing, TwistLimits};
use crate::mechanism::Mechanism;
use crate::observer::Observation;
use crate::planner::SetPoint;

/// Bandwidth of the loop (1/s).
pub const BANDWIDTH_PER_S: f32 = 3.0;
/// Corner of the two smoothing poles (rad/s).
pub const CORNER_RAD_PER_S: f32 = 9.0;
/// Error (m) below which a load at rest is left alone: an eighth of an LVDT count, so that stiction makes no limit cycle.
const AT_REST_M: f32 = 6e-6;

/// State of the loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct PositionLoop {
    smoothed: [f32; 2],
    /// What is turned to take up friction.
    pub crossing: Crossing,
}

/// What the loop wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopOutput {
    /// Twist speed (rad/s).
    pub twist_speed_rad_per_s: f32,
    /// Set-point less measured position (m).
    pub error_m: f32,
}

impl PositionLoop {
    /// One tick: where the load should be, where it was `age_s` ago (m), what is known of the mechanism, and the twist.
    #[allow(clippy::too_many_arguments)]
    pub fn step(
        &mut self,
        set_point: &SetPoint,
        setting_out: Option<f32>,
        position_m: f32,
        age_s: f32,
        seen: &Observation,
        mechanism: &Mechanism<'_>,
        twist_rad: f32,
        limits: &TwistLimits,
    ) -> LoopOutput {
        let tr = seen.point.tr_rad_per_m();
        let error_m = set_point.position_m - age_s * set_point.speed_m_per_s - position_m;
        let at_rest = set_point.done && error_m.abs() < AT_REST_M;
        let blend = CORNER_RAD_PER_S * TICK_S / (1.0 + CORNER_RAD_PER_S * TICK_S);
        self.smoothed[0] += blend * (if at_rest { 0.0 } else { error_m } - self.smoothed[0]);
        self.smoothed[1] += blend * (self.smoothed[0] - self.smoothed[1]);
        let error = self.smoothed[1];
        let ahead = self.crossing.step(set_point, setting_out, position_m, error, seen, mechanism, twist_rad, limits);
        let speed = set_point.speed_m_per_s + BANDWIDTH_PER_S * error;
        LoopOutput { twist_speed_rad_per_s: tr * speed + ahead, error_m }
    }
}
