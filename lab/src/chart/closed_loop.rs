//! The effect of a cheaper model or a less accurate table on the closed loop, drawn from the data of `cargo xtask loop`.

use super::{Inputs, Made, distinct};
use crate::closed_loop::Outcome;
use anyhow::Result;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, RGBColor, Shape, colour, extent};

/// Draws `loop.csv` of this folder, or of `out`.
///
/// # Errors
/// If there is none, or it cannot be read.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
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
