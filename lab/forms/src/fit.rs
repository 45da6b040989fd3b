//! The smallest table of each form on each load map.

use crate::form::{Form, MAX_ROWS};
use crate::table::{Axis, LoadMap, Table};
use tsa_model::{Mechanism, Tier};
use tsa_table::TableSpec;
use tsa_table::errors::errors_over;
use tsa_table::fit::{Errors, FitError, MAX_BYTES};
use tsa_table::reference::{Exact, Reference};

/// Load maps that are tried.
const LOAD_MAPS: [LoadMap; 5] = [
    LoadMap::Ratio { knee_n: 0.5 },
    LoadMap::Ratio { knee_n: 1.0 },
    LoadMap::Ratio { knee_n: 2.0 },
    LoadMap::Log,
    LoadMap::InverseRoot,
];

/// A candidate must stay within this fraction of the accuracy on the selection grid.
const SELECTION_FRACTION: f64 = 0.8;

/// Sizes that are tried, smallest first: load nodes, twist nodes.
const HERMITE_SIZES: [(u16, u16); 10] =
    [(4, 5), (5, 6), (6, 8), (7, 9), (8, 10), (8, 13), (10, 12), (10, 16), (12, 16), (14, 18)];
const BILINEAR_SIZES: [(u16, u16); 3] = [(8, 16), (16, 32), (16, 64)];
/// Cutting thresholds of the series, from coarse to fine, and weights of a term's slope, which decides its effect on
/// TR.
const THRESHOLDS: u32 = 48;
const SLOPE_WEIGHTS: [f64; 3] = [0.0, 0.02, 0.1];

/// One candidate: the smallest table of its form and load map that passes, or the most accurate one tried.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The table.
    pub table: Table<Vec<f32>>,
    /// Errors on the selection grid.
    pub errors: Errors,
    /// Whether it meets the accuracy within [`MAX_BYTES`].
    pub passes: bool,
}

/// The best table of every other form on every load map.
///
/// # Errors
/// [`FitError::Envelope`].
pub fn candidates(mechanism: &Mechanism, table_spec: &TableSpec) -> Result<Vec<Candidate>, FitError> {
    let reference = Reference::new(mechanism, Tier::Full, table_spec);
    let points = reference.selection_grid()?;
    let mut all = Vec::new();
    for map in LOAD_MAPS {
        all.extend(Search { reference: &reference, map, points: &points, table_spec }.candidates()?);
    }
    Ok(all)
}

/// Numbers, and what they mean.
type Numbers = (Form, Vec<f32>);

/// The search on one load map.
struct Search<'a> {
    reference: &'a Reference<'a>,
    map: LoadMap,
    points: &'a [Exact],
    table_spec: &'a TableSpec,
}

impl Search<'_> {
    /// The best table of every form.
    fn candidates(&self) -> Result<Vec<Candidate>, FitError> {
        let coefficients = self.chebyshev()?;
        let mut series = None;
        for weight in SLOPE_WEIGHTS {
            let thresholds = (0..THRESHOLDS)
                .map(|k| 100.0 * self.table_spec.accuracy.contraction_m * 10f64.powf(-f64::from(k) / 8.0))
                .map(|threshold| Ok(cut(&coefficients, threshold, weight)));
            self.smallest(thresholds, &mut series)?;
        }
        let [mut hermite, mut bilinear] = [None, None];
        self.smallest(HERMITE_SIZES.into_iter().map(|size| self.hermite(size)), &mut hermite)?;
        self.smallest(BILINEAR_SIZES.into_iter().map(|size| self.bilinear(size)), &mut bilinear)?;
        Ok([series, hermite, bilinear].into_iter().flatten().collect())
    }

    /// Tries sizes from small to large until one passes; `best` becomes the best so far.
    fn smallest(
        &self,
        sizes: impl Iterator<Item = Result<Numbers, FitError>>,
        best: &mut Option<Candidate>,
    ) -> Result<(), FitError> {
        for size in sizes {
            let (form, numbers) = size?;
            let (load_axis, twist_axis) = self.axes();
            let [load_n, twist_rad] = [self.reference.load_n, self.reference.twist_rad].map(|r| r.map(|v| v as f32));
            let table = Table { load_n, twist_rad, load_map: self.map, load_axis, twist_axis, form, numbers };
            let errors = errors_over(|load_n, twist_rad| table.table().point_inside(load_n, twist_rad), self.points);
            let passes = errors.meets(&self.table_spec.accuracy, SELECTION_FRACTION) && table.bytes() <= MAX_BYTES;
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

    /// Axes of the load map and of the twist over the reference's range.
    fn axes(&self) -> (Axis, Axis) {
        let [u0, u1] = self.reference.load_n.map(|f| self.map.apply_f64(f64::from(f as f32)) as f32);
        let [t0, t1] = self.reference.twist_rad.map(|t| t as f32);
        (Axis::new(u0, u1), Axis::new(t0, t1))
    }

    /// Load and twist at a position of the table, limited to the range.
    fn state_at(&self, x: f64, y: f64) -> (f64, f64) {
        let (load_axis, twist_axis) = self.axes();
        let ([f0, f1], [t0, t1]) = (self.reference.load_n, self.reference.twist_rad);
        (self.map.invert(load_axis.invert(x)).clamp(f0, f1), twist_axis.invert(y).clamp(t0, t1))
    }

    /// Chebyshev coefficients of the gap on an N × N grid of Chebyshev points.
    fn chebyshev(&self) -> Result<Vec<Vec<f64>>, FitError> {
        const N: usize = MAX_ROWS;
        let angle = |i: usize| std::f64::consts::PI * (i as f64 + 0.5) / N as f64;
        let mut gap = vec![vec![0.0; N]; N];
        for (i, row) in gap.iter_mut().enumerate() {
            for (j, g) in row.iter_mut().enumerate() {
                let (load, twist) = self.state_at(angle(i).cos(), angle(j).cos());
                *g = self.reference.solve(load, twist)?.gap_m;
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

    fn hermite(&self, (loads, twists): (u16, u16)) -> Result<Numbers, FitError> {
        let (load_axis, twist_axis) = self.axes();
        let (hx, hy) = (2.0 / f64::from(loads - 1), 2.0 / f64::from(twists - 1));
        let [t0, t1] = self.reference.twist_rad;
        let mut nodes = Vec::new();
        for i in 0..loads {
            for j in 0..twists {
                let (x, y) = (-1.0 + hx * f64::from(i), -1.0 + hy * f64::from(j));
                let (load, twist) = self.state_at(x, y);
                let e = self.reference.solve(load, twist)?;
                // dF/dx of the map by its own derivative.
                let step = 1e-6 * load;
                let slope = (self.map.apply_f64(load + step) - self.map.apply_f64(load - step)) / (2.0 * step);
                let load_by_x = 1.0 / (f64::from(load_axis.inverse_half) * slope);
                let twist_by_y = 1.0 / f64::from(twist_axis.inverse_half);
                // The mixed derivative is the slope of ∂G/∂F along the twist.
                let (a, b) = ((twist - 1e-3).max(t0), (twist + 1e-3).min(t1));
                let mixed = (self.reference.solve(load, b)?.dgap_dload_m_per_n
                    - self.reference.solve(load, a)?.dgap_dload_m_per_n)
                    / (b - a);
                nodes.extend([
                    e.gap_m as f32,
                    (hx * e.dgap_dload_m_per_n * load_by_x) as f32,
                    (hy * e.dgap_dtwist_m_per_rad * twist_by_y) as f32,
                    (hx * hy * mixed * load_by_x * twist_by_y) as f32,
                ]);
            }
        }
        Ok((Form::Hermite { loads, twists }, nodes))
    }

    fn bilinear(&self, (loads, twists): (u16, u16)) -> Result<Numbers, FitError> {
        let at = |k: u16, count: u16| 2.0 * f64::from(k) / f64::from(count - 1) - 1.0;
        let mut nodes = Vec::new();
        for i in 0..loads {
            for j in 0..twists {
                let (load, twist) = self.state_at(at(i, loads), at(j, twists));
                nodes.push(self.reference.solve(load, twist)?.gap_m as f32);
            }
        }
        Ok((Form::Bilinear { loads, twists }, nodes))
    }
}

/// Passing beats failing; of two that pass the smaller; of two that fail the more accurate.
fn better(a: &Candidate, b: &Candidate) -> bool {
    match (a.passes, b.passes) {
        (true, true) => a.table.bytes() < b.table.bytes(),
        (false, false) => a.errors.contraction_max_m < b.errors.contraction_max_m,
        (passes, _) => passes,
    }
}

/// Σ c_k T_k written in powers.
fn powers(chebyshev: &[f64]) -> Vec<f64> {
    let n = chebyshev.len();
    // T_k and T_(k + 1).
    let [mut term, mut next] = [vec![0.0; n + 2], vec![0.0; n + 2]];
    (term[0], next[1]) = (1.0, 1.0);
    let mut sum = vec![0.0; n];
    for c in chebyshev {
        sum.iter_mut().zip(&term).for_each(|(sum, t)| *sum += c * t);
        let mut after: Vec<f64> = term.iter().map(|t| -t).collect();
        after[1..].iter_mut().zip(&next).for_each(|(after, t)| *after += 2.0 * t);
        (term, next) = (next, after);
    }
    sum
}

/// Converts rows of Chebyshev coefficients, no row longer than the one before, to powers of both axes: down each
/// column, then along each row, the highest powers first.
fn in_powers(rows: &[Vec<f64>]) -> Numbers {
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
    let mut row_lengths = [0; MAX_ROWS];
    row_lengths.iter_mut().zip(rows.iter().rev()).for_each(|(length, row)| *length = row.len() as u8);
    (Form::Series { rows: rows.len() as u8, row_lengths }, coefficients)
}

/// Cuts a Chebyshev array where its terms fall below `threshold`, and writes it in powers.
/// `slope_weight` adds the weight of a term's derivative, which decides its effect on TR.
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
    in_powers(&rows)
}
