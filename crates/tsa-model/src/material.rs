//! Stress–strain law of the rods (eq. 12).

use crate::error::{ParameterError, require};

/// σ(ε) = Σ a_i ε^i, i = 1…5 (eq. 12).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(deny_unknown_fields))]
pub struct Material {
    /// a1…a5 (Pa).
    pub stress_coefficients_pa: [f64; 5],
}

/// Strain up to which eq. 12 was fitted (docs/explanation/model.md section 5).
pub const FIT_RANGE: f64 = 0.08;

impl Material {
    /// Checks that the coefficients are finite and the modulus at zero strain is positive.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let parameter = "material.stress_coefficients_pa";
        for value in self.stress_coefficients_pa {
            require(value.is_finite(), parameter, value, "must be finite")?;
        }
        let modulus_pa = self.stress_coefficients_pa[0];
        let reason = "the first one, Young's modulus at zero strain, must be above 0";
        require(modulus_pa > 0.0, parameter, modulus_pa, reason)
    }

    /// Stress at a strain (Pa), eq. 12.
    pub fn stress_pa(&self, strain: f64) -> f64 {
        let [a1, a2, a3, a4, a5] = self.stress_coefficients_pa;
        strain * (a1 + strain * (a2 + strain * (a3 + strain * (a4 + strain * a5))))
    }
}
