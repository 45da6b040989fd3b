//! Work against precision as a picture.

use super::work::{self, Measured, Point, Way, in_words};
use super::{Inputs, Made};
use crate::table;
use anyhow::Result;
use baseline_methods::Method;
use rig_config::Scene;
use rigctl::plot::{Axis, Block, Figure, Item, KeyRow, Panel, Pen, RGBColor, Shape, colour};
use serde::Deserialize;
use tsa_model::Tier;

/// Where an error of nothing at all, or of rounding, is drawn (m).
const FLOOR_M: f64 = 1e-17;
const ERRORS_M: [f64; 2] = [FLOOR_M, 1e-1];
/// Range of a time over that of the fastest.
const RATIOS: [f64; 2] = [0.7, 3e5];

/// A scene's measurements.
struct Case {
    name: String,
    measured: Measured,
}

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
    let case =
        |(name, scene): (_, Scene)| Ok(Case { name, measured: work::measure(&scene.mechanism()?, inputs.progress)? });
    let cases = inputs.with_plateau().into_iter().map(case).collect::<Result<Vec<Case>>>()?;
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
    let rows = cases.iter().flat_map(Case::rows).chain(peers.iter().map(|peer| peer.row(&peers)));
    let csv = table(HEADER, rows)?;
    Ok(Made { left_out, ..Made::new(&figure, csv, cases.iter().flat_map(findings).collect())? })
}

/// Each method and its colour.
fn colours() -> impl Iterator<Item = (&'static str, RGBColor)> {
    Method::ALL.iter().enumerate().map(|(k, method)| (method.name(), colour(k, Method::ALL.len())))
}

impl Case {
    /// Minimum time of all (s).
    fn fastest_s(&self) -> f64 {
        self.measured.points.iter().map(|p| p.seconds).fold(f64::INFINITY, f64::min)
    }

    fn rows(&self) -> impl Iterator<Item = Row> {
        self.measured.points.iter().map(|p| {
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

fn times(case: &Case) -> Panel {
    let Measured { points, states, .. } = &case.measured;
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

fn findings(case: &Case) -> Vec<String> {
    let points = &case.measured.points;
    let ours = points.iter().find(|p| p.way == Way::Method(Method::FirstIntegral { points: None }));
    let Some(Point { seconds, error_m, .. }) = ours else { return Vec::new() };
    let mut lines = vec![format!(
        "{}: the first integral takes {:.1} µs for {error_m:.0e} m; the reference is known to {:.0e} m",
        case.name,
        seconds * 1e6,
        case.measured.reference_m
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
