//! The cost of each table and solver on the board, drawn from the data of `cargo xtask cost`.

use super::{Inputs, Made};
use anyhow::{Context, Result};
use plotters::style::RGBColor;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Sample, Shape, colour};
use serde::Deserialize;

/// A line of `cost.csv`.
#[derive(Debug, Deserialize)]
struct Way {
    symbol: String,
    name: String,
    instructions_mean: f64,
    instructions_max: u64,
    bytes: Option<u64>,
    error: f64,
    error_of: String,
}

/// An exact root's error, and a root without any, is drawn here.
const ROUNDING: f64 = 3e-8;

/// Draws `cost.csv` of this folder, or of `out`.
///
/// # Errors
/// If there is none, or it cannot be read.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let csv = inputs.measured("cost.csv", "cargo xtask cost")?;
    let ways = csv::Reader::from_reader(csv.as_bytes()).deserialize().collect::<Result<Vec<Way>, _>>();
    let ways = ways.context("cost.csv")?;
    let gaps: Vec<&Way> = ways.iter().filter(|w| w.error_of == "gap_m").collect();
    let roots: Vec<&Way> = ways.iter().filter(|w| w.error_of == "root_relative").collect();
    let of_kind = |table: bool| {
        let numbered = gaps.iter().copied().enumerate();
        numbered.filter(|(_, w)| (kind(w) == 0) == table).collect::<Vec<(usize, &Way)>>()
    };
    let figure = Figure {
        heading: "On the board: instructions against error".into(),
        rows: vec![vec![
            gap_panel("tables", &of_kind(true), [1e-7, 1e-3], [100.0, 3000.0]),
            gap_panel("solvers", &of_kind(false), [1e-14, 1e-1], [1e5, 3e8]),
            root_panel(&roots),
        ]],
        panel_size: (400, 380),
        blocks: key(&gaps),
        notes: vec![
            "Counted on the emulated board, one image; a dot is the mean over 30 states (the paper's method: three), the \
             error the largest of the gap against the full solver. Not cycles: no stall or flash wait is counted."
                .into(),
        ],
    };
    let findings = ways.iter().map(|w| {
        let bytes = w.bytes.map_or(String::new(), |b| format!(", {b} bytes"));
        let Way { name, instructions_mean, instructions_max, error, error_of, .. } = w;
        format!(
            "{name}: {instructions_mean:.0} instructions, at most {instructions_max}{bytes}, {error:.1e} ({error_of})"
        )
    });
    Ok(Made { name: "target", svg: Some(figure.svg()?), csv, findings: findings.collect(), left_out: Vec::new() })
}

/// Tables, and the models in double precision.
fn kind(way: &Way) -> usize {
    usize::from(way.bytes.is_none())
}

fn kind_colour(kind: usize) -> RGBColor {
    colour([0, 2][kind], 6)
}

/// Numbered as in the key.
fn gap_panel(title: &str, ways: &[(usize, &Way)], errors_m: [f64; 2], instructions: [f64; 2]) -> Panel {
    let mut items = Vec::new();
    for (k, way) in ways {
        let at = (way.error.clamp(errors_m[0], errors_m[1]), way.instructions_mean);
        items.push(Item::Mark { at, shape: Shape::Dot, colour: kind_colour(kind(way)) });
        // Three and two that stand close together: aside by a part of the whole axis.
        let aside = match way.symbol.as_str() {
            "cost_arc_many" | "cost_series_ratio" => (-0.11, 0.0),
            "cost_arc_few" => (0.0, 0.04),
            _ => (0.0, 0.0),
        };
        let moved = |value: f64, range: [f64; 2], part: f64| value * (range[1] / range[0]).powf(part);
        let at = (moved(at.0, errors_m, aside.0), moved(at.1, instructions, aside.1));
        items.push(Item::Label { at, text: (k + 1).to_string(), colour: INK });
    }
    Panel {
        title: title.into(),
        x: Axis::log("largest error of the gap, m", errors_m),
        y: Axis::log("instructions", instructions),
        items,
    }
}

fn root_panel(ways: &[&Way]) -> Panel {
    let mut items = Vec::new();
    for way in ways {
        let at = (way.error.max(ROUNDING), way.instructions_mean);
        items.push(Item::Mark { at, shape: Shape::Diamond, colour: INK });
        let by = way.name.trim_start_matches("square root by ").to_owned();
        // Inside the plane on either side.
        let at = if at.0 > 1e-4 { (at.0 * 2e-4, at.1) } else { at };
        items.push(Item::Label { at, text: by, colour: INK });
    }
    Panel {
        title: "square root".into(),
        x: Axis::log("largest relative error", [1e-8, 1.0]),
        y: Axis::log("instructions", [1.0, 1000.0]),
        items,
    }
}

fn key(ways: &[&Way]) -> Vec<Block> {
    let row = |(k, way): (usize, &&Way)| {
        let bytes = way.bytes.map_or(String::new(), |b| format!(", {b} B"));
        KeyRow::sample(Sample::Mark(Shape::Dot, kind_colour(kind(way))), format!("{}  {}{bytes}", k + 1, way.name))
    };
    let rows: Vec<KeyRow> = ways.iter().enumerate().map(row).collect();
    rows.chunks(rows.len().div_ceil(2).max(1)).map(|half| Block { rows: half.to_vec() }).collect()
}
