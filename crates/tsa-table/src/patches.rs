//! Dividing the load for the mixed form: as few ranges and with as few terms as the scene needs.

use crate::arc::{ArcSeries, Growth, MAX_COLUMNS, MAX_ROWS, Patch, Shape};
use crate::fit::{Accuracy, Exact, FitError, Numbers, Reference};
use crate::patch_fit::{MAX_TERMS, PatchFit, Sample};
use crate::plane::{arc_at, growth};
use std::collections::BTreeMap;

/// Cuts of the load range at which a patch may end: evenly spaced in the square root of the load.
const CUTS: usize = 36;
/// Loads in each cut, and twists, that are fitted; between them, as many are checked.
const LOADS: usize = 3;
const TWISTS: usize = 30;
/// Share of the accuracy that gap and TR may miss at the points that are checked. A contraction is a difference of two
/// gaps.
const GAP_SHARE: f64 = 0.8;
const TR_SHARE: f64 = 0.9;

fn sample(growth: &Growth, e: &Exact) -> Sample {
    let (arc_m, arc_by_twist) = arc_at(growth, e.load_n, e.twist_rad);
    let Exact { load_n, twist_rad, gap_m, by_twist, .. } = *e;
    Sample { load_n, twist_rad, arc_m, arc_by_twist, gap_m, by_twist }
}

/// The form of each shape with the fewest ranges of the load.
pub(crate) fn candidates(reference: &Reference<'_>, accuracy: &Accuracy) -> Result<Vec<Numbers>, FitError> {
    let [f0, f1] = reference.load_n;
    let cut = |k: f64| {
        let root = f0.sqrt() + (f1.sqrt() - f0.sqrt()) * k / CUTS as f64;
        (root * root).clamp(f0, f1)
    };
    let (fitted_at, checked_at) = (grid(reference, &cut, false)?, grid(reference, &cut, true)?);
    let Some(growth) = growth(reference.mechanism.parameters(), reference.twist_rad) else { return Ok(Vec::new()) };
    let with_arc = |exacts: &[Vec<Exact>]| -> Vec<Vec<Sample>> {
        exacts.iter().map(|cut| cut.iter().map(|e| sample(&growth, e)).collect()).collect()
    };
    let mut plane = Plane {
        growth,
        fits: with_arc(&fitted_at),
        checks: with_arc(&checked_at),
        cuts: (0..=CUTS).map(|k| cut(k as f64)).collect(),
        tolerance: [GAP_SHARE * accuracy.contraction_m, TR_SHARE * accuracy.tr_relative],
        equations: BTreeMap::new(),
    };
    let shapes = (2..=MAX_ROWS).flat_map(|rows| (2..=MAX_COLUMNS).map(move |columns| Shape::of(rows, columns)));
    Ok(shapes.flatten().filter_map(|shape| plane.divided(shape)).collect())
}

/// Solved states of each cut: Chebyshev points to fit at, evenly spaced ones with the edges to check at.
fn grid(reference: &Reference<'_>, cut: &dyn Fn(f64) -> f64, check: bool) -> Result<Vec<Vec<Exact>>, FitError> {
    let [t0, t1] = reference.twist_rad;
    let share = |k: usize, n: usize| {
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
                let load = cut(c as f64 + share(i, LOADS));
                let start_gap_m = reference.solve(load, t0)?.gap_m;
                for j in 0..twists {
                    let twist = (t0 + (t1 - t0) * share(j, twists)).clamp(t0, t1);
                    let e = reference.solve(load, twist)?;
                    states.push(Exact {
                        load_n: load,
                        twist_rad: twist,
                        gap_m: e.gap_m,
                        by_twist: e.dgap_dtwist_m_per_rad,
                        start_gap_m,
                    });
                }
            }
            Ok(states)
        })
        .collect()
}

/// A patch and its coefficients.
struct Fitted {
    patch: Patch,
    coefficients: Vec<f32>,
}

/// The load–arc plane with its solved states, cut by cut, and the equations of every range of cuts asked for so far.
struct Plane {
    growth: Growth,
    fits: Vec<Vec<Sample>>,
    checks: Vec<Vec<Sample>>,
    cuts: Vec<f64>,
    tolerance: [f64; 2],
    equations: BTreeMap<[usize; 2], PatchFit<MAX_TERMS>>,
}

impl Plane {
    /// From the light end on, always the longest range that the shape can do.
    fn divided(&mut self, shape: Shape) -> Option<Numbers> {
        let (mut patches, mut coefficients) = (Vec::new(), Vec::new());
        // As many cuts as have loads enough to determine the shape.
        let least = (usize::from(shape.rows) + 1).div_ceil(LOADS);
        let mut start = 0;
        while start < CUTS {
            // A last range that would be too short reaches back over the one before it.
            start = start.min(CUTS - least);
            let mut good = start + least;
            let (mut fitted, mut bad) = (self.patch([start, good], shape)?, CUTS + 1);
            while bad - good > 1 {
                // Doubling, then halving.
                let end = (2 * good - start).min((good + bad) / 2);
                match self.patch([start, end], shape) {
                    Some(longer) => (fitted, good) = (longer, end),
                    None => bad = end,
                }
            }
            patches.push(fitted.patch);
            coefficients.extend(fitted.coefficients);
            start = good;
        }
        Some(Numbers::Arc { growth: self.growth, shape, patches, coefficients })
    }

    /// The patch over a range of cuts, if the shape meets the accuracy there.
    fn patch(&mut self, [i, j]: [usize; 2], shape: Shape) -> Option<Fitted> {
        let all = || self.fits[i..j].iter().chain(&self.checks[i..j]).flatten();
        let equations = self.equations.entry([i, j]).or_insert_with(|| {
            let low = all().map(|s| s.arc_m).fold(f64::INFINITY, f64::min);
            let high = all().map(|s| s.arc_m).fold(f64::NEG_INFINITY, f64::max);
            let mut new = PatchFit::new(MAX_COLUMNS, [self.cuts[i], self.cuts[j]], [low, high], self.tolerance);
            self.fits[i..j].iter().flatten().for_each(|s| new.add(s));
            new
        });
        let mut coefficients = vec![0.0; shape.terms()];
        let patch = equations.solve(shape, &mut coefficients)?;
        let good = |s: &Sample| {
            let form = ArcSeries { growth: self.growth, shape, patches: &[patch], coefficients: &coefficients };
            let at = form.evaluate(s.load_n as f32, s.twist_rad as f32);
            let tr = s.by_twist / f64::from(at.dgap_dtwist_m_per_rad) - 1.0;
            (f64::from(at.gap_m) - s.gap_m).abs() <= self.tolerance[0] && tr.abs() <= self.tolerance[1]
        };
        all().all(good).then_some(Fitted { patch, coefficients })
    }
}
