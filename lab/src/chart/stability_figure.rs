//! The stability map as a picture: a row for each method, a column for each rod.

use super::Made;
use super::grid::Grid;
use super::limits::Line;
use super::rods::{RODS, RodCase};
use super::stability::{ANOTHER_BRANCH_M, Map, SLOW, map};
use crate::csv;
use anyhow::Result;
use rigctl::parallel::Progress;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, RGBColor};
use serde::Serialize;

const LOAD_N: [f64; 2] = [0.3, 20.0];
const TURNS: [f64; 2] = [0.0, 8.0];

/// Colour and meaning of every outcome, from good to bad.
const OUTCOMES: [(&str, RGBColor, &str); 7] = [
    ("right", RGBColor(190, 225, 245), "right branch"),
    ("slow", RGBColor(0, 114, 178), "right, but slow"),
    ("limit", RGBColor(222, 222, 222), "no equilibrium, reported"),
    ("refused", RGBColor(240, 200, 60), "refused by a limit that is not there"),
    ("diverged", RGBColor(70, 70, 70), "diverged, reported"),
    ("wrong-branch", RGBColor(213, 94, 0), "another branch, no error"),
    ("beyond-limit", RGBColor(204, 121, 167), "an answer past the end of the branch"),
];

const SAFE: Pen = Pen { colour: INK, width: 3, dashed: false };
const OVERTWIST: Pen = Pen { colour: RGBColor(0, 90, 60), width: 3, dashed: true };
const PLATEAU: Pen = Pen { colour: RGBColor(120, 30, 110), width: 3, dashed: true };
const STRAIN: Pen = Pen { colour: RGBColor(190, 0, 0), width: 2, dashed: false };

/// One method at one state of one rod, a line of `stability.csv`.
#[derive(Serialize)]
struct Row {
    rod: &'static str,
    rod_span_m: f64,
    rod_radius_m: f64,
    method: &'static str,
    load_n: String,
    turns: String,
    outcome: &'static str,
    error_kind: &'static str,
    safe_zone: bool,
    evaluations: u32,
}

/// Draws a limit so that it is visible on light and dark cells.
fn limit<'a>((line, pen): (&'a Line, Pen)) -> impl Iterator<Item = Item> + use<'a> {
    let under = Pen { colour: RGBColor(255, 255, 255), width: pen.width + 3, dashed: false };
    [under, pen].into_iter().flat_map(|pen| line.iter().map(move |points| Item::line(points.clone(), pen)))
}

/// Judges every method on every rod and draws it.
///
/// # Errors
/// If a rod cannot be solved at all, or the drawing fails.
pub fn make(loads: usize, twists: usize, progress: &Progress<'_>) -> Result<Made> {
    let grid = Grid::new(LOAD_N, loads, TURNS, twists);
    let maps = RODS.iter().map(|rod| Ok((rod, map(&rod.mechanism()?, &grid, progress)))).collect::<Result<Vec<_>>>()?;
    let count = maps[0].1.methods.len();
    let panel = |m: usize, (rod, map): &(&RodCase, Map)| {
        let method = &map.methods[m];
        let title = if m == 0 { format!("{}, l/R {:.0}", rod.title, rod.slenderness()) } else { String::new() };
        let colour =
            |k: usize| OUTCOMES.iter().find(|o| o.0 == method.outcomes[k].name()).map_or(INK, |(_, colour, _)| *colour);
        let mut panel = grid.panel(title, colour);
        let l = &map.limits;
        let limits = [(&l.strain, STRAIN), (&l.plateau, PLATEAU), (&l.overtwist, OVERTWIST), (&l.safe, SAFE)];
        panel.items.extend(limits.into_iter().flat_map(limit));
        let ticks = [0.5, 2.0, 5.0, 10.0].map(|load| (load, format!("{load} N")));
        let x = if m + 1 == count { panel.x } else { panel.x.unnamed() };
        Panel { x, y: Axis::log_named(method.name, LOAD_N, ticks.to_vec()), ..panel }
    };
    let figure = Figure {
        heading: "Which equilibrium each method finds, over load and twist".into(),
        rows: (0..count).map(|m| Panel::side_by_side(maps.iter().map(|map| panel(m, map)))).collect(),
        panel_size: (320, 230),
        blocks: vec![
            Block::new(OUTCOMES.map(|(_, colour, meaning)| KeyRow::fill(colour, meaning))),
            Block::new([
                KeyRow::line(SAFE, "|n| l²/EI = π²/4: one equilibrium below and left"),
                KeyRow::line(OVERTWIST, "overtwist: no room for the strings beyond"),
                KeyRow::line(PLATEAU, "bending strain in the middle of the plateau"),
                KeyRow::line(STRAIN, "bending strain 8 %: end of the stress–strain fit"),
            ]),
        ],
        notes: vec![format!(
            "{loads} x {twists} states in each panel. The truth is the branch that the unloaded rig leads to, followed in 64 \
             and more steps of load and of twist. Another branch: more than {:.0} um away. Slow: more than {SLOW} times \
             the method's usual effort.",
            ANOTHER_BRANCH_M * 1e6
        )],
    };
    let (mut rows, mut findings) = (Vec::new(), Vec::new());
    for (rod, map) in &maps {
        for m in &map.methods {
            rows.extend(grid.states().iter().enumerate().map(|(k, (load, turns))| Row {
                rod: rod.title,
                rod_span_m: rod.rod_span_m,
                rod_radius_m: rod.rod_radius_m,
                method: m.name,
                load_n: format!("{load:.5}"),
                turns: format!("{turns:.5}"),
                outcome: m.outcomes[k].name(),
                error_kind: m.outcomes[k].kind(),
                safe_zone: map.safe[k],
                evaluations: m.evaluations[k],
            }));
            let count = |name: &str| m.outcomes.iter().filter(|o| o.name() == name).count();
            let counts = OUTCOMES.iter().map(|(name, ..)| (count(name), name)).filter(|(n, _)| *n > 0);
            let counts = counts.map(|(n, name)| format!("{n} {name}")).collect::<Vec<_>>().join(", ");
            let inside = m.outcomes.iter().zip(&map.safe).filter(|(o, safe)| **safe && o.is_failure()).count();
            findings.push(format!("{:<18} {:<18} {counts}; {inside} failures in the safe zone", rod.title, m.name));
        }
    }
    Made::new("stability", &figure, csv(rows)?, findings)
}
