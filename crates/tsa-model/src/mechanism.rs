//! Strings and rods together (eqs 25–29): the equilibrium at a load and a twist.
//!
//! Two unknowns, the rod's amplitude and the helix angle α, and two equations: the rod has its length, and
//! tan α · X = D + θ r (eq. 25). Newton with exact derivatives settles most states in a handful of steps, on few
//! quadrature nodes first and then on twice as many, whose residual measures what the fewer missed. Whatever does not
//! settle on the branch connected to zero load is solved again inside brackets, which cannot run away.

use crate::error::{ParameterError, SolveError, Warnings};
use crate::helix::State;
use crate::material::Material;
use crate::parameters::{Geometry, Parameters};
use crate::quadrature::{LEVELS, Rule};
use crate::rod::{Rod, RodResponse, RodShape, TipForce, outside_fit};
use crate::scalar::{Scalar, Single};
use crate::string::StringParameters;
use core::f64::consts::{FRAC_PI_2, PI};

/// Below this load (N) the fitted radius law has no support; the solution carries a warning.
pub const LIGHT_LOAD_N: f64 = 0.5;
/// Least load that is solved (N): below it 1/(k1 F) alone would make the string thicker than it is long.
pub const MINIMUM_LOAD_N: f64 = 0.05;
/// Strain past which the polynomial of eq. 12 is refused, half as far again as its fit reaches.
pub const STRAIN_LIMIT: f64 = 0.12;

/// An equilibrium and its derivatives. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equilibrium<T = f64> {
    /// Load Fz (N).
    pub load_n: f64,
    /// Twist θ (rad).
    pub twist_rad: f64,
    /// Helix angle α (rad).
    pub alpha_rad: T,
    /// Distance X between the attachments of the two rods (m), eq. 9.
    pub x_m: T,
    /// Span D of the bent rod (m), eq. 26.
    pub d_m: T,
    /// Axial tip displacement u(l) of half a rod (m).
    pub u_m: T,
    /// Lateral tip displacement w(l) (m).
    pub w_m: T,
    /// Radius r of the twisted pair (m), eq. 6.
    pub r_m: T,
    /// String tension (N), eq. 8.
    pub tension_n: T,
    /// Tip angle φ_l (rad).
    pub tip_angle_rad: T,
    /// Bending strain κ(0) R at the clamp.
    pub bending_strain: T,
    /// Gap G = X + 2w between the two clamps (m): what the LVDT sees up to an offset.
    pub gap_m: T,
    /// ∂G/∂θ at constant load (m/rad).
    pub dgap_dtwist_m_per_rad: T,
    /// ∂G/∂F at constant twist (m/N).
    pub dgap_dload_m_per_n: T,
    /// Ideal motor torque F tan α (r + θ ∂r/∂θ) (N m), model.md section 4.
    pub torque_nm: T,
    /// Largest scaled residual of the two equations.
    pub residual: f64,
    /// Steps of the outermost iteration.
    pub iterations: u32,
    /// Evaluations of a section or of an ODE's right-hand side, over all iterations.
    pub evaluations: u32,
    /// What to take this with.
    pub warnings: Warnings,
}

impl<T: Scalar> Equilibrium<T> {
    /// Transmission ratio TR = −1/(∂G/∂θ) (rad/m), eq. 29. Infinite at zero twist.
    pub fn tr_rad_per_m(&self) -> T {
        T::of(-1.0) / self.dgap_dtwist_m_per_rad
    }
}

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
    /// Doubled until the residual says that they are enough.
    Automatic,
    Fixed(Rule),
}

/// A point beyond which no helix is looked for: tan α ≈ 30, where eq. 9's stretch alone keeps a formal root alive.
pub(crate) const ALPHA_LIMIT: f64 = FRAC_PI_2 - 1.0 / 30.0;

/// A state of the two unknowns that Newton has settled on.
pub(crate) struct Found<T> {
    pub alpha: T,
    pub amplitude: T,
    shape: RodShape<T>,
    residual: f64,
    /// What the last but one number of nodes missed.
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

    /// The same mechanism with a stated number of quadrature nodes, 1 to 96, and no check that they are enough.
    pub(crate) fn points(self, points: usize) -> Self {
        Self { quadrature: Quadrature::Fixed(Rule::new(points)), ..self }
    }
}

macro_rules! gap_and_slope {
    ($number:ty) => {
        impl Mechanism<$number> {
            /// Gap (m) and ∂G/∂θ (m/rad) as [`Mechanism::solve`] finds them: not generic, so that an image has the
            /// solver's code once, and as this crate is built.
            ///
            /// # Errors
            /// As [`Mechanism::solve`].
            #[inline(never)]
            pub fn gap_and_slope(&self, load_n: f64, twist_rad: f64) -> Result<[f64; 2], SolveError> {
                let e = self.solve(load_n, twist_rad)?;
                Ok([e.gap_m.value(), e.dgap_dtwist_m_per_rad.value()])
            }
        }
    };
}

gap_and_slope!(f64);
gap_and_slope!(Single);

impl<T: Scalar> Mechanism<T> {
    /// The mechanism with these constants, which are taken as checked ([`Parameters::new`] does).
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

    /// As [`Mechanism::solve`], but an overtwisted state is returned with a warning: the equations' root, which no
    /// two strings of diameter r0 can reach. For comparing with numbers that were computed without that limit.
    ///
    /// # Errors
    /// As [`Mechanism::solve`], without [`SolveError::Overtwist`].
    pub fn formal(&self, load_n: f64, twist_rad: f64) -> Result<Equilibrium<T>, SolveError> {
        let state = State::new(load_n, twist_rad)?;
        if self.is_rigid() {
            return self.balance(&state, None, T::PRECISION, &mut |_| Ok(self.rigid_response()));
        }
        let direct = match self.settle(&state, self.first_guess(&state)) {
            Some(found) => self.complete(&state, found),
            None => self.bracket(&state).and_then(|found| self.complete(&state, found)),
        };
        match direct {
            Ok(e) if !e.warnings.contains(Warnings::NOT_UNIQUE) && self.helix_is_unique(&state, &e) => Ok(e),
            // Another equilibrium may exist: only the one that the unloaded state leads to counts.
            Ok(_) | Err(SolveError::NotConverged { .. }) => self.continued(&state, 1),
            Err(e) => Err(e),
        }
    }

    /// Whether eq. 25 can have no other root below this one: its slope falls with α all the way from zero.
    fn helix_is_unique(&self, state: &State, found: &Equilibrium<T>) -> bool {
        let helix = self.helix(state, found.alpha_rad);
        helix.slope(state, T::of(0.0)).value() > 0.0
    }

    pub(crate) fn complete(&self, state: &State, found: Found<T>) -> Result<Equilibrium<T>, SolveError> {
        if found.missed > T::HARDLY {
            let nodes = LEVELS[LEVELS.len() - 1].count();
            return Err(SolveError::Unresolved { load_n: state.load_n, nodes, missed: found.missed });
        }
        let (sin, cos) = found.alpha.sin_cos();
        let force = state.force(sin / cos);
        let response = self.rod.response(force, found.amplitude, &found.shape)?;
        let mut equilibrium = self.finish(state, found.alpha, &response)?;
        equilibrium.residual = equilibrium.residual.max(found.residual);
        equilibrium.iterations = found.iterations;
        equilibrium.evaluations = found.evaluations;
        converged(equilibrium)
    }

    /// Refuses what two strings of diameter r0 cannot reach.
    pub(crate) fn possible(&self, found: Equilibrium<T>) -> Result<Equilibrium<T>, SolveError> {
        if found.warnings.contains(Warnings::OVERTWIST) {
            let needed_m = self.parameters.diameter_m.value() * found.twist_rad.abs() / PI;
            return Err(SolveError::Overtwist { length_m: found.x_m.value(), needed_m });
        }
        Ok(found)
    }

    /// The rod of no free length.
    pub(crate) fn is_rigid(&self) -> bool {
        self.rod.length_m.value() == 0.0
    }

    /// Its response, tip at the clamp.
    pub(crate) fn rigid_response(&self) -> RodResponse<T> {
        let mut response = RodResponse::rigid(0.0);
        response.reach.value = self.rod.length_m;
        response
    }

    /// Rod and helix at a trial state.
    pub(crate) fn first_guess(&self, state: &State) -> (T, T) {
        let alpha = T::of(self.rigid_helix(state));
        let (sin, cos) = alpha.sin_cos();
        (alpha, self.rod.first_guess(state.force(sin / cos)))
    }

    /// Newton in both unknowns, on rising numbers of nodes; `None` if it does not settle on the stable branch.
    pub(crate) fn settle(&self, state: &State, start: (T, T)) -> Option<Found<T>> {
        let rules: &[Rule] = match &self.quadrature {
            Quadrature::Automatic => &LEVELS,
            Quadrature::Fixed(rule) => core::slice::from_ref(rule),
        };
        self.settle_on(state, start, rules, T::RESIDUAL)
    }

    /// As [`Self::settle`], on these rules and to this residual.
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
                let (sin, cos) = alpha.sin_cos();
                let force = state.force(sin / cos);
                let shape = self.rod.shape(force, amplitude, rule).ok()?;
                evaluations += shape.evaluations;
                let helix = self.helix(state, alpha);
                let r1 = shape.length.value - self.rod.length_m;
                let r2 = helix.miss(self, state, shape.reach.value);
                let residual = (r1 / self.rod.length_m).value().abs().max(helix.scaled(self, r2));
                if enough && step > 0 && residual <= limit {
                    if left == 0 {
                        return Some(Found { alpha, amplitude, shape, residual, missed, iterations, evaluations });
                    }
                    left -= 1;
                }
                // The first look through twice the nodes shows what the fewer missed.
                if k > 0 && step == 0 {
                    missed = residual;
                    enough |= missed <= T::NEARLY;
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
                // A far step is cut, a wild one ends the attempt.
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

    /// The first helix angle, counted from the untwisted string, at which eq. 25 holds, with the rod solved inside its
    /// own bracket at each: the branch connected to zero.
    pub(crate) fn bracket(&self, state: &State) -> Result<Found<T>, SolveError> {
        let rule = match &self.quadrature {
            Quadrature::Automatic => &LEVELS[3],
            Quadrature::Fixed(rule) => rule,
        };
        let (mut evaluations, mut at) = (0, None);
        let balanced = self.balance(state, Some(SCAN), T::PRECISION, &mut |force| {
            let (amplitude, shape, steps) = self.rod.amplitude(force, rule)?;
            evaluations += steps * shape.evaluations;
            let residual = ((shape.length.value / self.rod.length_m).value() - 1.0).abs();
            at = Some((amplitude, shape, residual));
            self.rod.response(force, amplitude, &shape)
        })?;
        let Some((amplitude, shape, residual)) = at else {
            return Err(SolveError::NoEquilibrium { load_n: state.load_n, twist_rad: state.twist_rad });
        };
        let alpha = balanced.alpha_rad;
        // From so near, Newton settles on the same root, and on as many nodes as it takes.
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

    /// The equilibrium at a solved state: everything but the counts.
    ///
    /// # Errors
    /// [`SolveError::StrainRange`].
    pub(crate) fn finish(
        &self,
        state: &State,
        alpha: T,
        response: &RodResponse<T>,
    ) -> Result<Equilibrium<T>, SolveError> {
        let helix = self.helix(state, alpha);
        let force: TipForce<T> = state.force(helix.tan);
        let miss = helix.miss(self, state, response.reach.value);
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
        if state.twist_rad < PI * (1.0 - 1e-12) {
            warnings.add(Warnings::OPEN_STRINGS);
        }
        let (by_twist, by_load) = self.gap_derivatives(state, &helix, response);
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
            gap_m: helix.x_m + response.deflection.value * 2.0,
            dgap_dtwist_m_per_rad: by_twist * state.sign,
            dgap_dload_m_per_n: by_load,
            torque_nm: helix.tan * helix.radius.arc_by_twist * (state.sign * state.load_n),
            residual: helix.scaled(self, miss),
            iterations: 0,
            evaluations: 0,
            warnings,
        })
    }
}

/// Intervals in which the first root is looked for.
const SCAN: u32 = 48;

/// A solution whose residual is as small as it must be.
pub(crate) fn converged<T: Scalar>(found: Equilibrium<T>) -> Result<Equilibrium<T>, SolveError> {
    // Not `>`: NaN is no solution either.
    if found.residual <= T::RESIDUAL {
        return Ok(found);
    }
    let Equilibrium { load_n, twist_rad, residual, .. } = found;
    Err(SolveError::NotConverged { load_n, twist_rad, residual })
}

/// x + step, the step no longer than `most`.
fn cut<T: Scalar>(x: T, step: T, most: f64) -> T {
    let size = step.value().abs();
    if size > most { x + step * (most / size) } else { x + step }
}
