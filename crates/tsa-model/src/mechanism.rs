//! Strings and rods together (eqs 25–29): the solver for the equilibrium at a load and a twist.
//!
//! There are two unknowns, the rod's amplitude and the helix angle α, and two equations: the rod has its length, and
//! tan α · X = D + θ r (eq. 25). Newton's method with exact derivatives converges in a few steps for most states, first
//! on few quadrature nodes, then on twice as many, whose residual measures the error of the fewer. A state that does
//! not converge on the branch connected to zero load is solved again inside brackets, where no step can diverge.

use crate::equilibrium::Equilibrium;
use crate::error::{ParameterError, SolveError, Warnings};
use crate::helix::{ALPHA_LIMIT, Helix, State, rigid_angle};
use crate::material::Material;
use crate::parameters::{Geometry, Parameters, touches};
use crate::quadrature::{LEVELS, Rule};
use crate::rod::{Rod, RodResponse, RodShape, TipForce, outside_fit};
use crate::scalar::{LAST_STEP_TOLERANCE, PRECISION, RESIDUAL, Scalar, ln};
pub use crate::string::MINIMUM_LOAD_N;
use crate::string::StringParameters;
use crate::{SLACK_LOAD_N, STEEPEST_M_PER_RAD};
use core::f64::consts::PI;

/// Below this load (N) the fitted radius model has no support; the solution carries a warning.
pub const LIGHT_LOAD_N: f64 = 0.5;
/// Largest fibre strain that is accepted: the polynomial of eq. 12 is fitted up to two thirds of it.
pub const STRAIN_LIMIT: f64 = 0.12;

/// Largest residual that half the nodes may leave: the error of all nodes falls with its square.
const HALF_NODES_TOLERANCE: f64 = 1e-6;

/// The mechanism of one scene, ready to be solved.
#[derive(Clone, Debug)]
pub struct Mechanism<T = f64> {
    pub(crate) parameters: Parameters<T>,
    pub(crate) rod: Rod<T>,
    pub(crate) start_length_m: T,
    quadrature: Quadrature,
}

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "the board has no heap to put a rule on")]
enum Quadrature {
    /// Doubled until the residual is small enough.
    Automatic,
    Fixed(Rule),
}

/// The two unknowns of a state on which Newton's method has converged.
pub(crate) struct Found<T> {
    pub alpha: T,
    pub amplitude: T,
    shape: RodShape<T>,
    residual: f64,
    /// Residual with half the nodes.
    missed: f64,
    pub iterations: u32,
    pub evaluations: u32,
}

impl Mechanism {
    /// Checks the parameters and prepares the solver, which takes as many quadrature nodes as a state needs.
    ///
    /// # Errors
    /// [`ParameterError`] naming the scene-file key.
    pub fn new(geometry: &Geometry, string: &StringParameters, material: &Material) -> Result<Self, ParameterError> {
        Ok(Self::of(Parameters::new(geometry, string, material)?))
    }

    /// The same mechanism with a fixed number of quadrature nodes, 1 to [`crate::quadrature::MAX_NODES`], and no check
    /// that they are enough.
    pub fn with_points(self, points: usize) -> Self {
        Self { quadrature: Quadrature::Fixed(Rule::new(points)), ..self }
    }
}

impl<T: Scalar> Mechanism<T> {
    /// The mechanism with these constants, which must have been checked (by [`Parameters::new`] and
    /// [`crate::Correction::validate`]).
    pub fn of(parameters: Parameters<T>) -> Self {
        let rod = Rod::new(parameters.free_length_m(), parameters.rod_radius_m, &parameters.stress_coefficients_pa);
        Self { parameters, rod, start_length_m: parameters.start_length_m(), quadrature: Quadrature::Automatic }
    }

    /// The constants.
    pub fn parameters(&self) -> &Parameters<T> {
        &self.parameters
    }

    /// X0 of eq. 1 (m).
    pub fn start_length_m(&self) -> T {
        self.start_length_m
    }

    /// Half a rod.
    pub fn rod(&self) -> &Rod<T> {
        &self.rod
    }

    /// The equilibrium at a load (N) and a twist (rad, either sign; π is the half-turn pre-twist).
    ///
    /// # Errors
    /// The named limit of the model that stopped it, see [`SolveError`].
    pub fn solve(&self, load_n: f64, twist_rad: f64) -> Result<Equilibrium<T>, SolveError> {
        self.possible(self.formal(load_n, twist_rad)?)
    }

    /// Torque on the strings that conserves energy (N m, towards zero twist positive), at a load (N) and a twist (rad):
    /// T = −∫ ∂G/∂θ dF from 0 to the load, so that ∂T/∂F = −∂G/∂θ (docs/explanation/model.md 4). Below [`SLACK_LOAD_N`] it is
    /// proportional to the load.
    ///
    /// # Errors
    /// As [`Mechanism::formal`], at any lighter load down to [`SLACK_LOAD_N`] too; [`SolveError::NoEquilibrium`] also where the gap of
    /// one falls faster than [`STEEPEST_M_PER_RAD`].
    pub fn conservative_torque_nm(&self, load_n: f64, twist_rad: f64) -> Result<f64, SolveError> {
        State::new(load_n, twist_rad)?;
        let slope = |load_n: f64| match self.formal(load_n, twist_rad)?.dgap_dtwist_m_per_rad.value() {
            by_twist if by_twist < -STEEPEST_M_PER_RAD => Err(SolveError::NoEquilibrium { load_n, twist_rad }),
            by_twist => Ok(load_n * by_twist),
        };
        let mut sum: f64 = slope(SLACK_LOAD_N)?;
        if load_n <= SLACK_LOAD_N {
            // Not by the gap's own slope there, which grows as the load vanishes.
            return Ok(-sum * load_n / SLACK_LOAD_N);
        }
        // In the logarithm of the load, as the radius has a term in 1/F; the rule has the positive half of its nodes.
        let half = 0.5 * ln(load_n / SLACK_LOAD_N);
        for (node, weight) in LEVELS[1].iter() {
            for at in [1.0 - node, 1.0 + node] {
                sum += half * weight * slope(SLACK_LOAD_N * (1.0 + Scalar::exp_m1(half * at)))?;
            }
        }
        Ok(-sum)
    }

    /// As [`Mechanism::solve`], but an overtwisted state, which two strings of diameter r0 cannot reach, is returned
    /// with a warning: for comparison with numbers that were computed without that limit.
    ///
    /// # Errors
    /// As [`Mechanism::solve`], without [`SolveError::Overtwist`].
    pub fn formal(&self, load_n: f64, twist_rad: f64) -> Result<Equilibrium<T>, SolveError> {
        let state = State::new(load_n, twist_rad)?;
        if self.is_rigid() {
            return self.balance(&state, None, PRECISION, &mut |_| Ok(RodResponse::rigid(self.rod.length_m)));
        }
        let direct = match self.settle(&state, self.first_guess(&state)) {
            Some(found) => self.complete(&state, found),
            None => self.bracket(&state).and_then(|found| self.complete(&state, found)),
        };
        match direct {
            Ok(e) if !e.warnings.contains(Warnings::NOT_UNIQUE) && self.helix_is_unique(&state, &e) => Ok(e),
            // Another equilibrium may exist: the valid one is connected to the unloaded state.
            Ok(_) | Err(SolveError::NotConverged { .. }) => self.continued(&state, 1),
            Err(e) => Err(e),
        }
    }

    /// Whether eq. 25 has no other root below this one, because its slope falls with α from zero on.
    fn helix_is_unique(&self, state: &State, found: &Equilibrium<T>) -> bool {
        let helix = self.helix(state, found.alpha_rad);
        helix.slope(state, T::of(0.0)).value() > 0.0
    }

    pub(crate) fn complete(&self, state: &State, found: Found<T>) -> Result<Equilibrium<T>, SolveError> {
        if found.missed > HALF_NODES_TOLERANCE {
            let nodes = LEVELS[LEVELS.len() - 1].count();
            return Err(SolveError::Unresolved { load_n: state.load_n, nodes, missed: found.missed });
        }
        let (sin, cos) = found.alpha.sin_cos();
        let force = state.force(sin / cos);
        let response = self.rod.response(force, found.amplitude, &found.shape);
        let mut equilibrium = self.finish(state, found.alpha, &response)?;
        equilibrium.residual = equilibrium.residual.max(found.residual);
        equilibrium.iterations = found.iterations;
        equilibrium.evaluations = found.evaluations;
        converged(equilibrium)
    }

    /// Refuses an equilibrium that two strings of diameter r0 cannot reach.
    ///
    /// # Errors
    /// [`SolveError::Overtwist`].
    pub fn possible(&self, found: Equilibrium<T>) -> Result<Equilibrium<T>, SolveError> {
        if found.warnings.contains(Warnings::OVERTWIST) {
            let needed_m = self.parameters.diameter_m.value() * found.twist_rad.abs() / PI;
            return Err(SolveError::Overtwist { length_m: found.x_m.value(), needed_m });
        }
        Ok(found)
    }

    /// Whether the rods have no free length.
    pub fn is_rigid(&self) -> bool {
        self.rod.length_m.value() == 0.0
    }

    /// The helix at an angle α (rad).
    pub fn helix(&self, state: &State, alpha: T) -> Helix<T> {
        Helix::new(&self.parameters, self.start_length_m, state, alpha)
    }

    /// Helix angle around rods that do not bend (rad): the maximum possible, because bending brings the tips together.
    pub fn rigid_helix_angle(&self, state: &State) -> f64 {
        rigid_angle(&self.parameters, self.start_length_m, state)
    }

    /// Helix angle and amplitude from which Newton's method starts.
    pub(crate) fn first_guess(&self, state: &State) -> (T, T) {
        let alpha = T::of(self.rigid_helix_angle(state));
        let (sin, cos) = alpha.sin_cos();
        (alpha, self.rod.first_guess(state.force(sin / cos)))
    }

    /// Newton's method in both unknowns, on rising numbers of nodes; `None` if it does not converge on the stable
    /// branch.
    pub(crate) fn settle(&self, state: &State, start: (T, T)) -> Option<Found<T>> {
        let rules: &[Rule] = match &self.quadrature {
            Quadrature::Automatic => &LEVELS,
            Quadrature::Fixed(rule) => core::slice::from_ref(rule),
        };
        self.settle_on(state, start, rules, RESIDUAL)
    }

    /// As [`Self::settle`], with these rules and to this residual.
    pub(crate) fn settle_on(
        &self,
        state: &State,
        (mut alpha, mut amplitude): (T, T),
        rules: &[Rule],
        limit: f64,
    ) -> Option<Found<T>> {
        let (mut iterations, mut evaluations) = (0, 0);
        let mut missed = 0.0;
        for (k, rule) in rules.iter().enumerate() {
            let top = k + 1 == rules.len();
            let mut enough = top;
            let mut left = T::EXTRA_STEPS;
            for step in 0..20 {
                let helix = self.helix(state, alpha);
                let force = state.force(helix.tan);
                let shape = self.rod.shape(force, amplitude, rule, enough && step > 0).ok()?;
                evaluations += shape.evaluations;
                let r1 = shape.length.value - self.rod.length_m;
                let r2 = helix.miss(&self.parameters, state, shape.reach.value);
                let residual = (r1 / self.rod.length_m).value().abs().max(helix.scaled(&self.parameters, r2));
                if enough && step > 0 && residual <= limit {
                    if left == 0 {
                        return Some(Found { alpha, amplitude, shape, residual, missed, iterations, evaluations });
                    }
                    left -= 1;
                }
                // The first residual on twice the nodes is the error of the fewer nodes.
                if k > 0 && step == 0 {
                    missed = residual;
                    enough |= missed <= LAST_STEP_TOLERANCE;
                }
                let (a, b) = (shape.length.by_amplitude, shape.length.by_inward * helix.inward_by_alpha);
                let c = -(shape.reach.by_amplitude * (2.0 * state.span_factor));
                let d = helix.slope(state, shape.reach.by_inward);
                let det = a * d - b * c;
                // On the branch connected to zero load both the rod's own slope and the determinant are positive.
                if !(det.value() > 0.0 && a.value() > 0.0) {
                    return None;
                }
                let step_amplitude = (r2 * b - r1 * d) / det;
                let step_alpha = (r1 * c - r2 * a) / det;
                // A long step is shortened; a step outside the valid range aborts this attempt.
                let next_amplitude = cut(amplitude, step_amplitude, 0.5 * amplitude.value());
                let next_alpha = cut(alpha, step_alpha, 0.2);
                if !(next_alpha.value() >= 0.0 && next_alpha.value() < ALPHA_LIMIT) {
                    return None;
                }
                (alpha, amplitude) = (next_alpha, next_amplitude);
                iterations += 1;
                let small = step_alpha.value().abs().max((step_amplitude / amplitude).value().abs());
                if !enough && small <= 1e-4 {
                    break;
                }
            }
        }
        None
    }

    /// The smallest helix angle at which eq. 25 holds, with the rod solved inside its own bracket at each angle: the
    /// branch connected to zero load.
    pub(crate) fn bracket(&self, state: &State) -> Result<Found<T>, SolveError> {
        let rule = match &self.quadrature {
            Quadrature::Automatic => &LEVELS[3],
            Quadrature::Fixed(rule) => rule,
        };
        let (mut evaluations, mut at) = (0, None);
        let balanced = self.balance(state, Some(SCAN), PRECISION, &mut |force| {
            let (amplitude, shape, steps) = self.rod.amplitude(force, rule)?;
            evaluations += steps * shape.evaluations;
            let residual = ((shape.length.value / self.rod.length_m).value() - 1.0).abs();
            at = Some((amplitude, shape, residual));
            Ok(self.rod.response(force, amplitude, &shape))
        })?;
        let Some((amplitude, shape, residual)) = at else {
            return Err(SolveError::NoEquilibrium { load_n: state.load_n, twist_rad: state.twist_rad });
        };
        let alpha = balanced.alpha_rad;
        // From this near, Newton's method converges to the same root, on as many nodes as it needs.
        if let Some(mut found) = self.settle(state, (alpha, amplitude))
            && (found.alpha - alpha).value().abs() < 1e-3
        {
            found.iterations += balanced.iterations;
            found.evaluations += evaluations;
            return Ok(found);
        }
        let residual = residual.max(balanced.residual);
        let (iterations, missed) = (balanced.iterations, 0.0);
        Ok(Found { alpha, amplitude, shape, residual, missed, iterations, evaluations })
    }

    /// The equilibrium at a solved state, without the counts of iterations and evaluations.
    ///
    /// # Errors
    /// [`SolveError::StrainRange`].
    pub fn finish(&self, state: &State, alpha: T, response: &RodResponse<T>) -> Result<Equilibrium<T>, SolveError> {
        let helix = self.helix(state, alpha);
        let force: TipForce<T> = state.force(helix.tan);
        let miss = helix.miss(&self.parameters, state, response.reach.value);
        let mut warnings = Warnings::default();
        if helix.x_m.value() < self.parameters.diameter_m.value() * state.twist_rad / PI {
            warnings.add(Warnings::OVERTWIST);
        }
        let strain = response.clamp.fibre();
        if strain > STRAIN_LIMIT {
            return Err(SolveError::StrainRange { strain, limit: STRAIN_LIMIT });
        }
        if outside_fit(response.clamp) {
            warnings.add(Warnings::STRAIN_RANGE);
        }
        let softest = self.rod.section.softest(response.clamp.bending_squared.value());
        if self.rod.load_number(force).value() >= softest * PI * PI / 4.0 {
            warnings.add(Warnings::NOT_UNIQUE);
        }
        if state.load_n < LIGHT_LOAD_N {
            warnings.add(Warnings::LIGHT_LOAD);
        }
        if !touches(state.twist_rad) {
            warnings.add(Warnings::OPEN_STRINGS);
        }
        let (mut by_twist, mut by_load) = helix.gap_derivatives(&self.parameters, state, response);
        let mut gap_m = helix.x_m + response.deflection.value * 2.0;
        if let Some(correction) = &self.parameters.correction {
            let shift = correction.at(state.load_n, state.twist_rad);
            gap_m += T::of(shift.gap_m);
            by_twist += T::of(shift.by_twist);
            by_load += T::of(shift.by_load);
        }
        Ok(Equilibrium {
            load_n: state.load_n,
            twist_rad: state.twist_rad * state.sign,
            alpha_rad: alpha,
            x_m: helix.x_m,
            d_m: response.reach.value * 2.0 + self.parameters.clamp_width_m,
            u_m: response.reach.value - self.rod.length_m,
            w_m: response.deflection.value,
            r_m: helix.radius.radius_m,
            tension_n: helix.sec2.sqrt() * (0.5 * state.load_n),
            tip_angle_rad: response.tip_angle_rad,
            bending_strain: response.clamp.bending_squared.sqrt(),
            gap_m,
            dgap_dtwist_m_per_rad: by_twist * state.sign,
            dgap_dload_m_per_n: by_load,
            torque_nm: helix.tan * helix.radius.arc_by_twist * (state.sign * state.load_n),
            residual: helix.scaled(&self.parameters, miss),
            iterations: 0,
            evaluations: 0,
            warnings,
        })
    }
}

/// Intervals of the search for the first root.
const SCAN: u32 = 48;

/// Refuses a solution whose residual is too large.
fn converged<T: Scalar>(found: Equilibrium<T>) -> Result<Equilibrium<T>, SolveError> {
    // NaN fails this comparison too.
    if found.residual <= RESIDUAL {
        return Ok(found);
    }
    let Equilibrium { load_n, twist_rad, residual, .. } = found;
    Err(SolveError::NotConverged { load_n, twist_rad, residual })
}

/// x + step, the step no longer than `max`.
fn cut<T: Scalar>(x: T, step: T, max: f64) -> T {
    let size = step.value().abs();
    if size > max { x + step * (max / size) } else { x + step }
}
