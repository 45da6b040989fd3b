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

/// Maximum modulus (Pa), a thousand times that of diamond. The bending of much stiffer rods is below what a double resolves, and
/// its derivatives are no numbers.
const STIFFEST_PA: f64 = 1e15;

impl Material {
    /// Checks that the coefficients are finite, and that the modulus at zero strain is positive and no more than a rigid rod needs.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let parameter = "material.stress_coefficients_pa";
        for value in self.stress_coefficients_pa {
            require(value.is_finite(), parameter, value, "must be finite")?;
        }
        let modulus_pa = self.stress_coefficients_pa[0];
        let reason = "the first one, Young's modulus at zero strain, must be above 0 and at most 1e15";
        require(modulus_pa > 0.0 && modulus_pa <= STIFFEST_PA, parameter, modulus_pa, reason)
    }

    /// Stress at a strain (Pa), eq. 12.
    pub fn stress_pa(&self, strain: f64) -> f64 {
        let [a1, a2, a3, a4, a5] = self.stress_coefficients_pa;
        strain * (a1 + strain * (a2 + strain * (a3 + strain * (a4 + strain * a5))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_modulus_is_positive_and_of_some_solid() {
        let law = |modulus_pa| Material { stress_coefficients_pa: [modulus_pa, 0.0, 0.0, 0.0, 0.0] }.validate();
        assert!(law(35e9).is_ok() && law(STIFFEST_PA).is_ok());
        for modulus_pa in [0.0, -1e9, f64::NAN, f64::INFINITY, 1.01 * STIFFEST_PA, 1.8e161] {
            let refused = law(modulus_pa).expect_err("no solid");
            assert_eq!(refused.parameter, "material.stress_coefficients_pa", "{modulus_pa}");
        }
    }
}
