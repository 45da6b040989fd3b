//! Work against precision as a picture.

use super::rods;
use super::work::{self, Measured, Point, Way};
use super::{Inputs, Made, stem};
use crate::table;
use anyhow::Result;
use baseline_methods::Method;
use rig_config::Scene;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, RGBColor, Shape, colour};
use serde::Deserialize;
use tsa_model::Tier;

/// Where an error of nothing at all, or of rounding, is drawn (m).
const FLOOR_M: f64 = 1e-17;
/// Further rounds of what is fast.
const ROUNDS: usize = 3;
const ERRORS_M: [f64; 2] = [FLOOR_M, 1e-1];
/// Range of a time over the fastest's.
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
    [("solve_bvp", "one rod: SciPy's solve_bvp"), ("DOP853 shooting", "one rod: SciPy's DOP853, shooting")];

/// Scene, method and effort, error (m), time (µs) and its ratio, how many states failed and why: a line of `work-precision.csv`.
type Row = ([String; 3], [Option<String>; 3], usize, &'static str);
const HEADER: &str = "scene,method,effort,max_error_m,us,time_ratio,failed,failed_kind";

/// Measures the scene, the one with a plateau beside it and a slender rod, and draws them; beside them what `peers.csv`
/// in the folder or in `out` holds.
///
/// # Errors
/// If a scene cannot be solved, or the drawing fails.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let plateau = inputs.scene_file.with_file_name("niti-plateau.toml");
    let mut scenes = vec![(inputs.scene.mechanism()?, stem(inputs.scene_file), ROUNDS)];
    let mut left_out = Vec::new();
    match Scene::load(&plateau) {
        Ok(other) => scenes.push((other.mechanism()?, stem(&plateau), ROUNDS)),
        Err(e) => left_out.push(e.to_string()),
    }
    // Its failures take so long that only their time is of interest.
    scenes.push((rods::SLENDER.mechanism()?, "slender rod".into(), 0));
    let case = |(mechanism, name, rounds): (_, String, usize)| {
        Ok(Case { name, measured: work::measure(&mechanism, rounds, inputs.progress)? })
    };
    let cases = scenes.into_iter().map(case).collect::<Result<Vec<Case>>>()?;
    let peers = inputs.measured::<Peer>("peers.csv", "cargo xtask bench");
    let peers = peers.map_err(|e| left_out.push(format!("{e:#}"))).map(|(_, peers)| peers).unwrap_or_default();
    let panels = cases.iter().map(times).chain((!peers.is_empty()).then(|| peers_panel(&peers))).collect::<Vec<_>>();
    let figure = Figure {
        heading: "Work against precision: one full equilibrium on the desktop".into(),
        rows: panels.chunks(2).map(<[Panel]>::to_vec).collect(),
        panel_size: (560, 380),
        blocks: key(!peers.is_empty()),
        notes: vec![notes(&cases)],
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

fn times(case: &Case) -> Panel {
    let Measured { points, states, .. } = &case.measured;
    let fastest_s = case.fastest_s();
    let place = |p: &Point| (p.error_m.clamp(FLOOR_M, ERRORS_M[1]), p.seconds / fastest_s);
    let mut items = Vec::new();
    for (name, colour) in colours() {
        let of_line = || points.iter().filter(|p| p.way.line() == name);
        let automatic = |p: &Point| p.way == Way::Method(Method::FirstIntegral { points: None });
        items.push(Item::line(of_line().filter(|p| !automatic(p)).map(place), Pen::solid(colour)));
        items.extend(of_line().map(|p| {
            let shape = match p {
                _ if p.failed > 0 => Shape::Circle,
                _ if automatic(p) => Shape::Diamond,
                _ => Shape::Dot,
            };
            // What has no answer at all stands at the right edge.
            let (error, cost) = place(p);
            Item::mark((if p.failed == *states { ERRORS_M[1] } else { error }, cost), shape, colour)
        }));
    }
    for p in points {
        let (Way::Tier(tier), at) = (p.way, place(p)) else { continue };
        if p.failed > 0 {
            items.push(Item::mark(at, Shape::Square, INK));
        }
        items.push(Item::label(at, (1 + tier as usize).to_string(), INK));
    }
    let x = Axis::log("largest error of the gap, m", ERRORS_M);
    Panel::new(format!("{}, {states} states", case.name), x, Axis::log("time over the fastest's", RATIOS), items)
}

/// One rod under a given force, which is what others can be asked for.
fn peers_panel(peers: &[Peer]) -> Panel {
    let ours_us = Peer::ours_us(peers).unwrap_or(f64::NAN);
    let place = |p: &Peer| Some((p.error_m?.clamp(FLOOR_M, ERRORS_M[1]), p.us? / ours_us));
    let mut items = Vec::new();
    for (k, (solver, _)) in PEERS.iter().enumerate() {
        let of_line = || peers.iter().filter(|p| p.solver == *solver);
        items.push(Item::line(of_line().filter_map(place), Pen::dashed(colour(2 + k, 6))));
        let shape = |p: &Peer| if p.failed > 0 { Shape::Circle } else { Shape::Dot };
        items.extend(of_line().filter_map(|p| Some(Item::mark(place(p)?, shape(p), colour(2 + k, 6)))));
    }
    // Against itself there is no error: that of the rule that it stops at.
    items.push(Item::mark((1e-14, 1.0), Shape::Diamond, colour(0, Method::ALL.len())));
    let x = Axis::log("largest error of the tip, m", ERRORS_M);
    Panel::new("one of the paper's rods, 12 states", x, Axis::log("time over the first integral's", RATIOS), items)
}

fn key(with_peers: bool) -> Vec<Block> {
    let titled = |name| match name {
        "first-integral" => "first-integral (ours)",
        "paper" => "paper: RK4 shooting, relaxed",
        "adaptive-shooting" => "DOP853 of differential-equations 0.7, shooting",
        other => other,
    };
    let line = |(name, colour)| KeyRow::line(Pen::solid(colour), titled(name));
    let peers = PEERS.iter().enumerate().filter(|_| with_peers);
    let peers = peers.map(|(k, (_, name))| KeyRow::line(Pen::dashed(colour(2 + k, 6)), *name));
    let cheaper = Tier::ALL.into_iter().filter(|t| *t != Tier::Full);
    vec![
        Block::new(colours().map(line).chain(peers)),
        Block::new([
            KeyRow::mark(Shape::Dot, INK, "steps or tolerances of a method"),
            KeyRow::mark(Shape::Circle, INK, "some or all states failed"),
            KeyRow::mark(Shape::Diamond, INK, "first integral as it is used"),
        ]),
        Block::new(cheaper.map(|t| KeyRow::text([format!("{}  {}, cheaper model", 1 + t as usize, t.name())]))),
    ]
}

fn notes(cases: &[Case]) -> String {
    let reference = |case: &Case| format!("{}: {:.0e} m", case.name, case.measured.reference_m);
    format!(
        "Loads of 1 to 17 N, 0 to 7.5 turns, one thread; a time is the least of three rounds. With a stated number of nodes \
         the first integral makes its rule anew for each state. A square around a number: the model has no answer for some \
         states. How many states failed, and why, is in the data. The reference has 96 nodes; it differs from that on 64 by: {}.",
        cases.iter().map(reference).collect::<Vec<_>>().join(", ")
    )
}

fn findings(case: &Case) -> Vec<String> {
    let points = &case.measured.points;
    let ours = points.iter().find(|p| p.way == Way::Method(Method::FirstIntegral { points: None }));
    let Some(Point { seconds, error_m, .. }) = ours else { return Vec::new() };
    let mut lines =
        vec![format!("{}: the first integral takes {:.1} us for {error_m:.0e} m", case.name, seconds * 1e6)];
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
