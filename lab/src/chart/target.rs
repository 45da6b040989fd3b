//! The cost of each table and solver on the board, drawn from the data of `cargo xtask cost`.

use super::{Inputs, Made};
use anyhow::Result;
use rigctl::plot::{Axis, Block, Figure, Item, KeyRow, Panel, Shape, colour, extent};
use serde::Deserialize;

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
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
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
