//! Strings and rods together (eqs 25–29): the equilibrium at a load and a twist.
//!
//! Two unknowns, the rods' tip angle φ_l and the helix angle α, and two equations: the rod has its length, and
//! tan α · X = D + θ r (eq. 25). Newton with exact derivatives settles most states in a handful of steps; whatever it
//! does not settle on the branch connected to zero load is solved again inside brackets, which cannot run away.

use crate::error::{ParameterError, SolveError, Warnings};
use crate::material::Material;
use crate::math::{asin, sin, sin_cos, sqrt};
use crate::rod::{Rod, RodShape, TipForce};
use crate::string::{Radius, StringParameters};
use core::f64::consts::{FRAC_PI_2, PI};

/// Lengths of the mechanism.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(deny_unknown_fields))]
pub struct Geometry {
    /// String length without load L0 (m).
    pub string_length_m: f64,
    /// Distance between the string attachments on an unbent rod D0 (m).
    pub rod_span_m: f64,
    /// Width c of the clamp at the rod's middle (m).
    pub clamp_width_m: f64,
    /// Rod radius R (m).
    pub rod_radius_m: f64,
}

impl Geometry {
    /// Checks signs and that the parts fit together.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let positive = [
            ("geometry.string_length_m", self.string_length_m),
            ("geometry.rod_span_m", self.rod_span_m),
            ("geometry.rod_radius_m", self.rod_radius_m),
        ];
        for (parameter, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ParameterError { parameter, value, reason: "must be above 0 and finite" });
            }
        }
        let (parameter, value) = ("geometry.clamp_width_m", self.clamp_width_m);
        if !(value >= 0.0 && value <= self.rod_span_m) {
            return Err(ParameterError { parameter, value, reason: "must be from 0 to geometry.rod_span_m" });
        }
        let (parameter, value) = ("geometry.rod_span_m", self.rod_span_m);
        if value >= self.string_length_m {
            return Err(ParameterError { parameter, value, reason: "must be below geometry.string_length_m" });
        }
        Ok(())
    }

    /// Free length of half a rod, (D0 − c)/2 (m).
    pub fn free_length_m(&self) -> f64 {
        0.5 * (self.rod_span_m - self.clamp_width_m)
    }

    /// X0 = √(L0² − D0²), eq. 1 (m).
    pub fn start_length_m(&self) -> f64 {
        sqrt(self.string_length_m * self.string_length_m - self.rod_span_m * self.rod_span_m)
    }
}

/// Below this load (N) the fitted radius law has no support; the solution carries a warning.
pub const LIGHT_LOAD_N: f64 = 0.5;
/// Least load that is solved (N): below it 1/(k1 F) alone would make the string thicker than it is long.
pub const MINIMUM_LOAD_N: f64 = 0.05;
/// Strain past which the polynomial of eq. 12 is refused, half as far again as its fit reaches.
pub const STRAIN_LIMIT: f64 = 0.12;
/// Largest scaled residual of an accepted solution.
pub const RESIDUAL_LIMIT: f64 = 1e-12;

/// An equilibrium and its derivatives. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equilibrium {
    /// Load Fz (N).
    pub load_n: f64,
    /// Twist θ (rad).
    pub twist_rad: f64,
    /// Helix angle α (rad).
    pub alpha_rad: f64,
    /// Distance X between the attachments of the two rods (m), eq. 9.
    pub x_m: f64,
    /// Span D of the bent rod (m), eq. 26.
    pub d_m: f64,
    /// Axial tip displacement u(l) of half a rod (m).
    pub u_m: f64,
    /// Lateral tip displacement w(l) (m).
    pub w_m: f64,
    /// Radius r of the twisted pair (m), eq. 6.
    pub r_m: f64,
    /// String tension (N), eq. 8.
    pub tension_n: f64,
    /// Tip angle φ_l (rad).
    pub tip_angle_rad: f64,
    /// Bending strain κ(0) R at the clamp.
    pub bending_strain: f64,
    /// Gap G = X + 2w between the two clamps (m): what the LVDT sees up to an offset.
    pub gap_m: f64,
    /// ∂G/∂θ at constant load (m/rad).
    pub dgap_dtwist_m_per_rad: f64,
    /// ∂G/∂F at constant twist (m/N).
    pub dgap_dload_m_per_n: f64,
    /// Ideal motor torque F tan α (r + θ ∂r/∂θ) (N m), model.md section 4.
    pub torque_nm: f64,
    /// Largest scaled residual of the two equations.
    pub residual: f64,
    /// Newton or bracket steps taken.
    pub iterations: u32,
    /// Section evaluations spent.
    pub evaluations: u32,
    /// What to take this with.
    pub warnings: Warnings,
}

impl Equilibrium {
    /// Transmission ratio TR = −1/(∂G/∂θ) (rad/m), eq. 29. Infinite at zero twist.
    pub fn tr_rad_per_m(&self) -> f64 {
        -1.0 / self.dgap_dtwist_m_per_rad
    }
}

/// The mechanism of one scene, ready to be solved.
#[derive(Clone, Debug)]
pub struct Mechanism {
    geometry: Geometry,
    string: StringParameters,
    rod: Rod,
    start_length_m: f64,
}

/// The two equations at a trial state, with everything their derivatives need.
struct Trial {
    shape: RodShape,
    radius: Radius,
    /// Rod length missed over l; helix equation missed over its own size.
    residual: [f64; 2],
    /// Size of the helix equation: string length or horizontal run, whichever is more (m).
    scale_m: f64,
    /// Derivatives of the two (unscaled) residuals by φ_l and α.
    jacobian: [f64; 4],
    x_m: f64,
    x_by_angle: f64,
    tan: f64,
    sec2: f64,
    /// D, and the horizontal run H = D S + |θ| r.
    d_m: f64,
}

/// What depends on load and twist alone.
struct State {
    load_n: f64,
    /// |θ|
    twist_rad: f64,
    /// S = sin(min(|θ|, π)/2): how much of D the open strings span (model.md section 5).
    span_factor: f64,
    span_factor_by_twist: f64,
}

/// A point beyond which no helix is looked for: tan α ≈ 30, where eq. 9's stretch alone keeps a formal root alive.
const ALPHA_LIMIT: f64 = FRAC_PI_2 - 1.0 / 30.0;

impl Mechanism {
    /// Checks the parameters and prepares the solver with as many quadrature points as the material needs.
    ///
    /// # Errors
    /// [`ParameterError`] naming the scene-file key.
    pub fn new(geometry: &Geometry, string: &StringParameters, material: &Material) -> Result<Self, ParameterError> {
        material.validate()?;
        // Straight line: 16 points reach rounding. On a near-flat plateau 40 still miss w by 1e-7 at 15 N.
        let mild = material.stress_pa(FIT_SAMPLE) / (FIT_SAMPLE * material.stress_coefficients_pa[0]);
        let points = if (0.8..1.25).contains(&mild) { 16 } else { 64 };
        Self::with_points(geometry, string, material, points)
    }

    /// As [`Mechanism::new`] with a stated number of quadrature points, 1 to 64.
    ///
    /// # Errors
    /// [`ParameterError`] naming the scene-file key.
    pub fn with_points(
        geometry: &Geometry,
        string: &StringParameters,
        material: &Material,
        points: usize,
    ) -> Result<Self, ParameterError> {
        geometry.validate()?;
        string.validate()?;
        material.validate()?;
        Ok(Self {
            geometry: *geometry,
            string: *string,
            rod: Rod::new(geometry.free_length_m(), geometry.rod_radius_m, material, points),
            start_length_m: geometry.start_length_m(),
        })
    }

    /// X0 of eq. 1 (m).
    pub fn start_length_m(&self) -> f64 {
        self.start_length_m
    }

    /// Half a rod.
    pub fn rod(&self) -> &Rod {
        &self.rod
    }

    /// The equilibrium at a load (N) and a twist (rad, either sign; π is the half-turn pre-twist).
    ///
    /// # Errors
    /// The named limit of the model that stopped it, see [`SolveError`].
    pub fn solve(&self, load_n: f64, twist_rad: f64) -> Result<Equilibrium, SolveError> {
        let found = self.formal(load_n, twist_rad)?;
        if found.warnings.contains(Warnings::OVERTWIST) {
            let needed_m = self.string.diameter_m * twist_rad.abs() / PI;
            return Err(SolveError::Overtwist { length_m: found.x_m, needed_m });
        }
        Ok(found)
    }

    /// As [`Mechanism::solve`], but an overtwisted state is returned with a warning: the equations' root, which no
    /// two strings of diameter r0 can reach. For comparing with numbers that were computed without that limit.
    ///
    /// # Errors
    /// As [`Mechanism::solve`], without [`SolveError::Overtwist`].
    pub fn formal(&self, load_n: f64, twist_rad: f64) -> Result<Equilibrium, SolveError> {
        if !load_n.is_finite() {
            return Err(SolveError::NotFinite { parameter: "load", value: load_n });
        }
        if !twist_rad.is_finite() {
            return Err(SolveError::NotFinite { parameter: "twist", value: twist_rad });
        }
        if load_n < MINIMUM_LOAD_N {
            return Err(SolveError::Slack { load_n, minimum_n: MINIMUM_LOAD_N });
        }
        let twist = twist_rad.abs();
        let half = 0.5 * twist.min(PI);
        let state = State {
            load_n,
            twist_rad: twist,
            span_factor: sin(half),
            span_factor_by_twist: if twist < PI { 0.5 * sin_cos(half).1 } else { 0.0 },
        };
        let (alpha, angle, trial, iterations) = match self.newton(&state) {
            Some(found) => found,
            None => self.bracket(&state)?,
        };
        self.finish(&state, twist_rad, alpha, angle, &trial, iterations)
    }

    /// Eq. 11. Open strings (|θ| < π) pull only by S of their horizontal force along the rod: a straight string
    /// between two circles meets the rod at |θ|/2 from its normal. Without S the gap would have a cusp at zero twist.
    fn force(state: &State, tan: f64) -> TipForce {
        TipForce { inward_n: 0.5 * state.load_n * tan * state.span_factor, sideways_n: 0.5 * state.load_n }
    }

    fn length(&self, state: &State, alpha: f64) -> (f64, f64) {
        let (sin, cos) = sin_cos(alpha);
        let l0 = self.geometry.string_length_m;
        (l0 * cos + state.load_n / (2.0 * self.string.stiffness_n_per_m), -l0 * sin)
    }

    fn trial(&self, state: &State, alpha: f64, tip_angle: f64) -> Result<Trial, SolveError> {
        let shape = if self.rod.length_m > 0.0 {
            let (sin, cos) = sin_cos(alpha);
            self.rod.shape(Self::force(state, sin / cos), tip_angle)?
        } else {
            RodShape::rigid()
        };
        Ok(self.trial_of(state, alpha, shape))
    }

    fn trial_of(&self, state: &State, alpha: f64, shape: RodShape) -> Trial {
        let (sin, cos) = sin_cos(alpha);
        let (tan, sec2) = (sin / cos, 1.0 / (cos * cos));
        let (x_m, x_by_angle) = self.length(state, alpha);
        let radius = self.string.radius(state.load_n, state.twist_rad, x_m, self.start_length_m);
        let d_m = 2.0 * shape.reach.value + self.geometry.clamp_width_m;
        let run = d_m * state.span_factor + state.twist_rad * radius.radius_m;
        let inward_by_alpha = 0.5 * state.load_n * sec2 * state.span_factor;
        let scale_m = run.max(self.geometry.string_length_m);
        let rod_miss = if self.rod.length_m > 0.0 { shape.length.value / self.rod.length_m - 1.0 } else { 0.0 };
        Trial {
            residual: [rod_miss, (tan * x_m - run) / scale_m],
            scale_m,
            jacobian: [
                shape.length.by_angle,
                shape.length.by_inward * inward_by_alpha,
                -2.0 * state.span_factor * shape.reach.by_angle,
                sec2 * x_m + tan * x_by_angle
                    - 2.0 * state.span_factor * shape.reach.by_inward * inward_by_alpha
                    - state.twist_rad * radius.by_length * x_by_angle,
            ],
            shape,
            radius,
            x_m,
            x_by_angle,
            tan,
            sec2,
            d_m,
        }
    }

    /// Newton in both unknowns from the rigid-rod helix; `None` if it does not settle at once on the stable branch.
    fn newton(&self, state: &State) -> Option<(f64, f64, Trial, u32)> {
        let (x_guess, l0) = (self.start_length_m, self.geometry.string_length_m);
        let radius = self.string.radius(state.load_n, state.twist_rad, x_guess, x_guess).radius_m;
        let run = self.geometry.rod_span_m * state.span_factor + state.twist_rad * radius;
        let stretched = l0 + state.load_n / (2.0 * self.string.stiffness_n_per_m);
        let mut alpha = asin((run / stretched).min(0.95));
        let rigid = self.rod.length_m == 0.0;
        let ceiling = |alpha: f64| FRAC_PI_2 + alpha;
        let (sin, cos) = sin_cos(alpha);
        let mut angle = self.rod.first_guess(Self::force(state, sin / cos), ceiling(alpha));
        for iterations in 1..=20 {
            let trial = self.trial(state, alpha, angle).ok()?;
            let [a, b, c, d] = trial.jacobian;
            let [r1, r2] = [trial.residual[0] * self.rod.length_m, trial.residual[1] * trial.scale_m];
            let (step_angle, step_alpha) = if rigid {
                (0.0, -r2 / d)
            } else {
                let det = a * d - b * c;
                // On the branch connected to zero load both the rod's own slope and the determinant are positive.
                if !(det > 0.0 && a > 0.0) {
                    return None;
                }
                ((-r1 * d + r2 * b) / det, (-a * r2 + c * r1) / det)
            };
            // A far step is cut, a wild one ends the attempt.
            let next_angle = if rigid { angle } else { angle + step_angle.clamp(-0.5 * angle, 0.5 * angle + 0.05) };
            let next_alpha = alpha + step_alpha.clamp(-0.2, 0.2);
            if !((0.0..ALPHA_LIMIT).contains(&next_alpha) && (rigid || next_angle < ceiling(next_alpha))) {
                return None;
            }
            let settled = step_alpha.abs() <= 1e-9 && (rigid || step_angle.abs() <= 1e-9 * (1.0 + angle));
            (alpha, angle) = (next_alpha, next_angle);
            if settled {
                let trial = self.trial(state, alpha, angle).ok()?;
                let residual = trial.residual[0].abs().max(trial.residual[1].abs());
                return (residual <= RESIDUAL_LIMIT).then_some((alpha, angle, trial, iterations));
            }
        }
        None
    }

    /// The rod solved inside its bracket at a given helix angle.
    fn rod_at(&self, state: &State, alpha: f64) -> Result<(f64, Trial), SolveError> {
        if self.rod.length_m == 0.0 {
            return Ok((0.0, self.trial_of(state, alpha, RodShape::rigid())));
        }
        let (sin, cos) = sin_cos(alpha);
        let (angle, shape) = self.rod.tip_angle(Self::force(state, sin / cos), FRAC_PI_2 + alpha)?;
        Ok((angle, self.trial_of(state, alpha, shape)))
    }

    /// The first helix angle, counted from the untwisted string, at which eq. 25 holds: the branch connected to zero.
    fn bracket(&self, state: &State) -> Result<(f64, f64, Trial, u32), SolveError> {
        const SCAN: u32 = 48;
        let none = SolveError::NoEquilibrium { load_n: state.load_n, twist_rad: state.twist_rad };
        let (mut low, mut high) = (0.0, None);
        let mut found = self.rod_at(state, 0.0)?;
        if found.1.residual[1] >= 0.0 {
            // Zero twist: the strings hang straight.
            return Ok((0.0, found.0, found.1, 1));
        }
        for k in 1..=SCAN {
            let alpha = ALPHA_LIMIT * f64::from(k) / f64::from(SCAN);
            found = self.rod_at(state, alpha)?;
            if found.1.residual[1] >= 0.0 {
                high = Some(alpha);
                break;
            }
            low = alpha;
        }
        let Some(mut high) = high else { return Err(none) };
        let mut alpha = high;
        let mut steps = SCAN;
        for _ in 0..200 {
            let trial = &found.1;
            let error = trial.residual[1];
            if error > 0.0 {
                high = alpha
            } else {
                low = alpha
            }
            // Slope of the helix equation along the solved rod.
            let [a, b, c, d] = trial.jacobian;
            let slope = if a > 0.0 { d - b * c / a } else { d };
            let newton = alpha - error * trial.scale_m / slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if error == 0.0 || (next - alpha).abs() <= 2.0 * f64::EPSILON * alpha {
                break;
            }
            alpha = next;
            found = self.rod_at(state, alpha)?;
            steps += 1;
        }
        let (angle, trial) = found;
        Ok((alpha, angle, trial, steps))
    }

    fn finish(
        &self,
        state: &State,
        twist_rad: f64,
        alpha: f64,
        angle: f64,
        trial: &Trial,
        iterations: u32,
    ) -> Result<Equilibrium, SolveError> {
        let load_n = state.load_n;
        let residual = trial.residual[0].abs().max(trial.residual[1].abs());
        let force = Self::force(state, trial.tan);
        let mut warnings = Warnings::default();
        if trial.x_m < self.string.diameter_m * state.twist_rad / PI {
            warnings.add(Warnings::OVERTWIST);
        }
        let mut bending_strain = 0.0;
        if self.rod.length_m > 0.0 {
            let clamp = self.rod.clamp_strain(force, angle)?;
            bending_strain = sqrt(clamp.bending_squared);
            if Rod::fibre_strain(clamp) > STRAIN_LIMIT {
                return Err(SolveError::StrainRange { strain: Rod::fibre_strain(clamp), limit: STRAIN_LIMIT });
            }
            if Rod::outside_fit(clamp) {
                warnings.add(Warnings::STRAIN_RANGE);
            }
            if self.rod.load_number(force) >= PI * PI / 4.0 {
                warnings.add(Warnings::NOT_UNIQUE);
            }
        }
        // A limit of the model names the failure better than a residual does, so this comes last. A rod bent until it
        // lies along the string has its tip angle within 1/κ of the force's direction: there a rounding of that angle
        // is worth more than 1e-12 of the length, and what rounding leaves is the limit.
        let conditioning = angle * trial.shape.length.by_angle / self.rod.length_m.max(f64::MIN_POSITIVE);
        let last_bit = 128.0 * f64::EPSILON * conditioning;
        if residual > RESIDUAL_LIMIT.max(last_bit) || residual.is_nan() {
            return Err(SolveError::NotConverged { load_n, twist_rad, residual });
        }
        if load_n < LIGHT_LOAD_N {
            warnings.add(Warnings::LIGHT_LOAD);
        }
        if state.twist_rad < PI * (1.0 - 1e-12) {
            warnings.add(Warnings::OPEN_STRINGS);
        }
        let (by_twist, by_load) = self.gap_derivatives(state, trial);
        let sign = if twist_rad < 0.0 { -1.0 } else { 1.0 };
        Ok(Equilibrium {
            load_n,
            twist_rad,
            alpha_rad: alpha,
            x_m: trial.x_m,
            d_m: trial.d_m,
            u_m: trial.shape.reach.value - self.rod.length_m,
            w_m: trial.shape.deflection.value,
            r_m: trial.radius.radius_m,
            tension_n: 0.5 * load_n * sqrt(trial.sec2),
            tip_angle_rad: angle,
            bending_strain,
            gap_m: trial.x_m + 2.0 * trial.shape.deflection.value,
            dgap_dtwist_m_per_rad: sign * by_twist,
            dgap_dload_m_per_n: by_load,
            torque_nm: sign * load_n * trial.tan * trial.radius.arc_by_twist,
            residual,
            iterations,
            evaluations: trial.shape.evaluations,
            warnings,
        })
    }

    /// ∂G/∂|θ| and ∂G/∂F by the implicit function theorem on the two equations.
    fn gap_derivatives(&self, state: &State, trial: &Trial) -> (f64, f64) {
        let RodShape { length, reach, deflection, .. } = &trial.shape;
        let (s, twist) = (state.span_factor, state.twist_rad);
        let inward_by_alpha = 0.5 * state.load_n * trial.sec2 * s;
        let inward_by_load = 0.5 * trial.tan * s;
        let inward_by_twist = 0.5 * state.load_n * trial.tan * state.span_factor_by_twist;
        let x_by_load = 0.5 / self.string.stiffness_n_per_m;
        // Derivatives of the residuals by θ and F at fixed unknowns.
        let by_twist = [
            length.by_inward * inward_by_twist,
            -(trial.d_m * state.span_factor_by_twist + trial.radius.arc_by_twist)
                - 2.0 * s * reach.by_inward * inward_by_twist,
        ];
        let by_load = [
            length.by_inward * inward_by_load + 0.5 * length.by_sideways,
            trial.tan * x_by_load
                - 2.0 * s * (reach.by_inward * inward_by_load + 0.5 * reach.by_sideways)
                - twist * (trial.radius.by_load + trial.radius.by_length * x_by_load),
        ];
        let [a, b, c, d] = trial.jacobian;
        let unknowns_by = |r: [f64; 2]| {
            if self.rod.length_m == 0.0 {
                return (0.0, -r[1] / d);
            }
            let det = a * d - b * c;
            ((-r[0] * d + r[1] * b) / det, (-a * r[1] + c * r[0]) / det)
        };
        let gap_by_unknowns = |(angle, alpha): (f64, f64)| {
            trial.x_by_angle * alpha
                + 2.0 * (deflection.by_angle * angle + deflection.by_inward * inward_by_alpha * alpha)
        };
        let direct = x_by_load + 2.0 * (deflection.by_inward * inward_by_load + 0.5 * deflection.by_sideways);
        let gap_by_twist = 2.0 * deflection.by_inward * inward_by_twist + gap_by_unknowns(unknowns_by(by_twist));
        (gap_by_twist, direct + gap_by_unknowns(unknowns_by(by_load)))
    }
}

/// Strain at which a law is compared with its own straight line to choose the number of quadrature points.
const FIT_SAMPLE: f64 = 0.05;
