//! `identify --figure`: a rig before and after its calibration, contraction under each load by the scene's constants and by the
//! identified ones, with the measured equilibria on them.

use crate::failure::Failure;
use crate::identify::Identified;
use crate::identify::data::{Data, Quantity, Row};
use crate::plot::{Axis, Block, Figure, GREY, INK, Item, KeyRow, Panel, Pen, Sample, Shape, colour, extent};
use rig_config::Scene;
use std::f64::consts::TAU;
use tsa_model::{Mechanism, PRETWIST_RAD, twist_from_turns};

/// One recorded sweep.
#[derive(Debug, Clone)]
struct Sweep {
    /// Load in the key.
    label: String,
    /// Measured equilibria: turns past the half-turn pre-twist, contraction since then (m).
    measured: Vec<(f64, f64)>,
    /// Computed contractions, in order of the turns.
    computed: Vec<Computed>,
}

/// Contraction at some turns.
#[derive(Debug, Clone, Copy)]
struct Computed {
    /// Turns past the half-turn pre-twist.
    turns: f64,
    /// By the scene before (m); none where it has no equilibrium.
    before_m: Option<f64>,
    /// By the identified scene (m).
    after_m: f64,
    /// Half the width of the interval that holds the true contraction nine times in ten (m).
    half_width_m: f64,
}

/// Points of each curve, and most marks on it.
const POINTS: usize = 41;
const MARKS: usize = 24;

/// The picture of an identification that began with `before`, as SVG.
///
/// # Errors
/// If the drawing library fails.
pub fn figure(before: &Scene, data: &Data, found: &Identified) -> Result<String, Failure> {
    let before = before.mechanism()?;
    let sweeps: Vec<Sweep> = data.runs().iter().map(|run| sweep(&before, data, run, found)).collect();
    draw(&sweeps).map_err(|e| Failure::failed(format!("the figure: {e:#}")))
}

fn sweep(before: &Mechanism, data: &Data, run: &[usize], found: &Identified) -> Sweep {
    let rows: Vec<&Row> = run.iter().map(|k| &data.rows[*k]).collect();
    let load_n = rows.first().map_or(0.0, |row| row.load_n);
    let marked = rows.iter().step_by(rows.len().div_ceil(MARKS).max(1));
    let measured: Vec<(f64, f64)> = marked.filter_map(|row| Some((turns(row), contraction_m(row, found)?))).collect();
    let most = rows.iter().map(|row| turns(row)).fold(0.0, f64::max);
    let computed = (0..POINTS).map(|k| most * k as f64 / (POINTS - 1) as f64).filter_map(|turns| {
        let after = found.known.predict(load_n, turns);
        let gap_m = |twist_rad| before.solve(load_n, twist_rad).map(|e| e.gap_m).ok();
        let before_m = gap_m(PRETWIST_RAD).zip(gap_m(twist_from_turns(turns))).map(|(from_m, to_m)| from_m - to_m);
        Some(Computed { turns, before_m, after_m: after.contraction_m?, half_width_m: after.half_width_m? })
    });
    Sweep { label: format!("{load_n} N"), measured, computed: computed.collect() }
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

const MM: f64 = 1e3;

fn draw(sweeps: &[Sweep]) -> anyhow::Result<String> {
    let mut contraction = Vec::new();
    let mut error =
        vec![Item::Line { points: ends(sweeps).map(|turns| (turns, 0.0)).to_vec(), pen: Pen::solid(INK).wide(1) }];
    for (k, sweep) in sweeps.iter().enumerate() {
        let colour = colour(k, sweeps.len());
        let line = |of: &dyn Fn(&Computed) -> Option<f64>, pen| Item::Line {
            points: sweep.computed.iter().filter_map(|c| Some((c.turns, MM * of(c)?))).collect(),
            pen,
        };
        contraction.push(line(&|c| c.before_m, Pen::dashed(colour)));
        contraction.push(line(&|c| Some(c.after_m), Pen::solid(colour)));
        error.push(line(&|c| Some(c.before_m? - c.after_m), Pen::dashed(colour)));
        for sign in [-1.0, 1.0] {
            error.push(line(&|c| Some(sign * c.half_width_m), Pen::solid(colour).wide(1)));
        }
        for &(turns, measured_m) in &sweep.measured {
            let mark = |at| Item::Mark { at, shape: Shape::Circle, colour };
            contraction.push(mark((turns, MM * measured_m)));
            if let Some(after_m) = after_m(sweep, turns) {
                error.push(mark((turns, MM * (measured_m - after_m))));
            }
        }
    }
    let panel = |title: &str, unit: &str, items: Vec<Item>| Panel {
        title: title.into(),
        x: Axis::linear("turns past the half-turn pre-twist", ends(sweeps)),
        y: Axis::linear(unit, extent(items.iter().flat_map(Item::points).map(|at| at.1))),
        items,
    };
    let loads = sweeps
        .iter()
        .enumerate()
        .map(|(k, sweep)| KeyRow::sample(Sample::Line(Pen::solid(colour(k, sweeps.len()))), &sweep.label));
    let kinds = [
        (Sample::Mark(Shape::Circle, GREY), "measured, mean of up and down"),
        (Sample::Line(Pen::dashed(GREY)), "scene before"),
        (Sample::Line(Pen::solid(GREY)), "identified scene"),
        (Sample::Line(Pen::solid(GREY).wide(1)), "its stated error: holds the truth nine times in ten"),
    ];
    Figure {
        heading: "A rig before and after its calibration".into(),
        rows: vec![vec![
            panel("Contraction", "mm", contraction),
            panel("Difference from the identified scene", "mm", error),
        ]],
        panel_size: (560, 420),
        blocks: vec![
            Block { rows: loads.collect() },
            Block { rows: kinds.map(|(sample, label)| KeyRow::sample(sample, label)).to_vec() },
        ],
        notes: Vec::new(),
    }
    .svg()
}

/// Least and greatest turns of all curves.
fn ends(sweeps: &[Sweep]) -> [f64; 2] {
    extent(sweeps.iter().flat_map(|sweep| sweep.computed.iter().map(|c| c.turns)))
}

/// The identified contraction (m) at some turns, by a line between its neighbours.
fn after_m(sweep: &Sweep, turns: f64) -> Option<f64> {
    let pair = sweep.computed.windows(2).find(|pair| (pair[0].turns..=pair[1].turns).contains(&turns))?;
    let share = (turns - pair[0].turns) / (pair[1].turns - pair[0].turns);
    Some(pair[0].after_m + share * (pair[1].after_m - pair[0].after_m))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_lie_on_the_curves_that_they_were_measured_on() {
        let computed: Vec<Computed> = (0..=10)
            .map(|k| Computed {
                turns: f64::from(k),
                before_m: (k < 8).then(|| 1.1e-3 * f64::from(k)),
                after_m: 1e-3 * f64::from(k),
                half_width_m: 1e-4,
            })
            .collect();
        let sweep = |label: &str| Sweep {
            label: label.into(),
            measured: vec![(2.5, 2.5e-3), (7.25, 7.3e-3)],
            computed: computed.clone(),
        };
        assert!((after_m(&sweep("1 N"), 7.25).unwrap() - 7.25e-3).abs() < 1e-12);
        assert_eq!(after_m(&sweep("1 N"), 11.0), None);
        let svg = draw(&[sweep("1 N"), sweep("15 N")]).unwrap();
        // Each point on both panels, and one in the key; a mark is a circle with a rim.
        assert_eq!(svg.matches("<circle").count(), 2 * (2 * 2 * 2 + 1));
        for text in ["1 N", "15 N", "before and after", "stated error", "Difference"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
