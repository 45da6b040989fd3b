//! The position loop: where the load should be and where it is, to how fast the strings turn.
//!
//! θ̇ = TR(F, θ) · (v* + K e): the transmission ratio at the estimated load turns a wanted load speed into twist speed,
//! so feedforward is right and the loop's bandwidth K does not depend on load or twist. The error is smoothed by two
//! poles below the load's resonance (20 rad/s at 1.5 kg deeply twisted, damping ratio a few percent), so that the loop
//! gain there stays below one.
//!
//! Where a move begins against the direction in which the load last moved, the strings first have to take up friction:
//! the pull must cross the band from W ∓ f to W ± f before anything moves. How far that is in twist is known, so it is
//! turned at once and not left to the error to build up.

use crate::TICK_S;
use crate::mechanism::Mechanism;
use crate::observer::Observation;
use crate::planner::{Ramp, SetPoint};

/// Bandwidth of the loop (1/s).
pub const BANDWIDTH_PER_S: f32 = 3.0;
/// Corner of the two smoothing poles (rad/s).
const CORNER_RAD_PER_S: f32 = 9.0;
/// Error (m) below which a load at rest is left alone: an eighth of an LVDT count, so that stiction makes no limit cycle.
const AT_REST_M: f32 = 6e-6;
/// Share of the way across the friction band that is turned ahead, as a move begins and at rest: what friction is wrong
/// by must not push the load, least of all back and forth about its target.
const CROSSING_SHARE: [f32; 2] = [0.95, 0.8];
/// Set-point speed (m/s) that is a move and not the last rounding of one.
const MOVING_M_PER_S: f32 = 8e-6;
/// Smoothed error (m) at rest that friction must be crossed for.
const STUCK_M: f32 = 20e-6;
/// Share of the motor's speed and acceleration for that; the rest is the move's.
const CROSSING_LIMITS: f32 = 0.7;

/// State of the loop.
#[derive(Clone, Copy, Debug)]
pub struct PositionLoop {
    smoothed: [f32; 2],
    /// Twist ahead of the set-point, across the friction band (rad).
    crossing: Ramp,
    crossing_end_rad: f32,
    /// Sign of the move for which it was last set.
    direction: f32,
    /// The crossing for that move is still to be worked out: not in its first tick, which has looked up enough.
    to_cross: bool,
}

impl Default for PositionLoop {
    fn default() -> Self {
        Self { smoothed: [0.0; 2], crossing: Ramp::at(0.0), crossing_end_rad: 0.0, direction: 0.0, to_cross: false }
    }
}

/// What the loop wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopOutput {
    /// Twist speed (rad/s).
    pub twist_speed_rad_per_s: f32,
    /// Set-point less measured position (m).
    pub error_m: f32,
}

/// Limits of the twist: speed (rad/s) and acceleration (rad/s²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistLimits {
    /// Greatest speed (rad/s).
    pub speed: f32,
    /// Greatest acceleration (rad/s²).
    pub acceleration: f32,
}

impl PositionLoop {
    /// One tick: where the load should be, where it was `age_s` ago (m), what is known of the mechanism, and the twist.
    /// One table lookup in the tick in which friction begins to be crossed, else none.
    #[allow(clippy::too_many_arguments)]
    pub fn step(
        &mut self,
        set_point: &SetPoint,
        setting_out: f32,
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
        let ahead = self.cross_friction(set_point, setting_out, seen, mechanism, twist_rad, limits);
        let speed = set_point.speed_m_per_s + BANDWIDTH_PER_S * self.smoothed[1];
        LoopOutput { twist_speed_rad_per_s: tr * speed + ahead, error_m }
    }

    /// Friction has been taken up for a move this way (±1).
    pub fn is_across(&self, way: f32) -> bool {
        way == self.direction && !self.to_cross && self.crossing.speed == 0.0
    }

    /// Twist speed (rad/s) that the crossing takes in this tick.
    fn cross_friction(
        &mut self,
        set_point: &SetPoint,
        setting_out: f32,
        seen: &Observation,
        mechanism: &Mechanism<'_>,
        twist_rad: f32,
        limits: &TwistLimits,
    ) -> f32 {
        let (wanted, share) = match (set_point.speed_m_per_s, self.smoothed[1]) {
            _ if setting_out != 0.0 => (setting_out, CROSSING_SHARE[0]),
            (v, _) if v.abs() > MOVING_M_PER_S => (v, CROSSING_SHARE[0]),
            // About to begin or to end.
            _ if !set_point.done => (self.direction, CROSSING_SHARE[0]),
            (_, e) if e.abs() > STUCK_M => (e, CROSSING_SHARE[1]),
            _ => (0.0, 0.0),
        };
        let direction = if wanted == 0.0 { 0.0 } else { libm::copysignf(1.0, wanted) };
        if direction != self.direction {
            self.direction = direction;
            self.crossing_end_rad = self.crossing.position;
            self.to_cross = direction != 0.0;
        } else if core::mem::take(&mut self.to_cross) {
            // Against the move it may only be stopped: there the pull is already past the end of the band.
            if direction * (seen.load_n + direction * seen.friction_n - seen.pull_n) > 0.0 {
                // Twisted this far, the same gap goes with the pull at the other end.
                let end = mechanism.at(seen.load_n + direction * seen.friction_n, twist_rad);
                let missing_m = (end.gap_m - seen.modelled_gap_m) * direction;
                let most_m = 2.5 * seen.friction_n * end.dgap_dload_m_per_n.max(seen.point.dgap_dload_m_per_n);
                self.crossing_end_rad += share * direction * end.tr_rad_per_m() * missing_m.clamp(0.0, most_m);
            }
        }
        let Ramp { position, .. } = self.crossing;
        self.crossing.step(
            self.crossing_end_rad,
            CROSSING_LIMITS * limits.speed,
            CROSSING_LIMITS * limits.acceleration,
        );
        let travelled = self.crossing.position - position;
        if self.crossing.speed == 0.0 {
            self.crossing = Ramp::at(0.0);
            self.crossing_end_rad = 0.0;
        }
        travelled / TICK_S
    }
}
