//! A form with its range and its maps, ready for lookups.

use crate::axis::{Axis, LoadMap};
use crate::form::Form;
use tsa_table::Point;

/// A table of another form. It is only compared, so it has neither certificate nor checksum.
#[derive(Clone, Copy, Debug)]
pub struct Table<'a> {
    /// Least and greatest load covered (N).
    pub load_n: [f32; 2],
    /// Least and greatest twist covered (rad).
    pub twist_rad: [f32; 2],
    /// Map of the load.
    pub load_map: LoadMap,
    /// Mapped load to [−1, 1].
    pub load_axis: Axis,
    /// Twist to [−1, 1].
    pub twist_axis: Axis,
    /// The numbers.
    pub form: Form<'a>,
}

/// `value` limited to [min, max]; `min` for NaN.
#[inline]
fn limited(value: f32, [min, max]: [f32; 2]) -> f32 {
    let value = if value > min { value } else { min };
    if value < max { value } else { max }
}

impl Table<'_> {
    /// Gap and gradient at a load (N) and a twist (rad), each moved to the nearest edge where it is outside.
    // Not inlined: its callers are optimised for size, this crate for speed.
    #[inline(never)]
    pub fn point_inside(&self, load_n: f32, twist_rad: f32) -> Point {
        let load_n = limited(load_n, self.load_n);
        let twist_rad = limited(twist_rad, self.twist_rad);
        let (coordinate, by_load) = self.load_map.apply(load_n);
        let v = self.form.evaluate(self.load_axis.apply(coordinate), self.twist_axis.apply(twist_rad));
        Point {
            gap_m: v.value,
            dgap_dtwist_m_per_rad: v.by_y * self.twist_axis.inverse_half,
            dgap_dload_m_per_n: v.by_x * self.load_axis.inverse_half * by_load,
        }
    }

    /// Instructions of one lookup with gradient on the board in the worst case, predicted; see
    /// [`tsa_table::instruction_model`].
    #[cfg(feature = "std")]
    pub fn instructions(&self) -> u32 {
        let map = match self.load_map {
            LoadMap::Ratio { .. } => 6,
            LoadMap::InverseRoot => 66,
            LoadMap::Log => 100,
        };
        map + match &self.form {
            Form::Series { row_lengths, coefficients } => {
                157 + 35 * row_lengths.len() as u32 + 3 * coefficients.len() as u32
            }
            Form::Hermite { .. } => 320,
            Form::Bilinear { .. } => 187,
        }
    }
}
