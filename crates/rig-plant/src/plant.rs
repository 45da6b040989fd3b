//! Plant keys: what can be changed about the emulated rig without telling the firmware, as `KEY=VALUE`. One table says all
//! that is fixed about each.

use crate::units::{self, Quantity, STANDARD_GRAVITY, UnitError};
use serde::{Deserialize, Serialize};
use std::fmt;

/// How a rig that a seed names draws a value for a size s ([`crate::preset`]).
#[derive(Clone, Copy, Debug)]
pub(crate) enum Draw {
    /// From −s to s.
    Either,
    /// From 0.3 s to s: friction, noise and the like are never absent.
    Present,
    /// 1 plus what [`Draw::Either`] gives.
    ScaleEither,
    /// 1 plus what [`Draw::Present`] gives.
    ScaleAbove,
    /// 1 less what [`Draw::Present`] gives.
    ScaleBelow,
}

/// What is fixed about a key.
struct Spec {
    name: &'static str,
    /// What it is, in Markdown.
    about: &'static str,
    default: Option<f64>,
    quantity: Quantity,
    /// Minimum and maximum, SI. Wide: it excludes what makes no rig at all, and not what makes a bad one.
    range: [f64; 2],
    when: When,
    part: Part,
    /// How it is drawn, its size on nominal and on hard rigs; nothing where all rigs have the default.
    sizes: &'static [(Draw, f64, f64)],
}

/// When a key can change.
#[derive(PartialEq)]
enum When {
    Always,
    AtStart,
}

/// What a key belongs to, where a plant from outside takes the place of the built-in one.
#[derive(PartialEq)]
enum Part {
    /// The mechanism's law, for which measured gaps stand.
    Law,
    /// Mechanism, load or rail: with the law what a plant program has in the emulator's place.
    Plant,
    /// Motor, drive, sensors and board, which stay.
    Rig,
}

/// Declares keys and settings from the table of what is fixed about each key.
macro_rules! plant_keys {
    ($($(#[doc = $doc:literal])+ $key:ident = $name:literal, $field:ident: $type:ty = $default:expr,
       $quantity:ident, $range:expr, $when:ident, $part:ident $(, $draw:ident [$nominal:expr, $hard:expr])?;)+) => {
        /// What can be changed about the emulated rig.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum PlantKey {
            $($(#[doc = $doc])+ $key,)+
        }

        /// The value of every plant key, in SI units.
        #[derive(Clone, Debug, PartialEq)]
        pub struct PlantSettings {
            $($(#[doc = $doc])+ pub $field: $type,)+
        }

        impl Default for PlantSettings {
            fn default() -> Self {
                Self { $($field: $default,)+ }
            }
        }

        impl PlantSettings {
            pub(crate) fn put(&mut self, PlantChange { key, value }: PlantChange) {
                match key {
                    $(PlantKey::$key => self.$field = value.into(),)+
                }
            }
        }

        impl PlantKey {
            /// Every key.
            pub const ALL: &'static [Self] = &[$(Self::$key),+];

            fn spec(self) -> Spec {
                match self {
                    $(Self::$key => Spec {
                        name: $name,
                        about: concat!($($doc),+),
                        default: Option::<f64>::from($default),
                        quantity: Quantity::$quantity,
                        range: $range,
                        when: When::$when,
                        part: Part::$part,
                        sizes: &[$((Draw::$draw, $nominal, $hard))?],
                    },)+
                }
            }
        }
    };
}

/// rad.
const DEGREE: f64 = std::f64::consts::PI / 180.0;

// Key, field and default; quantity, range, when, what it belongs to; then how rigs draw it, and the sizes on nominal and hard
// ones, whose sources stand in docs/reference/simulator.md.
plant_keys! {
    /// Weight on the rail (N); its inertia is load / g.
    Load = "load", load_n: f64 = 0.5 * STANDARD_GRAVITY, Load, [0.01, 200.0], Always, Plant;
    /// Coulomb friction on the rail.
    Friction = "friction", friction_n: f64 = 0.05, Force, [0.0, 100.0], Always, Plant, Present [0.15, 0.4];
    /// Friction on the rail that grows with the load, as a fraction of the load.
    FrictionLoadShare = "friction_load_share", friction_load_share: f64 = 0.0, Fraction, [0.0, 1.0], Always, Plant,
        Present [0.01, 0.03];
    /// Static friction on the rail over Coulomb friction.
    StictionRatio = "stiction_ratio", stiction_ratio: f64 = 1.0, Number, [1.0, 10.0], Always, Plant,
        ScaleAbove [0.2, 0.5];
    /// Speed at which the rail's friction has fallen from static to Coulomb friction by 63 %; 0 is only at standstill.
    StribeckSpeed = "stribeck_speed", stribeck_speed_m_per_s: f64 = 0.0, Speed, [0.0, 1.0], Always, Plant,
        Present [2e-3, 2e-3];
    /// How far the rail gives before it breaks loose.
    Presliding = "presliding", presliding_m: f64 = 0.0, Length, [0.0, 1e-3], Always, Plant, Present [10e-6, 10e-6];
    /// Viscous damping on the rail.
    Damping = "damping", damping_n_s_per_m: f64 = 1.0, Damping, [0.0, 1e4], Always, Plant;
    /// LVDT noise of one sample, rms.
    LvdtNoise = "lvdt_noise", lvdt_noise_m: f64 = 60e-6, Length, [0.0, 0.1], Always, Rig;
    /// LVDT offset.
    LvdtOffset = "lvdt_offset", lvdt_offset_m: f64 = 0.0, Length, [-0.2, 0.2], Always, Rig;
    /// LVDT gain error.
    LvdtGainError = "lvdt_gain_error", lvdt_gain_error: f64 = 0.0, Fraction, [-0.9, 9.0], AtStart, Rig;
    /// Curve of the LVDT: amplitude of an error that is one sine over the stroke, as a fraction of the stroke.
    LvdtNonlinearity = "lvdt_nonlinearity", lvdt_nonlinearity: f64 = 0.0, Fraction, [0.0, 0.1], Always, Rig,
        Present [0.0025, 0.005];
    /// LVDT noise that averaging over a block of samples leaves, rms.
    LvdtNoiseInband = "lvdt_noise_inband", lvdt_noise_inband_m: f64 = 0.0, Length, [0.0, 0.1], Always, Rig,
        Present [10e-6, 30e-6];
    /// Mains pickup in the LVDT's signal, peak.
    Hum = "hum", hum_m: f64 = 0.0, Length, [0.0, 0.1], Always, Rig, Present [10e-6, 50e-6];
    /// Integral non-linearity of the ADC, codes, peak.
    AdcInl = "adc_inl", adc_inl: f64 = 0.0, Number, [0.0, 100.0], Always, Rig, Present [1.5, 3.0];
    /// Twist of the strings at power-up.
    TwistAtBoot = "twist_at_boot", twist_at_boot_rad: f64 = 1.0, Angle, [-75.0, 75.0], AtStart, Rig;
    /// Scales the string's radius.
    RadiusScale = "radius_scale", radius_scale: f64 = 1.0, Fraction, [0.1, 10.0], AtStart, Law;
    /// Scales k2 of the string's radius model.
    K2Scale = "k2_scale", k2_scale: f64 = 1.0, Fraction, [0.1, 10.0], AtStart, Law;
    /// Scales k3.
    K3Scale = "k3_scale", k3_scale: f64 = 1.0, Fraction, [0.1, 10.0], AtStart, Law;
    /// Scales k4.
    K4Scale = "k4_scale", k4_scale: f64 = 1.0, Fraction, [0.1, 10.0], AtStart, Law;
    /// Scales the string's stiffness K.
    StiffnessScale = "stiffness_scale", stiffness_scale: f64 = 1.0, Fraction, [0.1, 100.0], AtStart, Law;
    /// Scales all coefficients of the rods' stress-strain law.
    ModulusScale = "modulus_scale", modulus_scale: f64 = 1.0, Fraction, [0.1, 100.0], AtStart, Law;
    /// Added to the exponent of the string's radius model.
    TwistExponentShift = "twist_exponent_shift", twist_exponent_shift: f64 = 0.0, Number, [-0.4, 0.4], AtStart, Law,
        Either [0.05, 0.05];
    /// Half width of the loop of the rods' stress over strain.
    RodHysteresis = "rod_hysteresis", rod_hysteresis_pa: f64 = 0.0, Stress, [0.0, 1e9], AtStart, Law,
        Present [60e6, 90e6];
    /// Slow stretch (creep) of the strings, as a fraction of their elastic stretch.
    StringCreep = "string_creep", string_creep: f64 = 0.0, Fraction, [0.0, 10.0], AtStart, Plant, Present [0.10, 0.30];
    /// Fraction of their radius that new strings lose over their first cycles.
    StringBedding = "string_bedding", string_bedding: f64 = 0.0, Fraction, [0.0, 0.5], AtStart, Plant,
        Present [0.02, 0.05];
    /// Width of the loop between the twist of the shaft and that of the strings.
    TwistPlay = "twist_play", twist_play_rad: f64 = 0.0, Angle, [0.0, 3.0], AtStart, Plant, Present [0.19, 0.57];
    /// Temperature of rods and LVDT, less that of the calibration.
    Temperature = "temperature", temperature_k: f64 = 0.0, Temperature, [-100.0, 100.0], Always, Plant,
        Either [5.0, 10.0];
    /// Coulomb friction at the motor's shaft (N m). At its default 0.5 kg drives the motor back on an ideal plant. Assumed.
    MotorFriction = "motor_friction", motor_friction_nm: f64 = 2e-5, Torque, [0.0, 0.1], Always, Rig,
        Present [0.2e-3, 0.5e-3];
    /// Fraction by which that friction is greater towards more twist, and smaller towards less.
    MotorFrictionAsymmetry = "motor_friction_asymmetry", motor_friction_asymmetry: f64 = 0.0, Fraction, [-0.9, 0.9], Always, Rig,
        Either [0.025, 0.10];
    /// Efficiency of the gear.
    GearEfficiency = "gear_efficiency", gear_efficiency: f64 = 1.0, Fraction, [0.05, 1.0], Always, Rig,
        ScaleBelow [0.25, 0.40];
    /// True torque constant over the scene's.
    TorqueConstantScale = "torque_constant_scale", torque_constant_scale: f64 = 1.0, Fraction, [0.1, 10.0], AtStart, Rig,
        ScaleEither [0.05, 0.10];
    /// Offset of the drive's current reading.
    CurrentOffset = "current_offset", current_offset_a: f64 = 0.0, Current, [-1.0, 1.0], Always, Rig,
        Either [5e-3, 20e-3];
    /// Noise of one current reading, rms.
    CurrentNoise = "current_noise", current_noise_a: f64 = 0.0, Current, [0.0, 1.0], Always, Rig,
        Present [10e-3, 30e-3];
    /// Quantum of the current reading; 0 is none.
    CurrentQuantum = "current_quantum", current_quantum_a: f64 = 0.0, Current, [0.0, 1.0], Always, Rig,
        Present [10e-3, 50e-3];
    /// Backlash of the gear at its output.
    GearBacklash = "gear_backlash", gear_backlash_rad: f64 = 0.0, Angle, [0.0, 1.0], AtStart, Rig,
        Present [0.9 * DEGREE, 2.0 * DEGREE];
    /// Supply of the drive (V).
    SupplyVoltage = "supply_voltage", supply_voltage_v: Option<f64> = None, Voltage, [0.0, 58.0], Always, Rig;
    /// Whether a motor-power relay is fitted: 1 is yes, 0 is no, and then the drive has power whatever the board does.
    RelayFitted = "relay_fitted", relay_fitted: f64 = 1.0, Number, [0.0, 1.0], AtStart, Rig;
    /// How long that relay goes on feeding the drive once its pin is low (s). By default that of a small power relay with a
    /// flyback diode; the one of the wiring diagram releases later. Assumed.
    RelayRelease = "relay_release", relay_release_s: f64 = 0.02, Time, [0.0, 10.0], Always, Rig;
}

impl PlantKey {
    /// The name as an operator types it.
    pub fn name(self) -> &'static str {
        self.spec().name
    }

    /// What its value measures.
    pub fn quantity(self) -> Quantity {
        self.spec().quantity
    }

    /// Minimum and maximum (SI units).
    pub fn range(self) -> [f64; 2] {
        self.spec().range
    }

    /// How rigs that a seed names draw it, and its size on nominal and on hard ones; `None` where all have the default.
    pub(crate) fn drawn(self) -> Option<&'static (Draw, f64, f64)> {
        self.spec().sizes.first()
    }

    /// Whether it is one of the built-in mechanism's constants, for which measured gaps stand.
    pub fn is_of_the_law(self) -> bool {
        self.spec().part == Part::Law
    }

    /// Whether it is one of mechanism, load or rail, which a plant program has in the emulator's place. The temperature is
    /// the LVDT's as well.
    pub fn is_of_the_plant(self) -> bool {
        self.spec().part != Part::Rig
    }

    /// The names of the keys that `wanted` is true for.
    pub(crate) fn names(wanted: fn(Self) -> bool) -> String {
        Self::ALL.iter().filter(|key| wanted(**key)).map(|key| key.name()).collect::<Vec<_>>().join(", ")
    }

    /// Every key in a table in Markdown, for docs/reference/simulator.md.
    #[must_use]
    pub fn table() -> String {
        let row = |key: &Self| {
            let Spec { name, about, default, quantity, range: [min, max], when, .. } = key.spec();
            let (about, [min, max]) =
                (about.trim().trim_end_matches('.'), [min, max].map(|value| quantity.show(value)));
            let default = default.map_or("the scene's".into(), |value| quantity.show(value));
            let when = if when == When::AtStart { "at the start" } else { "always" };
            format!("| `{name}` | {about} | {default} | {min} to {max} | {when} |\n")
        };
        let head = "| key | what it is | default | allowed | changes |\n|---|---|---|---|---|\n";
        head.to_owned() + &Self::ALL.iter().map(row).collect::<String>()
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
    #[error("plant has no key `{key}`; keys: {}", PlantKey::names(|_| true))]
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
        let [min, max] = self.key.range();
        if (min..=max).contains(&self.value) { Ok(()) } else { Err(PlantError::OutOfRange { change: self }) }
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

impl PlantSettings {
    /// Changes one of them.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`] if no rig can have the value.
    pub fn apply(&mut self, change: PlantChange) -> Result<(), PlantError> {
        change.check()?;
        self.put(change);
        Ok(())
    }

    /// Changes one of them as an operator types it: a number with or without a unit.
    ///
    /// # Errors
    /// [`PlantError`] naming the key and what it takes.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), PlantError> {
        self.apply(PlantChange::read(key, value)?)
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
    fn the_page_about_the_simulator_has_every_key() {
        let (page, table) = (include_str!("../../../docs/reference/simulator.md"), PlantKey::table());
        assert!(page.contains(&table), "docs/reference/simulator.md lacks:\n{table}");
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
