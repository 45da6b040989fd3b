//! Work against precision as a picture.

use super::Made;
use super::work::{self, Measured, Point, Way};
use crate::failure::Failure;
use crate::output::csv_text;
use crate::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, Sample, Shape, colour};
use plotters::style::RGBColor;
use std::path::Path;
use tsa_model::{Method, Scene, Tier};

/// Where an error of nothing at all, or of rounding, is drawn (m).
const FLOOR_M: f64 = 1e-17;
const ERRORS_M: [f64; 2] = [FLOOR_M, 1e-1];

/// A scene's measurements.
struct Case {
    name: String,
    measured: Measured,
}

/// Measures the scene and the one with a plateau beside it, and draws both.
///
/// # Errors
/// If a scene cannot be solved, or the drawing fails.
pub fn make(scene: &Scene, scene_file: &Path) -> Result<Made, Failure> {
    let plateau = scene_file.with_file_name("niti-plateau.toml");
    let mut cases = vec![(scene.clone(), scene_file)];
    match Scene::load(&plateau) {
        Ok(other) => cases.push((other, &plateau)),
        Err(e) => eprintln!("left out: {e}"),
    }
    let mut found = Vec::new();
    for (scene, file) in &cases {
        let mut measured = work::measure(&scene.mechanism()?)?;
        if let Err(e) = work::count(&mut measured.points, file) {
            eprintln!("left out: instructions: {}", e.message().unwrap_or_default());
        }
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        found.push(Case { name, measured });
    }
    let mut rows = vec![found.iter().map(times).collect::<Vec<_>>()];
    if found.iter().any(|c| c.measured.points.iter().any(|p| p.instructions.is_some())) {
        rows.push(found.iter().map(instructions).collect());
    }
    let figure = Figure {
        heading: "Work against precision: one full equilibrium on the desktop".into(),
        rows,
        panel_size: (560, 400),
        blocks: key(),
        notes: notes(&found),
    };
    Ok(Made { name: "work-precision", svg: Some(figure.svg()?), csv: csv(&found)?, said: said(&found) })
}

fn colours() -> Vec<(&'static str, RGBColor)> {
    let names: Vec<&str> = Method::ALL.iter().map(Method::name).collect();
    names.iter().enumerate().map(|(k, name)| (*name, colour(k, names.len()))).collect()
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
            let none = p.failed == work::states().len();
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
        title: format!("{}, {} states", case.name, work::states().len()),
        x: Axis::log("largest error of the gap, m", ERRORS_M),
        y: Axis::log(label, range),
        items,
    }
}

fn key() -> Vec<Block> {
    let line = |(name, colour): (&str, RGBColor)| KeyRow::sample(Sample::Line(Pen::solid(colour)), name);
    let mark = |shape, name: &str| KeyRow::sample(Sample::Mark(shape, INK), name);
    let cheaper = Tier::ALL.into_iter().filter(|t| *t != Tier::Full);
    let tiers = cheaper.map(|t| KeyRow::text([format!("{}  {}, cheaper model", 1 + t as usize, t.name())])).collect();
    vec![
        Block { rows: colours().into_iter().map(line).collect() },
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
        let failed: Vec<String> = m.points.iter().filter(|p| p.failed > 0).map(failure).collect();
        let failed = if failed.is_empty() { "none failed".into() } else { failed.join("; ") };
        notes.push(format!(
            "{}: reference on 96 nodes, {:.0e} m from that on 64. Failed: {failed}.",
            case.name, m.reference_m
        ));
    }
    notes
}

fn failure(p: &Point) -> String {
    let kind = p.reason.map_or("", |e| e.kind());
    format!("{} {} ({} of {}, {kind})", p.way.line(), p.way.effort(), p.failed, work::states().len())
}

fn csv(found: &[Case]) -> Result<String, Failure> {
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
    csv_text(&header, lines)
}

fn said(found: &[Case]) -> Vec<String> {
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
