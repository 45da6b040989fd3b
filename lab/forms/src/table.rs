//! A form with its numbers, its range and its maps, ready for lookups.

use crate::form::Form;
use tsa_table::Point;

/// The map of the load. The gap varies like 1/F at light loads (eq. 6), which no polynomial in F follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadMap {
    /// F/(F + b): one division, no transcendental function.
    Ratio {
        /// b (N).
        knee_n: f32,
    },
    /// ln F.
    Log,
    /// F^(−1/2).
    InverseRoot,
}

impl LoadMap {
    /// The mapped coordinate and its derivative by F. `load_n` must be above 0.
    #[inline]
    pub fn apply(self, load_n: f32) -> (f32, f32) {
        match self {
            Self::Ratio { knee_n } => {
                let inverse = 1.0 / (load_n + knee_n);
                (load_n * inverse, knee_n * inverse * inverse)
            }
            Self::Log => (libm::logf(load_n), 1.0 / load_n),
            Self::InverseRoot => {
                let root = 1.0 / libm::sqrtf(load_n);
                (root, -0.5 * root / load_n)
            }
        }
    }

    /// The load at a mapped coordinate, in f64 for the fit.
    #[cfg(feature = "std")]
    pub fn invert(self, coordinate: f64) -> f64 {
        match self {
            Self::Ratio { knee_n } => f64::from(knee_n) * coordinate / (1.0 - coordinate),
            Self::Log => coordinate.exp(),
            Self::InverseRoot => coordinate.powi(-2),
        }
    }

    /// The mapped coordinate in f64 for the fit.
    #[cfg(feature = "std")]
    pub fn apply_f64(self, load_n: f64) -> f64 {
        match self {
            Self::Ratio { knee_n } => load_n / (load_n + f64::from(knee_n)),
            Self::Log => load_n.ln(),
            Self::InverseRoot => load_n.powf(-0.5),
        }
    }
}

/// An affine map of a coordinate to [−1, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Middle of the range.
    pub centre: f32,
    /// 1 over half its width.
    pub inverse_half: f32,
}

impl Axis {
    /// The axis from `start` to `end`.
    pub fn new(start: f32, end: f32) -> Self {
        Self { centre: 0.5 * (start + end), inverse_half: 2.0 / (end - start) }
    }

    /// Position on the axis.
    #[inline]
    pub fn apply(self, coordinate: f32) -> f32 {
        (coordinate - self.centre) * self.inverse_half
    }

    /// Coordinate of a position, in f64 for the fit.
    #[cfg(feature = "std")]
    pub fn invert(self, position: f64) -> f64 {
        f64::from(self.centre) + position / f64::from(self.inverse_half)
    }
}

/// A table of another form. It is only compared, so it has neither certificate nor checksum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Table<N> {
    /// Minimum and maximum load covered (N).
    pub load_n: [f32; 2],
    /// Minimum and maximum twist covered (rad).
    pub twist_rad: [f32; 2],
    /// Map of the load.
    pub load_map: LoadMap,
    /// Mapped load to [−1, 1].
    pub load_axis: Axis,
    /// Twist to [−1, 1].
    pub twist_axis: Axis,
    /// What the numbers mean.
    pub form: Form,
    /// The numbers.
    pub numbers: N,
}

/// `value` limited to [min, max]; `min` for NaN.
#[inline]
fn limited(value: f32, [min, max]: [f32; 2]) -> f32 {
    let value = if value > min { value } else { min };
    if value < max { value } else { max }
}

impl Table<&[f32]> {
    /// Gap and gradient at a load (N) and a twist (rad), each moved to the nearest edge where it is outside.
    // Neither inlined nor generic: its callers are optimised for size, this crate for speed.
    #[inline(never)]
    pub fn point_inside(&self, load_n: f32, twist_rad: f32) -> Point {
        let load_n = limited(load_n, self.load_n);
        let twist_rad = limited(twist_rad, self.twist_rad);
        let (coordinate, by_load) = self.load_map.apply(load_n);
        let (x, y) = (self.load_axis.apply(coordinate), self.twist_axis.apply(twist_rad));
        let v = self.form.evaluate(self.numbers, x, y);
        Point {
            gap_m: v.value,
            dgap_dtwist_m_per_rad: v.by_y * self.twist_axis.inverse_half,
            dgap_dload_m_per_n: v.by_x * self.load_axis.inverse_half * by_load,
        }
    }
}

#[cfg(feature = "std")]
impl Table<Vec<f32>> {
    /// For lookups.
    pub fn table(&self) -> Table<&[f32]> {
        let Self { load_n, twist_rad, load_map, load_axis, twist_axis, form, .. } = *self;
        Table { load_n, twist_rad, load_map, load_axis, twist_axis, form, numbers: &self.numbers }
    }

    /// Bytes of numbers.
    pub fn bytes(&self) -> usize {
        let rows = if let Form::Series { rows, .. } = self.form { usize::from(rows) } else { 0 };
        rows + 4 * self.numbers.len()
    }

    /// Instructions of one lookup with gradient on the board in the worst case, predicted; see
    /// [`tsa_table::instruction_model`].
    pub fn instructions(&self) -> u32 {
        let map = match self.load_map {
            LoadMap::Ratio { .. } => 6,
            LoadMap::InverseRoot => 66,
            LoadMap::Log => 100,
        };
        map + match &self.form {
            Form::Series { rows, .. } => 157 + 35 * u32::from(*rows) + 3 * self.numbers.len() as u32,
            Form::Hermite { .. } => 320,
            Form::Bilinear { .. } => 187,
        }
    }
}
