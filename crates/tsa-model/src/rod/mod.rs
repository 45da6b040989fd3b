//! One free half of a rod (eqs 13–24), without shooting.
//!
//! A cantilever of reference length l is pulled at its tip by Px inward and Py sideways. Both are constant along the
//! rod and x does not appear, so H = κM + (1 + e)N − W is constant (docs/explanation/model.md section 3), and each
//! section follows pointwise from N and H. Let ψ be the angle between the rod's tangent and the line of the force: N =
//! P cos ψ, from ψ_0 = π/2 + atan(Px/Py) at the clamp to ψ_l at the tip, where κ vanishes. With the substitution of the
//! elastica's elliptic integrals, sin(ψ/2) = sin(ψ_l/2) cosh h, everything is an integral over h from 0 (tip) to the
//! *amplitude* S (clamp), where cosh S = sin(ψ_0/2)/sin(ψ_l/2). The integrands are smooth and even in h, so that
//! Gauss–Legendre converges spectrally, S grows almost in proportion to the rod's length however slender it is,
//! and no trigonometric function is left.

mod path;
mod sections;
mod shape;

use crate::error::SolveError;
use crate::material::FIT_RANGE;
use crate::quadrature::{LEVELS, Rule};
use crate::scalar::{RESIDUAL, Scalar};
use crate::section::{Section, Strain};

/// Force on the tip of half a rod (N): `inward` compresses (Px ≥ 0), `sideways` bends (Py > 0), eq. 11.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipForce<T = f64> {
    /// Px = (F/2) tan α.
    pub inward_n: T,
    /// Py = F/2.
    pub sideways_n: T,
}

/// A value with its derivatives by amplitude, Px and Py.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Partial<T = f64> {
    /// The value (m).
    pub value: T,
    /// By the amplitude (m).
    pub by_amplitude: T,
    /// By Px (m/N).
    pub by_inward: T,
    /// By Py (m/N).
    pub by_sideways: T,
}

impl<T: Scalar> Partial<T> {
    fn of(all: [T; 4]) -> Self {
        let [value, by_amplitude, by_inward, by_sideways] = all;
        Self { value, by_amplitude, by_inward, by_sideways }
    }
}

/// A rod of given amplitude: its length, and the position of its tip.
#[derive(Clone, Copy, Debug)]
pub struct RodShape<T = f64> {
    /// Reference length ∫dψ/κ (m).
    pub length: Partial<T>,
    /// Tip position along the clamp's direction, X(l) = l + u(l) (m).
    pub reach: Partial<T>,
    /// Lateral tip displacement w(l) (m).
    pub deflection: Partial<T>,
    /// Strain at the clamp, where bending is largest.
    pub clamp: Strain<T>,
    /// Section evaluations spent.
    pub evaluations: u32,
}

/// A length with its derivatives by the two components of the tip force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance<T = f64> {
    /// The length (m).
    pub value: T,
    /// By Px (m/N).
    pub by_inward: T,
    /// By Py (m/N).
    pub by_sideways: T,
}

impl<T: Scalar> Compliance<T> {
    /// A length that no force changes.
    pub fn rigid(value: T) -> Self {
        Self { value, by_inward: T::of(0.0), by_sideways: T::of(0.0) }
    }
}

/// The response of a rod to a tip force, by any method or tier.
#[derive(Clone, Copy, Debug)]
pub struct RodResponse<T = f64> {
    /// Tip position along the clamp's direction, l + u(l) (m).
    pub reach: Compliance<T>,
    /// Lateral tip displacement w(l) (m).
    pub deflection: Compliance<T>,
    /// Tip angle φ_l (rad).
    pub tip_angle_rad: T,
    /// Strain at the clamp, where bending is largest.
    pub clamp: Strain<T>,
}

impl<T: Scalar> RodResponse<T> {
    /// A rod of this length (m) that does not bend.
    pub fn rigid(length_m: T) -> Self {
        let zero = T::of(0.0);
        Self {
            reach: Compliance::rigid(length_m),
            deflection: Compliance::rigid(zero),
            tip_angle_rad: zero,
            clamp: Strain { axial: zero, bending_squared: zero },
        }
    }
}

/// The model of the rod.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RodModel {
    /// Stretch and the whole stress–strain law.
    Full,
    /// No stretch of the axis; the moment–curvature law that the section has without axial force.
    Inextensible,
    /// No stretch and a straight-line law: Euler's elastica.
    Elastica,
}

/// Half a rod.
#[derive(Clone, Debug)]
pub struct Rod<T = f64> {
    /// Its model.
    pub model: RodModel,
    /// Free length on one side, (D0 − c)/2 (m).
    pub length_m: T,
    /// Radius R (m).
    pub radius_m: T,
    /// The section, normalised.
    pub section: Section<T>,
    /// A·E at zero strain (N).
    pub stiffness_n: T,
}

/// The line of a force: its size over A·E and the half angle ψ_0/2 that it makes with the clamped end.
struct Line<T> {
    /// P/AE.
    p: T,
    /// Its derivatives by px and py (each over A·E): −cos ψ_0 and sin ψ_0.
    by: [T; 2],
}

impl<T: Scalar> Line<T> {
    fn new(px: T, py: T) -> Self {
        let p = (px * px + py * py).sqrt();
        Self { p, by: [px / p, py / p] }
    }

    /// sin and cos of ψ_0/2.
    fn half(&self) -> (T, T) {
        let [q, r] = self.by;
        // sin² = (1 + q)/2; cos² = (1 − q)/2, written without cancellation for a nearly axial force.
        let sin = ((q + 1.0) * 0.5).sqrt();
        (sin, r / (sin * 2.0))
    }
}

impl<T: Scalar> Rod<T> {
    /// A rod of this free length and radius (m) with the coefficients a1…a5 of eq. 12 (Pa).
    pub fn new(length_m: T, radius_m: T, stress_coefficients_pa: &[T; 5]) -> Self {
        Self {
            model: RodModel::Full,
            length_m,
            radius_m,
            section: Section::new(stress_coefficients_pa),
            stiffness_n: radius_m * radius_m * stress_coefficients_pa[0] * core::f64::consts::PI,
        }
    }

    /// Bending stiffness at zero strain, E I2 (N m²).
    pub fn bending_stiffness_nm2(&self) -> T {
        self.stiffness_n * self.radius_m * self.radius_m * 0.25
    }

    /// |n| l²/EI: below π²/4 the equilibrium is unique (crates/tsa-model/README.md 3).
    pub fn load_number(&self, force: TipForce<T>) -> T {
        let TipForce { inward_n: px, sideways_n: py } = force;
        (px * px + py * py).sqrt() * self.length_m * self.length_m / self.bending_stiffness_nm2()
    }

    fn line(&self, force: TipForce<T>) -> Line<T> {
        Line::new(force.inward_n / self.stiffness_n, force.sideways_n / self.stiffness_n)
    }

    /// Amplitude of a linear, inextensible rod, to about a percent: l √(P/EI) over the mean of 1/cos(ψ/2).
    pub fn first_guess(&self, force: TipForce<T>) -> T {
        let line = self.line(force);
        let (sin_half, cos_half) = line.half();
        let number = self.length_m * 2.0 * line.p.sqrt() / self.radius_m;
        let mut amplitude = number * cos_half;
        for _ in 0..2 {
            let (_, cosh) = amplitude.sinh_cosh();
            let tip = sin_half / cosh;
            let mid = tip * ((cosh + 1.0) * 0.5).sqrt();
            let inverse_cos = |sin: T| T::of(1.0) / (-(sin * sin) + 1.0).sqrt();
            let mean = (inverse_cos(tip) + inverse_cos(mid) * 4.0 + T::of(1.0) / cos_half) * (1.0 / 6.0);
            amplitude = number / mean;
        }
        amplitude
    }

    /// Tip angle φ_l = ψ_0 − ψ_l (rad), without cancellation for a rod that hardly bends.
    pub fn tip_angle(&self, force: TipForce<T>, amplitude: T) -> T {
        let (sin_half, cos_half) = self.line(force).half();
        let (sinh, cosh) = amplitude.sinh_cosh();
        let m = sin_half / cosh;
        let tanh = sinh / cosh;
        let sin = sin_half * sin_half * tanh * tanh / (sin_half * (-(m * m) + 1.0).sqrt() + cos_half * m);
        sin.asin() * 2.0
    }

    /// The response of the rod whose shape has the rod's length, with the amplitude eliminated.
    pub(crate) fn response(&self, force: TipForce<T>, amplitude: T, shape: &RodShape<T>) -> RodResponse<T> {
        let condense = |partial: &Partial<T>| {
            let fraction = partial.by_amplitude / shape.length.by_amplitude;
            Compliance {
                value: partial.value,
                by_inward: partial.by_inward - fraction * shape.length.by_inward,
                by_sideways: partial.by_sideways - fraction * shape.length.by_sideways,
            }
        };
        RodResponse {
            reach: condense(&shape.reach),
            deflection: condense(&shape.deflection),
            tip_angle_rad: self.tip_angle(force, amplitude),
            clamp: shape.clamp,
        }
    }

    /// Amplitude at which the rod has its length: the smallest one, which is the one connected to zero load.
    /// Safeguarded Newton inside a bracket that grows from zero; returns the amplitude, its shape and the steps taken.
    pub(crate) fn amplitude(&self, force: TipForce<T>, rule: &Rule) -> Result<(T, RodShape<T>, u32), SolveError> {
        let miss = |shape: &RodShape<T>| (shape.length.value / self.length_m).value() - 1.0;
        let mut low = 0.0;
        let mut high = self.first_guess(force).value();
        let mut shape;
        // Grow until the rod is too long; if the section fails first, go back halfway.
        let mut broken: Option<(f64, SolveError)> = None;
        let mut steps = 0;
        loop {
            steps += 1;
            match self.shape(force, T::of(high), rule, true) {
                Ok(s) if miss(&s) >= 0.0 => {
                    shape = s;
                    break;
                }
                Ok(s) => {
                    low = high;
                    let top = broken.as_ref().map_or(f64::INFINITY, |(amplitude, _)| *amplitude);
                    // The step by the slope, and a tenth more.
                    let ahead = -1.1 * miss(&s) * (self.length_m / s.length.by_amplitude).value();
                    high = (high + ahead.clamp(1e-3 * high, high)).min(0.5 * (high + top));
                }
                Err(e) => {
                    broken = Some((high, e));
                    high = 0.5 * (low + high);
                }
            }
            if steps > 80 {
                let lost = SolveError::SectionSingular { bending_strain: f64::NAN };
                return Err(broken.map_or(lost, |(_, e)| e));
            }
        }
        let mut amplitude = T::of(high);
        let mut left = T::EXTRA_STEPS;
        for _ in 0..100 {
            let error = shape.length.value / self.length_m - 1.0;
            if error.value() > 0.0 {
                high = amplitude.value()
            } else {
                low = amplitude.value()
            }
            let newton = amplitude - error * self.length_m / shape.length.by_amplitude;
            let inside = newton.value() > low && newton.value() < high;
            let settled = (newton - amplitude).value().abs() <= 5.0 * f64::EPSILON * high
                || error.value().abs() < 5.0 * f64::EPSILON;
            if settled {
                if left == 0 {
                    break;
                }
                left -= 1;
            }
            amplitude = if inside || settled { newton } else { T::of(0.5 * (low + high)) };
            shape = self.shape(force, amplitude, rule, true)?;
            steps += 1;
        }
        Ok((amplitude, shape, steps))
    }

    /// The rod under a tip force, with quadrature nodes doubled until the length agrees to 1e-12; how many were
    /// needed, and the steps taken.
    ///
    /// # Errors
    /// [`SolveError::SectionSingular`] if the section fails before the length is reached.
    pub fn respond(&self, force: TipForce<T>) -> Result<(RodResponse<T>, usize, u32), SolveError> {
        let mut total = 0;
        for pair in LEVELS.windows(2) {
            let (amplitude, _, steps) = self.amplitude(force, &pair[0])?;
            total += steps;
            let finer = self.shape(force, amplitude, &pair[1], true)?;
            if ((finer.length.value / self.length_m).value() - 1.0).abs() < RESIDUAL {
                return Ok((self.response(force, amplitude, &finer), pair[1].count(), total));
            }
        }
        let rule = &LEVELS[LEVELS.len() - 1];
        let (amplitude, shape, steps) = self.amplitude(force, rule)?;
        Ok((self.response(force, amplitude, &shape), rule.count(), total + steps))
    }
}

/// Whether a section is outside the range of the fit of eq. 12.
pub fn outside_fit<T: Scalar>(strain: Strain<T>) -> bool {
    strain.fibre() > FIT_RANGE
}
