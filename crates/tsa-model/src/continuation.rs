//! Continuation from the unloaded state, in the order of a real rig: the load is raised on untwisted strings, then the
//! strings are twisted.
//!
//! Each step starts from a secant through the last two states and must not change the helix angle much, so that
//! Newton's method cannot change branch. Where even the smallest step fails, the branch folds back: no equilibrium
//! beyond is continuously connected to the unloaded state.

use crate::equilibrium::Equilibrium;
use crate::error::SolveError;
use crate::helix::State;
use crate::mechanism::{Found, Mechanism};
use crate::quadrature::LEVELS;
use crate::scalar::Scalar;

/// The smallest step, as a fraction of the leg.
const MIN_STEP: f64 = 1e-9;
/// Residual of an intermediate state.
const INTERMEDIATE_RESIDUAL: f64 = 1e-6;
/// Maximum change of the helix angle in one step (rad).
const LARGEST_CHANGE_RAD: f64 = 0.1;

/// Counts over all steps.
struct Walk {
    iterations: u32,
    evaluations: u32,
}

impl<T: Scalar> Mechanism<T> {
    /// The equilibrium reached from the unloaded, untwisted state in at least `steps` steps of load and as many of
    /// twist, formal like that of [`Mechanism::formal`].
    ///
    /// # Errors
    /// [`SolveError::Fold`] where the branch ends before the state; else as [`Mechanism::formal`].
    pub fn continued(&self, state: &State, steps: usize) -> Result<Equilibrium<T>, SolveError> {
        if self.is_rigid() {
            return self.formal(state.load_n, state.sign * state.twist_rad);
        }
        let mut walk = Walk { iterations: 0, evaluations: 0 };
        // The amplitude grows like the root of the load: steps are equal in the root.
        let first = 1e-3;
        let untwisted = State::new(state.load_n, 0.0)?;
        let begin = self.first_guess(&untwisted.sharing(first * first));
        let loaded = walk.leg(self, steps, (first, 1.0), begin, |x| Ok(untwisted.sharing(x * x)))?;
        let twist = |x: f64| State::new(state.load_n, x * state.twist_rad);
        let mut found = walk.leg(self, steps, (0.0, 1.0), (loaded.alpha, loaded.amplitude), twist)?;
        (found.iterations, found.evaluations) = (walk.iterations, walk.evaluations);
        self.complete(state, found)
    }
}

impl Walk {
    /// From one end of a leg to the other; `at` is the state at a position on it.
    fn leg<T: Scalar>(
        &mut self,
        m: &Mechanism<T>,
        steps: usize,
        (from, to): (f64, f64),
        begin: (T, T),
        at: impl Fn(f64) -> Result<State, SolveError>,
    ) -> Result<Found<T>, SolveError> {
        let widest = (to - from) / steps.max(1) as f64;
        let fold = |x: f64| at(x).map(|s| SolveError::Fold { load_n: s.load_n, twist_rad: s.sign * s.twist_rad });
        let Some(mut found) = self.settle(m, &at(from)?, begin, false) else { return Err(fold(from)?) };
        let (mut x, mut step) = (from, widest);
        let mut before: Option<(f64, (T, T))> = None;
        while x < to {
            let here = (found.alpha, found.amplitude);
            let next = if x + step >= to - 1e-3 * step { to } else { x + step };
            let guess = match before {
                Some((x0, (alpha, amplitude))) => {
                    let ahead = (next - x) / (x - x0);
                    (here.0 + (here.0 - alpha) * ahead, here.1 + (here.1 - amplitude) * ahead)
                }
                None => here,
            };
            match self.settle(m, &at(next)?, guess, next == to) {
                Some(f) if (f.alpha - here.0).value().abs() < LARGEST_CHANGE_RAD => {
                    before = Some((x, here));
                    (found, x) = (f, next);
                    step = (2.0 * step).min(widest);
                }
                _ => {
                    step *= 0.25;
                    if step < MIN_STEP {
                        return Err(fold(x)?);
                    }
                }
            }
        }
        Ok(found)
    }

    /// An intermediate state only leads to the next, so few nodes and half the digits are enough; the last is solved
    /// fully.
    fn settle<T: Scalar>(&mut self, m: &Mechanism<T>, state: &State, guess: (T, T), last: bool) -> Option<Found<T>> {
        // A secant may overshoot zero.
        let above = |x: T, min: f64| if x.value() > min { x } else { T::of(min) };
        let guess = (above(guess.0, 0.0), above(guess.1, f64::MIN_POSITIVE));
        let rough = if last { None } else { m.settle_on(state, guess, &LEVELS[1..2], INTERMEDIATE_RESIDUAL) };
        let found = rough.or_else(|| m.settle(state, guess))?;
        self.iterations += found.iterations;
        self.evaluations += found.evaluations;
        Some(found)
    }
}
