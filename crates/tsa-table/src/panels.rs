//! Fitting the mixed form: G² in load and arc, on as few ranges of the load and with as few terms as the scene needs.

use crate::arc::{Growth, Panel};
use crate::axis::Axis;
use crate::candidates::in_powers;
use crate::fit::{Exact, FitError, Numbers, Reference};
use crate::least_squares::Normal;
use tsa_model::scene::Accuracy;
use tsa_model::{PRETWIST_RAD, RadiusLaw};

/// Most rows (powers of the load) and columns (powers of the arc).
const ROWS: usize = 8;
const COLUMNS: usize = 10;
const TERMS: usize = ROWS * COLUMNS;
/// Cuts of the load range at which a panel may end: evenly spaced in the square root of the load.
const CUTS: usize = 12;
/// Loads in each cut, and twists, that are fitted; between them, as many are checked.
const LOADS: usize = 9;
const TWISTS: usize = 30;
/// A panel must stay this far inside the accuracy at the points that are checked.
const MARGIN: f64 = 0.75;

/// κ and the polynomial ρ of the arc, in f64 and as the board will have them.
pub(crate) struct Arc {
    per_load_m_n: f32,
    powers: Vec<f32>,
}

impl Arc {
    /// Arc and its derivative by twist, by the rounded numbers.
    fn at(&self, load_n: f64, twist_rad: f64) -> (f64, f64) {
        let per_twist = f64::from(self.per_load_m_n) / load_n;
        let (mut value, mut slope) = (0.0, 0.0);
        for c in self.powers.iter().rev() {
            slope = slope * twist_rad + value;
            value = value * twist_rad + f64::from(*c);
        }
        (twist_rad * (per_twist + value), per_twist + value + twist_rad * slope)
    }

    /// Eq. 6 with `degree` powers of the twist in r0 (k2 + k3 g(θ)).
    fn new(reference: &Reference<'_>, degree: usize) -> Option<Self> {
        let p = reference.mechanism.parameters();
        let growth = |twist: f64| match p.radius_law {
            RadiusLaw::TwistPower => (twist / std::f64::consts::PI).powf(p.twist_exponent),
            // X0/X changes slowly; what it changes is left to the polynomials in F and a.
            RadiusLaw::LengthRatio => 1.0,
        };
        let top = reference.twist_rad[1];
        let mut normal = Normal::<8>::default();
        for k in 0..=200 {
            let twist = reference.twist_rad[0] + (top - reference.twist_rad[0]) * f64::from(k) / 200.0;
            let mut v = [0.0; 8];
            for (i, v) in v.iter_mut().enumerate() {
                *v = (twist / top).powi(i as i32);
            }
            normal.add(&v, p.diameter_m * (p.k2 + p.k3 * growth(twist)));
        }
        let kept: Vec<usize> = (0..degree).collect();
        let c = normal.solve(&kept)?;
        let powers = (0..degree).map(|i| (c[i] / top.powi(i as i32)) as f32).collect();
        Some(Self { per_load_m_n: (p.diameter_m / p.k1_per_n) as f32, powers })
    }
}

/// A solved state with its arc.
struct Sample {
    exact: Exact,
    arc: f64,
    arc_by_twist: f64,
}

/// The best panel over one range of the load.
#[derive(Clone)]
struct Fitted {
    panel: Panel,
    row_lengths: Vec<u8>,
    coefficients: Vec<f32>,
}

impl Fitted {
    fn bytes(&self) -> usize {
        Panel::BYTES + self.row_lengths.len() + 4 * self.coefficients.len()
    }
}

/// The form with the fewest bytes whose panels have at most `most_terms` coefficients each; `None` if there is none.
pub(crate) fn candidates(
    reference: &Reference<'_>,
    accuracy: &Accuracy,
    most_terms: &[usize],
) -> Result<Vec<Option<Numbers>>, FitError> {
    let [f0, f1] = reference.load_n;
    let cut = |k: f64| {
        let root = f0.sqrt() + (f1.sqrt() - f0.sqrt()) * k / CUTS as f64;
        (root * root).clamp(f0, f1)
    };
    let (fitted_at, checked_at) = (grid(reference, &cut, false)?, grid(reference, &cut, true)?);
    let mut best: Vec<Option<(usize, Numbers)>> = vec![None; most_terms.len()];
    let degrees: &[usize] = match reference.mechanism.parameters().radius_law {
        RadiusLaw::TwistPower => &[3, 4, 5, 6],
        RadiusLaw::LengthRatio => &[1],
    };
    for degree in degrees {
        let Some(arc) = Arc::new(reference, *degree) else { continue };
        let with_arc = |exacts: &[Vec<Exact>]| -> Vec<Vec<Sample>> {
            exacts
                .iter()
                .map(|cut| {
                    cut.iter()
                        .map(|e| {
                            let (a, by_twist) = arc.at(e.load_n, e.twist_rad);
                            Sample { exact: *e, arc: a, arc_by_twist: by_twist }
                        })
                        .collect()
                })
                .collect()
        };
        let (fits, checks) = (with_arc(&fitted_at), with_arc(&checked_at));
        // Every range from cut i to cut j, then the cheapest chain of them.
        let mut panels: Vec<Vec<Option<Fitted>>> = vec![vec![None; CUTS + 1]; CUTS];
        for (i, row) in panels.iter_mut().enumerate() {
            for (j, cell) in row.iter_mut().enumerate().skip(i + 1) {
                *cell = panel(&arc, &fits[i..j], &checks[i..j], [cut(i as f64), cut(j as f64)], accuracy);
                // What a range cannot do no longer one can.
                if cell.is_none() {
                    break;
                }
            }
        }
        for (best, most) in best.iter_mut().zip(most_terms) {
            let Some(chain) = cheapest(&panels, *most) else { continue };
            let numbers = joined(&arc, &chain);
            let bytes = numbers.form().bytes();
            if best.as_ref().is_none_or(|(b, _)| bytes < *b) {
                *best = Some((bytes, numbers));
            }
        }
    }
    Ok(best.into_iter().map(|b| b.map(|(_, numbers)| numbers)).collect())
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

/// T_0 … and their derivatives at x.
fn chebyshev<const N: usize>(x: f64) -> ([f64; N], [f64; N]) {
    let (mut t, mut d) = ([0.0; N], [0.0; N]);
    for k in 0..N {
        (t[k], d[k]) = match k {
            0 => (1.0, 0.0),
            1 => (x, 1.0),
            _ => (2.0 * x * t[k - 1] - t[k - 2], 2.0 * t[k - 1] + 2.0 * x * d[k - 1] - d[k - 2]),
        };
    }
    (t, d)
}

/// Shapes of a panel, fewest terms first: rows, columns, and how fast the rows become shorter.
fn shapes() -> Vec<Vec<usize>> {
    let mut shapes: Vec<Vec<usize>> = Vec::new();
    for rows in 2..=ROWS {
        for columns in 3..=COLUMNS {
            for taper in [0.0, 0.4, 0.7, 1.0] {
                let row = |i: usize| columns as f64 * (1.0 - taper * i as f64 / rows as f64);
                let lengths: Vec<usize> = (0..rows).map(|i| (row(i).round() as usize).max(1)).collect();
                if !shapes.contains(&lengths) {
                    shapes.push(lengths);
                }
            }
        }
    }
    shapes.sort_by_key(|s| s.iter().sum::<usize>());
    shapes
}

/// The panel with the fewest terms that meets the accuracy over one range.
fn panel(
    arc: &Arc,
    fits: &[Vec<Sample>],
    checks: &[Vec<Sample>],
    [f0, f1]: [f64; 2],
    accuracy: &Accuracy,
) -> Option<Fitted> {
    let all = || fits.iter().chain(checks).flatten();
    let low = all().map(|s| s.arc).fold(f64::INFINITY, f64::min);
    let high = all().map(|s| s.arc).fold(f64::NEG_INFINITY, f64::max);
    let (load_axis, arc_axis) = (Axis::new(f0 as f32, f1 as f32), Axis::new(low as f32, high as f32));
    let position = |axis: Axis, x: f64| (x - f64::from(axis.centre)) * f64::from(axis.inverse_half);
    // Errors are counted in parts of what is allowed: the value's, and the slope's.
    let weights = |s: &Sample| {
        let slope = s.exact.by_twist / s.arc_by_twist;
        let by_arc = 2.0 * s.exact.gap_m * slope;
        (0.5 / s.exact.gap_m / accuracy.contraction_m, 1.0 / by_arc.abs() / accuracy.tr_relative, by_arc)
    };
    let mut normal = Box::new(Normal::<TERMS>::default());
    for s in fits.iter().flatten() {
        let (tx, _) = chebyshev::<ROWS>(position(load_axis, s.exact.load_n));
        let (ty, dy) = chebyshev::<COLUMNS>(position(arc_axis, s.arc));
        let (weight, slope_weight, by_arc) = weights(s);
        let scale = slope_weight * f64::from(arc_axis.inverse_half);
        let (mut v, mut d) = ([0.0; TERMS], [0.0; TERMS]);
        for i in 0..ROWS {
            for j in 0..COLUMNS {
                v[i * COLUMNS + j] = weight * tx[i] * ty[j];
                d[i * COLUMNS + j] = scale * tx[i] * dy[j];
            }
        }
        normal.add(&v, weight * s.exact.gap_m * s.exact.gap_m);
        normal.add(&d, slope_weight * by_arc);
    }
    for lengths in shapes() {
        let kept: Vec<usize> =
            lengths.iter().enumerate().flat_map(|(i, l)| (0..*l).map(move |j| i * COLUMNS + j)).collect();
        let Some(c) = normal.solve(&kept) else { continue };
        let mut rows = Vec::new();
        let mut rest = &c[..kept.len()];
        for length in &lengths {
            let (row, after) = rest.split_at(*length);
            rows.push(row.to_vec());
            rest = after;
        }
        let row_lengths: Vec<u8> = lengths.iter().map(|l| *l as u8).collect();
        let coefficients = in_powers(&rows);
        let panel = Panel {
            load_max_n: f1 as f32,
            load_axis,
            arc_axis,
            rows: [0, row_lengths.len() as u8],
            terms: [0, coefficients.len() as u16],
        };
        let growth = Growth { per_load_m_n: arc.per_load_m_n, powers: &arc.powers };
        let evaluate = |load: f64, twist: f64| {
            crate::arc::evaluate(&growth, &[panel], &row_lengths, &coefficients, load as f32, twist as f32)
        };
        let good = checks.iter().chain(fits).all(|cut| {
            let mut start = (f64::NAN, 0.0);
            cut.iter().all(|s| {
                let e = &s.exact;
                if start.0 != e.load_n {
                    start = (e.load_n, f64::from(evaluate(e.load_n, PRETWIST_RAD).gap_m));
                }
                let at = evaluate(e.load_n, e.twist_rad);
                let contraction = (start.1 - f64::from(at.gap_m) - (e.start_gap_m - e.gap_m)).abs();
                let tr = (e.by_twist / f64::from(at.dgap_dtwist_m_per_rad) - 1.0).abs();
                contraction <= MARGIN * accuracy.contraction_m && tr <= MARGIN * accuracy.tr_relative
            })
        });
        if good {
            return Some(Fitted { panel, row_lengths, coefficients });
        }
    }
    None
}

/// The chain of panels from the first cut to the last with the fewest bytes.
fn cheapest(panels: &[Vec<Option<Fitted>>], most_terms: usize) -> Option<Vec<Fitted>> {
    let mut best: Vec<Option<(usize, Vec<Fitted>)>> = vec![None; CUTS + 1];
    best[0] = Some((0, Vec::new()));
    for i in 0..CUTS {
        let Some((bytes, chain)) = best[i].clone() else { continue };
        for j in i + 1..=CUTS {
            let Some(fitted) = panels[i][j].as_ref().filter(|f| f.coefficients.len() <= most_terms) else { continue };
            let total = bytes + fitted.bytes();
            if best[j].as_ref().is_none_or(|(b, _)| total < *b) {
                let mut longer = chain.clone();
                longer.push(fitted.clone());
                best[j] = Some((total, longer));
            }
        }
    }
    best[CUTS].take().map(|(_, chain)| chain)
}

/// A chain of panels as one form.
fn joined(arc: &Arc, chain: &[Fitted]) -> Numbers {
    let (mut panels, mut row_lengths, mut coefficients) = (Vec::new(), Vec::new(), Vec::new());
    for f in chain {
        let (rows, terms) = (row_lengths.len() as u8, coefficients.len() as u16);
        panels.push(Panel { rows: [rows, f.panel.rows[1]], terms: [terms, f.panel.terms[1]], ..f.panel });
        row_lengths.extend(&f.row_lengths);
        coefficients.extend(&f.coefficients);
    }
    Numbers::Arc { per_load_m_n: arc.per_load_m_n, powers: arc.powers.clone(), panels, row_lengths, coefficients }
}
