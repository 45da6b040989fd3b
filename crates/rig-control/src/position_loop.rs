//! The position loop: from where the load should be and how it moves to how fast the strings turn.
//!
//! In coordinates of the load the strings set where it would come to rest, q, and the load oscillates about that:
//! `p'' = ω² (q − p)`, `q' = u`, with ω² = k/m at this load and twist, and u turned into twist speed by TR. Feedback of p, p'
//! and q places the three poles of this plant ([`GAINS`], docs/explanation/control.md 3): the oscillation is damped, and a
//! motor that is at its limit for most of the way still brings the load to rest without an overshoot. A wanted motion r
//! of the load needs `q = r + r''/ω²`: the resonance is fed forward, so that following needs no feedback.
//!
//! What friction holds back is not left to the error either, see [`crate::friction_compensation`].

use crate::friction_compensation::FrictionCompensation;
use crate::load_motion::AHEAD_S;
use crate::load_state::LoadState;
use crate::observer::TRAVEL_M;
use crate::planner::{Motion, SetPoint};
use crate::rest::{Rest, Standing};

/// Poles `(s + A)(s² + B s + C)` over ω, with a damping ratio of 0.32: chosen, with [`FULL_PER_S`] and the observer's decay, by the
/// margins of the linear analysis and by load steps on emulated rigs (docs/explanation/control.md 3).
pub const POLES: [f32; 3] = [0.5, 0.6, 0.9];
/// Feedback of p, p'/ω and q, over ω, that places them: `s³ + K₂ s² + (1 + K₁) s + (K₀ + K₂)`.
pub const GAINS: [f32; 3] = {
    let [a, b, c] = POLES;
    [a * c - (a + b), a * b + c - 1.0, a + b]
};
/// Fraction of the strings' maximum speed that damping the oscillation may use. With more, strings whose load has just become heavier would
/// turn back and forth to damp its oscillation instead of taking it back to its place.
const DAMPING_FRACTION: f32 = 0.8;
/// Frequency of the load's oscillation (rad/s) from which the gains no longer grow with it, and from which those that damp it fall:
/// the observer is then hardly faster than the load. With one number for both, half a kilogram moves less evenly on nominal plants.
pub const FULL_PER_S: f32 = 22.0;
const THIN_PER_S: f32 = 36.0;
/// Speed over error (1/s) at which the strings turn for a load that sticks: slow enough that it is seen to move before it is past
/// its target.
const STUCK_PER_S: f32 = 2.0;

/// A load off its set-point that does not travel while the pull of its strings changes by so much is jammed: the sum of a least
/// change (N), since a small friction is not known well, of a fraction of the load, and of the width of the friction band. Turned
/// further, the strings would let it spring when it comes loose, or fall slack. The load estimate goes along with the pull; so the
/// change counts from what the load seemed to weigh when it last travelled or was at its set-point. While a weight is changed by
/// hand, the load may stand beside a set-point that stands, with strings that turn for it.
const MIN_JAMMED_N: f32 = 0.5;
const JAMMED_FRACTION: f32 = 0.3;

/// Fraction of the gains that damp the oscillation of a load at a frequency (rad/s): the faster the oscillation, the more of its phase the unknown
/// part of the delay takes.
pub fn damping_fraction(frequency: f32) -> f32 {
    let thin = (THIN_PER_S / frequency).min(1.0);
    (FULL_PER_S / frequency).min(1.0) * thin * thin
}

/// State of the loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct PositionLoop {
    /// The load at its target.
    pub rest: Rest,
    /// What is turned to take up friction.
    pub compensation: FrictionCompensation,
    /// What the load was taken for when it last moved (N); `None` before the first tick.
    moved_load_n: Option<f32>,
    /// The load has been at its set-point, which has not moved away from it since.
    was_there: bool,
    /// The load is jammed, and the strings do not turn further.
    pub stopped: bool,
}

impl PositionLoop {
    /// One tick: twist speed (rad/s). `setting_out`: the set-point of a move waits for friction to be taken up.
    pub fn step(&mut self, set_point: &SetPoint, setting_out: bool, load: &LoadState<'_>) -> f32 {
        let motion = &load.motion;
        let frequency_squared = motion.frequency_squared();
        let frequency = libm::sqrtf(frequency_squared);
        let hung = load.mechanism.at(motion.weight_n, load.twist_rad);
        // The set-point when this command acts.
        let SetPoint { motion: Motion { position, speed, acceleration }, jerk, done } = *set_point;
        let wanted_m = position + AHEAD_S * (speed + 0.5 * AHEAD_S * acceleration);
        let wanted_speed = speed + AHEAD_S * acceleration;
        let error_m = wanted_m - (load.found.reference_gap_m - motion.gap_m);
        let speed_error = wanted_speed + motion.speed_m_per_s;
        let rest_m = load.found.reference_gap_m - hung.gap_m;
        let rest_error_m = wanted_m + acceleration / frequency_squared - rest_m;
        let standing = self.rest.step(done, position - load.position_m, load);
        let [by_position, by_speed, by_rest] = GAINS;
        // What brings the place of rest to where it is wanted, and what damps the oscillation about it.
        let place = frequency.min(FULL_PER_S) * (by_position + by_rest) * rest_error_m;
        let max_m_per_s = DAMPING_FRACTION * load.rig.twist_speed_max() / hung.tr_rad_per_m();
        let damping = frequency * by_position * (error_m - rest_error_m) + by_speed * speed_error;
        let damping = (damping_fraction(frequency) * damping).clamp(-max_m_per_s, max_m_per_s);
        let feedback = load.rig.loop_gain * (place + damping);
        // The observer knows no friction: a load that sticks is not where it would come to rest.
        let (feedback, stuck_m) = match standing {
            Standing::LeftAlone => {
                self.compensation = FrictionCompensation::default();
                return 0.0;
            }
            Standing::Beside(stuck_m) => (STUCK_PER_S * stuck_m, stuck_m),
            // Neither is one that waits for its friction to be taken up.
            Standing::Moves if setting_out => (0.0, 0.0),
            Standing::Moves => (feedback, 0.0),
        };
        let compensation_rad_per_s = self.compensation.step(set_point, setting_out, stuck_m, load);
        let speed_m_per_s = wanted_speed + jerk / frequency_squared + feedback;
        let twist_speed_rad_per_s = hung.tr_rad_per_m() * speed_m_per_s + compensation_rad_per_s;
        self.stopped = self.jammed(set_point, load) * twist_speed_rad_per_s > 0.0;
        if self.stopped { 0.0 } else { twist_speed_rad_per_s }
    }

    /// By how much the strings pull a jammed load more than its weight (N); 0 for one that is not jammed.
    fn jammed(&mut self, set_point: &SetPoint, load: &LoadState<'_>) -> f32 {
        let observation = &load.observation;
        let weight_n = load.motion.weight_n;
        // A load at its set-point is where it is wanted, and one that has left a set-point which stands is not jammed: its strings
        // turn for another weight.
        let at_set_point = (set_point.motion.position - load.position_m).abs() < TRAVEL_M;
        self.was_there = at_set_point || (self.was_there && set_point.done);
        let known = if self.was_there { 1.0 } else { (observation.moved_m / load.moved_m()).min(1.0) };
        let before_n = self.moved_load_n.unwrap_or(weight_n);
        let moved_load_n = before_n + known * (weight_n - before_n);
        self.moved_load_n = Some(moved_load_n);
        let beyond_n = observation.pull_n - moved_load_n;
        let max_n = MIN_JAMMED_N + JAMMED_FRACTION * moved_load_n + 2.0 * load.found.friction_n;
        if beyond_n.abs() > max_n { beyond_n } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gains_place_the_poles() {
        let ([a, b, c], [by_position, by_speed, by_rest]) = (POLES, GAINS);
        // Of p'' = q − p, q' = −K₀ p − K₁ p' − K₂ q, and of (s + a)(s² + b s + c).
        let closed = [by_rest, 1.0 + by_speed, by_position + by_rest];
        for (got, wanted) in closed.into_iter().zip([a + b, a * b + c, a * c]) {
            assert!((got - wanted).abs() < 1e-6, "{closed:?}");
        }
        assert!(b / (2.0 * libm::sqrtf(c)) > 0.3, "damping ratio");
    }

    #[test]
    fn damping_falls_where_the_load_swings_faster_than_the_observer_sees() {
        assert_eq!(damping_fraction(10.0), 1.0);
        assert!((damping_fraction(72.0) - 22.0 / 72.0 * 0.25).abs() < 1e-6);
        assert!(damping_fraction(150.0) < 0.01);
    }
}
