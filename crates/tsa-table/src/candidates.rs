//! The smallest table of each form on a load map.

use crate::axis::{Axis, LoadMap};
use crate::fit::{Accuracy, Candidate, Exact, FitError, MAX_BYTES, Numbers, Reference, blank_table, errors_over};

/// A candidate must stay this far inside the accuracy on the selection grid, so that the certificate's search passes.
const MARGIN: f64 = 0.8;

/// Sizes that are tried, smallest first: load nodes, twist nodes.
const HERMITE_SIZES: [(u8, u8); 10] =
    [(4, 5), (5, 6), (6, 8), (7, 9), (8, 10), (8, 13), (10, 12), (10, 16), (12, 16), (14, 18)];
const BILINEAR_SIZES: [(u16, u16); 3] = [(8, 16), (16, 32), (16, 64)];
/// Cutting thresholds of the series, from coarse to fine, and how much a term counts for what its slope does to TR.
const THRESHOLDS: u32 = 48;
const SLOPE_WEIGHTS: [f64; 3] = [0.0, 0.02, 0.1];

/// The search on one load map.
pub(crate) struct Search<'a> {
    pub scene_hash: u32,
    pub reference: &'a Reference<'a>,
    pub map: LoadMap,
    pub points: &'a [Exact],
    pub accuracy: &'a Accuracy,
}

impl Search<'_> {
    /// The best table of every form.
    pub(crate) fn candidates(&self) -> Result<Vec<Candidate>, FitError> {
        let coefficients = chebyshev(self.reference, self.map)?;
        let mut series = None;
        for weight in SLOPE_WEIGHTS {
            let thresholds = (0..THRESHOLDS)
                .map(|k| 100.0 * self.accuracy.contraction_m * 10f64.powf(-f64::from(k) / 8.0))
                .map(|threshold| Ok(cut(&coefficients, threshold, weight)));
            self.smallest(thresholds, &mut series)?;
        }
        let mut hermite = None;
        let sizes =
            HERMITE_SIZES.iter().map(|(loads, twists)| hermite_nodes(self.reference, self.map, *loads, *twists));
        self.smallest(sizes, &mut hermite)?;
        let mut bilinear = None;
        let sizes =
            BILINEAR_SIZES.iter().map(|(loads, twists)| bilinear_nodes(self.reference, self.map, *loads, *twists));
        self.smallest(sizes, &mut bilinear)?;
        Ok([series, hermite, bilinear].into_iter().flatten().collect())
    }

    /// Goes through sizes from small to large until one passes; keeps the best seen.
    fn smallest(
        &self,
        sizes: impl Iterator<Item = Result<Numbers, FitError>>,
        best: &mut Option<Candidate>,
    ) -> Result<(), FitError> {
        for numbers in sizes {
            let table = blank_table(self.scene_hash, self.reference, self.map, numbers?);
            let errors = errors_over(&table.table(), self.points);
            let passes = errors.meets(self.accuracy, MARGIN) && table.numbers.form().bytes() <= MAX_BYTES;
            let candidate = Candidate { table, errors, passes };
            if best.as_ref().is_none_or(|b| better(&candidate, b)) {
                *best = Some(candidate);
            }
            if passes {
                break;
            }
        }
        Ok(())
    }
}

/// Passing beats failing; of two that pass the smaller; of two that fail the more accurate.
fn better(a: &Candidate, b: &Candidate) -> bool {
    match (a.passes, b.passes) {
        (true, true) => a.table.numbers.form().bytes() < b.table.numbers.form().bytes(),
        (false, false) => a.errors.contraction_max_m < b.errors.contraction_max_m,
        (passes, _) => passes,
    }
}

/// Axes of a load map over the envelope, as the table will have them.
fn axes(reference: &Reference<'_>, map: LoadMap) -> (Axis, Axis) {
    let [u0, u1] = reference.load_n.map(|f| map.apply_f64(f64::from(f as f32)) as f32);
    let [t0, t1] = reference.twist_rad.map(|t| t as f32);
    (Axis::new(u0, u1), Axis::new(t0, t1))
}

/// Load and twist at a position of the table, kept inside the envelope.
fn state_at(reference: &Reference<'_>, map: LoadMap, x: f64, y: f64) -> (f64, f64) {
    let (load_axis, twist_axis) = axes(reference, map);
    let [f0, f1] = reference.load_n;
    let [t0, t1] = reference.twist_rad;
    (map.invert(load_axis.invert(x)).clamp(f0, f1), twist_axis.invert(y).clamp(t0, t1))
}

/// Chebyshev coefficients of the gap on an N × N grid of Chebyshev points.
fn chebyshev(reference: &Reference<'_>, map: LoadMap) -> Result<Vec<Vec<f64>>, FitError> {
    const N: usize = 30;
    let angle = |i: usize| std::f64::consts::PI * (i as f64 + 0.5) / N as f64;
    let mut gap = vec![vec![0.0; N]; N];
    for (i, row) in gap.iter_mut().enumerate() {
        for (j, g) in row.iter_mut().enumerate() {
            let (load, twist) = state_at(reference, map, angle(i).cos(), angle(j).cos());
            *g = reference.solve(load, twist)?.gap_m;
        }
    }
    let transform = |values: &[f64]| -> Vec<f64> {
        (0..N)
            .map(|k| {
                let sum: f64 = values.iter().enumerate().map(|(i, v)| v * (k as f64 * angle(i)).cos()).sum();
                sum * if k == 0 { 1.0 } else { 2.0 } / N as f64
            })
            .collect()
    };
    let along_twist: Vec<Vec<f64>> = gap.iter().map(|row| transform(row)).collect();
    let mut coefficients = vec![vec![0.0; N]; N];
    for j in 0..N {
        let column: Vec<f64> = along_twist.iter().map(|row| row[j]).collect();
        for (i, c) in transform(&column).into_iter().enumerate() {
            coefficients[i][j] = c;
        }
    }
    Ok(coefficients)
}

/// Σ c_k T_k written in powers.
fn powers(chebyshev: &[f64]) -> Vec<f64> {
    let n = chebyshev.len();
    let (mut previous, mut current) = (vec![0.0; n], vec![0.0; n]);
    let mut sum = vec![0.0; n];
    if n == 0 {
        return sum;
    }
    previous[0] = 1.0;
    if n > 1 {
        current[1] = 1.0;
    }
    sum[0] = chebyshev[0];
    for c in &chebyshev[1..] {
        for (s, t) in sum.iter_mut().zip(&current) {
            *s += c * t;
        }
        let mut next: Vec<f64> = previous.iter().map(|p| -p).collect();
        for k in 1..n {
            next[k] += 2.0 * current[k - 1];
        }
        previous = std::mem::replace(&mut current, next);
    }
    sum
}

/// Rows of Chebyshev coefficients, no row longer than the one before, to powers of both axes: down each column, then
/// along each row. Row lengths and coefficients, the highest powers first.
pub(crate) fn in_powers(rows: &[Vec<f64>]) -> (Vec<u8>, Vec<f32>) {
    let width = rows.iter().map(Vec::len).max().unwrap_or(0);
    let mut in_x = vec![vec![0.0; width]; rows.len()];
    for j in 0..width {
        let column: Vec<f64> = rows.iter().map(|r| r.get(j).copied().unwrap_or(0.0)).collect();
        for (row, p) in in_x.iter_mut().zip(powers(&column)) {
            row[j] = p;
        }
    }
    let written = in_x.iter().zip(rows).rev();
    let coefficients =
        written.flat_map(|(row, kept)| powers(&row[..kept.len()]).into_iter().rev()).map(|p| p as f32).collect();
    (rows.iter().rev().map(|row| row.len() as u8).collect(), coefficients)
}

/// Cuts a Chebyshev array where its terms fall below `threshold`, and writes it in powers.
/// `slope_weight` lets a term count more for what its derivative does to TR.
fn cut(coefficients: &[Vec<f64>], threshold: f64, slope_weight: f64) -> Numbers {
    let counts = |j: usize, c: f64| c.abs() * (1.0 + slope_weight * (j * j) as f64) > threshold;
    let mut rows: Vec<Vec<f64>> = coefficients
        .iter()
        .map(|row| {
            let last = row.iter().enumerate().rposition(|(j, c)| counts(j, *c));
            row[..last.map_or(0, |l| l + 1)].to_vec()
        })
        .collect();
    let last = rows.iter().rposition(|r| !r.is_empty()).unwrap_or(0);
    rows.truncate(last + 1);
    // In powers of x a row also feeds the rows two, four … below it, so lengths must not grow with i.
    for i in (0..rows.len().saturating_sub(1)).rev() {
        let need = rows[i + 1..].iter().map(Vec::len).max().unwrap_or(0);
        let have = rows[i].len();
        if have < need {
            rows[i].extend_from_slice(&coefficients[i][have..need]);
        }
    }
    let (row_lengths, coefficients) = in_powers(&rows);
    Numbers::Series { row_lengths, coefficients }
}

fn hermite_nodes(reference: &Reference<'_>, map: LoadMap, loads: u8, twists: u8) -> Result<Numbers, FitError> {
    let (load_axis, twist_axis) = axes(reference, map);
    let (hx, hy) = (2.0 / f64::from(loads - 1), 2.0 / f64::from(twists - 1));
    let [t0, t1] = reference.twist_rad;
    let mut nodes = Vec::new();
    for i in 0..loads {
        for j in 0..twists {
            let (x, y) = (-1.0 + hx * f64::from(i), -1.0 + hy * f64::from(j));
            let (load, twist) = state_at(reference, map, x, y);
            let e = reference.solve(load, twist)?;
            // dF/dx of the map by its own derivative.
            let step = 1e-6 * load;
            let slope = (map.apply_f64(load + step) - map.apply_f64(load - step)) / (2.0 * step);
            let load_by_x = 1.0 / (f64::from(load_axis.inverse_half) * slope);
            let twist_by_y = 1.0 / f64::from(twist_axis.inverse_half);
            // The mixed derivative is the slope of ∂G/∂F along the twist.
            let (a, b) = ((twist - 1e-3).max(t0), (twist + 1e-3).min(t1));
            let mixed =
                (reference.solve(load, b)?.dgap_dload_m_per_n - reference.solve(load, a)?.dgap_dload_m_per_n) / (b - a);
            nodes.push([
                e.gap_m as f32,
                (hx * e.dgap_dload_m_per_n * load_by_x) as f32,
                (hy * e.dgap_dtwist_m_per_rad * twist_by_y) as f32,
                (hx * hy * mixed * load_by_x * twist_by_y) as f32,
            ]);
        }
    }
    Ok(Numbers::Hermite { loads, twists, nodes })
}

fn bilinear_nodes(reference: &Reference<'_>, map: LoadMap, loads: u16, twists: u16) -> Result<Numbers, FitError> {
    let at = |k: u16, count: u16| 2.0 * f64::from(k) / f64::from(count - 1) - 1.0;
    let mut nodes = Vec::new();
    for i in 0..loads {
        for j in 0..twists {
            let (load, twist) = state_at(reference, map, at(i, loads), at(j, twists));
            nodes.push(reference.solve(load, twist)?.gap_m as f32);
        }
    }
    Ok(Numbers::Bilinear { loads, twists, nodes })
}
