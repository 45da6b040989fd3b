//! What other commands have measured, drawn from the files that they leave:
//!
//! - closed loop: the effect of a cheaper model or a less accurate table (`cargo xtask loop`);
//! - target: the cost of each table and solver on the board (`cargo xtask cost`);
//! - rigs and effects: one effect at a time that the table's model leaves out, from the study of rigs: errors of load and position, and
//!   where the chain from homing to following breaks as the effect is turned up.

use super::{Inputs, Made, distinct};
use crate::closed_loop::Outcome;
use anyhow::Result;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, RGBColor, Shape, colour, extent};
use serde::Deserialize;

/// Draws `loop.csv` of this folder, or of `out`.
///
/// # Errors
/// If there is none, or it cannot be read.
pub fn closed_loop(inputs: &Inputs<'_>) -> Result<Made> {
    let (csv, runs) = inputs.measured::<Outcome>("loop.csv", "cargo xtask loop")?;
    let variants = distinct(runs.iter().map(|r| &r.variant));
    let loads = distinct(runs.iter().map(|r| &r.load));
    let panel = |label: &str, value: fn(&Outcome) -> Option<f64>| {
        let mark = |r: &Outcome| {
            let row = variants.iter().position(|v| **v == r.variant)?;
            let load = loads.iter().position(|l| **l == r.load)?;
            let at = (value(r)?, Axis::row(row, load, loads.len()));
            Some(Item::mark(at, if r.fault.is_none() { Shape::Dot } else { Shape::Circle }, load_colour(load)))
        };
        let [low, high] = extent(runs.iter().filter_map(value));
        let names = Axis::names(variants.iter().map(|name| name.as_str()));
        Panel::new("", Axis::linear(label, [low.min(0.0), high]), names, runs.iter().filter_map(mark))
    };
    let key = loads.iter().enumerate().map(|(k, load)| KeyRow::mark(Shape::Dot, load_colour(k), *load));
    let figure = Figure {
        heading: "Closed loop: tables of other models and accuracies in the firmware".into(),
        rows: vec![Panel::side_by_side([
            panel("tracking error, µm rms", |r| r.rms_m.map(|m| m * 1e6)),
            panel("error at rest, µm", |r| r.rest_m.map(|m| m.abs() * 1e6)),
            panel("load estimate off by, %", |r| r.load_relative_error.map(|error| error.abs() * 1e2)),
            panel("thousand instructions a tick", |r| Some(r.instructions_mean * 1e-3)),
        ])],
        panel_size: (330, 340),
        blocks: vec![Block::new(key), Block::new([KeyRow::mark(Shape::Circle, INK, "a fault on the way")])],
        notes: vec![
            "Emulated board and rig, 12, 2 and 9 mm at 2 mm/s after homing. A table is fitted to its model to 5 µm and 0.2 % \
             unless it says otherwise. Homing takes out what a scale of the twist and an offset of the gap can; the \
             feedback does the rest. What a cheap model costs is the load."
                .into(),
        ],
    };
    Made::new(&figure, csv, Vec::new())
}

fn load_colour(k: usize) -> RGBColor {
    colour([0, 4][k % 2], 6)
}

/// Smaller errors are rounding, and drawn here (m).
const ROUNDING_M: f64 = 1e-14;

/// A line of `cost.csv`.
#[derive(Debug, Deserialize)]
struct Way {
    name: String,
    instructions_mean: f64,
    bytes: Option<u64>,
    error: f64,
    error_of: String,
}

/// Draws `cost.csv` of this folder, or of `out`.
///
/// # Errors
/// If there is none, or it cannot be read.
pub fn target(inputs: &Inputs<'_>) -> Result<Made> {
    let (csv, mut ways) = inputs.measured::<Way>("cost.csv", "cargo xtask cost")?;
    ways.retain(|way| way.error_of == "gap_m");
    ways.sort_by(|a, b| a.instructions_mean.total_cmp(&b.instructions_mean));
    let named = |way: &Way| way.bytes.map_or(way.name.clone(), |bytes| format!("{}, {bytes} bytes", way.name));
    let panel = |label: &str, value: fn(&Way) -> f64| {
        let mark = |(k, way): (usize, &Way)| {
            Item::mark((value(way), Axis::row(k, 0, 1)), Shape::Dot, colour(if way.bytes.is_some() { 0 } else { 4 }, 6))
        };
        let x = Axis::log(label, extent(ways.iter().map(value)));
        Panel::new("", x, Axis::names(ways.iter().map(named)), ways.iter().enumerate().map(mark))
    };
    let figure = Figure {
        heading: "What each way to know the mechanism costs on the board (emulated)".into(),
        rows: vec![Panel::side_by_side([
            panel("instructions, mean", |way| way.instructions_mean),
            panel("largest error of the gap, µm", |way| 1e6 * way.error.max(ROUNDING_M)),
        ])],
        panel_size: (640, 560),
        blocks: Block::split(
            2,
            [
                KeyRow::mark(Shape::Dot, colour(0, 6), "tables"),
                KeyRow::mark(Shape::Dot, colour(4, 6), "models that are solved on the board"),
            ],
        ),
        notes: vec![
            "Errors against the full solver in f64. Instructions are not cycles: no stall or flash wait is counted."
                .into(),
        ],
    };
    Made::new(&figure, csv, Vec::new())
}

/// The command that measures effects.
const COMMAND: &str = "cargo xtask results rigs";
/// The files that it leaves: the rig of its own model, and single effects on rigs as built.
const FILES: [&str; 2] = ["ideal-summary.csv", "each-summary.csv"];

/// A line of a summary: one check over the rigs of a group. SI units.
#[derive(Debug, Deserialize)]
struct Row {
    rig: String,
    effect: String,
    factor: Option<f64>,
    check: String,
    cases: usize,
    missing: usize,
    worst: Option<f64>,
    holds: Option<bool>,
}

/// What a panel shows: check, label, factor to the label's unit.
const CHECKS: [(&str, &str, f64); 4] = [
    ("load_after_homing", "error of the load after homing, %", 1e2),
    ("load_after_step", "error of the load after it changed, %", 1e2),
    ("rest_true_m", "error at rest, µm", 1e6),
    ("following_most_m", "error while following, µm", 1e6),
];

/// Kinds of rigs, what the key says of them, and their colours.
const KINDS: [(&str, &str, usize); 3] = [
    ("ideal", "no effect: the table's own model", 2),
    ("nominal", "as large as on a well-made actuator (nominal)", 0),
    ("hard", "as large as on one of the worst in ten (hard)", 4),
];

/// Draws the summaries of this folder, or of `out`.
///
/// # Errors
/// If one is not there, or cannot be read.
pub fn rigs(inputs: &Inputs<'_>) -> Result<Made> {
    let (mut csv, mut rows) = (String::new(), Vec::new());
    for file in FILES {
        let (text, more) = inputs.measured::<Row>(file, COMMAND)?;
        csv += if rows.is_empty() { &text } else { text.split_once('\n').map_or("", |(_header, lines)| lines) };
        rows.extend(more);
    }
    let names = distinct(rows.iter().map(|r| r.effect.as_str()));
    let draw_row = |checks: &[_]| Panel::side_by_side(checks.iter().map(|check| panel(&rows, &names, check)));
    let refused = rows.iter().any(|r| r.missing > 0);
    let kinds = KINDS.map(|(_, meaning, k)| KeyRow::mark(Shape::Dot, colour(k, 6), meaning));
    let figure = Figure {
        heading: "One effect that the model leaves out, on an actuator that is not calibrated (emulated)".into(),
        rows: CHECKS.chunks(2).map(draw_row).collect(),
        panel_size: (560, 400),
        blocks: vec![Block::new(kinds)],
        notes: vec![format!(
            "The largest error of each.{}",
            if refused { " A cross: a homing or a move was refused, or a fault; how many of all." } else { "" }
        )],
    };
    Made::new(&figure, csv, Vec::new())
}

fn panel(rows: &[Row], names: &[&str], (check, label, by): &(&str, &str, f64)) -> Panel {
    let rows: Vec<&Row> = rows.iter().filter(|r| r.check == *check).collect();
    let [low, high] = extent(rows.iter().filter_map(|r| r.worst).map(|v| by * v).filter(|v| *v > 0.0));
    let mut items = Vec::new();
    for r in rows {
        let name = names.iter().position(|name| *name == r.effect).unwrap_or_default();
        let y = Axis::row(name, usize::from(r.rig == "hard"), 2);
        let colour = colour(KINDS.iter().find(|(kind, ..)| *kind == r.rig).map_or(0, |kind| kind.2), 6);
        let at = (r.worst.map_or(low, |v| (by * v).max(low)), y);
        items.push(Item::mark(at, if r.missing > 0 { Shape::Cross } else { Shape::Dot }, colour));
        if r.missing > 0 {
            items.push(Item::label(at, format!("{} of {}", r.missing, r.cases + r.missing), colour));
        }
    }
    let names = names.iter().map(|name| if name.is_empty() { "none" } else { name });
    // Room for the labels.
    Panel::new("", Axis::log(*label, [low, 2.0 * high]), Axis::names(names), items)
}

/// A part of the chain: its name, the checks that tell whether it holds, and its colour.
type Part = (&'static str, &'static [&'static str], RGBColor);

/// From the most severe to the mildest; the first that breaks colours a cell.
const PARTS: [Part; 5] = [
    ("homing", &["zero_error_rad"], RGBColor(70, 70, 70)),
    ("faults", &["faults", "sank_after_fault_m"], RGBColor(204, 121, 167)),
    ("rest", &["rest_measured_m", "rest_reversals", "rest_true_m"], RGBColor(213, 94, 0)),
    ("following", &["following_rms_m", "following_most_m"], RGBColor(230, 159, 0)),
    (
        "load",
        &["load_after_homing", "load_after_step", "load_error_over_stated", "held_out_contraction"],
        RGBColor(240, 220, 120),
    ),
];
const HOLDS: RGBColor = RGBColor(190, 225, 245);
const WHITE: RGBColor = RGBColor(255, 255, 255);

/// Draws the ramp of this folder, or of `out`.
///
/// # Errors
/// If it is not there, or cannot be read.
pub fn effects(inputs: &Inputs<'_>) -> Result<Made> {
    let (csv, rows) = inputs.measured::<Row>("effects-summary.csv", COMMAND)?;
    let mut effects = distinct(rows.iter().map(|r| r.effect.clone()));
    effects.sort_unstable();
    let mut factors = distinct(rows.iter().filter_map(|r| r.factor));
    factors.sort_by(f64::total_cmp);
    let mut items = Vec::new();
    for (row, effect) in effects.iter().enumerate() {
        for (column, factor) in factors.iter().enumerate() {
            let broken = broken(rows.iter().filter(|r| r.effect == *effect && r.factor == Some(*factor)));
            let (x, y) = (column as f64, -(row as f64));
            let colour = broken.first().map_or(HOLDS, |(.., colour)| *colour);
            items.push(Item::Fill { from: (x - 0.48, y - 0.42), to: (x + 0.48, y + 0.42), colour });
            let ink = if colour == PARTS[0].2 { WHITE } else { INK };
            for (line, parts) in broken.chunks(2).enumerate() {
                let names: Vec<&str> = parts.iter().map(|(name, ..)| *name).collect();
                items.push(Item::label((x - 0.5, y + 0.22 - 0.36 * line as f64), names.join(", "), ink));
            }
        }
    }
    let last = factors.len() as f64 - 0.5;
    let columns = factors.iter().enumerate().map(|(k, factor)| (k as f64, format!("{factor}")));
    let x = Axis::linear("size of the effect ÷ that on a well-made actuator", [-0.5, last])
        .tight([-0.5, last])
        .ticked(columns);
    let key = PARTS.iter().map(|(name, _, colour)| KeyRow::fill(*colour, format!("missed: {name}")));
    let figure = Figure {
        heading: "Which acceptance limit is missed as one effect is turned up (emulated)".into(),
        rows: vec![vec![Panel::new("", x, Axis::names(effects), items)]],
        panel_size: (1000, 520),
        blocks: Block::split(2, [KeyRow::fill(HOLDS, "every limit is met")].into_iter().chain(key)),
        notes: vec![
            "Actuators that are not calibrated and are the table's own model but for one effect, both signs. Limits of hard \
             rigs; the words name every part that misses one, the colour the most severe."
                .into(),
        ],
    };
    Made::new(&figure, csv, Vec::new())
}

/// The parts whose limits are missed, the most severe first.
fn broken<'a>(rows: impl Iterator<Item = &'a Row> + Clone) -> Vec<Part> {
    let misses = |check: &&str| rows.clone().find(|r| r.check == **check).is_some_and(|r| r.holds == Some(false));
    PARTS.into_iter().filter(|(_, checks, _)| checks.iter().any(misses)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(lines: &[&str]) -> Vec<Row> {
        let header = "rig,effect,factor,table,check,floor,cases,missing,median,p95,worst,met,holds\n";
        let text = header.to_owned() + &lines.join("\n");
        csv::Reader::from_reader(text.as_bytes()).deserialize().map(Result::unwrap).collect()
    }

    #[test]
    fn the_most_severe_broken_part_comes_first_and_is_named() {
        let rows = rows(&[
            "hard,e,2,identified,load_after_homing,x,3,1,1,1,1,0.5,false",
            "hard,e,2,identified,zero_error_rad,x,3,1,,,,0.5,false",
            "hard,e,2,identified,rest_true_m,x,3,0,1,1,1,1,true",
        ]);
        assert_eq!(broken(rows.iter()).into_iter().map(|(name, ..)| name).collect::<Vec<_>>(), ["homing", "load"]);
    }
}
