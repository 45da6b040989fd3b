//! The root of eq. 25 with any model of the rod.

use crate::equilibrium::Equilibrium;
use crate::error::SolveError;
use crate::helix::{ALPHA_LIMIT, State};
use crate::mechanism::Mechanism;
use crate::rod::{RodResponse, TipForce};
use crate::scalar::Scalar;

impl<T: Scalar> Mechanism<T> {
    /// The equilibrium with any model of the rod: the smallest helix angle at which eq. 25 holds. Newton's method
    /// starts from the angle around rigid rods; a step out of the bracket is replaced by halving. With `scan` the root
    /// is first bracketed by that many intervals from zero on. It ends when the scaled residual is at most `precision`,
    /// which must not be below the noise of `rod`.
    ///
    /// # Errors
    /// [`SolveError::NoEquilibrium`], [`SolveError::NotConverged`], and the errors of `rod`.
    pub fn balance(
        &self,
        state: &State,
        scan: Option<u32>,
        precision: f64,
        rod: &mut dyn FnMut(TipForce<T>) -> Result<RodResponse<T>, SolveError>,
    ) -> Result<Equilibrium<T>, SolveError> {
        let mut iterations = 0;
        let mut at = |alpha: T| {
            let helix = self.helix(state, alpha);
            let response = rod(state.force(helix.tan))?;
            let miss = helix.miss(&self.parameters, state, response.reach.value);
            let slope = helix.slope(state, response.reach.by_inward);
            iterations += 1;
            Ok::<_, SolveError>((response, miss, slope, helix.scaled(&self.parameters, miss)))
        };
        let (mut low, mut high);
        let mut alpha;
        let mut now;
        if let Some(intervals) = scan {
            (low, high) = (0.0, None);
            (alpha, now) = (T::of(0.0), at(T::of(0.0))?);
            let mut step = ALPHA_LIMIT / f64::from(intervals);
            while now.1.value() < 0.0 && low < ALPHA_LIMIT {
                let next = (low + step).min(ALPHA_LIMIT);
                match at(T::of(next)) {
                    Ok(found) => now = found,
                    // The rod may fail beyond the root: try a smaller step.
                    Err(e) if step < 1e-9 => return Err(e),
                    Err(_) => {
                        step *= 0.25;
                        continue;
                    }
                }
                alpha = T::of(next);
                if now.1.value() >= 0.0 {
                    high = Some(next);
                } else {
                    low = next;
                }
            }
        } else {
            alpha = T::of(self.rigid_helix_angle(state));
            (low, high) = (0.0, None);
            now = at(alpha)?;
        }
        let mut left = T::EXTRA_STEPS;
        for _ in 0..100 {
            let (response, miss, slope, residual) = now;
            if miss.value() > 0.0 {
                high = Some(alpha.value());
            } else {
                low = low.max(alpha.value());
            }
            let newton = alpha - miss / slope;
            let step = (newton - alpha).value();
            if residual <= precision || step.abs() <= 2.0 * f64::EPSILON * alpha.value() {
                if left == 0 {
                    let mut found = self.finish(state, alpha, &response)?;
                    found.iterations = iterations;
                    return Ok(found);
                }
                left -= 1;
            }
            let top = high.unwrap_or(ALPHA_LIMIT);
            alpha = if newton.value() >= low && newton.value() <= top {
                newton
            } else if high.is_some() {
                T::of(0.5 * (low + top))
            } else if low >= ALPHA_LIMIT {
                return Err(SolveError::NoEquilibrium { load_n: state.load_n, twist_rad: state.twist_rad });
            } else {
                // No root so far: try further, up to the limit.
                T::of((low + 0.1).min(ALPHA_LIMIT))
            };
            now = at(alpha)?;
        }
        let (.., residual) = now;
        Err(SolveError::NotConverged { load_n: state.load_n, twist_rad: state.twist_rad, residual })
    }
}
