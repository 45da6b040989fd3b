//! A table's numbers evaluated in f64: what its f32 arithmetic is measured against.

use crate::axis::Axis;
use crate::form::Form;
use crate::lookup::Table;

fn place(axis: Axis, coordinate: f64) -> f64 {
    (coordinate - f64::from(axis.centre)) * f64::from(axis.inverse_half)
}

/// Value and slope, the highest power first.
fn descend<'a>(coefficients: impl IntoIterator<Item = &'a f32>, x: f64) -> [f64; 2] {
    coefficients.into_iter().fold([0.0, 0.0], |[value, slope], c| [value * x + f64::from(*c), slope * x + value])
}

/// Gap (m) and ∂G/∂θ (m/rad) of the forms that are polynomials.
pub(crate) fn evaluate(table: &Table<'_>, load_n: f64, twist_rad: f64) -> Option<[f64; 2]> {
    let m = &table.metadata;
    let x = place(m.load_axis, m.load_map.apply_f64(load_n));
    let y = place(m.twist_axis, twist_rad);
    let twist_scale = f64::from(m.twist_axis.inverse_half);
    Some(match table.form {
        Form::Arc(s) => {
            let [sum, sum_slope] = descend(&s.growth.powers, twist_rad);
            let per_twist = f64::from(s.growth.per_load_m_n) / load_n;
            let arc = twist_rad * (per_twist + sum);
            let arc_by_twist = per_twist + sum + twist_rad * sum_slope;
            let last = s.patches.len() - 1;
            let k = s.patches.iter().position(|p| load_n <= f64::from(p.load_max_n)).unwrap_or(last);
            let [load_0, arc_0] = s.patches[k].centre.map(f64::from);
            let terms = s.shape.terms();
            let (mut square, mut by_arc) = (0.0, 0.0);
            for column in s.coefficients[k * terms..(k + 1) * terms].chunks(usize::from(s.shape.rows)) {
                by_arc = by_arc * (arc - arc_0) + square;
                square = square * (arc - arc_0) + descend(column, load_n - load_0)[0];
            }
            [square.sqrt(), 0.5 * by_arc / square.sqrt() * arc_by_twist]
        }
        Form::Series { row_lengths, coefficients } => {
            let (mut value, mut slope, mut rest) = (0.0, 0.0, coefficients);
            for length in row_lengths {
                let (row, after) = rest.split_at(usize::from(*length));
                let [v, s] = descend(row, y);
                (value, slope, rest) = (value * x + v, slope * x + s, after);
            }
            [value, slope * twist_scale]
        }
        // A few sums of products: nothing to add up.
        Form::Hermite { .. } | Form::Bilinear { .. } => return None,
    })
}
