//! The mixed form: a little of the mechanism's own geometry, and short polynomials for the rest.
//!
//! Everything that twist does to the equilibrium it does through the arc a = θ r that the strings add to the
//! horizontal run (eq. 25), and eq. 6 says how r depends on load and twist: a = κ θ/F + ρ(θ). In load and arc the gap
//! has neither the 1/F of a light load nor the fractional power of the radius law, and its square is smoother still:
//! G² ≈ L0² − (D + a)². So G² is a short polynomial in F and a, on a few ranges of the load.

use crate::axis::Axis;
use crate::form::series;
use crate::lookup::Point;

/// a(F, θ) = κ θ/F + ρ(θ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth<'a> {
    /// κ = r0/k1 (m N).
    pub per_load_m_n: f32,
    /// ρ in powers of the twist (m/rad^i), from the first power on; it vanishes with the twist.
    pub powers: &'a [f32],
}

/// One range of the load: where its rows and coefficients stand in the form's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Panel {
    /// Greatest load of the range (N).
    pub load_max_n: f32,
    /// Load to [−1, 1].
    pub load_axis: Axis,
    /// Arc to [−1, 1].
    pub arc_axis: Axis,
    /// First row and number of rows.
    pub rows: [u8; 2],
    /// First coefficient and number of coefficients.
    pub terms: [u16; 2],
}

impl Panel {
    /// Bytes of numbers beside rows and coefficients.
    pub const BYTES: usize = 26;

    /// Its part of the form's rows and coefficients; nothing where the form is too short.
    #[inline]
    pub(crate) fn part<'a>(&self, row_lengths: &'a [u8], coefficients: &'a [f32]) -> Option<(&'a [u8], &'a [f32])> {
        let ([row, rows], [term, terms]) = (self.rows.map(usize::from), self.terms.map(usize::from));
        Some((row_lengths.get(row..row + rows)?, coefficients.get(term..term + terms)?))
    }
}

/// Arc and its derivatives by twist and load.
#[inline]
fn arc(growth: &Growth<'_>, load_n: f32, twist_rad: f32) -> [f32; 3] {
    let per_twist = growth.per_load_m_n / load_n;
    let (mut value, mut slope) = (0.0f32, 0.0f32);
    for c in growth.powers.iter().rev() {
        slope = slope * twist_rad + value;
        value = value * twist_rad + c;
    }
    // ρ = θ · Σ
    let by_load = -per_twist * twist_rad / load_n;
    [twist_rad * (per_twist + value), per_twist + value + twist_rad * slope, by_load]
}

/// Gap and gradient at a load and a twist inside the table. A form that is not consistent answers with NaN.
#[inline]
pub(crate) fn evaluate(
    growth: &Growth<'_>,
    panels: &[Panel],
    row_lengths: &[u8],
    coefficients: &[f32],
    load_n: f32,
    twist_rad: f32,
) -> Point {
    let [arc_m, arc_by_twist, arc_by_load] = arc(growth, load_n, twist_rad);
    let panel = panels.iter().find(|p| load_n <= p.load_max_n).or(panels.last());
    let Some((panel, (rows, terms))) = panel.and_then(|p| Some((p, p.part(row_lengths, coefficients)?))) else {
        return Point { gap_m: f32::NAN, dgap_dtwist_m_per_rad: f32::NAN, dgap_dload_m_per_n: f32::NAN };
    };
    let v = series(rows, terms, panel.load_axis.apply(load_n), panel.arc_axis.apply(arc_m));
    let gap_m = libm::sqrtf(v.value);
    let half = 0.5 / gap_m;
    let by_arc = v.by_y * panel.arc_axis.inverse_half * half;
    Point {
        gap_m,
        dgap_dtwist_m_per_rad: by_arc * arc_by_twist,
        dgap_dload_m_per_n: v.by_x * panel.load_axis.inverse_half * half + by_arc * arc_by_load,
    }
}
