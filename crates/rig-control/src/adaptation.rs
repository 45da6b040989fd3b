//! Slow adaptation: the twist scale drifts as strings creep and warm up, and every longer move tells by how much.
//!
//! A load weighs the same wherever it is. If the scale is wrong by δ, twist and gap make it seem heavier by x δ, with
//! x = (∂G/∂s)/(∂G/∂F), which grows with twist: the slope of the estimate over x along one move is δ. A load that
//! changes under way shows otherwise, and a move in which the observer was surprised teaches nothing.
//!
//! Bounded about what homing found, so that what is not drift (slip, a failing sensor) cannot be learned away: moves that
//! ask for more than the bound, one after the other, mean that gap and table have parted ([`Adaptation::disagrees`]).
//! Nothing is stored unless asked for.

use crate::mechanism::TWIST_SCALE;

/// Farthest that a scale may drift from homing's.
pub const LARGEST_DRIFT: f32 = 0.03;
/// Share of a move's finding that is learned, and the most at once.
const SHARE: f32 = 0.3;
const LARGEST_STEP: f32 = 0.004;
/// Least spread (rms, N) of x along a move that tells anything: 1 % of scale is then 0.015 N.
const LEAST_SPREAD_N: f32 = 1.5;
/// Least spread that tells whether the bound is kept: on healthy rigs a move's finding is then within 0.016, after a
/// slip of 3 mm it is 0.04 and more.
const LEAST_SPREAD_TO_DOUBT_N: f32 = 0.3;
/// Moves in a row beyond the bound that are no chance, nor a load that somebody went on filling.
const DOUBTFUL_MOVES: u8 = 2;
/// Least readings.
const LEAST_COUNT: f32 = 100.0;

/// What the rig has learned, to be stored and given back on request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learned {
    /// Scale of the twist, see [`crate::mechanism`].
    pub twist_scale: f32,
    /// Coulomb friction of the rail (N).
    pub friction_n: f32,
    /// Moves that it was learned from.
    pub moves: u16,
    /// The drift stands at its bound: home anew, or look at the strings.
    pub at_bound: bool,
}

/// What one move taught.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding {
    /// Change of the scale; 0 if it taught nothing about it.
    pub scale_change: f32,
    /// Whether the load weighed the same all along the move, within what drift explains; `None` if the move was too short
    /// to tell.
    pub agrees: Option<bool>,
}

/// Regression of the load estimate over x along one move, and the scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation {
    homed_scale: f32,
    moves: u16,
    at_bound: bool,
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
        Self {
            homed_scale,
            moves: 0,
            at_bound: false,
            doubtful: 0,
            count: 0.0,
            mean_x: 0.0,
            mean_load: 0.0,
            spread: 0.0,
            together: 0.0,
        }
    }

    /// A move begins, or something happened that makes the present one worthless.
    pub fn forget_move(&mut self) {
        (self.count, self.mean_x, self.mean_load, self.spread, self.together) = (0.0, 0.0, 0.0, 0.0, 0.0);
    }

    /// One reading of a moving load: x (N for a scale of 1) and the load estimate (N).
    pub fn record(&mut self, x: f32, load_n: f32) {
        self.count += 1.0;
        let (from_x, from_load) = (x - self.mean_x, load_n - self.mean_load);
        self.mean_x += from_x / self.count;
        self.mean_load += from_load / self.count;
        self.spread += from_x * (x - self.mean_x);
        self.together += from_x * (load_n - self.mean_load);
    }

    /// The move is over: what it taught.
    pub fn end_move(&mut self, twist_scale: f32) -> Finding {
        let found = self.together / self.spread;
        let spread = |least_n: f32| self.count >= LEAST_COUNT && self.spread >= self.count * least_n * least_n;
        let (tells, doubts) = (spread(LEAST_SPREAD_N), spread(LEAST_SPREAD_TO_DOUBT_N));
        self.forget_move();
        if !doubts || !found.is_finite() {
            return Finding { scale_change: 0.0, agrees: None };
        }
        let beyond = (twist_scale + found - self.homed_scale).abs() > LARGEST_DRIFT;
        self.doubtful = if beyond { self.doubtful.saturating_add(1) } else { 0 };
        let agrees = Some(!beyond);
        if !tells {
            return Finding { scale_change: 0.0, agrees };
        }
        self.moves = self.moves.saturating_add(1);
        let wanted = twist_scale + (SHARE * found).clamp(-LARGEST_STEP, LARGEST_STEP);
        let scale = self.bounded(wanted);
        self.at_bound = scale != wanted;
        Finding { scale_change: scale - twist_scale, agrees }
    }

    /// Gap and table have parted: what the last moves found is no drift.
    pub fn disagrees(&self) -> bool {
        self.doubtful >= DOUBTFUL_MOVES
    }

    /// The nearest scale that may be learned.
    pub fn bounded(&self, twist_scale: f32) -> f32 {
        let low = TWIST_SCALE[0].max(self.homed_scale - LARGEST_DRIFT);
        let high = TWIST_SCALE[1].min(self.homed_scale + LARGEST_DRIFT);
        twist_scale.max(low).min(high)
    }

    /// For storing.
    pub fn learned(&self, twist_scale: f32, friction_n: f32) -> Learned {
        Learned { twist_scale, friction_n, moves: self.moves, at_bound: self.at_bound }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moves of a load of 5 N whose estimate is off by x δ; the scale after `moves`.
    fn learn(true_scale: f32, moves: u16, load: fn(u16) -> f32) -> (f32, Learned) {
        let (mut a, mut scale) = (Adaptation::new(1.0), 1.0f32);
        for _ in 0..moves {
            for k in 0..600u16 {
                let x = 0.5 + 0.02 * f32::from(k);
                a.record(x, load(k) + x * (true_scale - scale));
            }
            scale += a.end_move(scale).scale_change;
        }
        (scale, a.learned(scale, 0.05))
    }

    #[test]
    fn a_drift_is_learned_in_a_few_moves() {
        for drift in [-0.01f32, 0.02] {
            let (scale, learned) = learn(1.0 + drift, 20, |_| 5.0);
            assert!((scale - 1.0 - drift).abs() < 1e-3, "{scale}");
            assert!(learned.moves == 20 && !learned.at_bound);
        }
    }

    #[test]
    fn what_is_no_drift_is_not_learned_away() {
        let (scale, learned) = learn(1.1, 50, |_| 5.0);
        assert!((scale - 1.0 - LARGEST_DRIFT).abs() < 1e-6 && learned.at_bound);
    }

    /// Moves of a load whose estimate is off by x · `found`; how many until it disagrees.
    fn moves_until_it_disagrees(found: impl Fn(u16) -> f32) -> Option<u16> {
        let mut a = Adaptation::new(1.0);
        (0..20).find(|k| {
            (0..300u16).for_each(|n| a.record(0.005 * f32::from(n), 1.0 + 0.005 * f32::from(n) * found(*k)));
            a.end_move(1.0);
            a.disagrees()
        })
    }

    #[test]
    fn moves_that_ask_for_more_than_the_bound_are_doubted() {
        assert_eq!(moves_until_it_disagrees(|_| 0.04), Some(1));
        assert_eq!(moves_until_it_disagrees(|_| -0.3), Some(1));
        assert_eq!(moves_until_it_disagrees(|_| 0.029), None, "a drift");
        assert_eq!(moves_until_it_disagrees(|k| if k % 2 == 0 { 0.1 } else { 0.0 }), None, "never twice in a row");
    }

    #[test]
    fn a_long_enough_move_tells_whether_the_load_weighs_the_same_all_along() {
        let finding = |found: f32| {
            let mut a = Adaptation::new(1.0);
            (0..300u16).for_each(|n| a.record(0.005 * f32::from(n), 1.0 + 0.005 * f32::from(n) * found));
            a.end_move(1.0).agrees
        };
        assert_eq!(finding(0.0), Some(true));
        assert_eq!(finding(0.02), Some(true), "a drift");
        assert_eq!(finding(0.05), Some(false));
    }

    #[test]
    fn short_moves_and_nonsense_teach_nothing() {
        let mut a = Adaptation::new(1.0);
        (0..1000).for_each(|_| a.record(2.0, 5.0));
        let nothing = Finding { scale_change: 0.0, agrees: None };
        assert_eq!(a.end_move(1.0), nothing);
        (0..1000u16).for_each(|k| a.record(f32::from(k), f32::NAN));
        assert_eq!(a.end_move(1.0), nothing);
        assert_eq!(a.learned(1.0, 0.0).moves, 0);
    }
}
