//! Choosing a table by measurement: every form on every load map, the smallest that meets the scene's accuracy.

use crate::arc::{ArcSeries, Growth, Patch, Shape};
use crate::axis::{Axis, LoadMap};
use crate::candidates::Search;
use crate::certificate::{self, Certificate};
use crate::effort::{LOOKUP_INSTRUCTIONS, lookup_instructions};
use crate::form::Form;
use crate::lookup::{Metadata, Table};
use crate::patches;
use tsa_model::{Mechanism, PRETWIST_RAD, SolveError, Tier};

/// Most bytes of numbers that the firmware has room for.
pub const MAX_BYTES: usize = 4096;

/// How well a table must reproduce the full model.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accuracy {
    /// Largest error of the contraction (m).
    pub contraction_m: f64,
    /// Largest relative error of the transmission ratio.
    pub tr_relative: f64,
}

/// What a table must cover, and how well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Least and greatest load (N).
    pub load_n: [f64; 2],
    /// Greatest twist (rad); the least is the half-turn pre-twist, from which contraction is counted.
    pub twist_max_rad: f64,
    /// How well.
    pub accuracy: Accuracy,
    /// Hash of the scene that demands it, for the table's metadata.
    pub scene_hash: u32,
}

/// Why no table could be made.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
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
    /// See [`Form::Arc`].
    Arc {
        /// How the arc grows.
        growth: Growth,
        /// Powers in every range of the load.
        shape: Shape,
        /// Ranges of the load.
        patches: Vec<Patch>,
        /// All coefficients.
        coefficients: Vec<f32>,
    },
}

impl Numbers {
    /// Borrowed form.
    pub fn form(&self) -> Form<'_> {
        match self {
            Self::Series { row_lengths, coefficients } => Form::Series { row_lengths, coefficients },
            Self::Hermite { loads, twists, nodes } => Form::Hermite { loads: *loads, twists: *twists, nodes },
            Self::Bilinear { loads, twists, nodes } => Form::Bilinear { loads: *loads, twists: *twists, nodes },
            Self::Arc { growth, shape, patches, coefficients } => {
                Form::Arc(ArcSeries { growth: *growth, shape: *shape, patches, coefficients })
            }
        }
    }

    /// Name of the form.
    pub fn kind(&self) -> &'static str {
        self.form().name()
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
            Self::Arc { shape, patches, .. } => format!("{} ranges of {shape:?} coefficients", patches.len()),
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

impl Candidate {
    /// Instructions of a lookup on the board, predicted, see [`crate::effort`].
    pub fn instructions(&self) -> u32 {
        lookup_instructions(&self.table.table())
    }
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

/// The candidates that the board's costs are measured on beside the chosen table: of every other form the best, of the
/// mixed one the extremes and every load map of the series, so that [`crate::effort`] is checked where it reaches.
pub fn peers(fit: &Fit) -> Vec<(&'static str, &Candidate)> {
    let best = |chosen: &dyn Fn(&Table<'_>) -> bool| {
        let error = |c: &Candidate| c.errors.contraction_max_m;
        let of_kind = fit.candidates.iter().filter(|c| chosen(&c.table.table()));
        of_kind.min_by(|a, b| a.passes.cmp(&b.passes).reverse().then(error(a).total_cmp(&error(b))))
    };
    let shape = |rows: u8, columns: u8| {
        best(&|t| matches!(t.form, Form::Arc(s) if [s.shape.rows, s.shape.columns] == [rows, columns]))
    };
    let series =
        |map: &dyn Fn(LoadMap) -> bool| best(&|t| matches!(t.form, Form::Series { .. }) && map(t.metadata.load_map));
    let all = [
        ("ARC_SHORT", shape(6, 7)),
        ("ARC_LONG", shape(3, 8)),
        ("SERIES", series(&|m| m == LoadMap::InverseRoot)),
        ("SERIES_LOG", series(&|m| m == LoadMap::Log)),
        ("SERIES_RATIO", series(&|m| matches!(m, LoadMap::Ratio { .. }))),
        ("HERMITE", best(&|t| matches!(t.form, Form::Hermite { .. }))),
        ("BILINEAR", best(&|t| matches!(t.form, Form::Bilinear { .. }))),
    ];
    all.into_iter().filter_map(|(name, c)| Some((name, c?))).collect()
}

/// The solver on a scene's envelope.
pub(crate) struct Reference<'a> {
    pub mechanism: &'a Mechanism,
    pub tier: Tier,
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
        let solved = match self.tier {
            Tier::Full => self.mechanism.solve(load_n, twist_rad),
            tier => self.mechanism.formal_tier(tier, load_n, twist_rad),
        };
        solved.map_err(|source| FitError::Envelope {
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
    // A rough table may have no gap at all somewhere: no number is the largest error, not one to be passed over.
    let error = |e: f64| if e.is_nan() { f64::INFINITY } else { e.abs() };
    (
        error(contraction - (exact.start_gap_m - exact.gap_m)),
        error(exact.by_twist / f64::from(at.dgap_dtwist_m_per_rad) - 1.0),
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

/// Fits, chooses and certifies a table of the mechanism.
///
/// # Errors
/// [`FitError`]: the first point at which the envelope breaks the model, or an accuracy out of reach.
pub fn fit(mechanism: &Mechanism, demand: &Demand) -> Result<Fit, FitError> {
    fit_tier(mechanism, demand, Tier::Full)
}

/// The same from a cheaper model, by which it is then also judged: shows what controlling by that model would be like.
///
/// # Errors
/// As [`fit`].
pub fn fit_tier(mechanism: &Mechanism, demand: &Demand, tier: Tier) -> Result<Fit, FitError> {
    let Demand { load_n, accuracy, scene_hash, .. } = *demand;
    let twist_rad = [PRETWIST_RAD, demand.twist_max_rad];
    let reference = Reference { mechanism, tier, load_n, twist_rad };
    let points = reference.selection_grid()?;
    let mut candidates = Vec::new();
    for map in LOAD_MAPS {
        let search = Search { scene_hash, reference: &reference, map, points: &points, accuracy: &accuracy };
        candidates.extend(search.candidates()?);
    }
    for numbers in patches::candidates(&reference, &accuracy)? {
        let table = blank_table(scene_hash, &reference, LoadMap::Linear, numbers);
        let errors = errors_over(&table.table(), &points);
        let passes = errors.meets(&accuracy, 0.9) && table.numbers.form().bytes() <= MAX_BYTES;
        candidates.push(Candidate { table, errors, passes });
    }
    // Those that the board looks up fast enough, then the rest; in both the smallest first, of equal size the faster.
    candidates.sort_by_key(|c| {
        let (bytes, instructions) = (c.table.numbers.form().bytes(), c.instructions());
        (!c.passes, instructions > LOOKUP_INSTRUCTIONS, bytes, instructions)
    });
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

pub(crate) fn blank_table(scene_hash: u32, reference: &Reference<'_>, map: LoadMap, numbers: Numbers) -> OwnedTable {
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
        scene_hash,
        generator_version: crate::GENERATOR_VERSION,
    };
    let mut table = OwnedTable { metadata, numbers, crc: 0 };
    table.crc = table.table().checksum();
    table
}
