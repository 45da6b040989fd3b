//! `[uncertainty]`: how well the mechanism's constants are known.

use serde::{Deserialize, Serialize};
use tsa_model::ParameterError;

/// Standard errors of what the constants say of the strings (docs/scene.md). The control code computes from them how
/// well it knows load and position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Uncertainty {
    /// Relative standard error of the string radius.
    pub radius: f64,
    /// Standard error of the exponent with which the radius follows the twist.
    pub exponent: f64,
    /// Relative standard error of how the radius changes with the load.
    pub load_shape: f64,
}

impl Default for Uncertainty {
    /// Constants from the paper: its own numbers differ from its equations by 6 % of the radius.
    fn default() -> Self {
        Self { radius: 0.06, exponent: 0.03, load_shape: 0.03 }
    }
}

impl Uncertainty {
    /// Whether it is the default, which a scene file may leave out.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    pub(crate) fn validate(&self) -> Result<(), ParameterError> {
        for (parameter, value) in [
            ("uncertainty.radius", self.radius),
            ("uncertainty.exponent", self.exponent),
            ("uncertainty.load_shape", self.load_shape),
        ] {
            if !(0.0..=0.5).contains(&value) {
                return Err(ParameterError { parameter, value, reason: "must be from 0 to 0.5" });
            }
        }
        Ok(())
    }
}
