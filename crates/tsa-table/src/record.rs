//! A table as bytes: how the host sends it, and how the board keeps it in flash.

use crate::GENERATOR_VERSION;
use crate::arc::{ArcSeries, Growth, POWERS, Patch, Shape};
use crate::table::{Metadata, Table, Uncertainty};
use core::ops::RangeInclusive;

/// Maximum bytes of a table's numbers, a bound of flash and RAM on the board.
pub const MAX_BYTES: usize = 4096;
/// Maximum ranges of the load.
pub const MAX_PATCHES: usize = 32;
const MAX_COEFFICIENTS: usize = (MAX_BYTES - Growth::BYTES - Patch::BYTES) / 4;
/// Maximum bytes of a record: what stands before the coefficients, and the numbers.
pub const RECORD_MAX: usize = 16 + 4 * (4 + 4 + 2) + MAX_BYTES;
/// Intervals of load and twist at whose ends the gradient's signs are checked.
const SIGNS: u8 = 60;
/// Ranges outside which nothing can be a table of such a rig: loads (N), twists (rad).
const LOADS_N: RangeInclusive<f32> = 1e-3..=1e5;
const TWISTS_RAD: RangeInclusive<f32> = 1.0..=1e4;

/// Why bytes are no table that the board can use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecordError {
    /// The record ends too early, is too long, or its checksum is wrong.
    #[error("the record is damaged")]
    Damaged,
    /// [`GENERATOR_VERSION`] or the form is another one.
    #[error("the table was made by another version of the generator")]
    Version,
    /// A range is empty or impossible, or a stated error is none.
    #[error("a range or a stated error of the table is impossible")]
    Range,
    /// Somewhere the gap does not fall with the twist or does not rise with the load.
    #[error("the gap is not monotone: the inverses would not be unique")]
    NotMonotone,
}

/// A table that owns its numbers, without a heap.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredTable {
    metadata: Metadata,
    growth: Growth,
    shape: Shape,
    patches: heapless::Vec<Patch, MAX_PATCHES>,
    coefficients: heapless::Vec<f32, MAX_COEFFICIENTS>,
    crc: u32,
}

impl StoredTable {
    /// A copy of a table; `None` if it has more than [`MAX_PATCHES`] ranges or [`MAX_BYTES`] bytes.
    pub fn of(table: &Table<'_>) -> Option<Self> {
        let Table { metadata, series: ArcSeries { growth, shape, patches, coefficients }, crc } = *table;
        let (patches, coefficients) =
            (heapless::Vec::from_slice(patches).ok()?, heapless::Vec::from_slice(coefficients).ok()?);
        Some(Self { metadata, growth, shape, patches, coefficients, crc })
    }

    /// What stands for a table that is too large: it has no numbers, and [`Table::is_intact`] is false.
    const NONE: Self = Self {
        metadata: Metadata {
            load_min_n: 0.0,
            load_max_n: 0.0,
            twist_min_rad: 0.0,
            twist_max_rad: 0.0,
            contraction_error_m: 0.0,
            tr_relative_error: 0.0,
            uncertainty: Uncertainty { twist_scale: 0.5, gap_zero_m: 0.5, load_shape: 0.5, rod_memory: 0.5 },
            scene_hash: 0,
            generator_version: GENERATOR_VERSION,
        },
        growth: Growth { per_load_m_n: 0.0, powers: [0.0; POWERS], per_log_m: 0.0 },
        shape: Shape::of(2, 2).unwrap(),
        patches: heapless::Vec::new(),
        coefficients: heapless::Vec::new(),
        crc: 0,
    };

    /// A copy of a table, for [`Table::is_intact`] to check: a table that is too large leaves one without numbers.
    pub fn copy_of(table: &Table<'_>) -> Self {
        Self::of(table).unwrap_or(Self::NONE)
    }

    /// Range, accuracy and origin.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// The table for lookups.
    pub fn table(&self) -> Table<'_> {
        let Self { metadata, growth, shape, ref patches, ref coefficients, crc } = *self;
        Table { metadata, series: ArcSeries { growth, shape, patches, coefficients }, crc }
    }

    /// Reads a record and checks it: its checksum, its ranges, and that the gap is monotone.
    ///
    /// # Errors
    /// [`RecordError`].
    pub fn read(bytes: &[u8]) -> Result<Self, RecordError> {
        let read = Self::parse(bytes)?;
        let table = read.table();
        let Metadata { load_min_n, load_max_n, twist_min_rad, twist_max_rad, .. } = read.metadata;
        let ranges = [(LOADS_N, load_min_n, load_max_n), (TWISTS_RAD, twist_min_rad, twist_max_rad)];
        let possible = ranges.iter().all(|(range, min, max)| range.contains(min) && range.contains(max) && min < max);
        let errors = [read.metadata.contraction_error_m, read.metadata.tr_relative_error];
        if !possible || !errors.iter().all(|error| (0.0..1.0).contains(error)) {
            return Err(RecordError::Range);
        }
        is_monotone(&table, SIGNS).then_some(read).ok_or(RecordError::NotMonotone)
    }

    fn parse(bytes: &[u8]) -> Result<Self, RecordError> {
        let (words, rest) = bytes.as_chunks::<4>();
        let mut words = words.iter().copied();
        let mut word = || words.next().ok_or(RecordError::Damaged);
        let [rows, columns, count, _] = word()?;
        let shape = Shape::of(rows.into(), columns.into()).ok_or(RecordError::Version)?;
        let scene_hash = u32::from_le_bytes(word()?);
        let version = u32::from_le_bytes(word()?);
        if version != u32::from(GENERATOR_VERSION) {
            return Err(RecordError::Version);
        }
        let crc = u32::from_le_bytes(word()?);
        let mut value = || Ok(f32::from_le_bytes(word()?));
        let known = [value()?, value()?, value()?, value()?];
        let metadata = Metadata {
            load_min_n: value()?,
            load_max_n: value()?,
            twist_min_rad: value()?,
            twist_max_rad: value()?,
            contraction_error_m: value()?,
            tr_relative_error: value()?,
            uncertainty: Uncertainty::from_numbers(known).ok_or(RecordError::Range)?,
            scene_hash,
            generator_version: GENERATOR_VERSION,
        };
        let mut growth = Growth { per_load_m_n: value()?, per_log_m: value()?, powers: Default::default() };
        for power in &mut growth.powers {
            *power = value()?;
        }
        let mut read =
            Self { metadata, growth, shape, patches: heapless::Vec::new(), coefficients: heapless::Vec::new(), crc };
        for _ in 0..count {
            let patch = Patch { load_max_n: value()?, centre: [value()?, value()?] };
            read.patches.push(patch).map_err(|_| RecordError::Damaged)?;
        }
        for _ in 0..usize::from(count) * shape.terms() {
            read.coefficients.push(value()?).map_err(|_| RecordError::Damaged)?;
        }
        let whole = words.next().is_none() && rest.is_empty();
        (whole && read.table().is_intact()).then_some(read).ok_or(RecordError::Damaged)
    }
}

impl Table<'_> {
    /// Writes the table as a record; returns how many bytes of `out` it takes, `None` if they do not suffice.
    pub fn write(&self, out: &mut [u8]) -> Option<usize> {
        let (m, series) = (&self.metadata, &self.series);
        let mut at = 0;
        let mut put = |bytes: [u8; 4]| {
            out.get_mut(at..at + 4)?.copy_from_slice(&bytes);
            at += 4;
            Some(())
        };
        put([series.shape.rows, series.shape.columns, u8::try_from(series.patches.len()).ok()?, 0])?;
        for word in [m.scene_hash, u32::from(m.generator_version), self.crc] {
            put(word.to_le_bytes())?;
        }
        let ranges = [m.load_min_n, m.load_max_n, m.twist_min_rad, m.twist_max_rad];
        let errors = [m.contraction_error_m, m.tr_relative_error];
        let growth = [series.growth.per_load_m_n, series.growth.per_log_m];
        let patches = series.patches.iter().flat_map(|p| [p.load_max_n, p.centre[0], p.centre[1]]);
        let numbers = m.uncertainty.numbers().into_iter().chain(ranges).chain(errors).chain(growth);
        for value in numbers.chain(series.growth.powers).chain(patches).chain(series.coefficients.iter().copied()) {
            put(value.to_le_bytes())?;
        }
        Some(at)
    }
}

/// Whether the gap falls with the twist and rises with the load at the ends of `intervals` intervals of load, quadratically
/// denser towards the light end, and as many of twist.
pub(crate) fn is_monotone(table: &Table<'_>, intervals: u8) -> bool {
    let m = &table.metadata;
    let fraction = |k: u8| f32::from(k) / f32::from(intervals);
    (0..=intervals).all(|i| {
        let load_n = m.load_min_n + (m.load_max_n - m.load_min_n) * fraction(i) * fraction(i);
        (0..=intervals).all(|j| {
            let twist_rad = m.twist_min_rad + (m.twist_max_rad - m.twist_min_rad) * fraction(j);
            let p = table.point_inside(load_n, twist_rad);
            p.dgap_dtwist_m_per_rad < 0.0 && p.dgap_dload_m_per_n > 0.0
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::example::{COEFFICIENTS, PATCHES, table};

    fn record(table: &Table<'_>) -> Vec<u8> {
        let mut out = [0; RECORD_MAX];
        let length = table.write(&mut out).unwrap();
        out[..length].to_vec()
    }

    #[test]
    fn a_record_is_read_back_bit_for_bit() {
        let table = table(&PATCHES, &COEFFICIENTS);
        let bytes = record(&table);
        let read = StoredTable::read(&bytes).unwrap();
        assert_eq!(Some(&read), StoredTable::of(&table).as_ref());
        assert_eq!((read.table().crc, read.table().checksum(), record(&read.table())), (table.crc, table.crc, bytes));
    }

    #[test]
    fn a_record_that_is_damaged_anywhere_cut_or_too_long_is_refused() {
        let bytes = record(&table(&PATCHES, &COEFFICIENTS));
        // The fourth byte is not used.
        for place in (0..bytes.len()).filter(|place| *place != 3) {
            let mut broken = bytes.clone();
            broken[place] ^= 4;
            assert!(StoredTable::read(&broken).is_err(), "byte {place}");
        }
        for length in 0..bytes.len() {
            assert!(StoredTable::read(&bytes[..length]).is_err(), "{length} bytes");
        }
        assert_eq!(StoredTable::read(&[&bytes[..], &[0]].concat()), Err(RecordError::Damaged));
        assert_eq!(StoredTable::read(&[&bytes[..], &[0; 4]].concat()), Err(RecordError::Damaged));
    }

    #[test]
    fn a_table_of_another_version_without_a_range_or_not_monotone_is_refused_although_intact() {
        let good = table(&PATCHES, &COEFFICIENTS);
        let changed = |change: fn(&mut Metadata)| {
            let mut table = good;
            change(&mut table.metadata);
            StoredTable::read(&record(&Table { crc: table.checksum(), ..table }))
        };
        assert!(changed(|_| {}).is_ok());
        assert_eq!(changed(|m| m.generator_version += 1), Err(RecordError::Version));
        for change in [
            |m: &mut Metadata| m.load_min_n = 0.0,
            |m: &mut Metadata| m.load_min_n = m.load_max_n,
            |m: &mut Metadata| m.load_max_n = f32::INFINITY,
            |m: &mut Metadata| m.twist_max_rad = m.twist_min_rad,
            |m: &mut Metadata| m.twist_min_rad = f32::NAN,
            |m: &mut Metadata| m.contraction_error_m = f32::NAN,
            |m: &mut Metadata| m.tr_relative_error = -1e-3,
            |m: &mut Metadata| m.uncertainty.twist_scale = 0.0,
        ] {
            assert_eq!(changed(change), Err(RecordError::Range));
        }
        // Too steep in the arc, rising with the twist, falling with the load.
        for coefficients in [
            [0.0, -1.0, 0.0, -0.03, 5e-5, 0.0085],
            [0.0, 1.0, 0.0, -0.04, 5e-5, 0.0085],
            [0.0, -1.0, 0.0, -0.06, -5e-6, 0.0085],
        ] {
            assert_eq!(StoredTable::read(&record(&table(&PATCHES, &coefficients))), Err(RecordError::NotMonotone));
        }
    }

    #[test]
    fn a_gap_that_is_not_monotone_is_seen_where_an_end_of_an_interval_lies() {
        // Of two intervals between 1 and 16 N, the lighter one is a quarter of the range.
        let falling = [0.0, -1.0, 0.0, -0.06, -5e-4, 0.0085];
        for (load_n, seen) in [(1.0, true), (4.75, true), (5.25, false), (8.5, false), (16.0, true)] {
            let patches = [load_n - 0.1, load_n + 0.1, 17.0].map(|load_max_n| Patch { load_max_n, ..PATCHES[0] });
            let coefficients = [COEFFICIENTS, falling, COEFFICIENTS].concat();
            assert_eq!(is_monotone(&table(&patches, &coefficients), 2), !seen, "{load_n} N");
        }
        // Here the gap rises from 30 to 33 rad only, where ∂G²/∂a = −100 (a − 15 mm) (a − 16.5 mm) at an arc of 0.5 mm/rad.
        let mut cubic = table(&PATCHES, &[0.0, -100.0 / 3.0, 0.0, -0.425, 0.0, -1.75e-3, 5e-5, 0.0085]);
        (cubic.series.shape, cubic.series.growth.per_load_m_n) = (Shape::of(2, 4).unwrap(), 0.0);
        for middle_rad in [29.0, 31.5, 34.5] {
            cubic.metadata.twist_max_rad = 2.0 * middle_rad - cubic.metadata.twist_min_rad;
            assert_eq!(is_monotone(&cubic, 2), middle_rad != 31.5, "{middle_rad} rad");
        }
        // Without the only term of the load the gap does not rise with it.
        cubic.series.coefficients = &[0.0, -100.0 / 3.0, 0.0, -0.425, 0.0, -1.75e-3, 0.0, 0.0085];
        assert!(!is_monotone(&cubic, 2));
    }

    #[test]
    fn a_table_that_is_too_large_is_not_taken() {
        let patches = [PATCHES[0]; MAX_PATCHES + 1];
        let coefficients = vec![0.0; 6 * patches.len()];
        assert!(StoredTable::of(&table(&patches, &coefficients)).is_none());
        let none = StoredTable::copy_of(&table(&patches, &coefficients));
        assert!(!none.table().is_intact() && none.table().point_inside(5.0, 10.0).gap_m.is_nan());
        assert!(StoredTable::copy_of(&table(&PATCHES, &COEFFICIENTS)).table().is_intact());
        assert!(table(&PATCHES, &COEFFICIENTS).write(&mut [0; 80]).is_none());
    }
}
