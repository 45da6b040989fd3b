//! The constants of the rig that settings correct, and which settings still mean the same on a rig with other ones.

use crate::board_settings::LVDT_POINTS;
use crate::messages::{Setting, SettingValues};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// The constants of the rig that settings correct. A setting is good for as long as its own constants stay the same.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CorrectedConstants {
    /// Motor turns per turn of the strings.
    pub gear_ratio: f32,
    /// Encoder counts per radian of twist; negative where the strings are twisted against the encoder's count.
    pub counts_per_rad: f32,
    /// Gap at ADC code 0 of the LVDT (m).
    pub lvdt_gap_at_code_zero_m: f32,
    /// Gap per ADC code of the LVDT (m).
    pub lvdt_metres_per_code: f32,
}

impl CorrectedConstants {
    /// Whether a setting means the same on a rig with these constants and on one with `other`.
    fn same_for(&self, setting: Setting, other: &Self) -> bool {
        match setting {
            Setting::LvdtOffset | Setting::LvdtGain => self.same_lvdt(other),
            Setting::TwistSign => self.counts_per_rad.signum() == other.counts_per_rad.signum(),
            // The twist scale is learned from the twist, which has any error of the gear ratio in it.
            Setting::GearScale | Setting::TwistScale => {
                self.gear_ratio == other.gear_ratio && self.counts_per_rad.abs() == other.counts_per_rad.abs()
            }
            // Numbers of their own, which correct no constant.
            Setting::PositionZero
            | Setting::SpeedMax
            | Setting::CurrentLimit
            | Setting::LoopGain
            | Setting::HeaviestLoad => true,
        }
    }

    fn same_lvdt(&self, other: &Self) -> bool {
        self.lvdt_gap_at_code_zero_m == other.lvdt_gap_at_code_zero_m
            && self.lvdt_metres_per_code == other.lvdt_metres_per_code
    }
}

/// A set of settings that were dropped, because they were made for other constants of the rig or are not allowed on this one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Dropped {
    /// One for each [`Setting`], in the order of [`Setting::ALL`].
    numbers: [bool; Setting::ALL.len()],
    lvdt_points: bool,
}

impl Dropped {
    /// No setting.
    pub const NONE: Self = Self { numbers: [false; Setting::ALL.len()], lvdt_points: false };

    /// Whether no setting was dropped.
    pub fn is_empty(&self) -> bool {
        *self == Self::NONE
    }

    /// Whether a setting was dropped.
    pub fn contains(&self, setting: Setting) -> bool {
        self.numbers[setting as usize]
    }

    /// The names of the settings that were dropped.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        let numbers = Setting::ALL.iter().filter(|setting| self.contains(**setting)).map(|setting| setting.name());
        numbers.chain(self.lvdt_points.then_some(LVDT_POINTS))
    }
}

impl SettingValues {
    /// These settings, which were made for a rig with the constants `from`, on a rig with the constants `to` and with
    /// `defaults`. A setting that means something else there, or is not allowed there, becomes that of `instead`; it counts
    /// as dropped unless it was at its default. A curve is taken to be valid.
    pub fn carried_over(
        &self,
        from: &CorrectedConstants,
        to: &CorrectedConstants,
        defaults: &Self,
        instead: &Self,
    ) -> (Self, Dropped) {
        let (mut values, mut dropped) = (*self, Dropped::NONE);
        for (setting, value) in self.iter() {
            let default = defaults.get(setting);
            if !from.same_for(setting, to) || setting.check(value, default).is_err() {
                values = values.with(setting, instead.get(setting));
                dropped.numbers[setting as usize] = value != default;
            }
        }
        if !from.same_lvdt(to) {
            values.lvdt_curve = instead.lvdt_curve;
            dropped.lvdt_points = self.lvdt_curve.is_some();
        }
        (values, dropped)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::messages::LvdtCurve;
    use std::vec::Vec;

    const RIG: CorrectedConstants = CorrectedConstants {
        gear_ratio: 62.0,
        counts_per_rad: 40_416.0,
        lvdt_gap_at_code_zero_m: 0.01,
        lvdt_metres_per_code: 5.372e-5,
    };

    fn defaults(current_limit_a: f32) -> SettingValues {
        let default = |setting: &Setting| setting.spec().default.unwrap_or(current_limit_a);
        Setting::ALL.iter().fold(SettingValues::ZERO, |values, s| values.with(*s, default(s)))
    }

    /// No setting at its default.
    fn all_set() -> SettingValues {
        SettingValues {
            numbers: [1e-3, 1.01, 2e-3, -1.0, 1.02, 0.003, 0.3, 1.03, 0.5, 9.0],
            lvdt_curve: LvdtCurve::new(&[[0.06, 1e-4], [0.07, 1e-4]], 2e-5).ok(),
        }
    }

    /// The names of what is dropped; all else keeps its value.
    fn dropped(to: &CorrectedConstants, current_limit_a: f32) -> Vec<&'static str> {
        let (old, defaults) = (all_set(), defaults(current_limit_a));
        let (new, dropped) = old.carried_over(&RIG, to, &defaults, &defaults);
        for (setting, value) in new.iter() {
            let source = if dropped.contains(setting) { &defaults } else { &old };
            assert_eq!(value, source.get(setting), "{setting}");
        }
        assert_eq!(new.lvdt_curve, if dropped.lvdt_points { None } else { old.lvdt_curve });
        let names: Vec<&str> = dropped.names().collect();
        assert_eq!(names.is_empty(), dropped.is_empty());
        names
    }

    #[test]
    fn each_group_of_settings_is_dropped_with_its_own_constants() {
        assert!(dropped(&RIG, 0.5).is_empty());
        let lvdt = ["lvdt-offset", "lvdt-gain", "lvdt-points"];
        assert_eq!(dropped(&CorrectedConstants { lvdt_metres_per_code: 5e-5, ..RIG }, 0.5), lvdt);
        assert_eq!(dropped(&CorrectedConstants { lvdt_gap_at_code_zero_m: 0.0, ..RIG }, 0.5), lvdt);
        let gear = ["gear-scale", "twist-scale"];
        assert_eq!(dropped(&CorrectedConstants { gear_ratio: 53.0, counts_per_rad: 34_550.0, ..RIG }, 0.5), gear);
        assert_eq!(dropped(&CorrectedConstants { counts_per_rad: 20_208.0, ..RIG }, 0.5), gear, "another encoder");
        assert_eq!(dropped(&CorrectedConstants { counts_per_rad: -40_416.0, ..RIG }, 0.5), ["twist-sign"]);
        let not_a_number = CorrectedConstants { lvdt_gap_at_code_zero_m: f32::NAN, ..RIG };
        assert_eq!(dropped(&not_a_number, 0.5), lvdt);
    }

    #[test]
    fn a_current_limit_is_dropped_only_where_it_is_not_allowed() {
        assert_eq!([0.3, 0.5, 2.0].map(|limit_a| dropped(&RIG, limit_a).len()), [0; 3]);
        assert_eq!(dropped(&RIG, 0.2), ["current-limit"]);
    }

    #[test]
    fn what_was_at_its_default_is_not_lost() {
        let (defaults, other) = (defaults(0.5), CorrectedConstants { gear_ratio: 53.0, ..RIG });
        let old = defaults.with(Setting::GearScale, 1.02);
        let instead = all_set().with(Setting::GearScale, 0.9);
        let (new, dropped) = old.carried_over(&RIG, &other, &defaults, &instead);
        assert!(dropped.names().eq(["gear-scale"]), "{dropped:?}");
        assert_eq!(new, defaults.with(Setting::GearScale, 0.9).with(Setting::TwistScale, 1.03), "as stated instead");
    }
}
