//! The persistent settings ([`Setting`]): how they correct the scene's constants. `record`: how flash holds them.

mod record;

pub use record::{Loaded, RECORD_MAX, read, write, write_witness};

use crate::RigConstants;
use rig_link::messages::{CorrectedConstants, Setting, SettingValues};

/// The values in use where nobody has set anything.
pub fn defaults(rig: &RigConstants) -> SettingValues {
    let current_limit_a = 1e-3 * f32::from(rig.current_limit_ma);
    let mut values = SettingValues::ZERO;
    for setting in Setting::ALL {
        values = values.with(*setting, setting.spec().default.unwrap_or(current_limit_a));
    }
    values
}

/// The scene's constants as these settings correct them.
pub fn apply(values: &SettingValues, rig: &RigConstants) -> RigConstants {
    let gear = values.get(Setting::GearScale);
    RigConstants {
        gear_ratio: gear * rig.gear_ratio,
        counts_per_rad: gear * values.get(Setting::TwistSign) * rig.counts_per_rad,
        // A float to integer cast saturates; the value has been checked.
        current_limit_ma: libm::roundf(1e3 * values.get(Setting::CurrentLimit)) as i16,
        loop_gain: values.get(Setting::LoopGain),
        lvdt_curve: values.lvdt_curve,
        lvdt_gain: values.get(Setting::LvdtGain),
        lvdt_offset_m: values.get(Setting::LvdtOffset),
        ..*rig
    }
}

/// The constants that the settings correct.
pub fn corrected(rig: &RigConstants) -> CorrectedConstants {
    let RigConstants { gear_ratio, counts_per_rad, lvdt_gap_at_code_zero_m, lvdt_metres_per_code, .. } = *rig;
    CorrectedConstants { gear_ratio, counts_per_rad, lvdt_gap_at_code_zero_m, lvdt_metres_per_code }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::tests::RIG;
    use rig_link::messages::LvdtCurve;

    #[test]
    fn each_acts_on_the_constant_that_it_is_about() {
        let with = |setting: Setting, value| apply(&defaults(&RIG).with(setting, value), &RIG);
        assert_eq!(apply(&defaults(&RIG), &RIG), RIG);
        let gap_m = RIG.lvdt_gap_m(1000.0);
        assert!((with(Setting::LvdtOffset, 1e-3).lvdt_gap_m(1000.0) - gap_m - 1e-3).abs() < 1e-8);
        assert!((with(Setting::LvdtGain, 1.1).lvdt_gap_m(1000.0) - 1.1 * gap_m).abs() < 1e-8);
        let lvdt_curve = LvdtCurve::new(&[[0.06, 1e-4], [0.07, 1e-4]], 2e-5).ok();
        let curved = apply(&SettingValues { lvdt_curve, ..defaults(&RIG) }, &RIG);
        assert!((curved.lvdt_gap_m(1000.0) - gap_m - 1e-4).abs() < 1e-8);
        assert_eq!(with(Setting::TwistSign, -1.0).counts_per_rad, -RIG.counts_per_rad);
        let gear = with(Setting::GearScale, 0.5);
        assert_eq!((gear.gear_ratio, gear.counts_per_rad), (31.0, 20_208.0));
        assert_eq!(with(Setting::CurrentLimit, 0.3).current_limit_ma, 300);
        assert_eq!(with(Setting::LoopGain, 0.5).loop_gain, 0.5);
        // These four act elsewhere.
        for setting in [Setting::PositionZero, Setting::SpeedMax, Setting::TwistScale, Setting::HeaviestLoad] {
            assert_eq!(with(setting, setting.spec().range[1]), RIG);
        }
    }
}
