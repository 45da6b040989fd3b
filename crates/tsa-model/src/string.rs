//! The two strings (eqs 1–9): radius, stretch, helix.

use crate::error::ParameterError;
use crate::math::{powf, sqrt};
use core::f64::consts::PI;

/// How the radius of the twisted pair grows with twist (eq. 6 and model.md section 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(rename_all = "kebab-case"))]
pub enum RadiusLaw {
    /// g = √(X0/X): eq. 6 as printed.
    #[default]
    LengthRatio,
    /// g = (|θ|/π)^p: the growth that the published sweeps ask for.
    TwistPower,
}

/// One string, and how a pair of them twists.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(deny_unknown_fields))]
pub struct StringParameters {
    /// Diameter without load r0 (m).
    pub diameter_m: f64,
    /// Stiffness K of one string (N/m).
    pub stiffness_n_per_m: f64,
    /// k1 (1/N), eq. 6.
    pub k1_per_n: f64,
    /// k2, eq. 6.
    pub k2: f64,
    /// k3, eq. 6.
    pub k3: f64,
    /// Growth of the radius with twist.
    #[cfg_attr(feature = "std", serde(default))]
    pub radius_law: RadiusLaw,
    /// Exponent p of [`RadiusLaw::TwistPower`].
    #[cfg_attr(feature = "std", serde(default, skip_serializing_if = "Option::is_none"))]
    pub twist_exponent: Option<f64>,
}

impl StringParameters {
    /// Checks signs and finiteness.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let positive = [
            ("string.diameter_m", self.diameter_m),
            ("string.stiffness_n_per_m", self.stiffness_n_per_m),
            ("string.k1_per_n", self.k1_per_n),
        ];
        for (parameter, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ParameterError { parameter, value, reason: "must be above 0 and finite" });
            }
        }
        for (parameter, value) in [("string.k2", self.k2), ("string.k3", self.k3)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(ParameterError { parameter, value, reason: "must be at least 0 and finite" });
            }
        }
        match (self.radius_law, self.twist_exponent) {
            (RadiusLaw::TwistPower, Some(p)) if (0.0..=2.0).contains(&p) => Ok(()),
            (RadiusLaw::TwistPower, p) => Err(ParameterError {
                parameter: "string.twist_exponent",
                value: p.unwrap_or(f64::NAN),
                reason: "radius_law \"twist-power\" needs an exponent from 0 to 2",
            }),
            (RadiusLaw::LengthRatio, None) => Ok(()),
            (RadiusLaw::LengthRatio, Some(value)) => Err(ParameterError {
                parameter: "string.twist_exponent",
                value,
                reason: "only with radius_law = \"twist-power\"",
            }),
        }
    }

    /// Radius r of the twisted pair and what H = |θ| r needs of its derivatives (eq. 6).
    /// `twist_rad` is |θ|, `length_m` is X, `start_length_m` is X0.
    pub fn radius(&self, load_n: f64, twist_rad: f64, length_m: f64, start_length_m: f64) -> Radius {
        let base = 1.0 / (self.k1_per_n * load_n) + self.k2;
        let (g, g_by_length, twist_slope) = match self.radius_law {
            RadiusLaw::LengthRatio => {
                let g = sqrt(start_length_m / length_m);
                (g, -0.5 * g / length_m, 0.0)
            }
            RadiusLaw::TwistPower => {
                let p = self.twist_exponent.unwrap_or(0.0);
                (powf(twist_rad / PI, p), 0.0, p)
            }
        };
        let r0 = self.diameter_m;
        Radius {
            radius_m: (base + self.k3 * g) * r0,
            by_load: -r0 / (self.k1_per_n * load_n * load_n),
            by_length: self.k3 * g_by_length * r0,
            arc_by_twist: (base + self.k3 * g * (1.0 + twist_slope)) * r0,
        }
    }
}

/// Radius of the twisted pair and its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Radius {
    /// r (m).
    pub radius_m: f64,
    /// ∂r/∂F (m/N).
    pub by_load: f64,
    /// ∂r/∂X.
    pub by_length: f64,
    /// ∂(|θ| r)/∂|θ| = r + θ ∂r/∂θ (m/rad).
    pub arc_by_twist: f64,
}
