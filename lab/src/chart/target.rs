//! The cost of each table and solver on the board, drawn from the data of `cargo xtask cost`.

use super::{Inputs, Made};
use anyhow::Result;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, RGBColor, Shape, colour};
use serde::Deserialize;

/// A line of `cost.csv`.
#[derive(Debug, Deserialize)]
struct Way {
    symbol: String,
    name: String,
    instructions_mean: f64,
    bytes: Option<u64>,
    error: f64,
    error_of: String,
}

/// An exact root's error, and a root without any, is drawn here.
const ROUNDING: f64 = 3e-8;

impl Way {
    /// Tables, and the models in double precision.
    fn colour(&self) -> RGBColor {
        colour(if self.bytes.is_some() { 0 } else { 2 }, 6)
    }
}

/// Draws `cost.csv` of this folder, or of `out`.
///
/// # Errors
/// If there is none, or it cannot be read.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let (csv, ways) = inputs.measured::<Way>("cost.csv", "cargo xtask cost")?;
    // Numbered as in the key.
    let gaps: Vec<(usize, &Way)> = (1..).zip(ways.iter().filter(|w| w.error_of == "gap_m")).collect();
    let row = |(k, way): &(usize, &Way)| {
        let bytes = way.bytes.map_or(String::new(), |bytes| format!(", {bytes} B"));
        KeyRow::mark(Shape::Dot, way.colour(), format!("{k}  {}{bytes}", way.name))
    };
    let key: Vec<KeyRow> = gaps.iter().map(row).collect();
    let figure = Figure {
        heading: "On the board: instructions against error".into(),
        rows: vec![vec![
            gap_panel("tables", gaps.iter().filter(|(_, w)| w.bytes.is_some()), [1e-7, 1e-3], [100.0, 3000.0]),
            gap_panel("solvers", gaps.iter().filter(|(_, w)| w.bytes.is_none()), [1e-14, 1e-1], [1e5, 3e8]),
            root_panel(ways.iter().filter(|w| w.error_of == "root_relative")),
        ]],
        panel_size: (400, 380),
        blocks: key.chunks(key.len().div_ceil(2).max(1)).map(|half| Block { rows: half.to_vec() }).collect(),
        notes: vec![
            "Counted on the emulated board, one image; a dot is the mean over 30 states (the paper's method: three), the \
             error the largest of the gap against the full solver. Not cycles: no stall or flash wait is counted."
                .into(),
        ],
    };
    Made::new(&figure, csv, Vec::new())
}

fn gap_panel<'a>(
    title: &str,
    ways: impl Iterator<Item = &'a (usize, &'a Way)>,
    errors_m: [f64; 2],
    instructions: [f64; 2],
) -> Panel {
    let mut items = Vec::new();
    for (k, way) in ways {
        let at = (way.error.clamp(errors_m[0], errors_m[1]), way.instructions_mean);
        items.push(Item::mark(at, Shape::Dot, way.colour()));
        // Three and two that stand close together: aside by a part of the whole axis.
        let aside = match way.symbol.as_str() {
            "cost_arc_many" | "cost_series_ratio" => (-0.11, 0.0),
            "cost_arc_few" => (0.0, 0.04),
            _ => (0.0, 0.0),
        };
        let moved = |value: f64, range: [f64; 2], part: f64| value * (range[1] / range[0]).powf(part);
        let at = (moved(at.0, errors_m, aside.0), moved(at.1, instructions, aside.1));
        items.push(Item::label(at, k.to_string(), INK));
    }
    Panel::new(
        title,
        Axis::log("largest error of the gap, m", errors_m),
        Axis::log("instructions", instructions),
        items,
    )
}

fn root_panel<'a>(ways: impl Iterator<Item = &'a Way>) -> Panel {
    let items = ways.flat_map(|way| {
        let at = (way.error.max(ROUNDING), way.instructions_mean);
        // Inside the plane on either side.
        let beside = if at.0 > 1e-4 { (at.0 * 2e-4, at.1) } else { at };
        let by = way.name.trim_start_matches("square root by ");
        [Item::mark(at, Shape::Diamond, INK), Item::label(beside, by, INK)]
    });
    let instructions = Axis::log("instructions", [1.0, 1000.0]);
    Panel::new("square root", Axis::log("largest relative error", [1e-8, 1.0]), instructions, items)
}
