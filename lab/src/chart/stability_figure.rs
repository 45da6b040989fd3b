//! The stability map as a picture: a row for each method, a column for each rod.

use super::Made;
use super::grid::{Grid, Strip};
use super::limits::Line;
use super::rods::{RODS, RodCase};
use super::stability::{ANOTHER_BRANCH_M, Map, SLOW, map};
use anyhow::Result;
use plotters::style::{RGBColor, WHITE};
use rigctl::csv_text::csv_text;
use rigctl::parallel::Progress;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, Sample};

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

/// Draws a limit so that it is visible on light and dark cells.
fn limit(line: &Line, pen: Pen) -> Vec<Item> {
    let under = Pen { colour: WHITE, width: pen.width + 3, dashed: false };
    [under, pen]
        .into_iter()
        .flat_map(|pen| line.iter().map(move |points| Item::Line { points: points.clone(), pen }))
        .collect()
}

const SAFE: Pen = Pen { colour: INK, width: 3, dashed: false };
const OVERTWIST: Pen = Pen { colour: RGBColor(0, 90, 60), width: 3, dashed: true };
const PLATEAU_LINE: Pen = Pen { colour: RGBColor(120, 30, 110), width: 3, dashed: true };
const STRAIN: Pen = Pen { colour: RGBColor(190, 0, 0), width: 2, dashed: false };

/// Cells of one method.
fn cells(grid: &Grid, name: impl Fn(usize) -> &'static str) -> Vec<Item> {
    let fill = |s: Strip| {
        let colour = OUTCOMES.iter().find(|o| o.0 == name(s.cell)).map_or(INK, |o| o.1);
        Item::Fill { from: s.from, to: s.to, colour }
    };
    grid.strips(|a, b| name(a) == name(b)).into_iter().map(fill).collect()
}

/// Judges every method on every rod and draws it.
///
/// # Errors
/// If a rod cannot be solved at all, or the drawing fails.
pub fn make(loads: usize, twists: usize, progress: &Progress<'_>) -> Result<Made> {
    let grid = Grid::new(LOAD_N, loads, TURNS, twists);
    let mut maps = Vec::new();
    for rod in &RODS {
        maps.push((rod, map(&rod.mechanism()?, &grid, progress)));
    }
    let mut rows = Vec::new();
    let count = maps[0].1.methods.len();
    for m in 0..count {
        let panel = |(rod, map): &(&RodCase, Map)| {
            let method = &map.methods[m];
            let (first, last) = (rod.title == RODS[0].title, m + 1 == count);
            let mut items = cells(&grid, |k| method.outcomes[k].name());
            let l = &map.limits;
            let lines = [(&l.strain, STRAIN), (&l.plateau, PLATEAU_LINE), (&l.overtwist, OVERTWIST), (&l.safe, SAFE)];
            items.extend(lines.into_iter().flat_map(|(line, pen)| limit(line, pen)));
            let x = Axis::linear("turns past the pre-twist", TURNS).tight(TURNS);
            let ticks = [0.5, 2.0, 5.0, 10.0].map(|load| (load, format!("{load} N")));
            let y = Axis::log_named(method.name, LOAD_N, ticks.to_vec());
            let head = format!("{}, l/R {:.0}", rod.title, rod.slenderness());
            Panel {
                title: if m == 0 { head } else { String::new() },
                x: if last { x } else { x.unnamed() },
                y: if first { y } else { y.unnamed() },
                items,
            }
        };
        rows.push(maps.iter().map(panel).collect());
    }
    let figure = Figure {
        heading: "Which equilibrium each method finds, over load and twist".into(),
        rows,
        panel_size: (320, 230),
        blocks: key(),
        notes: vec![format!(
            "{loads} x {twists} states in each panel. The truth is the branch that the unloaded rig leads to, followed in 64 \
             and more steps of load and of twist. Another branch: more than {:.0} um away. Slow: more than {SLOW} times \
             the method's usual effort.",
            ANOTHER_BRANCH_M * 1e6
        )],
    };
    Ok(Made {
        name: "stability",
        svg: Some(figure.svg()?),
        csv: csv(&grid, &maps)?,
        findings: findings(&maps),
        left_out: Vec::new(),
    })
}

fn key() -> Vec<Block> {
    let outcomes =
        OUTCOMES.iter().map(|(_, colour, meaning)| KeyRow::sample(Sample::Fill(*colour), *meaning)).collect();
    let line = |pen, name: &str| KeyRow::sample(Sample::Line(pen), name);
    let lines = vec![
        line(SAFE, "|n| l²/EI = π²/4: one equilibrium below and left"),
        line(OVERTWIST, "overtwist: no room for the strings beyond"),
        line(PLATEAU_LINE, "bending strain in the middle of the plateau"),
        line(STRAIN, "bending strain 8 %: end of the stress–strain fit"),
    ];
    vec![Block { rows: outcomes }, Block { rows: lines }]
}

fn csv(grid: &Grid, maps: &[(&RodCase, Map)]) -> Result<String> {
    let states = grid.states();
    let lines = maps.iter().flat_map(|(rod, map)| {
        let states = &states;
        map.methods.iter().flat_map(move |m| {
            states.iter().zip(m.outcomes.iter().zip(&m.evaluations)).zip(&map.safe).map(
                move |(((load, turns), (outcome, evaluations)), safe)| {
                    vec![
                        rod.title.to_owned(),
                        rod.rod_span_m.to_string(),
                        rod.rod_radius_m.to_string(),
                        m.name.to_owned(),
                        format!("{load:.5}"),
                        format!("{turns:.5}"),
                        outcome.name().to_owned(),
                        outcome.kind().to_owned(),
                        safe.to_string(),
                        evaluations.to_string(),
                    ]
                },
            )
        })
    });
    let header = [
        "rod",
        "rod_span_m",
        "rod_radius_m",
        "method",
        "load_n",
        "turns",
        "outcome",
        "error_kind",
        "safe_zone",
        "evaluations",
    ];
    csv_text(&header, lines)
}

fn findings(maps: &[(&RodCase, Map)]) -> Vec<String> {
    let mut lines = Vec::new();
    for (rod, map) in maps {
        for m in &map.methods {
            let counts: Vec<String> = OUTCOMES
                .iter()
                .filter_map(|(name, ..)| Some((name, m.count(name))).filter(|(_, n)| *n > 0))
                .map(|(name, n)| format!("{n} {name}"))
                .collect();
            let inside = m.outcomes.iter().zip(&map.safe).filter(|(o, safe)| **safe && o.is_failure()).count();
            let [name, counts] = [m.name, &counts.join(", ")];
            lines.push(format!("{:<18} {name:<18} {counts}; {inside} failures in the safe zone", rod.title));
        }
    }
    lines
}
