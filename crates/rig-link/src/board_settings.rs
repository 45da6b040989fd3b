//! Unit, default and range of every setting of the board. [`Setting`] says what each is.

use crate::messages::{Refusal, Setting, SettingValues};
use core::fmt;

/// Name of the points of the LVDT's calibration, which are among the settings but no single number.
pub const LVDT_POINTS: &str = "lvdt-points";

/// What is fixed about a setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spec {
    /// SI unit; empty for a bare number.
    pub unit: &'static str,
    /// Default; `None` where it is the scene's, which is also the maximum value.
    pub default: Option<f32>,
    /// Minimum and maximum value (`unit`).
    pub range: [f32; 2],
    /// Only the two ends of the range are allowed.
    pub ends_only: bool,
    /// Another value changes the meaning of position, twist or load: the rig must be homed again.
    pub unhomes: bool,
}

const fn spec(unit: &'static str, default: Option<f32>, range: [f32; 2]) -> Spec {
    Spec { unit, default, range, ends_only: false, unhomes: false }
}

impl Setting {
    /// What is fixed about it.
    pub const fn spec(self) -> Spec {
        match self {
            Self::LvdtOffset => Spec { unhomes: true, ..spec("m", Some(0.0), [-0.05, 0.05]) },
            // A sensor that differs more than this is not the scene's.
            Self::LvdtGain => Spec { unhomes: true, ..spec("", Some(1.0), [0.8, 1.25]) },
            Self::PositionZero => spec("m", Some(0.0), [-0.1, 0.1]),
            Self::TwistSign => Spec { unhomes: true, ends_only: true, ..spec("", Some(1.0), [-1.0, 1.0]) },
            Self::GearScale => Spec { unhomes: true, ..spec("", Some(1.0), [0.5, 2.0]) },
            Self::SpeedMax => spec("m/s", Some(0.05), [1e-4, 0.05]),
            Self::CurrentLimit => spec("A", None, [0.05, 5.0]),
            Self::TwistScale => spec("", Some(1.0), [0.85, 1.15]),
            Self::LoopGain => spec("", Some(1.0), [0.2, 1.0]),
            // What a homing and the load after it were corrected by.
            Self::HeaviestLoad => Spec { unhomes: true, ..spec("N", Some(0.0), [0.0, 200.0]) },
        }
    }

    /// Minimum and maximum value (its unit), where `default` is this rig's.
    pub fn range(self, default: f32) -> [f32; 2] {
        let Spec { range: [min, max], default: fixed, .. } = self.spec();
        if fixed.is_some() { [min, max] } else { [min.min(default), default] }
    }

    /// Checks a value, where `default` is this rig's.
    ///
    /// # Errors
    /// A [`Refusal`] that names the setting and its limits.
    pub fn check(self, given: f32, default: f32) -> Result<f32, Refusal> {
        let [min, max] = self.range(default);
        let at_end = given == min || given == max;
        if !given.is_finite() {
            Err(Refusal::SettingNotFinite { setting: self })
        } else if at_end || (!self.spec().ends_only && (min..=max).contains(&given)) {
            Ok(given)
        } else {
            Err(Refusal::SettingOutOfRange { setting: self, min, max, given })
        }
    }

    /// A value with its unit.
    pub fn show(self, value: f32) -> impl fmt::Display {
        let unit = self.spec().unit;
        Words { first: None, value, unit }
    }

    /// Its limits in words.
    pub fn allowed(self, min: f32, max: f32) -> impl fmt::Display {
        let Spec { unit, ends_only, .. } = self.spec();
        Words { first: Some((min, if ends_only { "or" } else { "to" })), value: max, unit }
    }
}

/// One value, or two with a word between, and their unit.
struct Words {
    first: Option<(f32, &'static str)>,
    value: f32,
    unit: &'static str,
}

impl fmt::Display for Words {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { first, value, unit } = self;
        if let Some((first, word)) = first {
            write!(f, "{first} {word} ")?;
        }
        write!(f, "{value}{}{unit}", if unit.is_empty() { "" } else { " " })
    }
}

impl SettingValues {
    /// Zero for each setting, and no curve.
    pub const ZERO: Self = Self { numbers: [0.0; Setting::ALL.len()], lvdt_curve: None };

    /// Of one setting (its unit).
    pub fn get(&self, setting: Setting) -> f32 {
        self.numbers[setting as usize]
    }

    /// With one setting changed.
    #[must_use]
    pub fn with(mut self, setting: Setting, value: f32) -> Self {
        self.numbers[setting as usize] = value;
        self
    }

    /// Every setting that is a number, with its value.
    pub fn iter(&self) -> impl Iterator<Item = (Setting, f32)> {
        Setting::ALL.iter().copied().zip(self.numbers)
    }

    /// Checks all values, where `defaults` are the rig's.
    ///
    /// # Errors
    /// A [`Refusal`] for the first value that is not allowed.
    pub fn check(&self, defaults: &Self) -> Result<(), Refusal> {
        self.iter().try_for_each(|(setting, value)| setting.check(value, defaults.get(setting)).map(drop))?;
        self.lvdt_curve.map_or(Ok(()), |curve| curve.check()).map_err(|flaw| Refusal::LvdtPoints { flaw })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::codes::CurveFlaw;
    use crate::lvdt_curve::LvdtCurve;
    use std::string::ToString;

    #[test]
    fn codes_are_places_and_defaults_are_allowed() {
        for (place, setting) in Setting::ALL.iter().enumerate() {
            assert_eq!(usize::from(setting.code()), place, "values are stored in this order");
            let default = setting.spec().default.unwrap_or(0.5);
            assert_eq!(setting.check(default, default), Ok(default));
            let [min, max] = setting.range(default);
            assert!(setting.check(min, default).is_ok() && setting.check(max, default).is_ok());
            let named = |value: f32| setting.check(value, default).expect_err("outside").to_string();
            for outside in [min - 0.01 * (max - min), max * 1.01, f32::NAN, f32::INFINITY] {
                assert!(named(outside).contains(setting.name()), "{}", named(outside));
            }
        }
    }

    /// Position, twist or load are computed from these; the others bound or shift what is sent and shown.
    #[test]
    fn a_setting_that_changes_the_meaning_of_position_twist_or_load_unhomes() {
        let unhome = Setting::ALL.iter().filter(|setting| setting.spec().unhomes);
        let expected =
            [Setting::LvdtOffset, Setting::LvdtGain, Setting::TwistSign, Setting::GearScale, Setting::HeaviestLoad];
        assert!(unhome.eq(&expected));
    }

    #[test]
    fn values_are_kept_by_setting_and_checked_one_by_one() {
        let mut defaults = SettingValues::ZERO;
        for setting in Setting::ALL {
            defaults = defaults.with(*setting, setting.spec().default.unwrap_or(0.5));
        }
        assert_eq!(defaults.check(&defaults), Ok(()));
        for (place, setting) in Setting::ALL.iter().enumerate() {
            let marked = SettingValues::ZERO.with(*setting, 7.0);
            assert!(marked.iter().enumerate().all(|(k, (_, value))| value == if k == place { 7.0 } else { 0.0 }));
            assert_eq!((marked.get(*setting), marked.iter().nth(place)), (7.0, Some((*setting, 7.0))));
            let refused = defaults.with(*setting, 1e3).check(&defaults);
            assert!(matches!(refused, Err(Refusal::SettingOutOfRange { setting: named, .. }) if named == *setting));
        }
        let curve = LvdtCurve::new(&[[0.1, 0.0], [0.11, 0.0]], 0.0).unwrap();
        assert_eq!(SettingValues { lvdt_curve: Some(curve), ..defaults }.check(&defaults), Ok(()));
        // As it may come over the link.
        let mut bytes = [0; 128];
        let length = postcard::to_slice(&curve, &mut bytes).unwrap().len();
        let count = length - 5;
        assert_eq!(bytes[count], 2);
        bytes[count] = 1;
        let lvdt_curve = Some(postcard::from_bytes(&bytes[..length]).unwrap());
        let flaw = CurveFlaw::Count;
        assert_eq!(SettingValues { lvdt_curve, ..defaults }.check(&defaults), Err(Refusal::LvdtPoints { flaw }));
    }

    #[test]
    fn refusals_say_what_is_allowed() {
        let said = |setting: Setting, value, default| setting.check(value, default).expect_err("outside").to_string();
        assert_eq!(said(Setting::SpeedMax, 0.5, 0.05), "speed-max is 0.5 m/s, allowed are 0.0001 to 0.05 m/s");
        assert_eq!(said(Setting::TwistSign, 0.5, 1.0), "twist-sign is 0.5, allowed are -1 or 1");
        assert_eq!(said(Setting::CurrentLimit, 0.6, 0.5), "current-limit is 0.6 A, allowed are 0.05 to 0.5 A");
    }
}
