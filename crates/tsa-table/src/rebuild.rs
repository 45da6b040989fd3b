//! The board makes a new table from constants that a calibration found.
//!
//! Ranges of the load and numbers of powers are those of the built-in table; if they miss the scene's accuracy, the
//! numbers of powers are those of a spare shape. The coefficients are solved and fitted again in single precision
//! ([`tsa_model::scalar::Single`]), one equilibrium at a time, so that it can run in the background. The result is
//! checked like the first table: between the fitted states, against the solver in double precision, and for
//! monotonicity. A table that fails is not used.

use crate::arc::{ArcSeries, Growth, Patch, Shape};
use crate::arc_growth::{arc_at, growth};
use crate::patch_fit::{PatchFit, Sample};
use crate::table::{Metadata, Table, Uncertainty};
use tsa_model::scalar::Single;
use tsa_model::{Mechanism, Parameters, SolveError};

/// Most ranges of the load.
pub const MAX_PATCHES: usize = 8;
/// Most coefficients of a rebuilt table.
pub const MAX_COEFFICIENTS: usize = 256;
/// Most coefficients of a range: the normal equations take most of the memory that a rebuild needs.
const MAX_TERMS: usize = 45;
/// States that are checked against the single-precision solver, and against the double-precision one: loads, and twists
/// at each load.
const CHECKED: [usize; 2] = [24, 14];
const CHECKED_EXACTLY: [usize; 2] = [8, 5];
/// Intervals of load and twist at whose ends the gradient's signs are checked.
const SIGNS: usize = 60;

/// Why there is no new table.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RebuildError {
    /// The board's table has more ranges or coefficients than can be rebuilt.
    #[error("a table of this form cannot be rebuilt on the board")]
    Form,
    /// The envelope reaches past a limit of the model.
    #[error("at {load_n} N and {twist_rad} rad: {kind}")]
    Model {
        /// Load of the first point that broke it (N).
        load_n: f32,
        /// Twist of that point (rad).
        twist_rad: f32,
        /// [`SolveError::kind`].
        kind: &'static str,
    },
    /// The states do not determine the coefficients.
    #[error("the fit is not determined")]
    Fit,
    /// The table misses the scene's accuracy.
    #[error("contraction within {contraction_m} m and TR within {tr_relative} is all that this form reaches")]
    Accuracy {
        /// Largest error of the contraction (m).
        contraction_m: f32,
        /// Largest relative error of TR.
        tr_relative: f32,
    },
    /// Somewhere the gap does not fall with the twist or does not rise with the load.
    #[error("the gap is not monotone: the inverses would not be unique")]
    NotMonotone,
}

/// A table that owns its numbers, without a heap.
#[derive(Clone, Debug)]
pub struct Rebuilt {
    /// Range, accuracy and origin.
    pub metadata: Metadata,
    growth: Growth,
    shape: Shape,
    patches: heapless::Vec<Patch, MAX_PATCHES>,
    coefficients: heapless::Vec<f32, MAX_COEFFICIENTS>,
    crc: u32,
}

impl Rebuilt {
    /// The table for lookups.
    pub fn table(&self) -> Table<'_> {
        let Self { growth, shape, ref patches, ref coefficients, .. } = *self;
        Table { metadata: self.metadata, series: ArcSeries { growth, shape, patches, coefficients }, crc: self.crc }
    }

    /// Writes its numbers as bytes for flash; returns how many bytes of `out` were used, `None` if it is too short.
    pub fn write(&self, out: &mut [u8]) -> Option<usize> {
        let m = &self.metadata;
        let mut at = 0;
        let mut put = |bytes: [u8; 4]| {
            out.get_mut(at..at + 4)?.copy_from_slice(&bytes);
            at += 4;
            Some(())
        };
        put([self.shape.rows, self.shape.columns, self.patches.len() as u8, 0])?;
        for word in [m.scene_hash, u32::from(m.generator_version), self.crc] {
            put(word.to_le_bytes())?;
        }
        for value in m.uncertainty.numbers() {
            put(value.to_le_bytes())?;
        }
        for value in [m.contraction_error_m, m.tr_relative_error, self.growth.per_load_m_n, self.growth.per_log_m] {
            put(value.to_le_bytes())?;
        }
        let patches = self.patches.iter().flat_map(|p| [p.load_max_n, p.centre[0], p.centre[1]]);
        for value in self.growth.powers.iter().copied().chain(patches).chain(self.coefficients.iter().copied()) {
            put(value.to_le_bytes())?;
        }
        Some(at)
    }

    /// Reads a table written by [`Rebuilt::write`]: `None` if it is damaged, of another generator version or envelope
    /// than `like`, or neither of its shape nor of a spare one.
    pub fn read(like: &Table<'_>, spares: &[Shape], bytes: &[u8]) -> Option<Self> {
        let series = like.series;
        let mut words = bytes.as_chunks::<4>().0.iter().copied();
        let [rows, columns, count, _] = words.next()?;
        let shape = *[series.shape].iter().chain(spares).find(|s| [s.rows, s.columns] == [rows, columns])?;
        if usize::from(count) != series.patches.len() {
            return None;
        }
        let mut word = || words.next();
        let scene_hash = u32::from_le_bytes(word()?);
        let version = u32::from_le_bytes(word()?);
        let crc = u32::from_le_bytes(word()?);
        let mut value = || Some(f32::from_le_bytes(word()?));
        let uncertainty = Uncertainty::from_numbers([value()?, value()?, value()?, value()?])?;
        let mut metadata = Metadata { scene_hash, uncertainty, ..like.metadata };
        (metadata.contraction_error_m, metadata.tr_relative_error) = (value()?, value()?);
        let mut growth = Growth { per_load_m_n: value()?, per_log_m: value()?, ..series.growth };
        for power in &mut growth.powers {
            *power = value()?;
        }
        let mut rebuilt =
            Self { metadata, growth, shape, patches: heapless::Vec::new(), coefficients: heapless::Vec::new(), crc };
        for _ in 0..count {
            let patch = Patch { load_max_n: value()?, centre: [value()?, value()?] };
            rebuilt.patches.push(patch).ok()?;
        }
        for _ in 0..usize::from(count) * shape.terms() {
            rebuilt.coefficients.push(value()?).ok()?;
        }
        // The checksum covers every number, those of `like`'s metadata included.
        let good = version == u32::from(like.metadata.generator_version) && rebuilt.table().is_intact();
        good.then_some(rebuilt)
    }
}

/// The next step.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Sample { patch: usize, state: usize },
    Check { load: usize, twist: usize },
    Exact { state: usize },
    Signs { load: usize },
    Done,
}

/// A table being rebuilt.
pub struct Rebuild {
    single: Mechanism<Single>,
    exact: Mechanism,
    load_min_n: f64,
    twist_rad: [f64; 2],
    tolerance: [f32; 2],
    spares: &'static [Shape],
    equations: PatchFit<MAX_TERMS>,
    rebuilt: Rebuilt,
    phase: Phase,
    /// Gap at the pre-twist under the load being checked, by the table and by the solver (m).
    start_m: [f32; 2],
    states: u32,
}

impl Rebuild {
    /// Begins a table like `like` for other constants, with how well they are known. `tolerance` is the scene's accuracy of
    /// contraction (m) and TR (relative), `spares` are shapes with more powers for constants that need more than the first
    /// ones did, tried in turn.
    ///
    /// # Errors
    /// [`RebuildError::Form`].
    pub fn new(
        like: &Table<'_>,
        parameters: &Parameters,
        scene_hash: u32,
        uncertainty: Uncertainty,
        tolerance: [f32; 2],
        spares: &'static [Shape],
    ) -> Result<Self, RebuildError> {
        let series = like.series;
        let m = like.metadata;
        let twist_rad = [m.twist_min_rad, m.twist_max_rad].map(f64::from);
        let rebuilt = Rebuilt {
            metadata: Metadata { scene_hash, uncertainty, contraction_error_m: 0.0, tr_relative_error: 0.0, ..m },
            growth: growth(parameters, twist_rad).ok_or(RebuildError::Fit)?,
            shape: series.shape,
            patches: heapless::Vec::from_slice(series.patches).map_err(|_| RebuildError::Form)?,
            coefficients: heapless::Vec::from_slice(series.coefficients).map_err(|_| RebuildError::Form)?,
            crc: 0,
        };
        let mut new = Self {
            single: Mechanism::of(Parameters::constant(parameters)),
            exact: Mechanism::of(*parameters),
            load_min_n: f64::from(m.load_min_n),
            twist_rad,
            tolerance,
            spares,
            equations: PatchFit::new(1, [0.0, 1.0], [0.0, 1.0], [1.0, 1.0]),
            rebuilt,
            phase: Phase::Sample { patch: 0, state: 0 },
            start_m: [0.0; 2],
            states: 0,
        };
        new.begin_patch(0);
        Ok(new)
    }

    /// Equilibria solved so far.
    pub fn states(&self) -> u32 {
        self.states
    }

    /// Does one step: one equilibrium, one fit, or one row of signs. Returns the table when it is finished and good.
    ///
    /// # Errors
    /// [`RebuildError`]; there is then no table.
    pub fn step(&mut self) -> Result<Option<&Rebuilt>, RebuildError> {
        self.phase = match self.phase {
            Phase::Sample { patch, state } => self.sample(patch, state)?,
            Phase::Check { load, twist } => self.check(load, twist)?,
            Phase::Exact { state } => self.check_exactly(state)?,
            Phase::Signs { load } => self.signs(load)?,
            Phase::Done => return Ok(Some(&self.rebuilt)),
        };
        Ok(None)
    }

    fn loads(&self, patch: usize) -> [f64; 2] {
        let edge = |k: usize| self.rebuilt.patches.get(k).map_or(self.load_min_n, |p| f64::from(p.load_max_n));
        let low = if patch == 0 { self.load_min_n } else { edge(patch - 1) };
        [low, edge(patch)]
    }

    fn begin_patch(&mut self, patch: usize) {
        let [low, high] = self.loads(patch);
        // The arc grows with twist and 1/F.
        let arcs = [
            arc_at(&self.rebuilt.growth, high, self.twist_rad[0]).0,
            arc_at(&self.rebuilt.growth, low, self.twist_rad[1]).0,
        ];
        let columns = usize::from(self.rebuilt.shape.columns);
        self.equations = PatchFit::new(columns, [low, high], arcs, self.tolerance.map(f64::from));
    }

    fn solve(&mut self, load_n: f64, twist_rad: f64) -> Result<[f64; 2], RebuildError> {
        self.states += 1;
        self.single.gap_and_slope(load_n, twist_rad).map_err(|e| broken(load_n, twist_rad, &e))
    }

    fn sample(&mut self, patch: usize, state: usize) -> Result<Phase, RebuildError> {
        let shape = self.rebuilt.shape;
        let (loads, twists) = (usize::from(shape.rows) + 3, 2 * usize::from(shape.columns));
        if state < loads * twists {
            // Chebyshev points.
            let at = |k: usize, n: usize, [low, high]: [f64; 2]| {
                let x = libm::cos(core::f64::consts::PI * (k as f64 + 0.5) / n as f64);
                0.5 * (low + high) + 0.5 * (high - low) * x
            };
            let load_n = at(state / twists, loads, self.loads(patch));
            let twist_rad = at(state % twists, twists, self.twist_rad);
            let [gap_m, by_twist] = self.solve(load_n, twist_rad)?;
            let (arc_m, arc_by_twist) = arc_at(&self.rebuilt.growth, load_n, twist_rad);
            self.equations.add(&Sample { load_n, twist_rad, arc_m, arc_by_twist, gap_m, by_twist });
            return Ok(Phase::Sample { patch, state: state + 1 });
        }
        let terms = shape.terms();
        let out = self.rebuilt.coefficients.get_mut(patch * terms..(patch + 1) * terms).ok_or(RebuildError::Form)?;
        let fitted = self.equations.solve(shape, out).ok_or(RebuildError::Fit)?;
        let kept = self.rebuilt.patches.get_mut(patch).ok_or(RebuildError::Form)?;
        kept.centre = fitted.centre;
        if patch + 1 < self.rebuilt.patches.len() {
            self.begin_patch(patch + 1);
            return Ok(Phase::Sample { patch: patch + 1, state: 0 });
        }
        Ok(Phase::Check { load: 0, twist: 0 })
    }

    /// A load at this share of the range, quadratically denser towards the light end, both ends included.
    fn load_at(&self, share: f64) -> f64 {
        let [low, high] = [self.load_min_n, f64::from(self.rebuilt.metadata.load_max_n)];
        low + (high - low) * share * share
    }

    fn check(&mut self, load: usize, twist: usize) -> Result<Phase, RebuildError> {
        let [loads, twists] = CHECKED;
        if load == loads {
            return Ok(Phase::Exact { state: 0 });
        }
        let load_n = self.load_at(load as f64 / (loads - 1) as f64);
        let twist_rad =
            self.twist_rad[0] + (self.twist_rad[1] - self.twist_rad[0]) * twist as f64 / (twists - 1) as f64;
        let exact = self.solve(load_n, twist_rad)?;
        let at = self.rebuilt.table().point_inside(load_n as f32, twist_rad as f32);
        if twist == 0 {
            self.start_m = [at.gap_m, exact[0] as f32];
        }
        let contraction = (self.start_m[0] - at.gap_m) - (self.start_m[1] - exact[0] as f32);
        let tr = exact[1] as f32 / at.dgap_dtwist_m_per_rad - 1.0;
        self.note([contraction, tr]);
        Ok(if twist + 1 < twists {
            Phase::Check { load, twist: twist + 1 }
        } else {
            Phase::Check { load: load + 1, twist: 0 }
        })
    }

    /// Checks the single-precision solver's work against the double-precision one.
    fn check_exactly(&mut self, state: usize) -> Result<Phase, RebuildError> {
        let [loads, twists] = CHECKED_EXACTLY;
        if state < loads * twists {
            let load_n = self.load_at((state / twists) as f64 / (loads - 1) as f64);
            let share = (state % twists) as f64 / (twists - 1) as f64;
            let twist_rad = self.twist_rad[0] + (self.twist_rad[1] - self.twist_rad[0]) * share;
            self.states += 1;
            let [gap_m, by_twist] =
                self.exact.gap_and_slope(load_n, twist_rad).map_err(|e| broken(load_n, twist_rad, &e))?;
            let at = self.rebuilt.table().point_inside(load_n as f32, twist_rad as f32);
            if state.is_multiple_of(twists) {
                self.start_m = [at.gap_m, gap_m as f32];
            }
            let contraction = (self.start_m[0] - at.gap_m) - (self.start_m[1] - gap_m as f32);
            let tr = by_twist as f32 / at.dgap_dtwist_m_per_rad - 1.0;
            self.note([contraction, tr]);
            return Ok(Phase::Exact { state: state + 1 });
        }
        let Metadata { contraction_error_m: contraction_m, tr_relative_error: tr_relative, .. } = self.rebuilt.metadata;
        if contraction_m <= self.tolerance[0] && tr_relative <= self.tolerance[1] {
            return Ok(Phase::Signs { load: 0 });
        }
        if !self.enrich() {
            return Err(RebuildError::Accuracy { contraction_m, tr_relative });
        }
        Ok(Phase::Sample { patch: 0, state: 0 })
    }

    /// Begins again with the next spare shape, if there is one and it fits.
    fn enrich(&mut self) -> bool {
        let Some((&shape, rest)) = self.spares.split_first() else { return false };
        self.spares = rest;
        let coefficients = self.rebuilt.patches.len() * shape.terms();
        if shape.terms() > MAX_TERMS || self.rebuilt.coefficients.resize(coefficients, 0.0).is_err() {
            return false;
        }
        self.rebuilt.shape = shape;
        (self.rebuilt.metadata.contraction_error_m, self.rebuilt.metadata.tr_relative_error) = (0.0, 0.0);
        self.begin_patch(0);
        true
    }

    fn note(&mut self, errors: [f32; 2]) {
        let m = &mut self.rebuilt.metadata;
        for (most, error) in [&mut m.contraction_error_m, &mut m.tr_relative_error].into_iter().zip(errors) {
            let error = error.abs();
            // NaN replaces every number and stays.
            if error > *most || error.is_nan() {
                *most = error;
            }
        }
    }

    fn signs(&mut self, load: usize) -> Result<Phase, RebuildError> {
        if load > SIGNS {
            self.rebuilt.crc = self.rebuilt.table().checksum();
            return Ok(Phase::Done);
        }
        let load_n = self.load_at(load as f64 / SIGNS as f64) as f32;
        let table = self.rebuilt.table();
        let [low, high] = [table.metadata.twist_min_rad, table.metadata.twist_max_rad];
        for k in 0..=SIGNS {
            let p = table.point_inside(load_n, low + (high - low) * k as f32 / SIGNS as f32);
            if !(p.dgap_dtwist_m_per_rad < 0.0 && p.dgap_dload_m_per_n > 0.0) {
                return Err(RebuildError::NotMonotone);
            }
        }
        Ok(Phase::Signs { load: load + 1 })
    }
}

fn broken(load_n: f64, twist_rad: f64, error: &SolveError) -> RebuildError {
    RebuildError::Model { load_n: load_n as f32, twist_rad: twist_rad as f32, kind: error.kind() }
}
