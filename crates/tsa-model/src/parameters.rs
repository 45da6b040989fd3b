//! The mechanism's constants: as a scene gives them, and as the solver takes them.

use crate::correction::Correction;
use crate::error::{ParameterError, positive, require};
use crate::material::Material;
use crate::scalar::{Scalar, ln};
use crate::string::{RadiusLaw, StringParameters};
use core::f64::consts::PI;

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

/// Longest string (m): beyond it single precision does not resolve micrometres.
const LONGEST_M: f64 = 10.0;

impl Geometry {
    /// Checks signs and that the parts fit together.
    pub fn validate(&self) -> Result<(), ParameterError> {
        positive(&[
            ("geometry.string_length_m", self.string_length_m),
            ("geometry.rod_span_m", self.rod_span_m),
            ("geometry.rod_radius_m", self.rod_radius_m),
        ])?;
        let Self { string_length_m, rod_span_m, clamp_width_m, .. } = *self;
        let longest = string_length_m <= LONGEST_M;
        require(longest, "geometry.string_length_m", string_length_m, "must be at most 10 m")?;
        let clamped = (0.0..=rod_span_m).contains(&clamp_width_m);
        require(clamped, "geometry.clamp_width_m", clamp_width_m, "must be from 0 to geometry.rod_span_m")?;
        let shorter = rod_span_m < string_length_m;
        require(shorter, "geometry.rod_span_m", rod_span_m, "must be below geometry.string_length_m")
    }
}

/// All constants of the equations, as plain numbers or as numbers with derivatives by some of them, so that
/// [`crate::Mechanism::formal`] returns how every result depends on them.
#[derive(Clone, Copy, Debug)]
pub struct Parameters<T = f64> {
    /// L0 (m).
    pub string_length_m: T,
    /// D0 (m).
    pub rod_span_m: T,
    /// c (m).
    pub clamp_width_m: T,
    /// R (m).
    pub rod_radius_m: T,
    /// r0 (m).
    pub diameter_m: T,
    /// K (N/m).
    pub stiffness_n_per_m: T,
    /// k1 (1/N).
    pub k1_per_n: T,
    /// k2.
    pub k2: T,
    /// k3.
    pub k3: T,
    /// k4; 0 with [`RadiusLaw::TwistPower`].
    pub k4: T,
    /// p; of no effect with [`RadiusLaw::LengthRatio`].
    pub twist_exponent: T,
    /// a1…a5 (Pa).
    pub stress_coefficients_pa: [T; 5],
    /// Growth of the radius with twist.
    pub radius_law: RadiusLaw,
    /// What the law misses of this rig's gap.
    pub correction: Option<Correction>,
}

impl Parameters {
    /// Checks the constants of a scene and collects them, without a correction.
    ///
    /// # Errors
    /// [`ParameterError`] naming the scene-file key.
    pub fn new(geometry: &Geometry, string: &StringParameters, material: &Material) -> Result<Self, ParameterError> {
        geometry.validate()?;
        string.validate()?;
        material.validate()?;
        Ok(Self {
            string_length_m: geometry.string_length_m,
            rod_span_m: geometry.rod_span_m,
            clamp_width_m: geometry.clamp_width_m,
            rod_radius_m: geometry.rod_radius_m,
            diameter_m: string.diameter_m,
            stiffness_n_per_m: string.stiffness_n_per_m,
            k1_per_n: string.k1_per_n,
            k2: string.k2,
            k3: string.k3,
            k4: string.k4,
            twist_exponent: string.twist_exponent.unwrap_or(0.0),
            stress_coefficients_pa: material.stress_coefficients_pa,
            radius_law: string.radius_law,
            correction: None,
        })
    }
}

impl<T: Scalar> Parameters<T> {
    /// The same constants as another kind of number, with no derivatives.
    pub fn constant(p: &Parameters) -> Self {
        Self {
            string_length_m: T::of(p.string_length_m),
            rod_span_m: T::of(p.rod_span_m),
            clamp_width_m: T::of(p.clamp_width_m),
            rod_radius_m: T::of(p.rod_radius_m),
            diameter_m: T::of(p.diameter_m),
            stiffness_n_per_m: T::of(p.stiffness_n_per_m),
            k1_per_n: T::of(p.k1_per_n),
            k2: T::of(p.k2),
            k3: T::of(p.k3),
            k4: T::of(p.k4),
            twist_exponent: T::of(p.twist_exponent),
            stress_coefficients_pa: p.stress_coefficients_pa.map(T::of),
            radius_law: p.radius_law,
            correction: p.correction,
        }
    }

    /// Free length of half a rod, (D0 − c)/2 (m).
    pub fn free_length_m(&self) -> T {
        (self.rod_span_m - self.clamp_width_m) * 0.5
    }

    /// X0 = √(L0² − D0²), eq. 1 (m).
    pub fn start_length_m(&self) -> T {
        (self.string_length_m * self.string_length_m - self.rod_span_m * self.rod_span_m).sqrt()
    }

    /// Radius r of the twisted pair and its derivatives, as H = |θ| r needs them (eq. 6 and docs/explanation/model.md
    /// section 2). `twist_rad` is |θ|, `length_m` is X, `start_length_m` is X0.
    pub fn radius(&self, load_n: f64, twist_rad: f64, length_m: T, start_length_m: T) -> Radius<T> {
        let by_k1 = T::of(1.0) / (self.k1_per_n * load_n);
        let base = by_k1 + self.k2;
        let (g, g_by_length, slope) = match self.radius_law {
            RadiusLaw::LengthRatio => {
                let g = (start_length_m / length_m).sqrt();
                (g, -(g / length_m * 0.5), T::of(0.0))
            }
            RadiusLaw::TwistPower => {
                let p = self.twist_exponent;
                (T::of(twist_rad / PI).powf(p), T::of(0.0), p)
            }
        };
        // Open strings do not touch: the logarithm starts at the half-turn pre-twist.
        let (log, log_slope) = if touches(twist_rad) { (ln(twist_rad / PI).max(0.0), 1.0) } else { (0.0, 0.0) };
        let r0 = self.diameter_m;
        Radius {
            radius_m: (base + self.k3 * g + self.k4 * log) * r0,
            by_load: -(r0 * by_k1 / load_n),
            by_length: self.k3 * g_by_length * r0,
            arc_by_twist: (base + self.k3 * g * (slope + 1.0) + self.k4 * (log + log_slope)) * r0,
        }
    }
}

/// Whether strings at a twist |θ| (rad) touch: from the half-turn pre-twist up, which rounding may put just below π.
pub(crate) fn touches(twist_rad: f64) -> bool {
    twist_rad >= PI * (1.0 - 1e-12)
}

/// Radius of the twisted pair and its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Radius<T = f64> {
    /// r (m).
    pub radius_m: T,
    /// ∂r/∂F (m/N).
    pub by_load: T,
    /// ∂r/∂X.
    pub by_length: T,
    /// ∂(|θ| r)/∂|θ| = r + θ ∂r/∂θ (m/rad). With k4 it jumps up at |θ| = π, where it is the slope above.
    pub arc_by_twist: T,
}
