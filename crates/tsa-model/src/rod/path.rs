//! The line of a bent rod, for drawings.

use super::{Rod, TipForce};
use crate::equilibrium::Equilibrium;
use crate::error::SolveError;
use crate::scalar::Scalar;

/// Runge–Kutta steps from one point to the next.
const STEPS: usize = 5;

impl TipForce {
    /// On a rod in this state (eq. 11).
    pub fn of(state: &Equilibrium) -> Self {
        let (sin, cos) = Scalar::sin_cos(state.alpha_rad);
        Self { inward_n: 0.5 * state.load_n * sin / cos, sideways_n: 0.5 * state.load_n }
    }
}

impl Rod {
    /// Points of the bent half of a rod from the clamp to the tip, at equal steps of the unbent rod: along the clamp's
    /// direction, and sideways towards the strings (m). It integrates the equations of docs/explanation/model.md
    /// section 3 from the clamp, with the tip's force and place known from the equilibrium: another way than the
    /// solver's, so that the last point also checks the solver.
    ///
    /// # Errors
    /// [`SolveError::SectionSingular`].
    pub fn path(&self, force: TipForce, tip: [f64; 2], points: &mut [[f64; 2]]) -> Result<(), SolveError> {
        let TipForce { inward_n, sideways_n } = force;
        let mut guess = (0.0, 0.0);
        // Slopes of place and rotation by the unbent rod's length.
        let mut slopes = |[x, w, rotation]: [f64; 3]| {
            let (sin, cos) = Scalar::sin_cos(rotation);
            let force_n = -inward_n * cos + sideways_n * sin;
            let moment_nm = inward_n * (tip[1] - w) + sideways_n * (tip[0] - x);
            let (n, m) = (force_n / self.stiffness_n, moment_nm / (self.stiffness_n * self.radius_m));
            let (stretch, bending, _) = self.section.invert(n, m, guess)?;
            guess = (stretch, bending);
            Ok([(1.0 + stretch) * cos, (1.0 + stretch) * sin, bending / self.radius_m])
        };
        let ahead = |at: [f64; 3], by: [f64; 3], step: f64| core::array::from_fn(|k| at[k] + step * by[k]);
        let step_m = self.length_m / (points.len().saturating_sub(1).max(1) * STEPS) as f64;
        let mut now = [0.0; 3];
        for (number, point) in points.iter_mut().enumerate() {
            for _ in 0..if number == 0 { 0 } else { STEPS } {
                let k1 = slopes(now)?;
                let k2 = slopes(ahead(now, k1, 0.5 * step_m))?;
                let k3 = slopes(ahead(now, k2, 0.5 * step_m))?;
                let k4 = slopes(ahead(now, k3, step_m))?;
                now = ahead(now, core::array::from_fn(|k| (k1[k] + 2.0 * k2[k] + 2.0 * k3[k] + k4[k]) / 6.0), step_m);
            }
            *point = [now[0], now[1]];
        }
        Ok(())
    }
}
