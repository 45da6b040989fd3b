//! One free half of a rod (eqs 13–24), without shooting.
//!
//! A cantilever of reference length l is pulled at its tip by Px inward and Py sideways. Both are constant along the
//! rod and x does not appear, so H = κM + (1 + e)N − W is constant (model.md section 3). Given the tip angle φ_l, each
//! section follows pointwise from N(φ) and H, and length and tip position are integrals over φ. With φ = φ_l (1 − t²)
//! the integrands are smooth and Gauss–Legendre in t converges spectrally.

use crate::error::SolveError;
use crate::material::{FIT_RANGE, Material};
use crate::math::{sin_cos, sqrt};
use crate::quadrature::Rule;
use crate::section::{Demand, Section, Singular, Strain};

/// Force on the tip of half a rod (N): `inward` compresses (Px), `sideways` bends (Py), eq. 11.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipForce {
    /// Px = (F/2) tan α.
    pub inward_n: f64,
    /// Py = F/2.
    pub sideways_n: f64,
}

/// A value with its derivatives by tip angle, Px and Py.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Partial {
    /// The value (m).
    pub value: f64,
    /// By the tip angle (m/rad).
    pub by_angle: f64,
    /// By Px (m/N).
    pub by_inward: f64,
    /// By Py (m/N).
    pub by_sideways: f64,
}

/// A rod whose tip angle is given: what length it would have, and where its tip is.
#[derive(Clone, Copy, Debug)]
pub struct RodShape {
    /// Reference length ∫dφ/κ (m).
    pub length: Partial,
    /// Tip position along the clamp's direction, X(l) = l + u(l) (m).
    pub reach: Partial,
    /// Lateral tip displacement w(l) (m).
    pub deflection: Partial,
    /// Section evaluations spent.
    pub evaluations: u32,
}

impl RodShape {
    /// A rod without free length: the exact limit D0 → c.
    pub fn rigid() -> Self {
        let zero = Partial::default();
        Self { length: zero, reach: zero, deflection: zero, evaluations: 0 }
    }
}

/// Half a rod.
#[derive(Clone, Debug)]
pub struct Rod {
    /// Free length on one side, (D0 − c)/2 (m).
    pub length_m: f64,
    radius_m: f64,
    section: Section,
    /// A·E at zero strain (N).
    stiffness_n: f64,
    rule: Rule,
}

impl Rod {
    /// A rod of this material, with `points` quadrature nodes (1 to 64).
    pub fn new(length_m: f64, radius_m: f64, material: &Material, points: usize) -> Self {
        let area = core::f64::consts::PI * radius_m * radius_m;
        Self {
            length_m,
            radius_m,
            section: Section::new(material),
            stiffness_n: area * material.stress_coefficients_pa[0],
            rule: Rule::new(points),
        }
    }

    /// Bending stiffness at zero strain, E I2 (N m²).
    pub fn bending_stiffness_nm2(&self) -> f64 {
        self.stiffness_n * self.radius_m * self.radius_m / 4.0
    }

    /// |n| l²/EI: below π²/4 the equilibrium is unique (numerics.md 2.6).
    pub fn load_number(&self, force: TipForce) -> f64 {
        let TipForce { inward_n: px, sideways_n: py } = force;
        sqrt(px * px + py * py) * self.length_m * self.length_m / self.bending_stiffness_nm2()
    }

    /// Tip angle of the straight-line theory, Py l²/(2EI), kept below the force's direction (rad).
    pub fn first_guess(&self, force: TipForce, ceiling: f64) -> f64 {
        let n = force.sideways_n * self.length_m * self.length_m / self.bending_stiffness_nm2();
        // The compressive part adds about 5/12 of its own number to first order (beam-column).
        let h = force.inward_n * self.length_m * self.length_m / self.bending_stiffness_nm2();
        let angle = 0.5 * n * (1.0 + 5.0 / 12.0 * h.min(1.5));
        ceiling * (1.0 - 1.0 / (1.0 + angle / ceiling))
    }

    /// The section at φ = φ_l (1 − t²).
    fn demand(&self, force: TipForce, tip_angle: f64, t: f64, tip_stretch: f64) -> Demand {
        let (px, py) = (force.inward_n / self.stiffness_n, force.sideways_n / self.stiffness_n);
        let (sin, cos) = sin_cos(tip_angle * (1.0 - t * t));
        let half = 0.5 * tip_angle * t * t;
        let ((sin_half, _), (sin_mid, cos_mid)) = (sin_cos(half), sin_cos(tip_angle - half));
        Demand {
            n: py * sin - px * cos,
            // N_l − N in product form: as a difference it would lose half its digits near the tip.
            n_tip_less_n: 2.0 * sin_half * (px * sin_mid + py * cos_mid),
            tip_stretch,
        }
    }

    fn tip_stretch(&self, force: TipForce, tip_angle: f64) -> Result<f64, Singular> {
        let (sin, cos) = sin_cos(tip_angle);
        self.section.stretch((force.sideways_n * sin - force.inward_n * cos) / self.stiffness_n)
    }

    /// Shape of the rod that ends at `tip_angle` (rad) under `force`.
    ///
    /// # Errors
    /// [`SolveError::SectionSingular`] where the section's tangent vanishes.
    pub fn shape(&self, force: TipForce, tip_angle: f64) -> Result<RodShape, SolveError> {
        let e_tip = self.tip_stretch(force, tip_angle).map_err(singular)?;
        let (px, py) = (force.inward_n / self.stiffness_n, force.sideways_n / self.stiffness_n);
        let (sin_l, cos_l) = sin_cos(tip_angle);
        // Derivatives of the tip's axial force by tip angle, px, py.
        let n_tip_by = [px * sin_l + py * cos_l, -cos_l, sin_l];
        let mut shape = RodShape::rigid();
        let mut neighbour: Option<(f64, Strain)> = None;
        for (t, weight) in self.rule.iter() {
            let angle = tip_angle * (1.0 - t * t);
            let (sin, cos) = sin_cos(angle);
            let demand = self.demand(force, tip_angle, t, e_tip);
            // Bending grows like t² from the tip.
            let start = neighbour
                .map(|(t0, s)| Strain { axial: s.axial, bending_squared: s.bending_squared * (t / t0) * (t / t0) });
            let solved = self.section.solve(demand, start).map_err(singular)?;
            neighbour = Some((t, solved.strain));
            shape.evaluations += solved.iterations;
            let (e, y) = (solved.strain.axial, solved.strain.bending_squared);
            // dφ/κ = 2 φ_l t R/√y dt
            let element = weight * 2.0 * tip_angle * t * self.radius_m / sqrt(y);
            let n_by = [(1.0 - t * t) * (px * sin + py * cos), -cos, sin];
            let mut derivatives = [(0.0, 0.0); 3];
            for (k, derivative) in derivatives.iter_mut().enumerate() {
                let less_by = n_tip_by[k] - n_by[k];
                *derivative = solved.derivative(n_by[k], less_by + e_tip * n_tip_by[k] - e * n_by[k]);
            }
            let element_by = |k: usize| {
                let own = if k == 0 { 1.0 / tip_angle } else { 0.0 };
                element * (own - 0.5 * derivatives[k].1 / y)
            };
            let angle_by = [1.0 - t * t, 0.0, 0.0];
            let add = |partial: &mut Partial, factor: f64, factor_by_e: f64, factor_by_angle: f64| {
                partial.value += factor * element;
                let by = |k: usize| {
                    factor * element_by(k) + element * (factor_by_e * derivatives[k].0 + factor_by_angle * angle_by[k])
                };
                partial.by_angle += by(0);
                partial.by_inward += by(1) / self.stiffness_n;
                partial.by_sideways += by(2) / self.stiffness_n;
            };
            add(&mut shape.length, 1.0, 0.0, 0.0);
            add(&mut shape.reach, (1.0 + e) * cos, cos, -(1.0 + e) * sin);
            add(&mut shape.deflection, (1.0 + e) * sin, sin, (1.0 + e) * cos);
        }
        Ok(shape)
    }

    /// Strain at the clamp (φ = 0), where bending is greatest.
    ///
    /// # Errors
    /// As [`Rod::shape`].
    pub fn clamp_strain(&self, force: TipForce, tip_angle: f64) -> Result<Strain, SolveError> {
        let tip = self.tip_stretch(force, tip_angle).map_err(singular)?;
        let demand = self.demand(force, tip_angle, 1.0, tip);
        Ok(self.section.solve(demand, None).map_err(singular)?.strain)
    }

    /// Tip angle at which the rod has its length: the smallest one, which is the one connected to zero load.
    /// Safeguarded Newton inside a bracket that grows from zero; returns the angle and its shape.
    ///
    /// # Errors
    /// [`SolveError::SectionSingular`] if the section gives out before the length is reached.
    pub fn tip_angle(&self, force: TipForce, ceiling: f64) -> Result<(f64, RodShape), SolveError> {
        let miss = |shape: &RodShape| shape.length.value / self.length_m - 1.0;
        let mut low = 0.0;
        let mut high = self.first_guess(force, ceiling).clamp(1e-12, 0.9 * ceiling);
        let mut shape;
        // Grow until the rod is too long; where the section gives out first, come back halfway.
        let mut broken: Option<(f64, SolveError)> = None;
        let mut tries = 0;
        loop {
            tries += 1;
            match self.shape(force, high) {
                Ok(s) if miss(&s) >= 0.0 => {
                    shape = s;
                    break;
                }
                Ok(_) => {
                    low = high;
                    let top = broken.as_ref().map_or(ceiling, |(angle, _)| *angle);
                    high = (2.0 * high).min(0.5 * (high + top));
                }
                Err(e) => {
                    broken = Some((high, e));
                    high = 0.5 * (low + high);
                }
            }
            if tries > 80 {
                let lost = SolveError::SectionSingular { bending_strain: f64::NAN };
                return Err(broken.map_or(lost, |(_, e)| e));
            }
        }
        let mut angle = high;
        for _ in 0..100 {
            let error = miss(&shape);
            if error > 0.0 {
                high = angle
            } else {
                low = angle
            }
            let newton = angle - error * self.length_m / shape.length.by_angle;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - angle).abs() <= 1e-15 * angle || error.abs() < 1e-15 {
                break;
            }
            angle = next;
            shape = self.shape(force, angle)?;
        }
        Ok((angle, shape))
    }

    /// Largest fibre strain |e| + κR of a section.
    pub fn fibre_strain(strain: Strain) -> f64 {
        strain.axial.abs() + sqrt(strain.bending_squared)
    }

    /// Whether a section is outside the range of the fit of eq. 12.
    pub fn outside_fit(strain: Strain) -> bool {
        Self::fibre_strain(strain) > FIT_RANGE
    }
}

fn singular(s: Singular) -> SolveError {
    SolveError::SectionSingular { bending_strain: s.bending_strain }
}
