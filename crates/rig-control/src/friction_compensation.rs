//! Taking up friction: before a load that last moved the other way can move, the strings' pull has to go from W ∓ f to
//! W ± f.
//!
//! How far that is in twist is roughly known, and is turned at once instead of being left to the error to build up. A
//! move that sets out waits for it with its set-point where it is, until it is done or the load is seen to move.

use crate::TICK_S;
use crate::load_state::LoadState;
use crate::planner::SetPoint;
use crate::ramp::Ramp;

/// Fraction of the friction that is taken up at once for a load at its target. Friction is not known better: with more of it the
/// load breaks loose with too much pull and jumps past its target. The rest is left to the error.
const AT_TARGET: f32 = 0.8;

/// Positions of a load that is still stuck.
#[derive(Clone, Copy, Debug, Default)]
struct StuckLoad {
    sum_m: f32,
    count: f32,
    last_m: f32,
}

impl StuckLoad {
    /// Adds one position; whether the load has moved: along with its strings, or either way because it has changed.
    fn moved(&mut self, load: &LoadState<'_>) -> bool {
        let recent_m = 0.5 * (self.last_m + load.position_m);
        let moved = self.count > 0.0 && (recent_m - self.sum_m / self.count).abs() > load.moved_m();
        self.sum_m += load.position_m;
        self.count += 1.0;
        self.last_m = load.position_m;
        moved
    }
}

/// State of the compensation.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrictionCompensation {
    /// Twist ahead of the set-point (rad).
    ramp: Ramp,
    end_rad: f32,
    /// Sign of the motion for which friction was last taken up.
    direction: f32,
    /// The twist for that motion is still to be worked out.
    unplanned: bool,
    stuck: StuckLoad,
    /// A move that has set out waits with its set-point.
    pub waiting: bool,
    /// How long it still waits (s), as planned in its first tick.
    pub left_s: f32,
}

impl FrictionCompensation {
    /// A move sets out from rest in a direction (±1), and has to wait; 0 for one that is under way or has nowhere to go.
    pub fn set_out(&mut self, direction: f32) {
        self.turn(direction);
        self.waiting = direction != 0.0;
        self.stuck = StuckLoad::default();
    }

    fn turn(&mut self, direction: f32) {
        self.direction = direction;
        self.end_rad = self.ramp.position;
        self.unplanned = direction != 0.0;
        self.left_s = 0.0;
    }

    /// Twist speed (rad/s) that the compensation adds in this tick, at a smoothed error of the position (m). `setting_out`: the
    /// set-point of a move waits.
    pub fn step(&mut self, set_point: &SetPoint, setting_out: bool, error_m: f32, load: &LoadState<'_>) -> f32 {
        self.waiting &= setting_out;
        let wanted = match (set_point.motion.speed, error_m) {
            (v, _) if v != 0.0 => v,
            // About to begin or to end.
            _ if !set_point.done => self.direction,
            (_, e) if e.abs() > load.moved_m() => e,
            _ => 0.0,
        };
        let direction = if wanted == 0.0 { 0.0 } else { libm::copysignf(1.0, wanted) };
        let limits = load.rig.twist_limits();
        if direction != self.direction {
            self.turn(direction);
        }
        if core::mem::take(&mut self.unplanned) {
            self.plan(if set_point.done { AT_TARGET } else { 1.0 }, load);
            self.left_s = Ramp::duration_s(self.end_rad - self.ramp.position, limits.speed, limits.acceleration);
        }
        self.left_s = (self.left_s - TICK_S).max(0.0);
        let before_rad = self.ramp.position;
        self.ramp.step(self.end_rad, limits.speed, limits.acceleration);
        let turned_rad = self.ramp.position - before_rad;
        if self.ramp.speed == 0.0 {
            self.ramp = Ramp::at(0.0);
            self.end_rad = 0.0;
        }
        if self.waiting {
            if self.stuck.moved(load) {
                self.end_rad = self.ramp.stopping_point(limits.acceleration);
                self.waiting = false;
            } else {
                self.waiting = self.ramp.speed != 0.0;
            }
        }
        turned_rad / TICK_S
    }

    /// Works out how far it is to take up a fraction of the friction.
    fn plan(&mut self, fraction: f32, load: &LoadState<'_>) {
        let (direction, observation) = (self.direction, &load.observation);
        let friction_n = observation.friction_n;
        let end_n = observation.mechanism_load_n + direction * friction_n;
        // At this twist, the gap that goes with the pull at the other end of the band.
        let end = load.mechanism.at(end_n, load.twist_rad);
        let band_m = 2.0 * friction_n * end.dgap_dload_m_per_n.max(observation.point.dgap_dload_m_per_n);
        let tr_rad_per_m = end.tr_rad_per_m();
        // The weight is known with less noise than the pull, but only some time after the load has come to rest.
        let pull_n = if self.waiting { load.motion.weight_n } else { observation.pull_n };
        // A pull that is already past the end of the band needs nothing.
        if direction * (end_n - pull_n) > 0.0 {
            let missing_m = (end.gap_m - load.mechanism.at(pull_n, load.twist_rad).gap_m) * direction;
            self.end_rad += direction * fraction * tr_rad_per_m * missing_m.clamp(0.0, 1.25 * band_m);
        }
    }
}
