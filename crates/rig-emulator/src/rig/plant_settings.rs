//! The plant keys of the host tool (cli.md): what a test may change about the rig without telling the firmware.

use tsa_model::Scene;

/// Standard gravity, m/s²: turns a mass on the rail into a load.
pub const GRAVITY_M_PER_S2: f64 = 9.80665;

/// Why a plant setting was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingError {
    /// No such key.
    #[error("plant key `{key}` is unknown; known are {}", known())]
    UnknownKey {
        /// What was given.
        key: String,
    },
    /// The value is no number, has a wrong unit or is out of range.
    #[error("plant key `{key}`: `{value}` {reason}")]
    BadValue {
        /// The key.
        key: &'static str,
        /// What was given.
        value: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Needs a new rig.
    #[error("plant key `{key}` cannot change after boot; give it at the start")]
    NotAtRunTime {
        /// The key.
        key: &'static str,
    },
}

/// Everything that plant keys set. SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantSettings {
    /// Weight on the rail, N; its inertia is load / g.
    pub load_n: f64,
    /// Coulomb friction on the rail, N.
    pub friction_n: f64,
    /// Viscous damping on the rail, N s/m.
    pub damping_n_s_per_m: f64,
    /// LVDT noise of one sample, m rms.
    pub lvdt_noise_m: f64,
    /// LVDT offset, m.
    pub lvdt_offset_m: f64,
    /// LVDT gain error, a fraction.
    pub lvdt_gain_error: f64,
    /// Hum of the mains in the LVDT's signal, m, peak.
    pub hum_m: f64,
    /// Integral non-linearity of the converter, codes, peak.
    pub adc_inl: f64,
    /// Twist of the strings at power-up, rad.
    pub twist_at_boot_rad: f64,
    /// Scales k2 of the string's radius law.
    pub k2_scale: f64,
    /// Scales k3.
    pub k3_scale: f64,
    /// Scales the string's stiffness K.
    pub stiffness_scale: f64,
    /// Scales all coefficients of the rods' stress-strain law.
    pub modulus_scale: f64,
    /// Play of the gear at its output, rad.
    pub gear_backlash_rad: f64,
    /// Drive supply, V; `None` is the scene's.
    pub supply_voltage_v: Option<f64>,
    /// Whether a motor-power relay is fitted. Without one the drive has power whatever the board does.
    pub relay_fitted: bool,
    /// How long that relay goes on feeding the drive once its pin is low, s.
    pub relay_release_s: f64,
}

impl Default for PlantSettings {
    fn default() -> Self {
        Self {
            load_n: 0.5 * GRAVITY_M_PER_S2,
            friction_n: 0.05,
            damping_n_s_per_m: 1.0,
            lvdt_noise_m: 60e-6,
            lvdt_offset_m: 0.0,
            lvdt_gain_error: 0.0,
            hum_m: 0.0,
            adc_inl: 0.0,
            twist_at_boot_rad: 1.0,
            k2_scale: 1.0,
            k3_scale: 1.0,
            stiffness_scale: 1.0,
            modulus_scale: 1.0,
            gear_backlash_rad: 0.0,
            supply_voltage_v: None,
            relay_fitted: true,
            // The release time of a small power relay with a flyback diode. Assumed.
            relay_release_s: 0.02,
        }
    }
}

/// Units that a key takes, with the factor to SI. The empty one is the bare number.
type Units = &'static [(&'static str, f64)];

const FORCE: Units = &[("", 1.0), ("N", 1.0), ("mN", 1e-3)];
const LOAD: Units = &[("", 1.0), ("N", 1.0), ("mN", 1e-3), ("kg", GRAVITY_M_PER_S2), ("g", 1e-3 * GRAVITY_M_PER_S2)];
const DAMPING: Units = &[("", 1.0), ("Ns/m", 1.0), ("N*s/m", 1.0)];
const LENGTH: Units = &[("", 1.0), ("m", 1.0), ("mm", 1e-3), ("um", 1e-6), ("µm", 1e-6)];
const ANGLE: Units = &[("", 1.0), ("rad", 1.0), ("mrad", 1e-3), ("deg", std::f64::consts::PI / 180.0)];
const FRACTION: Units = &[("", 1.0), ("%", 1e-2)];
const NUMBER: Units = &[("", 1.0)];
const VOLTAGE: Units = &[("", 1.0), ("V", 1.0), ("mV", 1e-3)];
const TIME: Units = &[("", 1.0), ("s", 1.0), ("ms", 1e-3)];
/// 1 is yes, 0 is no.
const FLAG: Units = &[("", 1.0)];

struct Key {
    name: &'static str,
    units: Units,
    range: [f64; 2],
    at_run_time: bool,
    set: fn(&mut PlantSettings, f64),
}

const fn key(
    name: &'static str,
    units: Units,
    range: [f64; 2],
    at_run_time: bool,
    set: fn(&mut PlantSettings, f64),
) -> Key {
    Key { name, units, range, at_run_time, set }
}

/// Ranges are wide: what makes no rig at all is refused, not what makes a bad one.
const KEYS: [Key; 17] = [
    key("load", LOAD, [0.01, 200.0], true, |s, v| s.load_n = v),
    key("friction", FORCE, [0.0, 100.0], true, |s, v| s.friction_n = v),
    key("damping", DAMPING, [0.0, 1e4], true, |s, v| s.damping_n_s_per_m = v),
    key("lvdt_noise", LENGTH, [0.0, 0.1], true, |s, v| s.lvdt_noise_m = v),
    key("lvdt_offset", LENGTH, [-0.2, 0.2], true, |s, v| s.lvdt_offset_m = v),
    key("lvdt_gain_error", FRACTION, [-0.9, 9.0], false, |s, v| s.lvdt_gain_error = v),
    key("hum", LENGTH, [0.0, 0.1], true, |s, v| s.hum_m = v),
    key("adc_inl", NUMBER, [0.0, 100.0], true, |s, v| s.adc_inl = v),
    key("twist_at_boot", ANGLE, [-75.0, 75.0], false, |s, v| s.twist_at_boot_rad = v),
    key("k2_scale", FRACTION, [0.1, 10.0], false, |s, v| s.k2_scale = v),
    key("k3_scale", FRACTION, [0.1, 10.0], false, |s, v| s.k3_scale = v),
    key("stiffness_scale", FRACTION, [0.1, 100.0], false, |s, v| s.stiffness_scale = v),
    key("modulus_scale", FRACTION, [0.1, 100.0], false, |s, v| s.modulus_scale = v),
    key("gear_backlash", ANGLE, [0.0, 1.0], false, |s, v| s.gear_backlash_rad = v),
    key("supply_voltage", VOLTAGE, [0.0, 58.0], true, |s, v| s.supply_voltage_v = Some(v)),
    key("relay_fitted", FLAG, [0.0, 1.0], false, |s, v| s.relay_fitted = v >= 0.5),
    key("relay_release", TIME, [0.0, 10.0], true, |s, v| s.relay_release_s = v),
];

fn known() -> String {
    KEYS.map(|key| key.name).join(", ")
}

impl PlantSettings {
    /// Sets `key` to `text`, a number with or without a unit.
    pub fn set(&mut self, name: &str, text: &str) -> Result<(), SettingError> {
        self.apply(name, text, false)
    }

    /// As [`PlantSettings::set`], but only what can change while the rig runs.
    pub fn set_at_run_time(&mut self, name: &str, text: &str) -> Result<(), SettingError> {
        self.apply(name, text, true)
    }

    fn apply(&mut self, name: &str, text: &str, running: bool) -> Result<(), SettingError> {
        let key = KEYS
            .iter()
            .find(|key| key.name == name)
            .ok_or_else(|| SettingError::UnknownKey { key: name.to_owned() })?;
        if running && !key.at_run_time {
            return Err(SettingError::NotAtRunTime { key: key.name });
        }
        let bad = |reason: String| SettingError::BadValue { key: key.name, value: text.to_owned(), reason };
        let value = quantity(text, key.units).map_err(bad)?;
        let [least, most] = key.range;
        if !(least..=most).contains(&value) {
            return Err(bad(format!("is not within {least} to {most} (SI)")));
        }
        (key.set)(self, value);
        Ok(())
    }

    /// The scene as this rig really is: its constants differ from those that the firmware's table was built with.
    pub fn distort(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        scene.string.k2 *= self.k2_scale;
        scene.string.k3 *= self.k3_scale;
        scene.string.stiffness_n_per_m *= self.stiffness_scale;
        for coefficient in &mut scene.material.stress_coefficients_pa {
            *coefficient *= self.modulus_scale;
        }
        scene
    }
}

/// Number and unit to SI. The longest prefix that is a number is the number.
fn quantity(text: &str, units: Units) -> Result<f64, String> {
    let text = text.trim();
    let (number, unit) = (0..=text.len())
        .rev()
        .filter(|&at| text.is_char_boundary(at))
        .find_map(|at| text[..at].trim_end().parse::<f64>().ok().map(|number| (number, text[at..].trim())))
        .ok_or("is no number")?;
    if !number.is_finite() {
        return Err("is not finite".to_owned());
    }
    units.iter().find(|(name, _)| *name == unit).map(|(_, factor)| number * factor).ok_or_else(|| {
        let names: Vec<_> = units.iter().map(|(name, _)| *name).filter(|name| !name.is_empty()).collect();
        format!("has the unit `{unit}`; known are {} or none", names.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units() {
        let mut settings = PlantSettings::default();
        for (key, text) in [("load", "0.5kg"), ("load", "4.903325 N"), ("load", "4.903325"), ("load", "500g")] {
            settings.load_n = 0.0;
            settings.set(key, text).unwrap();
            assert!((settings.load_n - 4.903325).abs() < 1e-12, "{text}");
        }
        settings.set("lvdt_noise", "60um").unwrap();
        assert!((settings.lvdt_noise_m - 60e-6).abs() < 1e-15);
        settings.set("lvdt_offset", "-1e-3").unwrap();
        assert_eq!(settings.lvdt_offset_m, -1e-3);
        settings.set("lvdt_gain_error", "1%").unwrap();
        assert_eq!(settings.lvdt_gain_error, 0.01);
        settings.set("supply_voltage", "12V").unwrap();
        assert_eq!(settings.supply_voltage_v, Some(12.0));
    }

    #[test]
    fn refusals_name_the_key() {
        let mut settings = PlantSettings::default();
        let unknown = settings.set("weight", "1").unwrap_err().to_string();
        assert!(unknown.contains("weight") && unknown.contains("load") && unknown.contains("supply_voltage"));
        for (key, text) in
            [("load", "1lb"), ("load", "x"), ("load", "nan"), ("load", "inf"), ("load", "-1"), ("load", "")]
        {
            let message = settings.set(key, text).unwrap_err().to_string();
            assert!(message.contains("`load`"), "{message}");
        }
        assert!(settings.set("k2_scale", "0").is_err());
        assert!(settings.set("lvdt_noise", "1µ").is_err());
        assert_eq!(settings.set_at_run_time("k2_scale", "1"), Err(SettingError::NotAtRunTime { key: "k2_scale" }));
        assert_eq!(settings.set_at_run_time("load", "1kg"), Ok(()));
    }
}
