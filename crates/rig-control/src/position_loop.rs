//! The position loop: from where the load should be and where it is to how fast the strings turn.
//!
//! θ̇ = TR(F, θ) · (v* + K e): the transmission ratio at the estimated load turns a wanted load speed into twist speed,
//! so feedforward is right and the loop's bandwidth K does not depend on load or twist. The error is smoothed by two
//! poles below the load's resonance (20 rad/s at 1.5 kg deeply twisted, damping ratio a few percent), so that the loop
//! gain there stays below one.
//!
//! What friction holds back is not left to the error either, see [`crate::friction_takeup`].

use crate::TICK_S;
use crate::friction_takeup::FrictionTakeup;
use crate::load_state::LoadState;
use crate::planner::SetPoint;

/// Bandwidth of the loop (1/s).
pub const BANDWIDTH_PER_S: f32 = 3.0;
/// Corner of the two smoothing poles (rad/s).
pub const CORNER_RAD_PER_S: f32 = 9.0;
/// Least error (m) below which a load at rest is left alone, an eighth of an LVDT count, and more where the gap is noisier.
pub const AT_REST_M: f32 = 6e-6;
/// The same, over the noise of the gap.
pub const AT_REST_NOISES: f32 = 1.7;
/// How long the error at rest is averaged over (s) before it is held against what stiction does not let the loop reduce
/// ([`FrictionTakeup::tolerance_m`]): noise must not push a load that sticks.
const AT_REST_S: f32 = 0.3;

/// State of the loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct PositionLoop {
    smoothed_m: [f32; 2],
    /// Error averaged at rest (m).
    resting_m: f32,
    /// What is turned to take up friction.
    pub takeup: FrictionTakeup,
}

/// Result of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopOutput {
    /// Twist speed (rad/s).
    pub twist_speed_rad_per_s: f32,
    /// Set-point less measured position (m).
    pub error_m: f32,
}

impl PositionLoop {
    /// One tick. `setting_out` is the speed (m/s) of a move whose set-point waits for friction to be taken up.
    pub fn step(&mut self, set_point: &SetPoint, setting_out: Option<f32>, load: &LoadState<'_>) -> LoopOutput {
        let error_m = set_point.position_m - load.age_s * set_point.speed_m_per_s - load.position_m;
        self.resting_m += TICK_S / AT_REST_S * (error_m - self.resting_m);
        let quiet = error_m.abs() < AT_REST_M.max(AT_REST_NOISES * load.gap_noise_m);
        let sticks = self.resting_m.abs() < self.takeup.tolerance_m(load);
        let at_rest = set_point.done && (quiet || sticks);
        let blend = CORNER_RAD_PER_S * TICK_S / (1.0 + CORNER_RAD_PER_S * TICK_S);
        self.smoothed_m[0] += blend * (if at_rest { 0.0 } else { error_m } - self.smoothed_m[0]);
        self.smoothed_m[1] += blend * (self.smoothed_m[0] - self.smoothed_m[1]);
        let smoothed_m = self.smoothed_m[1];
        let takeup_rad_per_s = self.takeup.step(set_point, setting_out, smoothed_m, load);
        let speed_m_per_s = set_point.speed_m_per_s + BANDWIDTH_PER_S * smoothed_m;
        let twist_speed_rad_per_s = load.observation.point.tr_rad_per_m() * speed_m_per_s + takeup_rad_per_s;
        LoopOutput { twist_speed_rad_per_s, error_m }
    }
}
