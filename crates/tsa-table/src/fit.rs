//! Choosing a table by measurement: every form on every load map, the smallest that meets the scene's accuracy.

use crate::axis::{Axis, LoadMap};
use crate::certificate::{self, Certificate};
use crate::form::Form;
use crate::lookup::{Metadata, Table};
use tsa_model::scene::{Accuracy, Envelope};
use tsa_model::{Mechanism, PRETWIST_RAD, ParameterError, Scene, SceneError, SolveError};

/// Most bytes of numbers that the firmware has room for.
pub const MAX_BYTES: usize = 4096;

/// Why no table could be made.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// The scene is wrong, or does not say what the table must cover.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A parameter is wrong.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The envelope reaches past a limit of the model.
    #[error("the envelope reaches past a limit of the model: at {load_n:.3} N and {turns:.3} turns: {source}")]
    Envelope {
        /// Load of the first point that broke it (N).
        load_n: f64,
        /// Motor turns of that point.
        turns: f64,
        /// The limit.
        source: SolveError,
    },
    /// No form reaches the accuracy within [`MAX_BYTES`].
    #[error(
        "no table of at most {MAX_BYTES} bytes reaches accuracy.contraction_m = {contraction_m} and \
         accuracy.tr_relative = {tr_relative}; the best has {best}"
    )]
    Accuracy {
        /// Wanted (m).
        contraction_m: f64,
        /// Wanted.
        tr_relative: f64,
        /// What the best candidate reaches.
        best: String,
    },
}

/// Numbers of a table that owns them.
#[derive(Clone, Debug, PartialEq)]
pub enum Numbers {
    /// See [`Form::Series`].
    Series {
        /// Coefficients in each row.
        row_lengths: Vec<u8>,
        /// All rows.
        coefficients: Vec<f32>,
    },
    /// See [`Form::Hermite`].
    Hermite {
        /// Nodes along the load axis.
        loads: u8,
        /// Nodes along the twist axis.
        twists: u8,
        /// The nodes.
        nodes: Vec<[f32; 4]>,
    },
    /// See [`Form::Bilinear`].
    Bilinear {
        /// Nodes along the load axis.
        loads: u16,
        /// Nodes along the twist axis.
        twists: u16,
        /// G at the nodes (m).
        nodes: Vec<f32>,
    },
}

impl Numbers {
    /// Borrowed form.
    pub fn form(&self) -> Form<'_> {
        match self {
            Self::Series { row_lengths, coefficients } => Form::Series { row_lengths, coefficients },
            Self::Hermite { loads, twists, nodes } => Form::Hermite { loads: *loads, twists: *twists, nodes },
            Self::Bilinear { loads, twists, nodes } => Form::Bilinear { loads: *loads, twists: *twists, nodes },
        }
    }

    /// Name of the form.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Series { .. } => "chebyshev-series",
            Self::Hermite { .. } => "hermite-bicubic",
            Self::Bilinear { .. } => "bilinear",
        }
    }

    /// Its size in words.
    pub fn size(&self) -> String {
        match self {
            Self::Series { row_lengths, coefficients } => {
                let longest = row_lengths.iter().max().copied().unwrap_or(0);
                format!("{} of {}x{} coefficients", coefficients.len(), row_lengths.len(), longest)
            }
            Self::Hermite { loads, twists, .. } => format!("{loads}x{twists} nodes"),
            Self::Bilinear { loads, twists, .. } => format!("{loads}x{twists} nodes"),
        }
    }
}

/// A table that owns its numbers.
#[derive(Clone, Debug)]
pub struct OwnedTable {
    /// Metadata.
    pub metadata: Metadata,
    /// Numbers.
    pub numbers: Numbers,
    /// CRC-32, see [`Table::checksum`].
    pub crc: u32,
}

impl OwnedTable {
    /// The table as the firmware sees it.
    pub fn table(&self) -> Table<'_> {
        Table { metadata: self.metadata, form: self.numbers.form(), crc: self.crc }
    }
}

/// Errors of a table against the full solver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Largest error of the contraction (m).
    pub contraction_max_m: f64,
    /// Root mean square error of the contraction (m).
    pub contraction_rms_m: f64,
    /// Largest relative error of TR.
    pub tr_max: f64,
    /// Root mean square relative error of TR.
    pub tr_rms: f64,
}

impl Errors {
    pub(crate) fn meets(&self, accuracy: &Accuracy, share: f64) -> bool {
        self.contraction_max_m <= share * accuracy.contraction_m && self.tr_max <= share * accuracy.tr_relative
    }
}

/// One candidate: the smallest table of its form and load map that passes, or the largest tried.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The table.
    pub table: OwnedTable,
    /// Errors on the selection grid.
    pub errors: Errors,
    /// Whether it meets the accuracy within [`MAX_BYTES`].
    pub passes: bool,
}

/// The chosen table, its proof, and what else was considered.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The chosen table.
    pub table: OwnedTable,
    /// Its certificate.
    pub certificate: Certificate,
    /// Every candidate, smallest first.
    pub candidates: Vec<Candidate>,
}

/// Load maps that are tried.
const LOAD_MAPS: [LoadMap; 5] = [
    LoadMap::Ratio { knee_n: 0.5 },
    LoadMap::Ratio { knee_n: 1.0 },
    LoadMap::Ratio { knee_n: 2.0 },
    LoadMap::Log,
    LoadMap::InverseRoot,
];

/// A candidate must stay this far inside the accuracy on the selection grid, so that the certificate's search passes.
const MARGIN: f64 = 0.8;

/// The solver on a scene's envelope.
pub(crate) struct Reference<'a> {
    pub mechanism: &'a Mechanism,
    pub load_n: [f64; 2],
    pub twist_rad: [f64; 2],
}

/// The exact gap and its derivative by twist at a point, and the gap at the pre-twist under the same load.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exact {
    pub load_n: f64,
    pub twist_rad: f64,
    pub gap_m: f64,
    pub by_twist: f64,
    pub start_gap_m: f64,
}

impl Reference<'_> {
    pub(crate) fn solve(&self, load_n: f64, twist_rad: f64) -> Result<tsa_model::Equilibrium, FitError> {
        self.mechanism.solve(load_n, twist_rad).map_err(|source| FitError::Envelope {
            load_n,
            turns: (twist_rad - PRETWIST_RAD) / std::f64::consts::TAU,
            source,
        })
    }

    pub(crate) fn exact(&self, load_n: f64, twist_rad: f64) -> Result<Exact, FitError> {
        let e = self.solve(load_n, twist_rad)?;
        let start_gap_m = self.solve(load_n, self.twist_rad[0])?.gap_m;
        Ok(Exact { load_n, twist_rad, gap_m: e.gap_m, by_twist: e.dgap_dtwist_m_per_rad, start_gap_m })
    }

    /// Points between any candidate's nodes, edges included: quadratically denser towards the light end.
    fn selection_grid(&self) -> Result<Vec<Exact>, FitError> {
        const LOADS: u32 = 37;
        const TWISTS: u32 = 53;
        let [f0, f1] = self.load_n;
        let [t0, t1] = self.twist_rad;
        let mut points = Vec::new();
        for i in 0..=LOADS {
            let load = f0 * (f1 / f0).powf(f64::from(i) / f64::from(LOADS));
            let start_gap_m = self.solve(load, t0)?.gap_m;
            for j in 0..=TWISTS {
                let twist = t0 + (t1 - t0) * f64::from(j) / f64::from(TWISTS);
                let e = self.solve(load, twist)?;
                points.push(Exact {
                    load_n: load,
                    twist_rad: twist,
                    gap_m: e.gap_m,
                    by_twist: e.dgap_dtwist_m_per_rad,
                    start_gap_m,
                });
            }
        }
        Ok(points)
    }
}

/// Error of contraction (m) and relative error of TR at one point.
pub(crate) fn error_at(table: &Table<'_>, exact: &Exact) -> (f64, f64) {
    let clamp = |v: f64, min: f32, max: f32| (v as f32).clamp(min, max);
    let m = &table.metadata;
    let load = clamp(exact.load_n, m.load_min_n, m.load_max_n);
    let twist = clamp(exact.twist_rad, m.twist_min_rad, m.twist_max_rad);
    let (start, at) = (table.evaluate(load, m.twist_min_rad), table.evaluate(load, twist));
    let contraction = f64::from(start.gap_m - at.gap_m);
    (
        (contraction - (exact.start_gap_m - exact.gap_m)).abs(),
        (exact.by_twist / f64::from(at.dgap_dtwist_m_per_rad) - 1.0).abs(),
    )
}

/// Errors of a table over points.
pub(crate) fn errors_over(table: &Table<'_>, points: &[Exact]) -> Errors {
    let mut errors = Errors::default();
    for p in points {
        let (contraction, tr) = error_at(table, p);
        errors.contraction_max_m = errors.contraction_max_m.max(contraction);
        errors.tr_max = errors.tr_max.max(tr);
        errors.contraction_rms_m += contraction * contraction;
        errors.tr_rms += tr * tr;
    }
    errors.contraction_rms_m = (errors.contraction_rms_m / points.len() as f64).sqrt();
    errors.tr_rms = (errors.tr_rms / points.len() as f64).sqrt();
    errors
}

/// Fits, chooses and certifies the table of a scene.
///
/// # Errors
/// [`FitError`]: the scene, the first point at which the envelope breaks the model, or an accuracy out of reach.
pub fn fit(scene: &Scene) -> Result<Fit, FitError> {
    let (envelope, accuracy) = scene.table_demand()?;
    let Envelope { load_n, .. } = envelope;
    let mechanism = scene.mechanism()?;
    // Contraction is counted from the pre-twist, so a table always reaches down to it.
    let twist_rad = [PRETWIST_RAD, envelope.twist_rad()[1]];
    let reference = Reference { mechanism: &mechanism, load_n, twist_rad };
    let points = reference.selection_grid()?;
    let mut candidates = Vec::new();
    for map in LOAD_MAPS {
        let blank = |numbers: Numbers| blank_table(scene, &reference, map, numbers);
        candidates.push(series(&reference, map, &points, &accuracy, blank)?);
        candidates.push(hermite(&reference, map, &points, &accuracy, blank)?);
        candidates.push(bilinear(&reference, map, &points, &accuracy, blank)?);
    }
    // Smallest first; of equal size the one without a transcendental function.
    let cost = |c: &Candidate| {
        let map = matches!(c.table.metadata.load_map, LoadMap::Log) as usize;
        (!c.passes, c.table.numbers.form().bytes(), map)
    };
    candidates.sort_by_key(cost);
    for candidate in candidates.iter().filter(|c| c.passes) {
        let mut table = candidate.table.clone();
        let certificate = certificate::certify(&table.table(), &reference, certificate::RANDOM_POINTS)?;
        if certificate.errors.meets(&accuracy, 1.0) && certificate.monotone {
            table.metadata.contraction_error_m = certificate.errors.contraction_max_m as f32;
            table.metadata.tr_relative_error = certificate.errors.tr_max as f32;
            table.crc = table.table().checksum();
            return Ok(Fit { table, certificate, candidates });
        }
    }
    let best = candidates
        .iter()
        .min_by(|a, b| a.errors.contraction_max_m.total_cmp(&b.errors.contraction_max_m))
        .map(|c| {
            let e = &c.errors;
            format!("{:.3e} m and {:.3e} in {} bytes", e.contraction_max_m, e.tr_max, c.table.numbers.form().bytes())
        })
        .unwrap_or_default();
    Err(FitError::Accuracy { contraction_m: accuracy.contraction_m, tr_relative: accuracy.tr_relative, best })
}

fn blank_table(scene: &Scene, reference: &Reference<'_>, map: LoadMap, numbers: Numbers) -> OwnedTable {
    let [f0, f1] = reference.load_n.map(|f| f as f32);
    let [t0, t1] = reference.twist_rad.map(|t| t as f32);
    let metadata = Metadata {
        load_min_n: f0,
        load_max_n: f1,
        twist_min_rad: t0,
        twist_max_rad: t1,
        load_map: map,
        load_axis: Axis::new(map.apply_f64(f64::from(f0)) as f32, map.apply_f64(f64::from(f1)) as f32),
        twist_axis: Axis::new(t0, t1),
        contraction_error_m: 0.0,
        tr_relative_error: 0.0,
        scene_hash: scene.hash(),
        generator_version: crate::GENERATOR_VERSION,
    };
    let mut table = OwnedTable { metadata, numbers, crc: 0 };
    table.crc = table.table().checksum();
    table
}

fn judge(table: OwnedTable, points: &[Exact], accuracy: &Accuracy) -> Candidate {
    let errors = errors_over(&table.table(), points);
    let passes = errors.meets(accuracy, MARGIN) && table.numbers.form().bytes() <= MAX_BYTES;
    Candidate { table, errors, passes }
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
    // Down each column to powers of x, then along each row to powers of y.
    let width = rows.iter().map(Vec::len).max().unwrap_or(0);
    let mut in_x = vec![vec![0.0; width]; rows.len()];
    for j in 0..width {
        let column: Vec<f64> = rows.iter().map(|r| r.get(j).copied().unwrap_or(0.0)).collect();
        for (row, p) in in_x.iter_mut().zip(powers(&column)) {
            row[j] = p;
        }
    }
    let (mut row_lengths, mut flat) = (Vec::new(), Vec::new());
    for (row, kept) in in_x.iter().zip(&rows) {
        row_lengths.push(kept.len() as u8);
        flat.extend(powers(&row[..kept.len()]).into_iter().map(|p| p as f32));
    }
    Numbers::Series { row_lengths, coefficients: flat }
}

fn series(
    reference: &Reference<'_>,
    map: LoadMap,
    points: &[Exact],
    accuracy: &Accuracy,
    blank: impl Fn(Numbers) -> OwnedTable,
) -> Result<Candidate, FitError> {
    let coefficients = chebyshev(reference, map)?;
    let mut best: Option<Candidate> = None;
    for slope_weight in [0.0, 0.02, 0.1] {
        for k in 0..48 {
            let threshold = 100.0 * accuracy.contraction_m * 10f64.powf(-f64::from(k) / 8.0);
            let candidate = judge(blank(cut(&coefficients, threshold, slope_weight)), points, accuracy);
            let passes = candidate.passes;
            if best.as_ref().is_none_or(|b| better(&candidate, b)) {
                best = Some(candidate);
            }
            if passes {
                break;
            }
        }
    }
    best.ok_or_else(|| unreachable_accuracy(accuracy))
}

/// Passing beats failing; of two that pass the smaller; of two that fail the more accurate.
fn better(a: &Candidate, b: &Candidate) -> bool {
    match (a.passes, b.passes) {
        (true, true) => a.table.numbers.form().bytes() < b.table.numbers.form().bytes(),
        (false, false) => a.errors.contraction_max_m < b.errors.contraction_max_m,
        (passes, _) => passes,
    }
}

fn unreachable_accuracy(accuracy: &Accuracy) -> FitError {
    FitError::Accuracy {
        contraction_m: accuracy.contraction_m,
        tr_relative: accuracy.tr_relative,
        best: "no candidate".into(),
    }
}

fn hermite(
    reference: &Reference<'_>,
    map: LoadMap,
    points: &[Exact],
    accuracy: &Accuracy,
    blank: impl Fn(Numbers) -> OwnedTable,
) -> Result<Candidate, FitError> {
    let mut best: Option<Candidate> = None;
    for (loads, twists) in [(4, 5), (5, 6), (6, 8), (7, 9), (8, 10), (8, 13), (10, 12), (10, 16), (12, 16), (14, 18)] {
        let numbers = hermite_nodes(reference, map, loads, twists)?;
        let candidate = judge(blank(numbers), points, accuracy);
        let passes = candidate.passes;
        if best.as_ref().is_none_or(|b| better(&candidate, b)) {
            best = Some(candidate);
        }
        if passes {
            break;
        }
    }
    best.ok_or_else(|| unreachable_accuracy(accuracy))
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

fn bilinear(
    reference: &Reference<'_>,
    map: LoadMap,
    points: &[Exact],
    accuracy: &Accuracy,
    blank: impl Fn(Numbers) -> OwnedTable,
) -> Result<Candidate, FitError> {
    let mut best: Option<Candidate> = None;
    for (loads, twists) in [(8u16, 16u16), (16, 32), (16, 64)] {
        let mut nodes = Vec::new();
        for i in 0..loads {
            for j in 0..twists {
                let (x, y) =
                    (2.0 * f64::from(i) / f64::from(loads - 1) - 1.0, 2.0 * f64::from(j) / f64::from(twists - 1) - 1.0);
                let (load, twist) = state_at(reference, map, x, y);
                nodes.push(reference.solve(load, twist)?.gap_m as f32);
            }
        }
        let candidate = judge(blank(Numbers::Bilinear { loads, twists, nodes }), points, accuracy);
        let passes = candidate.passes;
        if best.as_ref().is_none_or(|b| better(&candidate, b)) {
            best = Some(candidate);
        }
        if passes {
            break;
        }
    }
    best.ok_or_else(|| unreachable_accuracy(accuracy))
}
