//! A table with its metadata, and the forward lookup.

use crate::arc::ArcSeries;
use crate::axis::{Axis, LoadMap};
use crate::form::{self, Form, Value};

/// What a table says of itself. Generated with the numbers; a consumer repeats none of it.
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
    /// Bend of the load axis.
    pub load_map: LoadMap,
    /// Mapped load to [−1, 1].
    pub load_axis: Axis,
    /// Twist to [−1, 1].
    pub twist_axis: Axis,
    /// Largest error of the contraction against the full solver that the certificate found (m).
    pub contraction_error_m: f32,
    /// Largest relative error of TR that the certificate found.
    pub tr_relative_error: f32,
    /// Hash of the scene that the table was made for.
    pub scene_hash: u32,
    /// [`crate::GENERATOR_VERSION`] of the generator.
    pub generator_version: u16,
}

/// A table ready to be asked.
#[derive(Clone, Copy, Debug)]
pub struct Table<'a> {
    /// What it says of itself.
    pub metadata: Metadata,
    /// Its numbers.
    pub form: Form<'a>,
    /// CRC-32 over metadata and numbers, see [`Table::checksum`].
    pub crc: u32,
}

/// The mechanism at a load and a twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Gap G between the clamps (m).
    pub gap_m: f32,
    /// ∂G/∂θ at constant load (m/rad), negative.
    pub dgap_dtwist_m_per_rad: f32,
    /// ∂G/∂F at constant twist (m/N), positive.
    pub dgap_dload_m_per_n: f32,
}

impl Point {
    /// TR = −1/(∂G/∂θ) (rad/m), eq. 29.
    #[inline]
    pub fn tr_rad_per_m(&self) -> f32 {
        -1.0 / self.dgap_dtwist_m_per_rad
    }
}

/// A load or a twist that the table does not cover. It is refused, never extrapolated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{parameter} {value} is outside the table's range, {min} to {max}")]
pub struct OutOfRange {
    /// `load_n`, `twist_rad` or `gap_m`.
    pub parameter: &'static str,
    /// What was asked for.
    pub value: f32,
    /// Least value covered.
    pub min: f32,
    /// Greatest value covered.
    pub max: f32,
}

/// Relative slack at the edges of the envelope, for what rounding to f32 does to a value that is on the edge.
const EDGE: f32 = 1e-6;

/// `value`, or the end of [min, max] that it is beyond; `min` for NaN. By comparisons: `clamp` panics on a bad range,
/// `max` and `min` are library calls on the board.
#[inline]
fn onto(value: f32, min: f32, max: f32) -> f32 {
    let value = if value > min { value } else { min };
    if value < max { value } else { max }
}

/// `value` if it is in [min, max] up to rounding, moved onto the edge if it is just outside.
#[inline]
fn within(parameter: &'static str, value: f32, min: f32, max: f32) -> Result<f32, OutOfRange> {
    let slack = EDGE * (max - min);
    // Written so that NaN is refused.
    if value >= min - slack && value <= max + slack {
        Ok(onto(value, min, max))
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
        Ok(self.evaluate(self.load_inside(load_n)?, self.twist_inside(twist_rad)?))
    }

    /// The load (N) if the table covers it.
    #[inline]
    pub(crate) fn load_inside(&self, load_n: f32) -> Result<f32, OutOfRange> {
        within("load_n", load_n, self.metadata.load_min_n, self.metadata.load_max_n)
    }

    /// The twist (rad) if the table covers it.
    #[inline]
    pub(crate) fn twist_inside(&self, twist_rad: f32) -> Result<f32, OutOfRange> {
        within("twist_rad", twist_rad, self.metadata.twist_min_rad, self.metadata.twist_max_rad)
    }

    /// As [`Table::look_up`] with load and twist moved to the nearest edge where they are outside: for a caller that
    /// keeps them inside itself and must not stop for the last bit. NaN counts as the lower edge.
    #[inline]
    pub fn point_inside(&self, load_n: f32, twist_rad: f32) -> Point {
        let m = &self.metadata;
        let load_n = onto(load_n, m.load_min_n, m.load_max_n);
        self.evaluate(load_n, onto(twist_rad, m.twist_min_rad, m.twist_max_rad))
    }

    /// As [`Table::look_up`] for a load and a twist that are known to be inside.
    #[inline]
    pub(crate) fn evaluate(&self, load_n: f32, twist_rad: f32) -> Point {
        match &self.form {
            Form::Arc(series) => series.evaluate(load_n, twist_rad),
            _ => self.evaluate_on_axes(load_n, twist_rad),
        }
    }

    /// The forms that have the metadata's axes. Apart, so that the other one does not pay for their registers.
    #[inline(never)]
    fn evaluate_on_axes(&self, load_n: f32, twist_rad: f32) -> Point {
        let m = &self.metadata;
        let place = || {
            let (coordinate, by_load) = m.load_map.apply(load_n);
            (m.load_axis.apply(coordinate), m.twist_axis.apply(twist_rad), by_load)
        };
        let point = |v: Value, by_load: f32| Point {
            gap_m: v.value,
            dgap_dtwist_m_per_rad: v.by_y * m.twist_axis.inverse_half,
            dgap_dload_m_per_n: v.by_x * m.load_axis.inverse_half * by_load,
        };
        match self.form {
            Form::Series { row_lengths, coefficients } => {
                let (x, y, by_load) = place();
                point(form::series(row_lengths, coefficients, x, y), by_load)
            }
            Form::Hermite { loads, twists, nodes } => {
                let (x, y, by_load) = place();
                point(form::hermite(usize::from(loads), usize::from(twists), nodes, x, y), by_load)
            }
            Form::Bilinear { loads, twists, nodes } => {
                let (x, y, by_load) = place();
                point(form::bilinear(usize::from(loads), usize::from(twists), nodes, x, y), by_load)
            }
            Form::Arc(_) => point(Value::NONE, f32::NAN),
        }
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
        let (kind, knee) = match m.load_map {
            LoadMap::Ratio { knee_n } => (0u8, knee_n),
            LoadMap::Log => (1, 0.0),
            LoadMap::InverseRoot => (2, 0.0),
            LoadMap::Linear => (3, 0.0),
        };
        digest.update(&[kind]);
        let header = [
            knee,
            m.load_min_n,
            m.load_max_n,
            m.twist_min_rad,
            m.twist_max_rad,
            m.load_axis.centre,
            m.load_axis.inverse_half,
            m.twist_axis.centre,
            m.twist_axis.inverse_half,
            m.contraction_error_m,
            m.tr_relative_error,
        ];
        for value in header {
            digest.update(&value.to_le_bytes());
        }
        digest.update(&m.scene_hash.to_le_bytes());
        digest.update(&m.generator_version.to_le_bytes());
        match self.form {
            Form::Series { row_lengths, coefficients } => {
                digest.update(&[0]);
                digest.update(row_lengths);
                for c in coefficients {
                    digest.update(&c.to_le_bytes());
                }
            }
            Form::Hermite { loads, twists, nodes } => {
                digest.update(&[1, loads, twists]);
                for value in nodes.iter().flatten() {
                    digest.update(&value.to_le_bytes());
                }
            }
            Form::Arc(ArcSeries { growth, shape, patches, coefficients }) => {
                digest.update(&[3, shape.rows, shape.columns, patches.len() as u8]);
                digest.update(&growth.per_load_m_n.to_le_bytes());
                for p in patches {
                    for value in p.centre.iter().chain([&p.load_max_n]) {
                        digest.update(&value.to_le_bytes());
                    }
                }
                for c in growth.powers.iter().chain(coefficients) {
                    digest.update(&c.to_le_bytes());
                }
            }
            Form::Bilinear { loads, twists, nodes } => {
                digest.update(&[2]);
                digest.update(&loads.to_le_bytes());
                digest.update(&twists.to_le_bytes());
                for value in nodes {
                    digest.update(&value.to_le_bytes());
                }
            }
        }
        digest.finalize()
    }

    /// Whether shape and checksum are right: the firmware asks at boot and uses no table that fails.
    pub fn is_intact(&self) -> bool {
        self.form.is_consistent() && self.crc == self.checksum()
    }
}
