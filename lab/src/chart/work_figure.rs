//! Work against precision as a picture.

use super::rods;
use super::work::{self, Measured, Point, Way};
use super::{Inputs, Made};
use anyhow::{Context, Result};
use plotters::style::RGBColor;
use rig_config::Scene;
use rigctl::csv_text::csv_text;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, Sample, Shape, colour};
use rival_methods::Method;
use serde::Deserialize;
use tsa_model::Tier;

/// Where an error of nothing at all, or of rounding, is drawn (m).
const FLOOR_M: f64 = 1e-17;
/// Further rounds of what is fast.
const ROUNDS: usize = 3;
const ERRORS_M: [f64; 2] = [FLOOR_M, 1e-1];

/// A scene's measurements.
struct Case {
    name: String,
    measured: Measured,
}

impl Case {
    fn is_counted(&self) -> bool {
        self.measured.points.iter().any(|p| p.instructions.is_some())
    }
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

/// Measures the scene, the one with a plateau beside it and a slender rod, and draws them; beside them what `peers.csv`
/// in the folder or in `out` holds.
///
/// # Errors
/// If a scene cannot be solved, or the drawing fails.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let plateau = inputs.scene_file.with_file_name("niti-plateau.toml");
    let mut cases = vec![(inputs.scene.clone(), inputs.scene_file)];
    let mut left_out = Vec::new();
    match Scene::load(&plateau) {
        Ok(other) => cases.push((other, &plateau)),
        Err(e) => left_out.push(e.to_string()),
    }
    let mut found = Vec::new();
    for (scene, file) in &cases {
        let mut measured = work::measure(&scene.mechanism()?, ROUNDS, inputs.progress)?;
        if let Err(e) = work::count(&mut measured.points, file, inputs.kernel) {
            left_out.push(format!("instructions: {e:#}"));
        }
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        found.push(Case { name, measured });
    }
    // Its failures take so long that only their time is of interest.
    found.push(Case {
        name: "slender rod".into(),
        measured: work::measure(&rods::SLENDER.mechanism()?, 0, inputs.progress)?,
    });
    let peers = peers(inputs).map_err(|e| left_out.push(format!("{e:#}"))).ok();
    let mut second: Vec<Panel> = found.iter().filter(|c| c.is_counted()).map(instructions).collect();
    second.extend(peers.as_deref().map(peers_panel));
    let mut rows = vec![found.iter().map(times).collect::<Vec<_>>()];
    rows.extend((!second.is_empty()).then_some(second));
    let figure = Figure {
        heading: "Work against precision: one full equilibrium on the desktop".into(),
        rows,
        panel_size: (420, 360),
        blocks: key(peers.is_some()),
        notes: notes(&found),
    };
    Ok(Made {
        name: "work-precision",
        svg: Some(figure.svg()?),
        csv: csv(&found, peers.as_deref().unwrap_or_default())?,
        findings: findings(&found),
        left_out,
    })
}

fn colours() -> Vec<(&'static str, RGBColor)> {
    let names: Vec<&str> = Method::ALL.iter().map(Method::name).collect();
    names.iter().enumerate().map(|(k, name)| (*name, colour(k, names.len()))).collect()
}

/// What stands behind a method's name.
fn titled(name: &str) -> &str {
    match name {
        "first-integral" => "first-integral (ours)",
        "paper" => "paper: RK4 shooting, relaxed",
        "adaptive-shooting" => "DOP853 of differential-equations 0.7, shooting",
        other => other,
    }
}

fn times(case: &Case) -> Panel {
    let fastest = case.measured.points.iter().map(|p| p.seconds).fold(f64::INFINITY, f64::min);
    let cost = |p: &Point| Some(p.seconds / fastest);
    panel(case, "time over the fastest's", [0.7, 3e5], cost)
}

fn instructions(case: &Case) -> Panel {
    panel(case, "instructions", [1e3, 3e9], |p| p.instructions)
}

fn panel(case: &Case, label: &str, range: [f64; 2], cost: impl Fn(&Point) -> Option<f64>) -> Panel {
    let place = |p: &Point| Some((p.error_m.clamp(FLOOR_M, ERRORS_M[1]), cost(p)?));
    let mut items = Vec::new();
    for (name, colour) in colours() {
        let of_line = || case.measured.points.iter().filter(|p| p.way.line() == name);
        let fixed = |p: &&Point| p.way != Way::Method(Method::FirstIntegral { points: None });
        let points: Vec<(f64, f64)> = of_line().filter(fixed).filter_map(place).collect();
        items.push(Item::Line { points, pen: Pen::solid(colour) });
        for p in of_line() {
            let shape = match p {
                _ if p.failed > 0 => Shape::Circle,
                _ if !fixed(&p) => Shape::Diamond,
                _ => Shape::Dot,
            };
            // What has no answer at all stands at the right edge.
            let none = p.failed == case.measured.states;
            let at = place(p).map(|(error, cost)| (if none { ERRORS_M[1] } else { error }, cost));
            items.extend(at.map(|at| Item::Mark { at, shape, colour }));
        }
    }
    for p in &case.measured.points {
        let (Way::Tier(tier), Some(at)) = (p.way, place(p)) else { continue };
        if p.failed > 0 {
            items.push(Item::Mark { at, shape: Shape::Square, colour: INK });
        }
        items.push(Item::Label { at, text: (1 + tier as usize).to_string(), colour: INK });
    }
    Panel {
        title: format!("{}, {} states", case.name, case.measured.states),
        x: Axis::log("largest error of the gap, m", ERRORS_M),
        y: Axis::log(label, range),
        items,
    }
}

/// Lines of other people's solvers.
const PEERS: [(&str, &str); 2] =
    [("solve_bvp", "one rod: SciPy's solve_bvp"), ("DOP853 shooting", "one rod: SciPy's DOP853, shooting")];

fn peers(inputs: &Inputs<'_>) -> Result<Vec<Peer>> {
    let text = inputs.measured("peers.csv", "cargo xtask bench")?;
    let peers = csv::Reader::from_reader(text.as_bytes()).deserialize().collect::<Result<_, _>>();
    peers.context("peers.csv")
}

/// One rod under a given force, which is what others can be asked for.
fn peers_panel(peers: &[Peer]) -> Panel {
    let ours_us = peers.iter().find(|p| p.solver == "first-integral, rod").and_then(|p| p.us).unwrap_or(f64::NAN);
    let place = |p: &Peer| Some((p.error_m?.clamp(FLOOR_M, ERRORS_M[1]), p.us? / ours_us));
    let mut items = Vec::new();
    for (k, (solver, _)) in PEERS.iter().enumerate() {
        let of_line = || peers.iter().filter(|p| p.solver == *solver);
        items.push(Item::Line { points: of_line().filter_map(place).collect(), pen: Pen::dashed(colour(2 + k, 6)) });
        items.extend(of_line().filter_map(|p| {
            let shape = if p.failed > 0 { Shape::Circle } else { Shape::Dot };
            Some(Item::Mark { at: place(p)?, shape, colour: colour(2 + k, 6) })
        }));
    }
    // Against itself there is no error: that of the rule that it stops at.
    items.push(Item::Mark { at: (1e-14, 1.0), shape: Shape::Diamond, colour: colours()[0].1 });
    Panel {
        title: "one of the paper's rods, 12 states".into(),
        x: Axis::log("largest error of the tip, m", ERRORS_M),
        y: Axis::log("time over the first integral's", [0.7, 3e5]),
        items,
    }
}

fn key(with_peers: bool) -> Vec<Block> {
    let line = |(name, colour): (&str, RGBColor)| KeyRow::sample(Sample::Line(Pen::solid(colour)), titled(name));
    let peers = PEERS.iter().enumerate().filter(|_| with_peers);
    let peers = peers.map(|(k, (_, name))| KeyRow::sample(Sample::Line(Pen::dashed(colour(2 + k, 6))), *name));
    let mark = |shape, name: &str| KeyRow::sample(Sample::Mark(shape, INK), name);
    let cheaper = Tier::ALL.into_iter().filter(|t| *t != Tier::Full);
    let tiers = cheaper.map(|t| KeyRow::text([format!("{}  {}, cheaper model", 1 + t as usize, t.name())])).collect();
    vec![
        Block { rows: colours().into_iter().map(line).chain(peers).collect() },
        Block {
            rows: vec![
                mark(Shape::Dot, "steps or tolerances of a method"),
                mark(Shape::Circle, "some or all states failed"),
                mark(Shape::Diamond, "first integral as it is used"),
            ],
        },
        Block { rows: tiers },
    ]
}

fn notes(found: &[Case]) -> Vec<String> {
    let mut notes = vec![
        "Loads of 1 to 17 N, 0 to 7.5 turns, one thread; a time is the least of three rounds, instructions are of \
         four of the states. With a stated number of nodes the first integral makes its rule anew for each state. A \
         square around a number: the model has no answer for some states."
            .to_owned(),
    ];
    for case in found {
        let m = &case.measured;
        let mut failed: Vec<String> = Vec::new();
        for line in m.points.chunk_by(|a, b| a.way.line() == b.way.line()) {
            let counts: Vec<usize> = line.iter().map(|p| p.failed).filter(|failed| *failed > 0).collect();
            let (Some(least), Some(most)) = (counts.iter().min(), counts.iter().max()) else { continue };
            let kind = line.iter().find_map(|p| p.reason).map_or("", |e| e.kind());
            let often = if least == most { least.to_string() } else { format!("{least} to {most}") };
            let who = if counts.len() == line.len() { "every point" } else { "some points" };
            failed.push(format!("{} ({who}: {often} states, {kind})", line[0].way.line()));
        }
        let failed = if failed.is_empty() { "none failed".into() } else { failed.join("; ") };
        notes.push(format!(
            "{}: reference on 96 nodes, {:.0e} m from that on 64. Failed: {failed}.",
            case.name, m.reference_m
        ));
    }
    notes
}

fn csv(found: &[Case], peers: &[Peer]) -> Result<String> {
    let lines = found.iter().flat_map(|case| {
        let fastest = case.measured.points.iter().map(|p| p.seconds).fold(f64::INFINITY, f64::min);
        case.measured.points.iter().map(move |p| {
            vec![
                case.name.clone(),
                p.way.line().into(),
                p.way.effort(),
                format!("{:.3e}", p.error_m),
                format!("{:.3}", p.seconds * 1e6),
                format!("{:.2}", p.seconds / fastest),
                p.instructions.map_or(String::new(), |n| format!("{n:.0}")),
                p.failed.to_string(),
                p.reason.map_or(String::new(), |e| e.kind().into()),
            ]
        })
    });
    let header =
        ["scene", "method", "effort", "max_error_m", "us", "time_ratio", "instructions", "failed", "failed_kind"];
    let number = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:.3e}"));
    let ours_us = peers.iter().find(|p| p.solver == "first-integral, rod").and_then(|p| p.us);
    let others = peers.iter().map(|p| {
        let effort = p.tolerance.map_or(String::new(), |t| format!("tolerance {t:.0e}"));
        let ratio = number(p.us.zip(ours_us).map(|(us, ours)| us / ours));
        let us = p.us.map_or(String::new(), |us| format!("{us:.3}"));
        let known = ["one rod".into(), p.solver.clone(), effort, number(p.error_m), us, ratio, String::new()];
        known.into_iter().chain([p.failed.to_string(), String::new()]).collect()
    });
    csv_text(&header, lines.chain(others))
}

fn findings(found: &[Case]) -> Vec<String> {
    let mut lines = Vec::new();
    for case in found {
        let points = &case.measured.points;
        let Some(ours) = points.iter().find(|p| p.way == Way::Method(Method::FirstIntegral { points: None })) else {
            continue;
        };
        lines.push(format!(
            "{}: the first integral takes {:.1} us for {:.0e} m",
            case.name,
            ours.seconds * 1e6,
            ours.error_m
        ));
        for (name, _) in colours().into_iter().skip(1) {
            let good = points.iter().filter(|p| p.way.line() == name && p.failed == 0 && p.error_m <= 1e-9);
            let text = match good.min_by(|a, b| a.seconds.total_cmp(&b.seconds)) {
                Some(p) => format!("{:.0} times as long, {}", p.seconds / ours.seconds, p.way.effort()),
                None => "not reached at any effort".into(),
            };
            lines.push(format!("  {name} for 1e-9 m at every state: {text}"));
        }
    }
    lines
}
