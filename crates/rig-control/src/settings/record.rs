//! The settings' record in flash: [`Record`] in postcard's format, and its witness, which is the generation as u32 LE.
//!
//! The store checks every record and skips a damaged one, so that it then returns an older record of the same key, with
//! calibration numbers that are out of date, or none. The witness shows this: it is written after the settings, so it is
//! the newer one of the two only if the settings are damaged.
//!
//! The record has the constants for which its settings were made. Firmware with other constants uses the settings that do
//! not depend on those that differ, and reports the others ([`Kept::Partly`]); the record stays as it is until the settings
//! are changed. A record of another version counts as damaged.
//!
//! A setting that a record does not have is at its default, and an unknown one is ignored, so that firmware that knows other
//! settings reads it.

use super::{corrected, defaults};
use crate::RigConstants;
use heapless::Vec;
use rig_link::messages::{CorrectedConstants, Dropped, Kept, LvdtCurve, Setting, SettingValues};
use serde::{Deserialize, Serialize};

/// Version of the record.
const VERSION: u8 = 3;
/// Most settings of a record that is read: another firmware may have more of them.
const SETTINGS_MAX: usize = 50;
/// Maximum bytes of a record: a setting takes 5 of them, and the rest, with all points of the LVDT, 117.
pub const RECORD_MAX: usize = 117 + 5 * SETTINGS_MAX;

/// What flash holds.
#[derive(Serialize, Deserialize)]
struct Record {
    version: u8,
    generation: u32,
    /// Those for which the settings were made.
    constants: CorrectedConstants,
    /// Code and value of each setting that is not at its default.
    set: Vec<(u8, f32), SETTINGS_MAX>,
    lvdt_curve: Option<LvdtCurve>,
}

/// The settings that flash had.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loaded {
    /// Values to use.
    pub values: SettingValues,
    /// [`Kept::Nothing`], [`Kept::These`], [`Kept::Partly`] or [`Kept::Damaged`].
    pub kept: Kept,
    /// With [`Kept::Partly`] the settings in flash that are not used.
    pub dropped: Dropped,
    /// Of the newest record that was written.
    pub generation: u32,
    /// Power failed between record and witness: write both again as they should be.
    pub witness_behind: bool,
}

/// The record of values, for a rig with these constants, in a generation.
pub fn write(values: &SettingValues, rig: &RigConstants, generation: u32) -> Vec<u8, RECORD_MAX> {
    let defaults = defaults(rig);
    let set = values.iter().filter(|(setting, value)| *value != defaults.get(*setting));
    bytes(&Record {
        version: VERSION,
        generation,
        constants: corrected(rig),
        set: set.map(|(setting, value)| (setting.code(), value)).collect(),
        lvdt_curve: values.lvdt_curve,
    })
}

fn bytes(record: &Record) -> Vec<u8, RECORD_MAX> {
    // There is room for every record, so this cannot fail.
    postcard::to_extend(record, Vec::new()).unwrap_or_default()
}

/// The record of a witness.
pub fn write_witness(generation: u32) -> [u8; 4] {
    generation.to_le_bytes()
}

/// Generation, values and the settings that are not used, of a record on this rig; `None` if it is not one of ours.
fn parse(record: &[u8], rig: &RigConstants) -> Option<(u32, SettingValues, Dropped)> {
    let Record { version, generation, constants, set, lvdt_curve } = postcard::from_bytes(record).ok()?;
    if version != VERSION || lvdt_curve.is_some_and(|curve| curve.check().is_err()) {
        return None;
    }
    let defaults = defaults(rig);
    let known = set.iter().filter_map(|(code, value)| Some((Setting::from_code(*code)?, *value)));
    let values =
        known.fold(SettingValues { lvdt_curve, ..defaults }, |values, (setting, value)| values.with(setting, value));
    let (values, dropped) = values.carried_over(&constants, &corrected(rig), &defaults, &defaults);
    Some((generation, values, dropped))
}

/// The settings to use on a rig with these constants, from both records. `None` is a record that is missing or damaged.
pub fn read(record: Option<&[u8]>, witness: Option<&[u8]>, rig: &RigConstants) -> Loaded {
    let witness = witness.and_then(|bytes| bytes.try_into().ok()).map(u32::from_le_bytes);
    let newest = witness.unwrap_or(0);
    let without = |kept, generation| Loaded {
        values: defaults(rig),
        kept,
        dropped: Dropped::NONE,
        generation,
        witness_behind: false,
    };
    match (record.map(|record| parse(record, rig)), witness) {
        (None, None) => without(Kept::Nothing, 0),
        (Some(Some((generation, values, dropped))), _) if generation >= newest => {
            let kept = if dropped.is_empty() { Kept::These } else { Kept::Partly };
            Loaded { values, kept, dropped, generation, witness_behind: witness != Some(generation) }
        }
        // An older record, none, or one that is not for this rig.
        (record, _) => without(Kept::Damaged, newest.max(record.flatten().map_or(0, |(generation, ..)| generation))),
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::constants::tests::RIG;
    use crate::settings::apply;
    use proptest::prelude::*;
    use rig_link::messages::LVDT_POINTS_MAX;

    /// A record of settings alone.
    fn record_of(set: impl IntoIterator<Item = (u8, f32)>, generation: u32, rig: &RigConstants) -> Vec<u8, RECORD_MAX> {
        let set = set.into_iter().collect();
        bytes(&Record { version: VERSION, generation, constants: corrected(rig), set, lvdt_curve: None })
    }

    /// Values that are allowed.
    fn values() -> impl Strategy<Value = SettingValues> {
        let curve = (2..=LVDT_POINTS_MAX, prop::array::uniform11(-1e-4..1e-4f32), 0.0..1e-3f32);
        (prop::array::uniform10(0.0..=1f32), prop::option::of(curve)).prop_map(|(fractions, curve)| {
            let mut defaults = defaults(&RIG);
            defaults.lvdt_curve = curve.map(|(count, corrections, error_m)| {
                let mut points = corrections.map(|correction_m| [0.0, correction_m]);
                points.iter_mut().enumerate().for_each(|(k, point)| point[0] = 0.08 + 2e-3 * k as f32);
                LvdtCurve::new(&points[..count], error_m).expect("a curve")
            });
            Setting::ALL.iter().fold(defaults, |values, setting| {
                let ([min, max], fraction) = (setting.range(defaults.get(*setting)), fractions[*setting as usize]);
                let between = (min + fraction * (max - min)).clamp(min, max);
                let ends = if fraction < 0.5 { min } else { max };
                values.with(*setting, if setting.spec().ends_only { ends } else { between })
            })
        })
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(values in values(), generation: u32, behind: bool) {
            let record = write(&values, &RIG, generation);
            let witness = write_witness(generation.wrapping_sub(u32::from(behind && generation > 0)));
            let loaded = read(Some(&record), Some(&witness), &RIG);
            prop_assert_eq!((loaded.values, loaded.kept, loaded.generation), (values, Kept::These, generation));
            prop_assert_eq!(loaded.witness_behind, behind && generation > 0);
        }

        #[test]
        fn any_bytes_give_allowed_values(record in prop::option::of(prop::collection::vec(any::<u8>(), 0..300)),
                                         witness in prop::option::of(prop::collection::vec(any::<u8>(), 0..9))) {
            let loaded = read(record.as_deref(), witness.as_deref(), &RIG);
            prop_assert!(loaded.values.check(&defaults(&RIG)).is_ok());
            prop_assert_eq!(loaded.kept == Kept::Nothing, record.is_none() && witness.is_none_or(|w| w.len() != 4));
            prop_assert_eq!(loaded.kept == Kept::Partly, !loaded.dropped.is_empty());
        }

        #[test]
        fn any_entries_give_allowed_values(entries in prop::collection::vec((0..12u8, prop::num::f32::ANY), 0..12), same: bool) {
            let rig = if same { RIG } else { RigConstants { gear_ratio: 53.0, lvdt_metres_per_code: 5e-5, ..RIG } };
            let record = record_of(entries.iter().copied(), 7, &rig);
            let loaded = read(Some(&record), Some(&write_witness(7)), &RIG);
            prop_assert!(loaded.values.check(&defaults(&RIG)).is_ok());
            prop_assert_eq!(loaded.kept, if loaded.dropped.is_empty() { Kept::These } else { Kept::Partly });
            for (setting, value) in loaded.values.iter() {
                let default = defaults(&RIG).get(setting);
                let last = entries.iter().rfind(|(code, _)| *code == setting.code()).map_or(default, |(_, given)| *given);
                let dropped = loaded.dropped.contains(setting);
                prop_assert_eq!(value, if dropped { default } else { last });
                prop_assert!(!dropped || last != default);
            }
        }

        /// Damage that passes the store's checksum still gives allowed values.
        #[test]
        fn a_changed_byte_gives_allowed_values(values in values(), place: prop::sample::Index, change in 1..=255u8) {
            let mut record = write(&values, &RIG, 7).to_vec();
            let place = place.index(record.len());
            record[place] ^= change;
            let loaded = read(Some(&record), Some(&write_witness(7)), &RIG);
            prop_assert!(loaded.values.check(&defaults(&RIG)).is_ok());
            let applied = apply(&loaded.values, &RIG);
            prop_assert!(applied.counts_per_rad.abs() > 1.0 && applied.lvdt_gain > 0.0);
            prop_assert!(applied.lvdt_curve.is_none_or(|curve| curve.check().is_ok()));
        }

        #[test]
        fn a_record_of_another_firmware_gives_what_both_know(values in values(), keep in 0..8usize, more in 0..30u8) {
            let written: std::vec::Vec<Setting> =
                values.iter().filter(|(s, value)| *value != defaults(&RIG).get(*s)).map(|(setting, _)| setting).collect();
            let both = &written[..keep.min(written.len())];
            let known = both.iter().map(|setting| (setting.code(), values.get(*setting)));
            let mut record = record_of(known.chain((0..more).map(|k| (100 + k, 1.5))), 3, &RIG).to_vec();
            // What a later firmware appends.
            record.extend(core::iter::repeat_n(1, more.into()));
            let loaded = read(Some(&record), Some(&write_witness(3)), &RIG);
            prop_assert_eq!(loaded.kept, Kept::These);
            for (setting, value) in loaded.values.iter() {
                let source = if both.contains(&setting) { values } else { defaults(&RIG) };
                prop_assert_eq!(value, source.get(setting));
            }
            prop_assert_eq!(loaded.values.lvdt_curve, None);
        }
    }

    #[test]
    fn older_or_missing_records_are_damage() {
        let values = defaults(&RIG).with(Setting::LvdtGain, 1.01);
        let (old, new) = (write(&values, &RIG, 1), write_witness(2));
        for (record, witness) in [(Some(&old[..]), Some(&new[..])), (None, Some(&new)), (Some(&old[..3]), None)] {
            let loaded = read(record, witness, &RIG);
            assert_eq!((loaded.kept, loaded.values), (Kept::Damaged, defaults(&RIG)));
        }
        assert_eq!(read(None, Some(&new), &RIG).generation, 2, "the next record must be newer than the witness");
        // What the settings have nothing to do with may change.
        let same = RigConstants { supply_divider: Some(12.0), ..RIG };
        assert_eq!(read(Some(&old), Some(&write_witness(1)), &same).values, values);
        // The first record, cut off from its witness.
        assert!(read(Some(&old), None, &RIG).witness_behind);
    }

    /// Firmware with other constants: every setting that does not correct them keeps its value.
    #[test]
    fn other_constants_drop_only_what_corrects_them() {
        let lvdt_curve = LvdtCurve::new(&[[0.06, 1e-4], [0.07, 1e-4]], 2e-5).ok();
        let set = SettingValues { numbers: [1e-3, 1.01, 4e-3, -1.0, 1.02, 0.03, 0.4, 1.03, 0.5, 9.0], lvdt_curve };
        let record = write(&set, &RIG, 1);
        for (other, lost) in [
            (RigConstants { motor_speed_max_rad_per_s: 500.0, current_limit_ma: 900, ..RIG }, &[][..]),
            (RigConstants { lvdt_metres_per_code: 5e-5, ..RIG }, &["lvdt-offset", "lvdt-gain", "lvdt-points"]),
            (RigConstants { lvdt_gap_at_code_zero_m: 0.0, ..RIG }, &["lvdt-offset", "lvdt-gain", "lvdt-points"]),
            (RigConstants { gear_ratio: 53.0, ..RIG }, &["gear-scale", "twist-scale"]),
            (RigConstants { counts_per_rad: 20_208.0, ..RIG }, &["gear-scale", "twist-scale"]),
            (RigConstants { counts_per_rad: -RIG.counts_per_rad, ..RIG }, &["twist-sign"]),
            (RigConstants { current_limit_ma: 300, ..RIG }, &["current-limit"]),
        ] {
            // Whether or not power failed before the witness was written.
            for witness in [Some(&write_witness(1)[..]), None] {
                let loaded = read(Some(&record), witness, &other);
                assert!(loaded.dropped.names().eq(lost.iter().copied()), "{lost:?}: {:?}", loaded.dropped);
                let kept = if lost.is_empty() { Kept::These } else { Kept::Partly };
                assert_eq!((loaded.kept, loaded.generation), (kept, 1), "{lost:?}");
                for (setting, value) in loaded.values.iter() {
                    let source = if lost.contains(&setting.name()) { defaults(&other) } else { set };
                    assert_eq!(value, source.get(setting), "{setting} without {lost:?}");
                }
                assert_eq!(loaded.values.lvdt_curve, set.lvdt_curve.filter(|_| !lost.contains(&"lvdt-points")));
            }
        }
    }

    /// Where nobody has set anything, nothing can be lost, and the new rig's defaults are used.
    #[test]
    fn defaults_become_the_new_rigs() {
        let record = write(&defaults(&RIG).with(Setting::SpeedMax, 0.003), &RIG, 1);
        for current_limit_ma in [300, 900] {
            let other = RigConstants { current_limit_ma, gear_ratio: 53.0, lvdt_metres_per_code: 5e-5, ..RIG };
            let loaded = read(Some(&record), Some(&write_witness(1)), &other);
            assert_eq!((loaded.kept, loaded.values), (Kept::These, defaults(&other).with(Setting::SpeedMax, 0.003)));
        }
    }

    #[test]
    fn a_record_of_another_version_is_damage() {
        let mut record = write(&defaults(&RIG), &RIG, 5);
        for version in [0, VERSION - 1, VERSION + 1] {
            record[0] = version;
            let loaded = read(Some(&record), Some(&write_witness(5)), &RIG);
            assert_eq!((loaded.kept, loaded.values, loaded.generation), (Kept::Damaged, defaults(&RIG), 5));
        }
    }

    #[test]
    fn there_is_room_for_the_largest_record() {
        let points = core::array::from_fn(|k| [0.01 * k as f32, 0.0]);
        let lvdt_curve = LvdtCurve::new(&points as &[_; LVDT_POINTS_MAX], 1e-5).ok();
        let set = core::iter::repeat_n((255, 1.0), SETTINGS_MAX).collect();
        let record = Record { version: VERSION, generation: u32::MAX, constants: corrected(&RIG), set, lvdt_curve };
        assert_eq!(bytes(&record).len(), RECORD_MAX);
    }

    #[test]
    fn half_of_a_calibration_is_damage() {
        let lvdt_curve = LvdtCurve::new(&[[0.06, 1e-4], [0.07, 1e-4], [0.08, 0.0]], 2e-5).ok();
        let record = write(&SettingValues { lvdt_curve, ..defaults(&RIG) }, &RIG, 1);
        for cut in 1..record.len() {
            let loaded = read(Some(&record[..record.len() - cut]), Some(&write_witness(1)), &RIG);
            assert_eq!(loaded.kept, Kept::Damaged, "{cut} bytes less");
        }
    }
}
