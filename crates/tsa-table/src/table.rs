//! A table with its metadata, and the forward lookup.

use crate::arc::ArcSeries;
use crate::point::Point;

/// What a table covers and how good it is. The generator writes it with the numbers; a consumer repeats none of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metadata {
    /// Least load covered (N).
    pub load_min_n: f32,
    /// Greatest load covered (N).
    pub load_max_n: f32,
    /// Least twist covered (rad); the half-turn pre-twist π or above.
    pub twist_min_rad: f32,
    /// Greatest twist covered (rad).
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
    /// Of the string radius (relative).
    pub radius: f32,
    /// Of the LVDT's zero beside the mechanism's gap (m).
    pub gap_zero_m: f32,
    /// Of how the radius depends on the load: error of a weighed load, and of a change of the load (relative).
    pub load_shape: f32,
    /// Of a light load on rods that have carried a much heavier one since (relative).
    pub rod_memory: f32,
}

impl Uncertainty {
    /// The numbers in the order in which records, messages and the checksum have them.
    pub fn numbers(&self) -> [f32; 4] {
        [self.radius, self.gap_zero_m, self.load_shape, self.rod_memory]
    }

    /// From [`Self::numbers`]; `None` if one of them is not from 1e-6 to 0.5: nothing is known exactly, and the control
    /// code divides by them.
    pub fn from_numbers(numbers: [f32; 4]) -> Option<Self> {
        let [radius, gap_zero_m, load_shape, rod_memory] = numbers;
        let good = numbers.iter().all(|x| (0.99e-6..=0.5).contains(x));
        good.then_some(Self { radius, gap_zero_m, load_shape, rod_memory })
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
    /// Least value covered.
    pub min: f32,
    /// Greatest value covered.
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
