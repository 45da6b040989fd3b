//! Dividing the load into ranges: as few as each shape needs for the accuracy.

use crate::arc::{ArcSeries, Growth, MAX_COLUMNS, MAX_ROWS, Patch, Shape};
use crate::arc_growth::{arc_at, growth};
use crate::owned::OwnedSeries;
use crate::patch_fit::{PatchFit, Sample};
use crate::reference::{Exact, Reference};
use crate::table_spec::{Accuracy, FitError};
use std::collections::BTreeMap;

/// Cuts of the load range at which a patch may end: evenly spaced in the square root of the load.
const CUTS: usize = 36;
/// Loads in each cut, and twists, that are fitted; as many loads and some more twists between them are checked.
const LOADS: usize = 3;
const TWISTS: usize = 30;
/// Fraction of the accuracy that the errors of gap and TR may reach at the checked points. A contraction is a difference
/// of two gaps.
const GAP_FRACTION: f64 = 0.8;
const TR_FRACTION: f64 = 0.9;

fn sample(growth: &Growth, e: &Exact) -> Sample {
    let (arc_m, arc_by_twist) = arc_at(growth, e.load_n, e.twist_rad);
    let Exact { load_n, twist_rad, gap_m, by_twist, .. } = *e;
    Sample { load_n, twist_rad, arc_m, arc_by_twist, gap_m, by_twist }
}

/// Solved states of each cut: Chebyshev points to fit at, evenly spaced ones with the edges to check at.
fn grid(reference: &Reference<'_>, cut: &dyn Fn(f64) -> f64, check: bool) -> Result<Vec<Vec<Exact>>, FitError> {
    let [t0, t1] = reference.twist_rad;
    let fraction = |k: usize, n: usize| {
        if check {
            k as f64 / (n - 1) as f64
        } else {
            0.5 - 0.5 * (std::f64::consts::PI * (k as f64 + 0.5) / n as f64).cos()
        }
    };
    let twists = if check { TWISTS + 7 } else { TWISTS };
    (0..CUTS)
        .map(|c| {
            let mut states = Vec::with_capacity(LOADS * twists);
            for i in 0..LOADS {
                let load = cut(c as f64 + fraction(i, LOADS));
                let twist = |j: usize| (t0 + (t1 - t0) * fraction(j, twists)).clamp(t0, t1);
                states.extend(reference.exact_at(load, (0..twists).map(twist))?);
            }
            Ok(states)
        })
        .collect()
}

/// A patch and its coefficients.
type Fitted = (Patch, Vec<f32>);

/// The solved states, cut by cut, and the equations of every range of cuts tried so far.
pub(crate) struct Ranges {
    growth: Growth,
    fits: Vec<Vec<Sample>>,
    checks: Vec<Vec<Sample>>,
    cuts: Vec<f64>,
    tolerance: [f64; 2],
    equations: BTreeMap<[usize; 2], PatchFit>,
}

impl Ranges {
    /// Solves the states of the reference's range. `None` if the constants do not determine how the arc grows.
    pub(crate) fn new(reference: &Reference<'_>, accuracy: &Accuracy) -> Result<Option<Self>, FitError> {
        let [f0, f1] = reference.load_n;
        let cut = |k: f64| {
            let root = f0.sqrt() + (f1.sqrt() - f0.sqrt()) * k / CUTS as f64;
            (root * root).clamp(f0, f1)
        };
        let Some(growth) = growth(reference.mechanism.parameters(), reference.twist_rad) else { return Ok(None) };
        let samples = |check: bool| -> Result<Vec<Vec<Sample>>, FitError> {
            let of_cut = |cut: Vec<Exact>| cut.iter().map(|e| sample(&growth, e)).collect();
            Ok(grid(reference, &cut, check)?.into_iter().map(of_cut).collect())
        };
        Ok(Some(Self {
            growth,
            fits: samples(false)?,
            checks: samples(true)?,
            cuts: (0..=CUTS).map(|k| cut(k as f64)).collect(),
            tolerance: [GAP_FRACTION * accuracy.contraction_m, TR_FRACTION * accuracy.tr_relative],
            equations: BTreeMap::new(),
        }))
    }

    /// The table of each shape with the fewest ranges of the load; none for a shape that misses the accuracy even on
    /// the shortest ranges.
    pub(crate) fn fewest_of_each_shape(&mut self) -> Vec<OwnedSeries> {
        let shapes = (2..=MAX_ROWS).flat_map(|rows| (2..=MAX_COLUMNS).map(move |columns| Shape::of(rows, columns)));
        shapes.flatten().filter_map(|shape| self.fewest(shape)).collect()
    }

    /// The most accurate table that can be fitted: the largest shape on the shortest ranges.
    pub(crate) fn shortest(&mut self) -> Option<OwnedSeries> {
        let shape = Shape::of(MAX_ROWS, MAX_COLUMNS)?;
        let min = min_cuts(shape);
        let starts = (0..CUTS).step_by(min).map(|start| start.min(CUTS - min));
        let fitted = starts.map(|start| self.fitted([start, start + min], shape)).collect::<Option<Vec<_>>>()?;
        Some(self.series(shape, fitted))
    }

    /// From the light end on, always the longest range on which the shape meets the accuracy.
    fn fewest(&mut self, shape: Shape) -> Option<OwnedSeries> {
        let min = min_cuts(shape);
        let mut all = Vec::new();
        let mut start = 0;
        while start < CUTS {
            // A last range that would be too short reaches back over the one before it.
            start = start.min(CUTS - min);
            let mut good = start + min;
            let (mut longest, mut bad) = (self.accurate([start, good], shape)?, CUTS + 1);
            while bad - good > 1 {
                // The length is doubled until a range fails, then halved between good and bad.
                let end = (2 * good - start).min((good + bad) / 2);
                match self.accurate([start, end], shape) {
                    Some(longer) => (longest, good) = (longer, end),
                    None => bad = end,
                }
            }
            all.push(longest);
            start = good;
        }
        Some(self.series(shape, all))
    }

    fn series(&self, shape: Shape, all: Vec<Fitted>) -> OwnedSeries {
        let (patches, coefficients): (Vec<_>, Vec<_>) = all.into_iter().unzip();
        OwnedSeries { growth: self.growth, shape, patches, coefficients: coefficients.concat() }
    }

    /// The states over a range of cuts, those to fit at first.
    fn states(&self, [i, j]: [usize; 2]) -> impl Iterator<Item = &Sample> {
        self.fits[i..j].iter().chain(&self.checks[i..j]).flatten()
    }

    /// The patch over a range of cuts.
    fn fitted(&mut self, range: [usize; 2], shape: Shape) -> Option<Fitted> {
        if !self.equations.contains_key(&range) {
            let arcs = || self.states(range).map(|s| s.arc_m);
            let arc_m = [arcs().fold(f64::INFINITY, f64::min), arcs().fold(f64::NEG_INFINITY, f64::max)];
            let mut new = PatchFit::new(range.map(|k| self.cuts[k]), arc_m, self.tolerance);
            self.fits[range[0]..range[1]].iter().flatten().for_each(|s| new.add(s));
            self.equations.insert(range, new);
        }
        self.equations.get(&range)?.solve(shape)
    }

    /// The patch over a range of cuts, if it meets the accuracy at every state there.
    fn accurate(&mut self, range: [usize; 2], shape: Shape) -> Option<Fitted> {
        let fitted = self.fitted(range, shape)?;
        let (patch, coefficients) = &fitted;
        let series = ArcSeries { growth: self.growth, shape, patches: &[*patch], coefficients };
        let good = |s: &Sample| {
            let at = series.evaluate(s.load_n as f32, s.twist_rad as f32);
            let tr = s.by_twist / f64::from(at.dgap_dtwist_m_per_rad) - 1.0;
            (f64::from(at.gap_m) - s.gap_m).abs() <= self.tolerance[0] && tr.abs() <= self.tolerance[1]
        };
        self.states(range).all(good).then_some(fitted)
    }
}

/// The shortest range (cuts) with loads enough to determine a shape.
fn min_cuts(shape: Shape) -> usize {
    (usize::from(shape.rows) + 1).div_ceil(LOADS)
}
