//! The persistent settings ([`Setting`]): how they correct the scene's constants, and their record in flash.
//!
//! ```text
//! settings:  version 1 | generation u32 LE | basis u32 LE | for each: code u8, value f32 LE
//! witness:   generation u32 LE
//! ```
//! The store checks every record and skips a damaged one, so that it then returns an older record of the same key, with
//! calibration numbers that are out of date, or none. The witness shows this: it is written after the settings, so it is
//! the newer one of the two only if the settings are damaged. The basis is a hash of the constants that the settings
//! correct, and shows a record that was made for others. A setting that a record does not have keeps its default, and an
//! unknown one is ignored. The points of the LVDT's calibration are entries of their own, so that records of
//! firmware without them are read, and the other way round.

use crate::RigConstants;
use heapless::Vec;
use rig_link::messages::{Kept, LVDT_POINTS_MAX, LvdtCurve, Setting, SettingValues};

/// Version of the record.
const VERSION: u8 = 1;
const HEAD: usize = 9;
const ENTRY: usize = 5;
/// Longest record that is read (bytes): another firmware's may have more settings than ours.
pub const RECORD_MAX: usize = HEAD + 50 * ENTRY;
/// Code of the first entry of the LVDT's calibration: for each point its reading and its correction; then, behind the room
/// for 11 points, the stated error.
const CURVE: u8 = 200;
const CURVE_ERROR: u8 = CURVE + 2 * LVDT_POINTS_MAX as u8;
/// Most bytes of our own record.
pub const RECORD: usize = HEAD + (Setting::ALL.len() + 2 * LVDT_POINTS_MAX + 1) * ENTRY;

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
        lvdt_curve: values.lvdt_curve,
        lvdt_gain: values.get(Setting::LvdtGain),
        lvdt_offset_m: values.get(Setting::LvdtOffset),
        ..*rig
    }
}

/// Hash (FNV-1a) of the constants that the settings correct or are bounded by: with others they would mean something else.
fn basis(rig: &RigConstants) -> u32 {
    let RigConstants { gear_ratio, counts_per_rad, lvdt_gap_at_code_zero_m, lvdt_metres_per_code, .. } = *rig;
    [gear_ratio, counts_per_rad, lvdt_gap_at_code_zero_m, lvdt_metres_per_code, f32::from(rig.current_limit_ma)]
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// The settings that flash had.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loaded {
    /// Values to use.
    pub values: SettingValues,
    /// [`Kept::Nothing`], [`Kept::These`] or [`Kept::Damaged`].
    pub kept: Kept,
    /// Of the newest record that was written.
    pub generation: u32,
    /// Power failed between record and witness: write the witness again.
    pub witness_behind: bool,
}

/// The record of values, for a rig with these constants, in a generation.
pub fn write(values: &SettingValues, rig: &RigConstants, generation: u32) -> Vec<u8, RECORD> {
    let curve = values.lvdt_curve.iter().flat_map(|curve| {
        let numbers = (CURVE..).zip(curve.points().iter().flatten().copied());
        numbers.chain([(CURVE_ERROR, curve.error_m())])
    });
    let entries = values.iter().map(|(setting, value)| (setting.code(), value)).chain(curve);
    [VERSION]
        .into_iter()
        .chain(generation.to_le_bytes())
        .chain(basis(rig).to_le_bytes())
        .chain(entries.flat_map(|(code, value)| [code].into_iter().chain(value.to_le_bytes())))
        .collect()
}

/// The record of a witness.
pub fn write_witness(generation: u32) -> [u8; 4] {
    generation.to_le_bytes()
}

fn number(bytes: &[u8]) -> Option<u32> {
    bytes.try_into().ok().map(u32::from_le_bytes)
}

/// Generation and values of a record; `None` if it is not one of ours, or if any of its values is not allowed.
fn parse(record: &[u8], rig: &RigConstants) -> Option<(u32, SettingValues)> {
    let (head, entries) = record.split_at_checked(HEAD)?;
    if head[0] != VERSION || number(&head[5..])? != basis(rig) || !entries.len().is_multiple_of(ENTRY) {
        return None;
    }
    let defaults = defaults(rig);
    let mut values = defaults;
    let mut curve = Vec::<f32, { 2 * LVDT_POINTS_MAX }>::new();
    let mut curve_error_m = None;
    for entry in entries.chunks_exact(ENTRY) {
        let value = f32::from_bits(number(&entry[1..])?);
        match (entry[0], Setting::from_code(entry[0])) {
            (_, Some(setting)) => values = values.with(setting, value),
            (CURVE_ERROR, None) => curve_error_m = Some(value),
            // Its numbers stand in their order; a record where they do not is damaged.
            (code @ CURVE..CURVE_ERROR, None) if usize::from(code - CURVE) == curve.len() => curve.push(value).ok()?,
            (CURVE..CURVE_ERROR, None) => return None,
            _ => {}
        }
    }
    if !curve.is_empty() || curve_error_m.is_some() {
        let (points, rest) = curve.as_chunks();
        values.lvdt_curve = Some(LvdtCurve::new(points, curve_error_m.filter(|_| rest.is_empty())?).ok()?);
    }
    values.check(&defaults).ok()?;
    Some((number(&head[1..5])?, values))
}

/// The settings to use on a rig with these constants, from both records. `None` is a record that is missing or damaged.
pub fn read(record: Option<&[u8]>, witness: Option<&[u8]>, rig: &RigConstants) -> Loaded {
    let witness = witness.and_then(number);
    let newest = witness.unwrap_or(0);
    match (record.map(|record| parse(record, rig)), witness) {
        (None, None) => Loaded { values: defaults(rig), kept: Kept::Nothing, generation: 0, witness_behind: false },
        (Some(Some((generation, values))), _) if generation >= newest => {
            Loaded { values, kept: Kept::These, generation, witness_behind: witness != Some(generation) }
        }
        // An older record, none, or one that is not for this rig.
        (record, _) => {
            let found = record.flatten().map_or(0, |(generation, _)| generation);
            let generation = newest.max(found);
            Loaded { values: defaults(rig), kept: Kept::Damaged, generation, witness_behind: false }
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::constants::tests::RIG;
    use proptest::prelude::*;

    /// Values that are allowed.
    fn values() -> impl Strategy<Value = SettingValues> {
        let curve = (2..=LVDT_POINTS_MAX, prop::array::uniform11(-1e-4..1e-4f32), 0.0..1e-3f32);
        (prop::array::uniform8(0.0..=1f32), prop::option::of(curve)).prop_map(|(shares, curve)| {
            let mut defaults = defaults(&RIG);
            defaults.lvdt_curve = curve.map(|(count, corrections, error_m)| {
                let mut points = corrections.map(|correction_m| [0.0, correction_m]);
                points.iter_mut().enumerate().for_each(|(k, point)| point[0] = 0.08 + 2e-3 * k as f32);
                LvdtCurve::new(&points[..count], error_m).expect("a curve")
            });
            Setting::ALL.iter().fold(defaults, |values, setting| {
                let ([min, max], share) = (setting.range(defaults.get(*setting)), shares[*setting as usize]);
                let between = (min + share * (max - min)).clamp(min, max);
                let ends = if share < 0.5 { min } else { max };
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
            let mut record = write(&values, &RIG, 3)[..HEAD + keep * ENTRY].to_vec();
            (0..more).for_each(|k| record.extend([100 + k, 1, 2, 3, 4]));
            prop_assert!(record.len() <= RECORD_MAX);
            let loaded = read(Some(&record), Some(&write_witness(3)), &RIG);
            prop_assert_eq!(loaded.kept, Kept::These);
            for (k, (setting, value)) in loaded.values.iter().enumerate() {
                prop_assert_eq!(value, if k < keep { values.get(setting) } else { defaults(&RIG).get(setting) });
            }
            prop_assert_eq!(loaded.values.lvdt_curve, None);
        }
    }

    #[test]
    fn older_or_missing_records_and_other_rigs_are_damage() {
        let values = defaults(&RIG).with(Setting::LvdtGain, 1.01);
        let (old, new) = (write(&values, &RIG, 1), write_witness(2));
        for (record, witness) in [(Some(&old[..]), Some(&new[..])), (None, Some(&new)), (Some(&old[..3]), None)] {
            let loaded = read(record, witness, &RIG);
            assert_eq!((loaded.kept, loaded.values), (Kept::Damaged, defaults(&RIG)));
        }
        assert_eq!(read(None, Some(&new), &RIG).generation, 2, "the next record must be newer than the witness");
        let other = RigConstants { lvdt_metres_per_code: 5e-5, ..RIG };
        assert_eq!(read(Some(&old), Some(&write_witness(1)), &other).kept, Kept::Damaged);
        // What the settings have nothing to do with may change.
        let same = RigConstants { supply_divider: Some(12.0), ..RIG };
        assert_eq!(read(Some(&old), Some(&write_witness(1)), &same).values, values);
        // The first record, cut off from its witness.
        assert!(read(Some(&old), None, &RIG).witness_behind);
    }

    /// A record as firmware without the points of a calibration wrote it.
    #[test]
    fn a_record_from_before_the_points_is_read() {
        let mut record = std::vec![1, 5, 0, 0, 0];
        record.extend(basis(&RIG).to_le_bytes());
        for (code, value) in (0u8..).zip([1e-3f32, 1.01, 0.0, -1.0, 1.0, 0.03, 0.4, 1.0]) {
            record.push(code);
            record.extend(value.to_le_bytes());
        }
        let loaded = read(Some(&record), Some(&write_witness(5)), &RIG);
        assert_eq!((loaded.kept, loaded.generation, loaded.values.lvdt_curve), (Kept::These, 5, None));
        assert_eq!(loaded.values.numbers, [1e-3, 1.01, 0.0, -1.0, 1.0, 0.03, 0.4, 1.0]);
        assert_eq!(write(&loaded.values, &RIG, 5)[..], record[..], "and without points it is written as it was");
    }

    #[test]
    fn half_of_a_calibration_is_damage() {
        let lvdt_curve = LvdtCurve::new(&[[0.06, 1e-4], [0.07, 1e-4], [0.08, 0.0]], 2e-5).ok();
        let record = write(&SettingValues { lvdt_curve, ..defaults(&RIG) }, &RIG, 1);
        for entries in 1..=6 {
            let cut = &record[..record.len() - entries * ENTRY];
            assert_eq!(read(Some(cut), Some(&write_witness(1)), &RIG).kept, Kept::Damaged, "{entries} less");
        }
    }

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
        // These three act elsewhere.
        for setting in [Setting::PositionZero, Setting::SpeedMax, Setting::TwistScale] {
            assert_eq!(with(setting, setting.spec().range[0]), RIG);
        }
    }
}
