//! A table's numbers evaluated in f64: the difference to the f32 lookup is the rounding of its arithmetic.

use crate::arc::ArcSeries;
use crate::arc_growth::arc_at;

/// A polynomial, the highest power first.
fn descend<'a>(coefficients: impl IntoIterator<Item = &'a f32>, x: f64) -> f64 {
    coefficients.into_iter().fold(0.0, |value, c| value * x + f64::from(*c))
}

/// Gap (m) and ∂G/∂θ (m/rad).
pub(crate) fn evaluate(series: &ArcSeries<'_>, load_n: f64, twist_rad: f64) -> [f64; 2] {
    let (arc, arc_by_twist) = arc_at(&series.growth, load_n, twist_rad);
    let last = series.patches.len() - 1;
    let k = series.patches.iter().position(|p| load_n <= f64::from(p.load_max_n)).unwrap_or(last);
    let [load_0, arc_0] = series.patches[k].centre.map(f64::from);
    let terms = series.shape.terms();
    let (mut square, mut by_arc) = (0.0, 0.0);
    for column in series.coefficients[k * terms..(k + 1) * terms].chunks(usize::from(series.shape.rows)) {
        by_arc = by_arc * (arc - arc_0) + square;
        square = square * (arc - arc_0) + descend(column, load_n - load_0);
    }
    [square.sqrt(), 0.5 * by_arc / square.sqrt() * arc_by_twist]
}
