//! The helix (eqs 9, 25–29) around whatever rod: its one equation, the root of it, and the gap's derivatives.

use crate::error::SolveError;
use crate::mechanism::{ALPHA_LIMIT, Equilibrium, MINIMUM_LOAD_N, Mechanism};
use crate::parameters::Radius;
use crate::rod::{RodResponse, TipForce};
use crate::scalar::Scalar;
use core::f64::consts::PI;

/// What depends on load and twist alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct State {
    pub load_n: f64,
    /// |θ|
    pub twist_rad: f64,
    /// Sign of θ: the mechanism is symmetric.
    pub sign: f64,
    /// S = sin(min(|θ|, π)/2): how much of D the open strings span (model.md section 5).
    pub span_factor: f64,
    span_factor_by_twist: f64,
    /// Part of the load that bends the rods: 1 but for continuation.
    rod_share: f64,
}

impl State {
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
            rod_share: 1.0,
        })
    }

    /// The same state with the rods bent by a part of the load only.
    pub fn sharing(&self, rod_share: f64) -> Self {
        Self { rod_share, ..*self }
    }

    /// Eq. 11. Open strings (|θ| < π) pull only by S of their horizontal force along the rod: a straight string
    /// between two circles meets the rod at |θ|/2 from its normal. Without S the gap would have a cusp at zero twist.
    pub fn force<T: Scalar>(&self, tan: T) -> TipForce<T> {
        let half = 0.5 * self.load_n * self.rod_share;
        TipForce { inward_n: tan * (half * self.span_factor), sideways_n: T::of(half) }
    }
}

/// The strings at a helix angle.
pub(crate) struct Helix<T> {
    pub tan: T,
    /// 1/cos² α
    pub sec2: T,
    /// X and its derivative by α (m).
    pub x_m: T,
    x_by_alpha: T,
    pub radius: Radius<T>,
    /// ∂Px/∂α (N).
    pub inward_by_alpha: T,
}

impl<T: Scalar> Helix<T> {
    /// Horizontal run H = D S + |θ| r (m).
    fn run(&self, m: &Mechanism<T>, state: &State, reach: T) -> T {
        (reach * 2.0 + m.parameters.clamp_width_m) * state.span_factor + self.radius.radius_m * state.twist_rad
    }

    /// tan α · X − H (m): eq. 25 is that this vanishes.
    pub fn miss(&self, m: &Mechanism<T>, state: &State, reach: T) -> T {
        self.tan * self.x_m - self.run(m, state, reach)
    }

    /// A miss over the size of the equation: the horizontal run or the string's length, whichever is more.
    pub fn scaled(&self, m: &Mechanism<T>, miss: T) -> f64 {
        // At a root the run is tan α X.
        let run = (self.tan * self.x_m).value();
        miss.value().abs() / run.max(m.parameters.string_length_m.value())
    }

    /// ∂G/∂α with the rod as it answers.
    pub fn gap_by_alpha(&self, rod: &RodResponse<T>) -> T {
        self.x_by_alpha + rod.deflection.by_inward * self.inward_by_alpha * 2.0
    }

    /// Derivative of the miss by α, when the tip reaches by `reach_by_inward` further for each N of Px.
    pub fn slope(&self, state: &State, reach_by_inward: T) -> T {
        self.sec2 * self.x_m + self.tan * self.x_by_alpha
            - self.radius.by_length * self.x_by_alpha * state.twist_rad
            - reach_by_inward * self.inward_by_alpha * (2.0 * state.span_factor)
    }
}

impl<T: Scalar> Mechanism<T> {
    pub(crate) fn helix(&self, state: &State, alpha: T) -> Helix<T> {
        let p = &self.parameters;
        let (sin, cos) = alpha.sin_cos();
        let tan = sin / cos;
        let sec2 = T::of(1.0) / (cos * cos);
        let x_m = p.string_length_m * cos + T::of(0.5 * state.load_n) / p.stiffness_n_per_m;
        Helix {
            tan,
            sec2,
            x_m,
            x_by_alpha: -(p.string_length_m * sin),
            radius: p.radius(state.load_n, state.twist_rad, x_m, self.start_length_m),
            inward_by_alpha: sec2 * (0.5 * state.load_n * state.rod_share * state.span_factor),
        }
    }

    /// Helix angle around rods that do not bend: above every other, because bending brings the tips together (rad).
    pub(crate) fn rigid_helix(&self, state: &State) -> f64 {
        let p = &self.parameters;
        let start = self.start_length_m;
        let radius = p.radius(state.load_n, state.twist_rad, start, start).radius_m.value();
        let run = p.rod_span_m.value() * state.span_factor + state.twist_rad * radius;
        let stretched = p.string_length_m.value() + state.load_n / (2.0 * p.stiffness_n_per_m.value());
        Scalar::asin((run / stretched).min(0.95))
    }

    /// The helix angle at which strings and rods balance, whatever answers for the rod: the first root from the
    /// untwisted string on. Newton from the rigid rod's angle inside the bracket between no twist and that; where it
    /// leaves, or where `scan` asks for it at once, a scan in that many intervals. Done when the scaled miss is at most
    /// `precision`, which cannot be less than the noise of the rod's answer.
    ///
    /// # Errors
    /// [`SolveError::NoEquilibrium`], [`SolveError::NotConverged`], and whatever the rod answers.
    pub(crate) fn balance(
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
            let miss = helix.miss(self, state, response.reach.value);
            let slope = helix.slope(state, response.reach.by_inward);
            iterations += 1;
            Ok::<_, SolveError>((response, miss, slope, helix.scaled(self, miss)))
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
                    // A rod that gives out past the root does not matter: closer.
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
            alpha = T::of(self.rigid_helix(state));
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
            if residual <= precision || step.abs() <= 2.0 * T::EPSILON * alpha.value() {
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
                // No root so far: further, but not past the last helix that means anything.
                T::of((low + 0.1).min(ALPHA_LIMIT))
            };
            now = at(alpha)?;
        }
        let (.., residual) = now;
        Err(SolveError::NotConverged { load_n: state.load_n, twist_rad: state.twist_rad, residual })
    }

    /// ∂G/∂|θ| and ∂G/∂F by the implicit function theorem on eq. 25.
    pub(crate) fn gap_derivatives(&self, state: &State, helix: &Helix<T>, response: &RodResponse<T>) -> (T, T) {
        let RodResponse { reach, deflection, .. } = response;
        let (s, s_by_twist) = (state.span_factor, state.span_factor_by_twist);
        let inward_by_load = helix.tan * (0.5 * s);
        let inward_by_twist = helix.tan * (0.5 * state.load_n * s_by_twist);
        let x_by_load = T::of(0.5) / self.parameters.stiffness_n_per_m;
        let d_m = reach.value * 2.0 + self.parameters.clamp_width_m;
        // Derivatives of the miss at a fixed helix angle.
        let by_twist = -(d_m * s_by_twist + helix.radius.arc_by_twist + reach.by_inward * inward_by_twist * (2.0 * s));
        let by_load = helix.tan * x_by_load
            - (reach.by_inward * inward_by_load + reach.by_sideways * 0.5) * (2.0 * s)
            - (helix.radius.by_load + helix.radius.by_length * x_by_load) * state.twist_rad;
        let slope = helix.slope(state, reach.by_inward);
        let gap_by_alpha = helix.gap_by_alpha(response);
        let direct = x_by_load + (deflection.by_inward * inward_by_load + deflection.by_sideways * 0.5) * 2.0;
        (
            deflection.by_inward * inward_by_twist * 2.0 - gap_by_alpha * by_twist / slope,
            direct - gap_by_alpha * by_load / slope,
        )
    }
}
