//! Work against precision on the desktop: the cost of an equilibrium by every method and tier, and its error.

use anyhow::Result;
use baseline_methods::Method;
use rigctl::parallel::Progress;
use std::hint::black_box;
use std::time::{Duration, Instant};
use tsa_model::{Equilibrium, Mechanism, SolveError, Tier, twist_from_turns};

/// One way of solving with its effort.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Way {
    /// The full model by a method.
    Method(Method),
    /// A cheaper model.
    Tier(Tier),
}

impl Way {
    /// Name of its line.
    pub fn line(&self) -> &'static str {
        match self {
            Self::Method(method) => method.name(),
            Self::Tier(tier) => tier.name(),
        }
    }

    /// Its steps or its tolerance.
    pub fn effort(&self) -> String {
        match *self {
            Self::Method(Method::FirstIntegral { points: Some(points) }) => format!("{points} nodes"),
            Self::Method(Method::FirstIntegral { points: None }) => "automatic".into(),
            Self::Method(Method::Paper { steps, .. }) => format!("{steps} steps"),
            Self::Method(Method::AdaptiveShooting { tolerance }) => format!("tolerance {tolerance:.0e}"),
            Self::Method(Method::Collocation { intervals, .. }) => format!("{intervals} intervals"),
            Self::Method(Method::Continuation { steps }) => format!("{steps} steps"),
            Self::Tier(_) => String::new(),
        }
    }

    fn solve(&self, mechanism: &Mechanism, (load, twist): (f64, f64)) -> Result<Equilibrium, SolveError> {
        match *self {
            Self::Method(method) => method.solve(mechanism, load, twist),
            Self::Tier(tier) => mechanism.formal_tier(tier, load, twist),
        }
    }
}

/// A method's name in words.
pub fn in_words(name: &'static str) -> &'static str {
    match name {
        "first-integral" => "first integral (ours)",
        "paper" => "the paper's shooting, damped",
        "paper, factor 0.5" => "the paper's, damped",
        "paper, factor 1" => "the paper's, undamped",
        "adaptive-shooting" => "adaptive shooting",
        other => other,
    }
}

/// Every line from coarse to fine.
pub fn ways() -> Vec<Way> {
    let mut all = Vec::new();
    all.extend([2, 3, 4, 6, 8, 12, 16, 24, 48].map(|n| Method::FirstIntegral { points: Some(n) }));
    all.push(Method::FirstIntegral { points: None });
    all.extend([4, 8, 16, 32, 64, 128].map(|steps| Method::Paper { steps, relaxation: 0.5, tolerance: 1e-12 }));
    all.extend([1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13].map(|tolerance| Method::AdaptiveShooting { tolerance }));
    all.extend([2, 4, 8, 16, 32, 64, 128].map(|intervals| Method::Collocation { intervals, tolerance: 1e-13 }));
    all.extend([1, 4, 16].map(|steps| Method::Continuation { steps }));
    let tiers = Tier::ALL.into_iter().filter(|t| *t != Tier::Full).map(Way::Tier);
    all.into_iter().map(Way::Method).chain(tiers).collect()
}

/// Loads (N) and twists (rad), evenly spaced over the range of the paper's load sweep (section 4.2) with its ends.
pub fn states(loads: u32, twists: u32) -> Vec<(f64, f64)> {
    let part = |k: u32, count: u32| f64::from(k) / f64::from(count - 1);
    let at = |i, j| (1.0 + 16.0 * part(i, loads), twist_from_turns(7.5 * part(j, twists)));
    (0..loads).flat_map(|i| (0..twists).map(move |j| at(i, j))).collect()
}

/// Loads and twists at which the ways are compared.
const COMPARED: (u32, u32) = (4, 4);

/// A point of a line.
#[derive(Debug, Clone)]
pub struct Point {
    /// The way.
    pub way: Way,
    /// Largest error of the gap over the states that were solved (m).
    pub error_m: f64,
    /// States without an answer, and the first reason.
    pub failed: usize,
    /// The first reason.
    pub reason: Option<SolveError>,
    /// Minimum time for one state, of all rounds, the failed ones included (s).
    pub seconds: f64,
}

/// All points of a scene, and how well the reference is known.
#[derive(Debug, Clone)]
pub struct Measured {
    /// The points.
    pub points: Vec<Point>,
    /// Largest difference of the reference from itself on a third fewer nodes (m).
    pub reference_m: f64,
    /// How many states have an equilibrium; the others are left out.
    pub states: usize,
}

/// How often each way is measured after the first time, and for how long.
const ROUNDS: usize = 3;
const LAP: Duration = Duration::from_millis(20);

/// Measures every way over states of the published range: once, and in further rounds in which all ways take turns, so that a
/// disturbance of some seconds affects one round only.
///
/// # Errors
/// If the reference has no answer.
pub fn measure(mechanism: &Mechanism, progress: &Progress<'_>) -> Result<Measured> {
    let mut states = states(COMPARED.0, COMPARED.1);
    states.retain(|(load, twist)| mechanism.solve(*load, *twist).is_ok());
    let reference = |nodes: usize| {
        let way = Way::Method(Method::FirstIntegral { points: Some(nodes) });
        states.iter().map(|s| Ok(way.solve(mechanism, *s)?.gap_m)).collect::<Result<Vec<f64>, SolveError>>()
    };
    let [exact, coarser] = [96, 64].map(reference);
    let (exact, coarser) = (exact?, coarser?);
    let reference_m = exact.iter().zip(&coarser).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let mut points: Vec<Point> = ways().into_iter().map(|way| judged(way, mechanism, &states, &exact)).collect();
    let count = points.len();
    for round in 0..ROUNDS {
        for (k, point) in points.iter_mut().enumerate() {
            point.seconds = point.seconds.min(lap(point.way, mechanism, &states));
            progress(round * count + k + 1, ROUNDS * count);
        }
    }
    Ok(Measured { points, reference_m, states: states.len() })
}

fn judged(way: Way, mechanism: &Mechanism, states: &[(f64, f64)], exact: &[f64]) -> Point {
    let mut point = Point { way, error_m: 0.0, failed: 0, reason: None, seconds: f64::INFINITY };
    let begin = Instant::now();
    for (state, exact) in states.iter().zip(exact) {
        match way.solve(mechanism, *state) {
            Ok(e) => point.error_m = point.error_m.max((e.gap_m - exact).abs()),
            Err(e) => {
                point.failed += 1;
                point.reason.get_or_insert(e);
            }
        }
    }
    point.seconds = begin.elapsed().as_secs_f64() / states.len().max(1) as f64;
    point
}

/// Minimum time of a state over one lap (s).
fn lap(way: Way, mechanism: &Mechanism, states: &[(f64, f64)]) -> f64 {
    let begin = Instant::now();
    let mut min = f64::INFINITY;
    loop {
        let before = Instant::now();
        for state in states {
            let _ = black_box(way.solve(mechanism, black_box(*state)));
        }
        min = min.min(before.elapsed().as_secs_f64() / states.len() as f64);
        if begin.elapsed() > LAP {
            return min;
        }
    }
}
