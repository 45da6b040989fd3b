//! Slow adaptation: the twist scale drifts as strings creep and warm up, and every longer move shows by how much.
//!
//! A load weighs the same wherever it is. If the scale is wrong by δ, twist and gap make it seem heavier by x δ, with
//! x = (∂G/∂s)/(∂G/∂F), which grows with twist: the slope of the load that is shown over x along one move is δ. A load that
//! changes under way looks different, and a move with a pull outside the friction band teaches nothing.
//!
//! A move that asks for a scale too far from that of homing teaches nothing, so that errors that are no drift (a slip, a failing
//! sensor) cannot be learned away: such moves in a row mean that gap and table have parted ([`Adaptation::disagrees`]).

use crate::mechanism::bounded_scale;
use crate::observer::{KnownErrors, LoadObserver, Observation, SETTLED_TICKS};
use rig_link::messages::LoadChoice;

/// Maximum drift of the scale from that of homing.
pub const LARGEST_DRIFT: f32 = 0.03;
/// Spread (rms, N) of x along a move of whose slope half is learned. A move with a smaller spread says less about a drift, and less of its
/// slope is learned.
const HALF_LEARNED_N: f32 = 3.0;
/// Minimum spread (rms, N) of a move that says whether the bound is kept. A move with a smaller spread can only say that it is not: if it
/// makes the load seem to change by more than friction and creep do.
const MIN_SPREAD_TO_JUDGE_N: f32 = 1.25;
/// Moves in a row beyond the bound that are neither chance nor a load that somebody goes on filling.
const DOUBTFUL_MOVES: u8 = 2;

/// Regression of the load that is shown over x along one move, and the scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation {
    homed_scale: f32,
    /// Moves in a row that asked for more than the bound.
    doubtful: u8,
    count: f32,
    mean_x: f32,
    mean_load: f32,
    spread: f32,
    together: f32,
}

impl Adaptation {
    /// From the scale that homing found.
    pub const fn new(homed_scale: f32) -> Self {
        Self { homed_scale, doubtful: 0, count: 0.0, mean_x: 0.0, mean_load: 0.0, spread: 0.0, together: 0.0 }
    }

    /// One tick of a move at a twist (rad); `done` when the set-point has arrived. What the move teaches changes the scale and
    /// what the observer makes of twist and gap.
    pub fn step(
        &mut self,
        twist_scale: &mut f32,
        observer: &mut LoadObserver,
        observation: &Observation,
        twist_rad: f32,
        done: bool,
    ) {
        // Change of the load estimate (N) for a change of the scale by 1: (∂G/∂s)/(∂G/∂F).
        let x =
            observation.point.dgap_dtwist_m_per_rad * twist_rad / *twist_scale / observation.point.dgap_dload_m_per_n;
        if observation.changing || observer.source != LoadChoice::Auto {
            self.forget_move();
        } else if done {
            if let Some((scale_change, agrees)) = self.end_move(*twist_scale, observer.known_errors()) {
                observer.end_move(agrees);
                *twist_scale += scale_change;
                observer.shift_load(-x * scale_change);
            }
        } else if observation.moved_m > 0.0 {
            // The estimate follows with a lag, from one end of the friction band to the other or from a load that has changed
            // at rest. On a short move that would look like a drift.
            self.record(x, observation.shown_n);
        }
    }

    /// Begins a move, or drops one that cannot teach anything.
    pub fn forget_move(&mut self) {
        (self.count, self.mean_x, self.mean_load, self.spread, self.together) = (0.0, 0.0, 0.0, 0.0, 0.0);
    }

    /// One reading of a moving load: x (N for a scale of 1) and the load that it shows (N).
    fn record(&mut self, x: f32, load_n: f32) {
        self.count += 1.0;
        let (from_x, from_load) = (x - self.mean_x, load_n - self.mean_load);
        self.mean_x += from_x / self.count;
        self.mean_load += from_load / self.count;
        self.spread += from_x * (x - self.mean_x);
        self.together += from_x * (load_n - self.mean_load);
    }

    /// Ends a move at a scale: the change of the scale, 0 if it taught nothing about it, and whether the load weighed the same all
    /// along the move, drift aside; `None` if the move was too short to judge.
    fn end_move(&mut self, twist_scale: f32, known: KnownErrors) -> Option<(f32, bool)> {
        let slope = self.together / self.spread;
        let variance_n2 = self.spread / self.count;
        let is_long = self.count >= f32::from(SETTLED_TICKS);
        let learned = variance_n2 / (variance_n2 + HALF_LEARNED_N * HALF_LEARNED_N);
        self.forget_move();
        let drift = (twist_scale + slope - self.homed_scale).abs();
        let bound = LARGEST_DRIFT + known.memory;
        // Another load than the homed one explains a greater slope. It is no fault then, but it confirms no load either.
        let doubtful = drift > bound + known.change && drift * libm::sqrtf(variance_n2) > known.noise_n;
        let can_judge = doubtful || variance_n2 >= MIN_SPREAD_TO_JUDGE_N * MIN_SPREAD_TO_JUDGE_N;
        if !is_long || !can_judge || !slope.is_finite() {
            return None;
        }
        self.doubtful = if doubtful { self.doubtful.saturating_add(1) } else { 0 };
        // What is beyond the bound is no drift, and teaches nothing about it.
        let scale = twist_scale + if drift <= LARGEST_DRIFT { learned * slope } else { 0.0 };
        Some((bounded_scale(scale) - twist_scale, drift <= bound))
    }

    /// Whether gap and table have parted: the slopes of the last moves are no drift.
    pub fn disagrees(&self) -> bool {
        self.doubtful >= DOUBTFUL_MOVES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moves of a load of 5 N whose estimate is off by x δ; the scale after `moves`.
    fn learn(true_scale: f32, moves: u16, load: fn(u16) -> f32) -> f32 {
        let (mut a, mut scale) = (Adaptation::new(1.0), 1.0f32);
        for _ in 0..moves {
            for k in 0..600u16 {
                let x = 0.5 + 0.02 * f32::from(k);
                a.record(x, load(k) + x * (true_scale - scale));
            }
            scale += a.end_move(scale, KnownErrors::default()).map_or(0.0, |(change, _)| change);
        }
        scale
    }

    #[test]
    fn a_drift_is_learned_in_a_few_moves() {
        for drift in [-0.01f32, 0.02] {
            let scale = learn(1.0 + drift, 20, |_| 5.0);
            assert!((scale - 1.0 - drift).abs() < 1e-3, "{scale}");
        }
    }

    #[test]
    fn a_longer_move_teaches_more() {
        for (spread_n, part) in [(1.5f32, 0.2), (3.0, 0.5), (9.0, 0.9)] {
            let mut a = Adaptation::new(1.0);
            for k in 0..100u16 {
                let x = 20.0 + if k % 2 == 0 { spread_n } else { -spread_n };
                a.record(x, 5.0 + 0.01 * x);
            }
            let learned = a.end_move(1.0, KnownErrors::default()).map_or(0.0, |(change, _)| change) / 0.01;
            assert!((learned - part).abs() < 1e-3, "{spread_n} N: {learned}");
        }
    }

    #[test]
    fn what_is_no_drift_is_not_learned_away() {
        assert_eq!(learn(1.1, 50, |_| 5.0), 1.0);
    }

    /// Ends a move along which the estimate was off by x · `slope`; whether the load weighed the same.
    fn ends(a: &mut Adaptation, slope: f32, known: KnownErrors) -> Option<bool> {
        (0..300u16).for_each(|n| a.record(0.02 * f32::from(n), 1.0 + 0.02 * f32::from(n) * slope));
        a.end_move(1.0, known).map(|(_, agrees)| agrees)
    }

    #[test]
    fn two_moves_in_a_row_beyond_the_bound_are_doubted_unless_a_known_error_explains_them() {
        // On a rig whose constants are not its own, the scale that fits under the homed load does not fit under another one:
        // 2 % error of a change, and a load that is 4.3 times the homed one. What a slip of 3 mm makes of it looks like a load
        // that has become 0.6 times heavier.
        let (other, slipped) = (0.02 * 3.3, 0.02 * 0.6);
        for (slopes, memory, change, agree, disagrees) in [
            ([0.0, 0.02], 0.0, 0.0, [true; 2], false),
            ([0.029; 2], 0.0, 0.0, [true; 2], false),
            ([0.04; 2], 0.0, 0.0, [false; 2], true),
            ([-0.3; 2], 0.0, 0.0, [false; 2], true),
            ([0.1, 0.0], 0.0, 0.0, [false, true], false),
            ([0.0, 0.1], 0.0, 0.0, [true, false], false),
            ([0.07; 2], 0.0, 0.0, [false; 2], true),
            ([0.07; 2], 0.1, 0.0, [true; 2], false),
            ([0.1; 2], 0.0, 0.0, [false; 2], true),
            // No fault, but nothing is confirmed.
            ([0.09; 2], 0.0, other, [false; 2], false),
            ([0.1; 2], 0.0, other, [false; 2], true),
            ([0.045; 2], 0.0, slipped, [false; 2], true),
        ] {
            let mut a = Adaptation::new(1.0);
            let known = KnownErrors { memory, change, noise_n: 0.0 };
            assert_eq!(ends(&mut a, slopes[0], known), Some(agree[0]), "{slopes:?} {known:?}");
            assert!(!a.disagrees(), "one is not enough: {slopes:?}");
            assert_eq!(ends(&mut a, slopes[1], known), Some(agree[1]), "{slopes:?} {known:?}");
            assert_eq!(a.disagrees(), disagrees, "{slopes:?} {known:?}");
        }
    }

    #[test]
    fn a_load_that_seems_to_change_by_less_than_friction_and_creep_explain_is_no_contradiction() {
        // 16.7 N on a rail with 0.6 N of friction: 0.2 N, which is 0.11 of the rms of x here.
        let known = KnownErrors { noise_n: 0.2, ..KnownErrors::default() };
        for (slopes, disagrees) in [([0.055, 0.051], false), ([0.12; 2], true)] {
            let mut a = Adaptation::new(1.0);
            for slope in slopes {
                assert_eq!(ends(&mut a, slope, known), Some(false), "it confirms nothing: {slope}");
            }
            assert_eq!(a.disagrees(), disagrees, "{slopes:?}");
        }
    }

    #[test]
    fn a_short_move_can_contradict_but_not_confirm() {
        let known = KnownErrors { noise_n: 0.1, ..KnownErrors::default() };
        let ends = |a: &mut Adaptation, slope: f32| {
            // The rms of x is 0.87 N.
            (0..300u16).for_each(|n| a.record(0.01 * f32::from(n), 1.0 + 0.01 * f32::from(n) * slope));
            a.end_move(1.0, known).map(|(_, agrees)| agrees)
        };
        let mut a = Adaptation::new(1.0);
        assert_eq!([0.02, 0.08, 0.2].map(|slope| ends(&mut a, slope)), [None, None, Some(false)]);
        // What says nothing does not take the doubt away.
        assert_eq!([0.02, 0.2].map(|slope| ends(&mut a, slope)), [None, Some(false)]);
        assert!(a.disagrees());
    }

    #[test]
    fn short_moves_and_nonsense_teach_nothing() {
        let mut a = Adaptation::new(1.0);
        (0..1000).for_each(|_| a.record(2.0, 5.0));
        assert_eq!(a.end_move(1.0, KnownErrors::default()), None);
        (0..1000u16).for_each(|k| a.record(f32::from(k), f32::NAN));
        assert_eq!(a.end_move(1.0, KnownErrors::default()), None);
    }
}
