//! `identify --figure`: a rig before and after its calibration, contraction under each load by the scene's constants and by the
//! identified ones, with the measured equilibria on them.

use crate::failure::Failure;
use crate::identify::Identified;
use crate::identify::data::{Data, Quantity, Row};
use crate::identify::predict::Prediction;
use crate::plot::{Axis, Block, Figure, GREY, INK, Item, KeyRow, Panel, Pen, Sample, Shape, colour, extent};
use crate::units::N;
use rig_config::Scene;
use std::f64::consts::TAU;
use tsa_model::{PRETWIST_RAD, twist_from_turns};

/// Points of each curve, and most marks on it.
const POINTS: usize = 41;
const MARKS: usize = 24;
const MM: f64 = 1e3;

/// The picture of an identification that began with `before`, as SVG.
///
/// # Errors
/// If the scene has no mechanism, or the drawing library fails.
pub fn figure(before: &Scene, data: &Data, found: &Identified) -> Result<String, Failure> {
    let (before, runs) = (before.mechanism()?, data.runs());
    let max = |run: &[usize]| run.iter().map(|k| turns(&data.rows[*k])).fold(0.0, f64::max);
    let ends = [0.0, runs.iter().map(|run| max(run)).fold(0.0, f64::max)];
    let (mut contraction, mut loads) = (Vec::new(), Vec::new());
    let mut error = vec![Item::line(ends.map(|turns| (turns, 0.0)), Pen::solid(INK).wide(1))];
    for (n, run) in runs.iter().enumerate() {
        let rows: Vec<&Row> = run.iter().map(|k| &data.rows[*k]).collect();
        let (load_n, colour) = (rows.first().map_or(0.0, |row| row.load_n), colour(n, runs.len()));
        let gap_m = |twist_rad| before.solve(load_n, twist_rad).map(|e| e.gap_m).ok();
        let before_m = |turns| Some(gap_m(PRETWIST_RAD)? - gap_m(twist_from_turns(turns))?);
        let step = max(run) / (POINTS - 1) as f64;
        let after: Vec<Prediction> = (0..POINTS).map(|k| found.known.predict(load_n, step * k as f64)).collect();
        let line = |of: &dyn Fn(&Prediction) -> Option<f64>, pen| {
            Item::line(after.iter().filter_map(|p| Some((p.turns, MM * of(p)?))), pen)
        };
        contraction.push(line(&|p| before_m(p.turns), Pen::dashed(colour)));
        contraction.push(line(&|p| p.contraction_m, Pen::solid(colour)));
        error.push(line(&|p| Some(before_m(p.turns)? - p.contraction_m?), Pen::dashed(colour)));
        for sign in [-1.0, 1.0] {
            error.push(line(&|p| Some(sign * p.half_width_m?), Pen::solid(colour).wide(1)));
        }
        for row in rows.iter().step_by(rows.len().div_ceil(MARKS).max(1)) {
            let Some(measured_m) = contraction_m(row, found) else { continue };
            let mark = |m: f64| Item::mark((turns(row), MM * m), Shape::Circle, colour);
            contraction.push(mark(measured_m));
            error.extend(
                found.known.predict(load_n, turns(row)).contraction_m.map(|after_m| mark(measured_m - after_m)),
            );
        }
        loads.push(KeyRow::line(Pen::solid(colour), N.exact(load_n)));
    }
    let panel = |title: &str, items: Vec<Item>| {
        let y = Axis::linear("mm", extent(items.iter().flat_map(Item::points).map(|at| at.1)));
        Panel::new(title, Axis::linear("turns past the half-turn pre-twist", ends), y, items)
    };
    let kinds = [
        (Sample::Mark(Shape::Circle, GREY), "measured, mean of up and down"),
        (Sample::Line(Pen::dashed(GREY)), "scene before"),
        (Sample::Line(Pen::solid(GREY)), "identified scene"),
        (Sample::Line(Pen::solid(GREY).wide(1)), "its stated error: holds the truth nine times in ten"),
    ];
    let figure = Figure {
        heading: "A rig before and after its calibration".into(),
        rows: vec![vec![panel("Contraction", contraction), panel("Difference from the identified scene", error)]],
        panel_size: (560, 420),
        blocks: vec![Block::new(loads), Block::new(kinds.map(|(sample, label)| KeyRow::sample(sample, label)))],
        notes: Vec::new(),
    };
    figure.svg().map_err(|e| Failure::failed(format!("the figure: {e:#}")))
}

fn turns(row: &Row) -> f64 {
    row.twist_rad / TAU - 0.5
}

/// The measured contraction since the half-turn pre-twist (m). Where a gap was measured, the identified law says where the
/// pre-twist is, and the fit where the sensor's zero is.
fn contraction_m(row: &Row, found: &Identified) -> Option<f64> {
    match row.quantity {
        Quantity::Contraction => Some(row.value),
        Quantity::Gap => {
            let zero_m = row.zero.map_or(0.0, |zero| found.fit.x[found.fit.unknowns.count() + zero]);
            let (pretwist, _) = found.known.fit.gap(row.load_n, PRETWIST_RAD).ok()?;
            let added_m = found.scene.correction.map_or(0.0, |c| c.at(row.load_n, PRETWIST_RAD).gap_m);
            Some(pretwist.value + added_m - (row.value - zero_m))
        }
        Quantity::Tr | Quantity::Span => None,
    }
}
