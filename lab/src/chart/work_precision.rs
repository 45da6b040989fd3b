//! Work against precision on the desktop: the cost of an equilibrium by every method and tier, and its error; measured and drawn.

use super::{Inputs, Made};
use anyhow::Result;
use baseline_methods::Method;
use rig_config::Scene;
use rigctl::csv_text::below;
use rigctl::parallel::Progress;
use rigctl::plot::{Axis, Block, Figure, Item, KeyRow, Panel, Pen, RGBColor, Shape, colour};
use serde::Deserialize;
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
    /// Name of the scene.
    pub name: String,
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
pub fn measure(name: String, mechanism: &Mechanism, progress: &Progress<'_>) -> Result<Measured> {
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
    Ok(Measured { name, points, reference_m, states: states.len() })
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

/// Where an error of nothing at all, or of rounding, is drawn (m).
const FLOOR_M: f64 = 1e-17;
const ERRORS_M: [f64; 2] = [FLOOR_M, 1e-1];
/// Range of a time over that of the fastest.
const RATIOS: [f64; 2] = [0.7, 3e5];

/// One solver of one rod, as `cargo xtask bench` found it.
#[derive(Debug, Deserialize)]
struct Peer {
    solver: String,
    tolerance: Option<f64>,
    error_m: Option<f64>,
    us: Option<f64>,
    failed: usize,
}

/// Lines of other people's solvers.
const PEERS: [(&str, &str); 2] =
    [("solve_bvp", "SciPy's solve_bvp, one rod"), ("DOP853 shooting", "SciPy's DOP853, shooting, one rod")];

/// Scene, method and effort, error (m), time (µs) and its ratio, how many states failed and why: a line of `work-precision.csv`.
type Row = ([String; 3], [Option<String>; 3], usize, &'static str);
const HEADER: &str = "scene,method,effort,max_error_m,us,time_ratio,failed,failed_kind";

/// Measures the scene and the one with a plateau beside it, and draws them; beside them what `peers.csv` in the folder or in `out`
/// holds.
///
/// # Errors
/// If a scene cannot be solved, or the drawing fails.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let case = |(name, scene): (_, Scene)| measure(name, &scene.mechanism()?, inputs.progress);
    let cases = inputs.with_plateau().into_iter().map(case).collect::<Result<Vec<Measured>>>()?;
    let mut left_out = Vec::new();
    let peers = inputs.measured::<Peer>("peers.csv", "cargo xtask bench");
    let peers = peers.map_err(|e| left_out.push(format!("{e:#}"))).map(|(_, peers)| peers).unwrap_or_default();
    let figure = Figure {
        heading: "What one equilibrium costs on the desktop, by method and error".into(),
        rows: vec![Panel::side_by_side(
            cases.iter().map(times).chain((!peers.is_empty()).then(|| peers_panel(&peers))),
        )],
        panel_size: (380, 420),
        blocks: key(&peers),
        notes: vec![
            "One thread. With a stated number of nodes the first integral makes its rule anew for each state. Open: some \
             or all states failed."
                .into(),
        ],
    };
    let rows = cases.iter().flat_map(Measured::rows).chain(peers.iter().map(|peer| peer.row(&peers)));
    let csv = below(HEADER, rows)?;
    Ok(Made { left_out, ..Made::new(&figure, csv, cases.iter().flat_map(findings).collect())? })
}

/// Each method and its colour.
fn colours() -> impl Iterator<Item = (&'static str, RGBColor)> {
    Method::ALL.iter().enumerate().map(|(k, method)| (method.name(), colour(k, Method::ALL.len())))
}

impl Measured {
    /// Minimum time of all (s).
    fn fastest_s(&self) -> f64 {
        self.points.iter().map(|p| p.seconds).fold(f64::INFINITY, f64::min)
    }

    fn rows(&self) -> impl Iterator<Item = Row> {
        self.points.iter().map(|p| {
            let ratio = p.seconds / self.fastest_s();
            let numbers = [format!("{:.3e}", p.error_m), format!("{:.3}", p.seconds * 1e6), format!("{ratio:.2}")];
            let what = [self.name.clone(), p.way.line().into(), p.way.effort()];
            (what, numbers.map(Some), p.failed, p.reason.map_or("", |e| e.kind()))
        })
    }
}

impl Peer {
    /// Time of our own rod (µs).
    fn ours_us(peers: &[Self]) -> Option<f64> {
        peers.iter().find(|p| p.solver == "first-integral, rod").and_then(|p| p.us)
    }

    fn row(&self, peers: &[Self]) -> Row {
        let number = |x: f64| format!("{x:.3e}");
        let ratio = self.us.zip(Self::ours_us(peers)).map(|(us, ours)| number(us / ours));
        let effort = self.tolerance.map_or(String::new(), |t| format!("tolerance {t:.0e}"));
        let numbers = [self.error_m.map(number), self.us.map(|us| format!("{us:.3}")), ratio];
        (["one rod".into(), self.solver.clone(), effort], numbers, self.failed, "")
    }
}

/// Filled where every state has an answer.
fn shape(failed: usize) -> Shape {
    if failed > 0 { Shape::Circle } else { Shape::Dot }
}

fn panel(title: String, of_what: &str, items: Vec<Item>) -> Panel {
    let x = Axis::log(format!("largest error of the {of_what}, m"), ERRORS_M);
    Panel::new(title, x, Axis::log("time ÷ the fastest", RATIOS), items)
}

fn times(case: &Measured) -> Panel {
    let Measured { points, states, .. } = case;
    let fastest_s = case.fastest_s();
    let place = |p: &Point| (p.error_m.clamp(FLOOR_M, ERRORS_M[1]), p.seconds / fastest_s);
    let as_used = |p: &Point| p.way == Way::Method(Method::FirstIntegral { points: None });
    let mut items = Vec::new();
    for (name, colour) in colours() {
        let of_line = || points.iter().filter(|p| p.way.line() == name);
        items.push(Item::line(of_line().filter(|p| !as_used(p)).map(place), Pen::solid(colour)));
        let shape = |p: &Point| if as_used(p) { Shape::Diamond } else { shape(p.failed) };
        items.extend(of_line().map(|p| Item::mark(place(p), shape(p), colour)));
    }
    items.extend(points.iter().rev().filter_map(|p| match p.way {
        Way::Tier(tier) => Some(Item::mark(place(p), tier_shape(tier), tier_colour(tier))),
        Way::Method(_) => None,
    }));
    panel(format!("scene {}, {states} states", case.name), "gap", items)
}

/// What stretch changes is small, so that two models often have the same place.
fn tier_shape(tier: Tier) -> Shape {
    if tier == Tier::Elastica { Shape::Cross } else { Shape::Square }
}

fn tier_colour(tier: Tier) -> RGBColor {
    colour(tier as usize, Tier::ALL.len())
}

/// One rod under a given force, which is what others can be asked for.
fn peers_panel(peers: &[Peer]) -> Panel {
    let ours_us = Peer::ours_us(peers).unwrap_or(f64::NAN);
    let mut items = Vec::new();
    for (k, (solver, _)) in PEERS.iter().enumerate() {
        let of_line = peers.iter().filter(|p| p.solver == *solver);
        let placed =
            of_line.filter_map(|p| Some(((p.error_m?.clamp(FLOOR_M, ERRORS_M[1]), p.us? / ours_us), p.failed)));
        let placed: Vec<_> = placed.collect();
        items.push(Item::line(placed.iter().map(|(at, _)| *at), peer_pen(k)));
        items.extend(placed.iter().map(|(at, failed)| Item::mark(*at, shape(*failed), peer_pen(k).colour)));
    }
    // Against itself there is no error: that of the rule that it stops at.
    items.push(Item::mark((1e-14, 1.0), Shape::Diamond, colour(0, Method::ALL.len())));
    panel("one of the paper's rods, 12 states".into(), "tip", items)
}

fn peer_pen(k: usize) -> Pen {
    Pen::dashed(colour(2 + k, 6))
}

fn key(peers: &[Peer]) -> Vec<Block> {
    let line = |(name, colour)| KeyRow::line(Pen::solid(colour), in_words(name));
    let peers = PEERS.iter().enumerate().filter(|_| !peers.is_empty());
    let peers = peers.map(|(k, (_, name))| KeyRow::line(peer_pen(k), *name));
    let cheaper = Tier::ALL.into_iter().filter(|t| *t != Tier::Full);
    let cheaper = cheaper.map(|t| KeyRow::mark(tier_shape(t), tier_colour(t), format!("cheaper model: {}", t.name())));
    let used = KeyRow::mark(Shape::Diamond, colour(0, Method::ALL.len()), "first integral as it is used");
    vec![Block::new(colours().map(line)), Block::new(cheaper), Block::new([used].into_iter().chain(peers))]
}

fn findings(case: &Measured) -> Vec<String> {
    let points = &case.points;
    let ours = points.iter().find(|p| p.way == Way::Method(Method::FirstIntegral { points: None }));
    let Some(Point { seconds, error_m, .. }) = ours else { return Vec::new() };
    let mut lines = vec![format!(
        "{}: the first integral takes {:.1} µs for {error_m:.0e} m; the reference is known to {:.0e} m",
        case.name,
        seconds * 1e6,
        case.reference_m
    )];
    for (name, _) in colours().skip(1) {
        let good = points.iter().filter(|p| p.way.line() == name && p.failed == 0 && p.error_m <= 1e-9);
        let text = match good.min_by(|a, b| a.seconds.total_cmp(&b.seconds)) {
            Some(p) => format!("{:.0} times as long, {}", p.seconds / seconds, p.way.effort()),
            None => "not reached at any effort".into(),
        };
        lines.push(format!("  {name} for 1e-9 m at every state: {text}"));
    }
    lines
}
