//! The helix of the strings (eqs 9, 25–29) around rods of any kind: its equation, and the gap's derivatives.

use crate::error::SolveError;
use crate::parameters::{Parameters, Radius};
use crate::rod::{RodResponse, TipForce};
use crate::scalar::Scalar;
use crate::string::MINIMUM_LOAD_N;
use core::f64::consts::{FRAC_PI_2, PI};

/// Largest helix angle that is tried (rad), tan α ≈ 30: beyond it only the stretch of eq. 9 gives the equation a root.
pub const ALPHA_LIMIT: f64 = FRAC_PI_2 - 1.0 / 30.0;

/// Quantities that depend on load and twist alone.
#[derive(Clone, Copy, Debug)]
pub struct State {
    /// Load (N).
    pub load_n: f64,
    /// |θ| (rad).
    pub twist_rad: f64,
    /// Sign of θ: the mechanism is symmetric.
    pub sign: f64,
    /// S = sin(min(|θ|, π)/2): how much of D the open strings span (docs/explanation/model.md section 5).
    pub span_factor: f64,
    span_factor_by_twist: f64,
    /// Fraction of the load that bends the rods; below 1 only on the way of a continuation.
    rod_fraction: f64,
}

impl State {
    /// The state at a load (N) and a twist (rad, either sign).
    ///
    /// # Errors
    /// [`SolveError::NotFinite`], [`SolveError::Slack`].
    pub fn new(load_n: f64, twist_rad: f64) -> Result<Self, SolveError> {
        for (parameter, value) in [("load", load_n), ("twist", twist_rad)] {
            if !value.is_finite() {
                return Err(SolveError::NotFinite { parameter, value });
            }
        }
        if load_n < MINIMUM_LOAD_N {
            return Err(SolveError::Slack { load_n, minimum_n: MINIMUM_LOAD_N });
        }
        let twist = twist_rad.abs();
        let (sin, cos) = (0.5 * twist.min(PI)).sin_cos();
        Ok(Self {
            load_n,
            twist_rad: twist,
            sign: if twist_rad < 0.0 { -1.0 } else { 1.0 },
            span_factor: sin,
            span_factor_by_twist: if twist < PI { 0.5 * cos } else { 0.0 },
            rod_fraction: 1.0,
        })
    }

    /// The same state with the rods bent by a fraction of the load only.
    pub(crate) fn sharing(&self, rod_fraction: f64) -> Self {
        Self { rod_fraction, ..*self }
    }

    /// Force on the tip of half a rod at the helix's tan α, eq. 11. Of the horizontal force of open strings (|θ| < π)
    /// only the fraction S acts along the rod: a straight string between two circles meets the rod at |θ|/2 from its
    /// normal. Without S the gap would have a cusp at zero twist.
    pub fn force<T: Scalar>(&self, tan: T) -> TipForce<T> {
        let half = 0.5 * self.load_n * self.rod_fraction;
        TipForce { inward_n: tan * (half * self.span_factor), sideways_n: T::of(half) }
    }
}

/// The strings at a helix angle α.
pub struct Helix<T> {
    /// tan α.
    pub tan: T,
    /// 1/cos² α.
    pub sec2: T,
    /// X (m).
    pub x_m: T,
    /// ∂X/∂α (m).
    x_by_alpha: T,
    /// Radius of the twisted pair.
    pub radius: Radius<T>,
    /// ∂Px/∂α (N).
    pub inward_by_alpha: T,
}

/// Helix angle around rods that do not bend, see [`crate::Mechanism::rigid_helix_angle`].
pub(crate) fn rigid_angle<T: Scalar>(p: &Parameters<T>, start_length_m: T, state: &State) -> f64 {
    let radius = p.radius(state.load_n, state.twist_rad, start_length_m, start_length_m).radius_m.value();
    let run = p.rod_span_m.value() * state.span_factor + state.twist_rad * radius;
    let stretched = p.string_length_m.value() + state.load_n / (2.0 * p.stiffness_n_per_m.value());
    Scalar::asin((run / stretched).min(0.95))
}

impl<T: Scalar> Helix<T> {
    /// `start_length_m` is X0 of eq. 1.
    pub(crate) fn new(p: &Parameters<T>, start_length_m: T, state: &State, alpha: T) -> Self {
        let (sin, cos) = alpha.sin_cos();
        let tan = sin / cos;
        let sec2 = T::of(1.0) / (cos * cos);
        let x_m = p.string_length_m * cos + T::of(0.5 * state.load_n) / p.stiffness_n_per_m;
        Self {
            tan,
            sec2,
            x_m,
            x_by_alpha: -(p.string_length_m * sin),
            radius: p.radius(state.load_n, state.twist_rad, x_m, start_length_m),
            inward_by_alpha: sec2 * (0.5 * state.load_n * state.rod_fraction * state.span_factor),
        }
    }

    /// Horizontal run H = D S + |θ| r (m) between rods whose tips are at `reach` (m).
    pub fn run(&self, p: &Parameters<T>, state: &State, reach: T) -> T {
        (reach * 2.0 + p.clamp_width_m) * state.span_factor + self.radius.radius_m * state.twist_rad
    }

    /// The residual of eq. 25, tan α · X − H (m).
    pub(crate) fn miss(&self, p: &Parameters<T>, state: &State, reach: T) -> T {
        self.tan * self.x_m - self.run(p, state, reach)
    }

    /// A residual relative to the horizontal run or the string's length, whichever is more.
    pub(crate) fn scaled(&self, p: &Parameters<T>, miss: T) -> f64 {
        // At a root the run is tan α X.
        let run = (self.tan * self.x_m).value();
        miss.value().abs() / run.max(p.string_length_m.value())
    }

    /// ∂G/∂α with the response of the rod.
    pub(crate) fn gap_by_alpha(&self, rod: &RodResponse<T>) -> T {
        self.x_by_alpha + rod.deflection.by_inward * self.inward_by_alpha * 2.0
    }

    /// Derivative of the residual by α, where the tip's reach changes by `reach_by_inward` (m/N) with Px.
    pub(crate) fn slope(&self, state: &State, reach_by_inward: T) -> T {
        self.sec2 * self.x_m + self.tan * self.x_by_alpha
            - self.radius.by_length * self.x_by_alpha * state.twist_rad
            - reach_by_inward * self.inward_by_alpha * (2.0 * state.span_factor)
    }

    /// ∂G/∂|θ| and ∂G/∂F by the implicit function theorem on eq. 25.
    pub(crate) fn gap_derivatives(&self, p: &Parameters<T>, state: &State, response: &RodResponse<T>) -> (T, T) {
        let RodResponse { reach, deflection, .. } = response;
        let (s, s_by_twist) = (state.span_factor, state.span_factor_by_twist);
        let inward_by_load = self.tan * (0.5 * s);
        let inward_by_twist = self.tan * (0.5 * state.load_n * s_by_twist);
        let x_by_load = T::of(0.5) / p.stiffness_n_per_m;
        let d_m = reach.value * 2.0 + p.clamp_width_m;
        // Derivatives of the residual at a fixed helix angle.
        let by_twist = -(d_m * s_by_twist + self.radius.arc_by_twist + reach.by_inward * inward_by_twist * (2.0 * s));
        let by_load = self.tan * x_by_load
            - (reach.by_inward * inward_by_load + reach.by_sideways * 0.5) * (2.0 * s)
            - (self.radius.by_load + self.radius.by_length * x_by_load) * state.twist_rad;
        let slope = self.slope(state, reach.by_inward);
        let gap_by_alpha = self.gap_by_alpha(response);
        let direct = x_by_load + (deflection.by_inward * inward_by_load + deflection.by_sideways * 0.5) * 2.0;
        (
            deflection.by_inward * inward_by_twist * 2.0 - gap_by_alpha * by_twist / slope,
            direct - gap_by_alpha * by_load / slope,
        )
    }
}
