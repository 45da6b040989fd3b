//! Plant keys: what can be changed about the emulated rig without telling the firmware, as `KEY=VALUE`.

use crate::units::{self, Quantity, UnitError};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Declares the enum of keys with the table of what is fixed about each.
macro_rules! plant_keys {
    ($($(#[$doc:meta])* $key:ident = $name:literal, $quantity:ident, $range:expr, $when:ident;)+) => {
        /// What can be changed about the emulated rig.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum PlantKey {
            $($(#[$doc])* $key,)+
        }

        impl PlantKey {
            /// Every key.
            pub const ALL: &'static [Self] = &[$(Self::$key),+];

            /// What is fixed about it.
            const fn spec(self) -> Spec {
                match self {
                    $(Self::$key => {
                        Spec { name: $name, quantity: Quantity::$quantity, range: $range, when: When::$when }
                    })+
                }
            }
        }
    };
}

/// What is fixed about a key.
struct Spec {
    name: &'static str,
    quantity: Quantity,
    /// Least and greatest value, SI. Wide: it excludes what makes no rig at all, and not what makes a bad one.
    range: [f64; 2],
    when: When,
}

/// When a key can change.
#[derive(PartialEq)]
enum When {
    Always,
    AtStart,
}

plant_keys! {
    /// Weight on the rail.
    Load = "load", Load, [0.01, 200.0], Always;
    /// Coulomb friction on the rail.
    Friction = "friction", Force, [0.0, 100.0], Always;
    /// Friction on the rail that grows with the load, as a share of the load.
    FrictionLoadShare = "friction_load_share", Fraction, [0.0, 1.0], Always;
    /// Static friction on the rail over Coulomb friction.
    StictionRatio = "stiction_ratio", Number, [1.0, 10.0], Always;
    /// Speed at which the rail's friction has fallen from static to Coulomb friction by 63 %; 0 is only at standstill.
    StribeckSpeed = "stribeck_speed", Speed, [0.0, 1.0], Always;
    /// How far the rail gives before it breaks loose.
    Presliding = "presliding", Length, [0.0, 1e-3], Always;
    /// Viscous damping on the rail.
    Damping = "damping", Damping, [0.0, 1e4], Always;
    /// LVDT noise of one sample, rms.
    LvdtNoise = "lvdt_noise", Length, [0.0, 0.1], Always;
    /// LVDT offset.
    LvdtOffset = "lvdt_offset", Length, [-0.2, 0.2], Always;
    /// LVDT gain error.
    LvdtGainError = "lvdt_gain_error", Fraction, [-0.9, 9.0], AtStart;
    /// Curve of the LVDT: amplitude of an error that is one sine over the stroke, as a share of the stroke.
    LvdtNonlinearity = "lvdt_nonlinearity", Fraction, [0.0, 0.1], Always;
    /// LVDT noise that averaging over a block of samples leaves, rms.
    LvdtNoiseInband = "lvdt_noise_inband", Length, [0.0, 0.1], Always;
    /// Hum of the mains in the LVDT's signal, peak.
    Hum = "hum", Length, [0.0, 0.1], Always;
    /// Integral non-linearity of the converter, codes, peak.
    AdcInl = "adc_inl", Number, [0.0, 100.0], Always;
    /// Twist of the strings at power-up.
    TwistAtBoot = "twist_at_boot", Angle, [-75.0, 75.0], AtStart;
    /// Scales k2 of the string's radius law.
    K2Scale = "k2_scale", Fraction, [0.1, 10.0], AtStart;
    /// Scales k3.
    K3Scale = "k3_scale", Fraction, [0.1, 10.0], AtStart;
    /// Scales k4.
    K4Scale = "k4_scale", Fraction, [0.1, 10.0], AtStart;
    /// Scales the string's stiffness K.
    StiffnessScale = "stiffness_scale", Fraction, [0.1, 100.0], AtStart;
    /// Scales all coefficients of the rods' stress-strain law.
    ModulusScale = "modulus_scale", Fraction, [0.1, 100.0], AtStart;
    /// Added to the exponent of the string's radius law.
    TwistExponentShift = "twist_exponent_shift", Number, [-0.4, 0.4], AtStart;
    /// Half width of the loop of the rods' stress over strain.
    RodHysteresis = "rod_hysteresis", Stress, [0.0, 1e9], AtStart;
    /// What the strings stretch slowly, as a share of their elastic stretch.
    StringCreep = "string_creep", Fraction, [0.0, 10.0], AtStart;
    /// Share of their radius that new strings lose over their first cycles.
    StringBedding = "string_bedding", Fraction, [0.0, 0.5], AtStart;
    /// Width of the loop between the twist of the shaft and that of the strings.
    TwistPlay = "twist_play", Angle, [0.0, 3.0], AtStart;
    /// Temperature of rods and LVDT, less that of the calibration.
    Temperature = "temperature", Temperature, [-100.0, 100.0], Always;
    /// Coulomb friction at the motor's shaft.
    MotorFriction = "motor_friction", Torque, [0.0, 0.1], Always;
    /// Share by which that friction is greater towards more twist, and smaller towards less.
    MotorFrictionAsymmetry = "motor_friction_asymmetry", Fraction, [-0.9, 0.9], Always;
    /// Efficiency of the gear.
    GearEfficiency = "gear_efficiency", Fraction, [0.05, 1.0], Always;
    /// True torque constant over the scene's.
    TorqueConstantScale = "torque_constant_scale", Fraction, [0.1, 10.0], AtStart;
    /// Offset of the drive's current reading.
    CurrentOffset = "current_offset", Current, [-1.0, 1.0], Always;
    /// Noise of one current reading, rms.
    CurrentNoise = "current_noise", Current, [0.0, 1.0], Always;
    /// Quantum of the current reading; 0 is none.
    CurrentQuantum = "current_quantum", Current, [0.0, 1.0], Always;
    /// Play of the gear at its output.
    GearBacklash = "gear_backlash", Angle, [0.0, 1.0], AtStart;
    /// Supply of the drive.
    SupplyVoltage = "supply_voltage", Voltage, [0.0, 58.0], Always;
    /// Whether a motor-power relay is fitted: 1 is yes, 0 is no.
    RelayFitted = "relay_fitted", Number, [0.0, 1.0], AtStart;
    /// How long that relay goes on feeding the drive once its pin is low.
    RelayRelease = "relay_release", Time, [0.0, 10.0], Always;
}

impl PlantKey {
    /// The name as an operator types it.
    pub const fn name(self) -> &'static str {
        self.spec().name
    }

    /// What its value measures.
    pub const fn quantity(self) -> Quantity {
        self.spec().quantity
    }

    /// Least and greatest value (SI units).
    pub const fn range(self) -> [f64; 2] {
        self.spec().range
    }

    fn names() -> String {
        Self::ALL.iter().map(|key| key.name()).collect::<Vec<_>>().join(", ")
    }

    /// Every key with its units, a line each, for help texts.
    pub fn help() -> String {
        Self::ALL.iter().map(|key| format!("  {key}: {}", key.quantity().units())).collect::<Vec<_>>().join("\n")
    }
}

impl fmt::Display for PlantKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Why the plant cannot be changed so.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// No `=`.
    #[error("`{0}` is not KEY=VALUE")]
    NoEquals(String),
    /// No such key.
    #[error("plant has no key `{key}`; keys: {}", PlantKey::names())]
    UnknownKey {
        /// What was given.
        key: String,
    },
    /// The value is no number, or has a unit of another quantity.
    #[error("plant key {0}")]
    Value(#[from] UnitError),
    /// The value makes no rig at all.
    #[error("plant key {change}: allowed are {} to {} (SI units)", change.key.range()[0], change.key.range()[1])]
    OutOfRange {
        /// What was asked for.
        change: PlantChange,
    },
    /// It needs a new rig.
    #[error("plant key {0} cannot change after boot; give it at the start")]
    OnlyAtStart(PlantKey),
}

/// One change of the plant. Its text, and its serialized form, is `KEY=VALUE` in SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct PlantChange {
    /// What.
    pub key: PlantKey,
    /// Its new value (SI units).
    pub value: f64,
}

impl PlantChange {
    /// Reads a value with or without a unit; a bare number is SI.
    ///
    /// # Errors
    /// [`PlantError`] if there is no such key, or the value is of another kind.
    pub fn read(key: &str, value: &str) -> Result<Self, PlantError> {
        let found = PlantKey::ALL.iter().copied().find(|known| known.name() == key.trim());
        let key = found.ok_or_else(|| PlantError::UnknownKey { key: key.trim().to_owned() })?;
        Ok(Self { key, value: units::parse(key.name(), key.quantity(), value)? })
    }

    /// Whether a rig can be built with it.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`] if it makes no rig at all.
    pub fn check(self) -> Result<(), PlantError> {
        let [least, most] = self.key.range();
        if (least..=most).contains(&self.value) { Ok(()) } else { Err(PlantError::OutOfRange { change: self }) }
    }

    /// Whether it can happen while the rig runs.
    ///
    /// # Errors
    /// As [`PlantChange::check`], and [`PlantError::OnlyAtStart`] if the key needs a new rig.
    pub fn check_running(self) -> Result<(), PlantError> {
        match self.key.spec().when {
            When::AtStart => Err(PlantError::OnlyAtStart(self.key)),
            When::Always => self.check(),
        }
    }
}

impl fmt::Display for PlantChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.key, self.value)
    }
}

impl std::str::FromStr for PlantChange {
    type Err = PlantError;

    fn from_str(text: &str) -> Result<Self, PlantError> {
        let (key, value) = text.split_once('=').ok_or_else(|| PlantError::NoEquals(text.to_owned()))?;
        Self::read(key, value)
    }
}

impl From<PlantChange> for String {
    fn from(change: PlantChange) -> Self {
        change.to_string()
    }
}

impl TryFrom<String> for PlantChange {
    type Error = PlantError;

    fn try_from(text: String) -> Result<Self, PlantError> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        text.parse::<PlantChange>().expect_err(text).to_string()
    }

    #[test]
    fn changes_come_back_from_their_own_text() {
        for (text, key, value) in [
            ("load=12N", PlantKey::Load, 12.0),
            ("load=500g", PlantKey::Load, 4.903_325),
            ("lvdt_noise=60um", PlantKey::LvdtNoise, 60.0 * 1e-6),
            ("lvdt_offset=-1e-3", PlantKey::LvdtOffset, -1e-3),
            ("lvdt_gain_error=1%", PlantKey::LvdtGainError, 0.01),
            ("supply_voltage=12V", PlantKey::SupplyVoltage, 12.0),
        ] {
            let change: PlantChange = text.parse().unwrap();
            assert_eq!(change, PlantChange { key, value });
            assert_eq!(change.to_string().parse(), Ok(change));
        }
    }

    #[test]
    fn refusals_name_key_units_and_alternatives() {
        for (text, named) in [("load", "KEY=VALUE"), ("lod=1", "lod"), ("lod=1", "relay_release"), ("load=1V", "kg")] {
            assert!(error(text).contains(named), "{}", error(text));
        }
        for text in ["load=1lb", "load=x", "load=nan", "load=inf", "load=", "lvdt_noise=1kg", "lvdt_noise=1µ"] {
            let key = text.split('=').next().unwrap();
            assert!(error(text).contains(key), "{}", error(text));
        }
    }

    #[test]
    fn a_value_out_of_range_is_refused_with_the_range() {
        let out = PlantChange { key: PlantKey::Load, value: -1.0 };
        let message = out.check().expect_err("out of range").to_string();
        assert_eq!(message, "plant key load=-1: allowed are 0.01 to 200 (SI units)");
        assert!(PlantChange { key: PlantKey::K2Scale, value: 0.0 }.check().is_err());
        assert!(PlantChange { key: PlantKey::K2Scale, value: 1.0 }.check().is_ok());
        let running = |key, value| PlantChange { key, value }.check_running();
        assert_eq!(running(PlantKey::K2Scale, 1.0), Err(PlantError::OnlyAtStart(PlantKey::K2Scale)));
        assert!(running(PlantKey::Load, -1.0).is_err() && running(PlantKey::Load, 9.8).is_ok());
    }
}
