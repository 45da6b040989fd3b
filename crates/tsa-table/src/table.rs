//! A table with its metadata, and the forward lookup.

use crate::arc::{ArcSeries, Point};

/// What a table covers and how good it is. The generator writes it with the numbers; a consumer repeats none of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metadata {
    /// Minimum load covered (N).
    pub load_min_n: f32,
    /// Maximum load covered (N).
    pub load_max_n: f32,
    /// Minimum twist covered (rad); the half-turn pre-twist π or above.
    pub twist_min_rad: f32,
    /// Maximum twist covered (rad).
    pub twist_max_rad: f32,
    /// Largest error of the contraction against the full solver that the certificate found (m).
    pub contraction_error_m: f32,
    /// Largest relative error of TR that the certificate found.
    pub tr_relative_error: f32,
    /// How well the constants are known.
    pub uncertainty: Uncertainty,
    /// Hash of the scene that the table was made for.
    pub scene_hash: u32,
    /// [`crate::GENERATOR_VERSION`] of the generator.
    pub generator_version: u16,
}

/// Standard errors of what the constants of a table say of the mechanism: the control code computes from them how well it
/// knows the load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// Of the scale of the twist that compensates an error of the string radius (relative), and of the exponent of the twist by
    /// which the radius grows.
    pub twist_scale: f32,
    /// Of the LVDT's zero beside the mechanism's gap (m).
    pub gap_zero_m: f32,
    /// Of how the radius depends on the load: error of a weighed load, and of a change of the load (relative).
    pub load_shape: f32,
    /// By how much a light load seems heavier on rods that have carried a much heavier one (relative); no standard error.
    pub rod_memory: f32,
}

impl Uncertainty {
    /// The numbers in the order in which records, messages and the checksum have them.
    pub fn numbers(&self) -> [f32; 4] {
        [self.twist_scale, self.gap_zero_m, self.load_shape, self.rod_memory]
    }

    /// From [`Self::numbers`]; `None` if one of them is not from 1e-6 to 0.5: nothing is known exactly, and the control
    /// code divides by them.
    pub fn from_numbers(numbers: [f32; 4]) -> Option<Self> {
        let [twist_scale, gap_zero_m, load_shape, rod_memory] = numbers;
        let good = numbers.iter().all(|x| (0.99e-6..=0.5).contains(x));
        good.then_some(Self { twist_scale, gap_zero_m, load_shape, rod_memory })
    }
}

/// A table ready for lookups.
#[derive(Clone, Copy, Debug)]
pub struct Table<'a> {
    /// Range, accuracy and origin.
    pub metadata: Metadata,
    /// The numbers.
    pub series: ArcSeries<'a>,
    /// CRC-32 over metadata and numbers, see [`Table::checksum`].
    pub crc: u32,
}

/// A load or a twist that the table does not cover. It is refused, never extrapolated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{parameter} {value} is outside the table's range, {min} to {max}")]
pub struct OutOfRange {
    /// `load_n` or `twist_rad`.
    pub parameter: &'static str,
    /// The refused value.
    pub value: f32,
    /// Minimum value covered.
    pub min: f32,
    /// Maximum value covered.
    pub max: f32,
}

/// Relative slack at the edges of the range: rounding to f32 may put a value on the edge just outside.
const EDGE_SLACK: f32 = 1e-6;

/// `value` limited to [min, max]; `min` for NaN. It compares by itself: `clamp` panics if min > max, and `max` and
/// `min` are library calls on the board.
#[inline]
fn limited(value: f32, min: f32, max: f32) -> f32 {
    let value = if value > min { value } else { min };
    if value < max { value } else { max }
}

/// `value` if it is in [min, max] up to rounding, moved onto the edge if it is just outside.
#[inline]
fn within(parameter: &'static str, value: f32, min: f32, max: f32) -> Result<f32, OutOfRange> {
    let slack = EDGE_SLACK * (max - min);
    // NaN fails both comparisons and is refused.
    if value >= min - slack && value <= max + slack {
        Ok(limited(value, min, max))
    } else {
        Err(OutOfRange { parameter, value, min, max })
    }
}

impl Table<'_> {
    /// Gap and gradient at a load (N) and a twist (rad).
    ///
    /// # Errors
    /// [`OutOfRange`] naming the parameter.
    #[inline]
    pub fn look_up(&self, load_n: f32, twist_rad: f32) -> Result<Point, OutOfRange> {
        Ok(self.series.evaluate(self.load_inside(load_n)?, self.twist_inside(twist_rad)?))
    }

    /// The load (N) if the table covers it.
    #[inline]
    pub(crate) fn load_inside(&self, load_n: f32) -> Result<f32, OutOfRange> {
        within("load_n", load_n, self.metadata.load_min_n, self.metadata.load_max_n)
    }

    /// The twist (rad) if the table covers it.
    #[inline]
    fn twist_inside(&self, twist_rad: f32) -> Result<f32, OutOfRange> {
        within("twist_rad", twist_rad, self.metadata.twist_min_rad, self.metadata.twist_max_rad)
    }

    /// As [`Table::look_up`], with load and twist moved to the nearest edge where they are outside: for a caller that
    /// limits both itself and cannot handle a refusal over the last bit. NaN counts as the lower edge.
    #[inline]
    pub fn point_inside(&self, load_n: f32, twist_rad: f32) -> Point {
        let m = &self.metadata;
        let load_n = limited(load_n, m.load_min_n, m.load_max_n);
        self.series.evaluate(load_n, limited(twist_rad, m.twist_min_rad, m.twist_max_rad))
    }

    /// Contraction ΔX since the half-turn pre-twist at the same load (m), eq. 28.
    ///
    /// # Errors
    /// [`OutOfRange`] naming the parameter.
    pub fn contraction_m(&self, load_n: f32, twist_rad: f32) -> Result<f32, OutOfRange> {
        let start = self.look_up(load_n, self.metadata.twist_min_rad)?;
        Ok(start.gap_m - self.look_up(load_n, twist_rad)?.gap_m)
    }

    /// CRC-32 over metadata and numbers as little-endian bytes: the same on every machine.
    pub fn checksum(&self) -> u32 {
        let algorithm = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);
        let mut digest = algorithm.digest();
        let m = &self.metadata;
        let ArcSeries { growth, shape, patches, coefficients } = &self.series;
        // Versions up to 3 had other forms too: the numbers 3 name this one, and the middle and the inverse half width
        // of both ranges were stored. They stay in the checksum.
        digest.update(&[3]);
        let middle_and_scale = |min: f32, max: f32| [0.5 * (min + max), 2.0 / (max - min)];
        let ranges = [m.load_min_n, m.load_max_n, m.twist_min_rad, m.twist_max_rad];
        let scales = [middle_and_scale(ranges[0], ranges[1]), middle_and_scale(ranges[2], ranges[3])];
        let errors = [m.contraction_error_m, m.tr_relative_error];
        let known = m.uncertainty.numbers();
        for value in [0.0].iter().chain(&ranges).chain(scales.as_flattened()).chain(&errors).chain(&known) {
            digest.update(&value.to_le_bytes());
        }
        digest.update(&m.scene_hash.to_le_bytes());
        digest.update(&m.generator_version.to_le_bytes());
        digest.update(&[3, shape.rows, shape.columns, patches.len() as u8]);
        let of_patches = patches.iter().flat_map(|p| p.centre.iter().chain([&p.load_max_n]));
        for value in
            [growth.per_load_m_n, growth.per_log_m].iter().chain(of_patches).chain(&growth.powers).chain(*coefficients)
        {
            digest.update(&value.to_le_bytes());
        }
        digest.finalize()
    }

    /// Whether shape and checksum are right: the firmware checks at boot and uses no table that fails.
    pub fn is_intact(&self) -> bool {
        self.series.is_consistent() && self.crc == self.checksum()
    }
}

/// A table for the tests of this crate.
#[cfg(test)]
pub(crate) mod example {
    use super::*;
    use crate::arc::{Growth, Patch, Shape};

    pub(crate) const METADATA: Metadata = Metadata {
        load_min_n: 1.0,
        load_max_n: 16.0,
        twist_min_rad: 3.0,
        twist_max_rad: 60.0,
        contraction_error_m: 5e-6,
        tr_relative_error: 2e-3,
        uncertainty: Uncertainty { twist_scale: 0.01, gap_zero_m: 1e-4, load_shape: 0.02, rod_memory: 0.1 },
        scene_hash: 0,
        generator_version: crate::GENERATOR_VERSION,
    };
    pub(crate) const PATCHES: [Patch; 1] = [Patch { load_max_n: 16.0, centre: [8.0, 0.02] }];
    /// G² falls with the arc, the faster the greater it is, as that of strings does; the last one is G² in the middle (m²).
    pub(crate) const COEFFICIENTS: [f32; 6] = [0.0, -1.0, 0.0, -0.06, 5e-5, 0.0085];

    /// Of two powers of the load and three of the arc.
    pub(crate) fn table<'a>(patches: &'a [Patch], coefficients: &'a [f32]) -> Table<'a> {
        let growth = Growth { per_load_m_n: 2e-4, powers: [0.0, 0.0, 0.0, 0.0, 0.0, 5e-4], per_log_m: 0.0 };
        let series = ArcSeries { growth, shape: Shape::of(2, 3).unwrap(), patches, coefficients };
        let table = Table { metadata: METADATA, series, crc: 0 };
        Table { crc: table.checksum(), ..table }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arc::{Growth, Patch, Shape};

    const KNOWN: Uncertainty = Uncertainty { twist_scale: 0.01, gap_zero_m: 1e-4, load_shape: 0.02, rod_memory: 0.1 };
    const PATCHES: [Patch; 2] =
        [Patch { load_max_n: 4.0, centre: [2.5, 0.01] }, Patch { load_max_n: 16.0, centre: [10.0, 0.01] }];
    /// G² = 0.01 − 0.1 (a − a₀) + 1e-4 (F − F₀) + …, twice.
    const COEFFICIENTS: [f32; 8] = [1e-4, -0.1, 1e-4, 0.01, 2e-4, -0.09, 1e-4, 0.011];

    /// A table of the arc a = 1 mm · θ/F + 0.4 mm · θ.
    fn table() -> Table<'static> {
        let metadata = Metadata { twist_max_rad: 40.0, scene_hash: 0x1234_5678, ..example::METADATA };
        let growth = Growth { per_load_m_n: 1e-3, powers: [0.0, 0.0, 0.0, 0.0, 0.0, 4e-4], per_log_m: 0.0 };
        let shape = Shape::of(2, 2).unwrap();
        let series = ArcSeries { growth, shape, patches: &PATCHES, coefficients: &COEFFICIENTS };
        let table = Table { metadata, series, crc: 0 };
        Table { crc: table.checksum(), ..table }
    }

    #[test]
    fn the_edges_of_the_range_have_a_slack_for_rounding_and_no_more() {
        let slack = EDGE_SLACK * 15.0;
        let t = table();
        for (load_n, inside) in
            [(1.0 - 0.5 * slack, 1.0), (1.0, 1.0), (7.0, 7.0), (16.0, 16.0), (16.0 + 0.5 * slack, 16.0)]
        {
            assert_eq!(t.load_inside(load_n), Ok(inside));
        }
        for load_n in [1.0 - 1.5 * slack, 16.0 + 1.5 * slack, 0.0, -7.0, f32::NAN] {
            let refused = t.look_up(load_n, 10.0).unwrap_err();
            assert_eq!((refused.parameter, refused.min, refused.max), ("load_n", 1.0, 16.0));
        }
        assert_eq!(t.look_up(7.0, 2.9).unwrap_err().parameter, "twist_rad");
        assert_eq!(t.look_up(7.0, 40.1).unwrap_err().parameter, "twist_rad");
    }

    #[test]
    fn the_slack_is_a_share_of_the_width_of_the_range() {
        let of = |value| within("x", value, -1.0, 1.0).map_err(|refused| refused.value);
        assert_eq!([of(1.000_001), of(-1.000_001)], [Ok(1.0), Ok(-1.0)]);
        assert_eq!([of(1.000_004), of(-1.000_004)], [Err(1.000_004), Err(-1.000_004)]);
    }

    #[test]
    fn beyond_the_edges_the_point_of_the_nearest_edge_counts_where_the_caller_asks_for_it() {
        let t = table();
        for (given, nearest) in [
            ([0.5, 20.0], [1.0, 20.0]),
            ([20.0, 20.0], [16.0, 20.0]),
            ([7.0, 1.0], [7.0, 3.0]),
            ([7.0, 50.0], [7.0, 40.0]),
        ] {
            assert_eq!(t.point_inside(given[0], given[1]), t.look_up(nearest[0], nearest[1]).unwrap());
        }
        assert_eq!(t.point_inside(f32::NAN, f32::NAN), t.look_up(1.0, 3.0).unwrap());
        assert_eq!(t.point_inside(7.0, 20.0), t.look_up(7.0, 20.0).unwrap());
    }

    #[test]
    fn contraction_is_the_gap_lost_since_the_pre_twist() {
        let t = table();
        let gap_m = |twist_rad| t.look_up(5.0, twist_rad).unwrap().gap_m;
        assert_eq!(t.contraction_m(5.0, 30.0), Ok(gap_m(3.0) - gap_m(30.0)));
        assert!(t.contraction_m(5.0, 30.0).unwrap() > 5e-3);
        assert!(t.contraction_m(5.0, 50.0).is_err() && t.contraction_m(50.0, 30.0).is_err());
    }

    #[test]
    fn the_checksum_covers_every_number() {
        let good = table();
        assert!(good.is_intact());
        let metadata = |change: fn(&mut Metadata)| {
            let mut changed = good;
            change(&mut changed.metadata);
            changed
        };
        let series = |change: fn(&mut ArcSeries<'static>)| {
            let mut changed = good;
            change(&mut changed.series);
            changed
        };
        let changed = [
            metadata(|m| m.load_min_n = 1.5),
            metadata(|m| m.load_max_n = 15.0),
            metadata(|m| m.twist_min_rad = 3.5),
            metadata(|m| m.twist_max_rad = 39.0),
            metadata(|m| m.contraction_error_m = 4e-6),
            metadata(|m| m.tr_relative_error = 1e-3),
            metadata(|m| m.uncertainty.rod_memory = 0.2),
            metadata(|m| m.scene_hash += 1),
            metadata(|m| m.generator_version += 1),
            series(|s| s.growth.per_load_m_n = 2e-3),
            series(|s| s.growth.per_log_m = 1e-4),
            series(|s| s.growth.powers[2] = 1e-9),
            series(|s| s.patches = &[PATCHES[1], PATCHES[0]]),
            series(|s| s.coefficients = &[1e-4, -0.1, 1e-4, 0.01, 2e-4, -0.09, 1e-4, 0.012]),
        ];
        for (k, table) in changed.iter().enumerate() {
            assert!(!table.is_intact() && table.crc != table.checksum(), "change {k}");
        }
        // A right checksum does not make up for numbers that do not fit together.
        let short = Table { series: ArcSeries { coefficients: &COEFFICIENTS[..7], ..good.series }, ..good };
        assert!(!Table { crc: short.checksum(), ..short }.is_intact());
    }

    /// Boards keep tables with their checksums in flash, so it must not change from version to version.
    #[test]
    fn the_checksum_is_that_of_these_bytes() {
        let mut bytes = vec![3];
        let middles_and_inverse_half_widths = [8.5, 2.0 / 15.0, 21.5, 2.0 / 37.0];
        let mut floats = |values: &[f32]| bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        floats(&[0.0, 1.0, 16.0, 3.0, 40.0]);
        floats(&middles_and_inverse_half_widths);
        floats(&[5e-6, 2e-3, 0.01, 1e-4, 0.02, 0.1]);
        bytes.extend([0x78, 0x56, 0x34, 0x12, crate::GENERATOR_VERSION as u8, 0, 3, 2, 2, 2]);
        let mut floats = |values: &[f32]| bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        floats(&[1e-3, 0.0, 2.5, 0.01, 4.0, 10.0, 0.01, 16.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4e-4]);
        floats(&COEFFICIENTS);
        assert_eq!(table().checksum(), crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes));
    }

    #[test]
    fn nothing_is_known_exactly_and_nothing_not_at_all() {
        assert_eq!(Uncertainty::from_numbers(KNOWN.numbers()), Some(KNOWN));
        for place in 0..4 {
            let with = |number| {
                let mut numbers = KNOWN.numbers();
                numbers[place] = number;
                Uncertainty::from_numbers(numbers)
            };
            assert!([1e-6, 0.5].into_iter().all(|number| with(number).is_some()));
            assert!([0.0, 0.9e-6, 0.51, -0.1, f32::NAN].into_iter().all(|number| with(number).is_none()), "{place}");
        }
    }
}
