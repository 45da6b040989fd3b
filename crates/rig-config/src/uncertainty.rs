//! `[uncertainty]`: how well the mechanism's constants are known.

use serde::{Deserialize, Serialize};
use tsa_model::ParameterError;
use tsa_model::error::require;

/// Standard errors of what the constants say of the strings (docs/reference/config.md). The control code computes from
/// them how well it knows load and position.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Uncertainty {
    /// Relative standard error of the string radius.
    pub radius: f64,
    /// Standard error of the LVDT's zero beside the mechanism's gap (m).
    pub gap_zero_m: f64,
    /// Standard error of how the radius depends on the load: of a load that is weighed, and of a change of the load, as a
    /// share of it.
    pub load_shape: f64,
    /// How much heavier a light load seems on rods that have carried a much heavier one, as a fraction of it. Its standard error
    /// is half of it (`hysteresis.rs` of rig-control).
    pub rod_memory: f64,
}

impl Default for Uncertainty {
    /// Constants from the paper for a rig of its kind that nobody has identified, an LVDT whose zero is measured with callipers, and
    /// rods of a nominal emulated rig, whose loop is 60 MPa to either side (crates/rig-plant/README.md).
    fn default() -> Self {
        Self { radius: 0.03, gap_zero_m: 0.5e-3, load_shape: 0.03, rod_memory: 0.16 }
    }
}

impl Uncertainty {
    /// As the metadata of a table has it, with the standard error of the twist's scale.
    pub(crate) fn of_table(&self, twist_scale: f64) -> tsa_table::Uncertainty {
        tsa_table::Uncertainty {
            twist_scale: twist_scale as f32,
            gap_zero_m: self.gap_zero_m as f32,
            load_shape: self.load_shape as f32,
            rod_memory: self.rod_memory as f32,
        }
    }

    /// Whether it is the default, which a scene file may leave out.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    pub(crate) fn validate(&self) -> Result<(), ParameterError> {
        for (parameter, value) in [
            ("uncertainty.radius", self.radius),
            ("uncertainty.gap_zero_m", self.gap_zero_m),
            ("uncertainty.load_shape", self.load_shape),
            ("uncertainty.rod_memory", self.rod_memory),
        ] {
            // Nothing is known exactly, and the fit divides by each of them.
            require((1e-6..=0.5).contains(&value), parameter, value, "must be from 0.000001 to 0.5")?;
        }
        Ok(())
    }
}
