//! Changes of the emulated plant, `KEY=VALUE`.

use crate::units::{self, Quantity, UnitError};

/// Every key and what its value measures. The emulator knows their ranges.
pub const KEYS: [(&str, Quantity); 15] = [
    ("load", Quantity::Load),
    ("friction", Quantity::Force),
    ("damping", Quantity::Damping),
    ("lvdt_noise", Quantity::Length),
    ("lvdt_offset", Quantity::Length),
    ("lvdt_gain_error", Quantity::Fraction),
    ("hum", Quantity::Length),
    ("adc_inl", Quantity::Number),
    ("twist_at_boot", Quantity::Angle),
    ("k2_scale", Quantity::Fraction),
    ("k3_scale", Quantity::Fraction),
    ("stiffness_scale", Quantity::Fraction),
    ("modulus_scale", Quantity::Fraction),
    ("gear_backlash", Quantity::Angle),
    ("supply_voltage", Quantity::Voltage),
];

/// What `--plant` takes, for its help.
pub fn help() -> String {
    let lines = KEYS.map(|(key, quantity)| format!("  {key}: {}", quantity.units()));
    format!(
        "Changes of the emulated plant that the firmware does not know, for example load=1.2kg,friction=0.1. Keys and \
         their units:\n{}",
        lines.join("\n")
    )
}

/// One change of the plant.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// One of [`KEYS`].
    pub key: &'static str,
    /// Value in SI units.
    pub value: f64,
}

/// Why a text is not a change of the plant.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// No `=`.
    #[error("`{0}` is not KEY=VALUE")]
    NoEquals(String),
    /// No such key.
    #[error("plant has no key `{key}`; keys: {}", KEYS.map(|(k, _)| k).join(", "))]
    UnknownKey {
        /// What was given.
        key: String,
    },
    /// The value is of another kind.
    #[error("plant key {0}")]
    Value(#[from] UnitError),
}

impl std::str::FromStr for Setting {
    type Err = PlantError;

    fn from_str(text: &str) -> Result<Self, PlantError> {
        let (key, value) = text.split_once('=').ok_or_else(|| PlantError::NoEquals(text.into()))?;
        let (key, quantity) = KEYS
            .into_iter()
            .find(|(name, _)| *name == key.trim())
            .ok_or_else(|| PlantError::UnknownKey { key: key.trim().into() })?;
        Ok(Self { key, value: units::parse(key, quantity, value)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings() {
        assert_eq!("load=12N".parse(), Ok(Setting { key: "load", value: 12.0 }));
        assert_eq!("lvdt_noise=60um".parse(), Ok(Setting { key: "lvdt_noise", value: 60.0 * 1e-6 }));
        for (text, named) in [("load", "KEY=VALUE"), ("lod=1", "lod"), ("lod=1", "load"), ("load=1V", "kg")] {
            let message = text.parse::<Setting>().expect_err(text).to_string();
            assert!(message.contains(named), "{message}");
        }
    }
}
