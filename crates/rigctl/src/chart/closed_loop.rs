//! What a cheaper model or a rougher table does to the closed loop: drawn from what `cargo xtask loop` has measured.

use super::{Made, measured};
use crate::failure::Failure;
use crate::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Sample, Shape, colour, extent};
use plotters::style::RGBColor;
use serde::Deserialize;
use std::path::Path;

/// A line of `loop.csv`.
#[derive(Debug, Deserialize)]
struct Run {
    variant: String,
    load: String,
    rms_m: f64,
    max_m: f64,
    rest_m: f64,
    load_relative_error: f64,
    instructions_mean: f64,
    instructions_max: f64,
    fault: String,
}

impl Run {
    fn shape(&self) -> Shape {
        if self.fault.is_empty() { Shape::Dot } else { Shape::Circle }
    }
}

/// Draws `loop.csv` of this folder, or of `out`.
///
/// # Errors
/// If there is none, or it cannot be read.
pub fn make(folder: &Path) -> Result<Made, Failure> {
    let csv = measured(folder, "loop.csv", "cargo xtask loop")?;
    let runs = csv::Reader::from_reader(csv.as_bytes()).deserialize().collect::<Result<Vec<Run>, _>>();
    let runs = runs.map_err(|e| Failure::failed(format!("loop.csv: {e}")))?;
    let mut variants: Vec<&str> = runs.iter().map(|r| r.variant.as_str()).collect();
    variants.dedup();
    let mut loads: Vec<&str> = runs.iter().map(|r| r.load.as_str()).collect();
    loads.sort_unstable();
    loads.dedup();
    let panel = |label: &str, value: fn(&Run) -> f64| {
        let place = |r: &Run| (r.instructions_mean, value(r));
        let x = extent(runs.iter().map(|r| r.instructions_mean));
        let y = extent(runs.iter().map(value));
        let mut items = Vec::new();
        for r in &runs {
            let load = loads.iter().position(|l| *l == r.load).unwrap_or_default();
            items.push(Item::Mark { at: place(r), shape: r.shape(), colour: load_colour(load) });
            let number = variants.iter().position(|v| *v == r.variant).map_or(0, |k| k + 1);
            // Those that fall on one point are named by the first of them.
            let first = runs.iter().find(|o| o.load == r.load && near(place(o), place(r), x, y));
            if first.is_some_and(|o| o.variant == r.variant) {
                let others = runs.iter().filter(|o| o.load == r.load && near(place(o), place(r), x, y)).count();
                let text = if others > 1 { format!("{number} …") } else { number.to_string() };
                items.push(Item::Label { at: place(r), text, colour: INK });
            }
        }
        Panel {
            title: String::new(),
            x: Axis::linear("instructions a tick, mean", [x[0], x[1] + 0.1 * (x[1] - x[0])]),
            y: Axis::linear(label, [y[0].min(0.0), y[1]]),
            items,
        }
    };
    let names = variants.iter().enumerate().map(|(k, v)| KeyRow::text([format!("{}  {v}", k + 1)]));
    let names: Vec<KeyRow> = names.collect();
    let mut blocks: Vec<Block> = names.chunks(4).map(|rows| Block { rows: rows.to_vec() }).collect();
    let samples = loads.iter().enumerate();
    blocks.push(Block {
        rows: samples
            .map(|(k, load)| KeyRow::sample(Sample::Mark(Shape::Dot, load_colour(k)), *load))
            .chain([KeyRow::sample(Sample::Mark(Shape::Circle, INK), "a fault on the way")])
            .collect(),
    });
    let figure = Figure {
        heading: "Closed loop: tables of other models and accuracies in the firmware".into(),
        rows: vec![vec![
            panel("tracking error, um rms", |r| r.rms_m * 1e6),
            panel("at rest, um", |r| (r.rest_m * 1e6).abs()),
            panel("load estimate off by, %", |r| r.load_relative_error.abs() * 1e2),
        ]],
        panel_size: (420, 360),
        blocks,
        notes: vec![
            "Emulated board and rig, 12, 2 and 9 mm at 2 mm/s after homing. A table is fitted to its model to 5 um and 0.2 % \
             unless it says otherwise. Homing takes out what a scale of the twist and an offset of the gap can; the \
             feedback does the rest. What a cheap model costs is the load."
                .into(),
        ],
    };
    let said = runs.iter().map(|r| {
        format!(
            "{:<14} {}: {:5.1} um rms, {:4.0} um at most, at rest {:+6.1} um, load {:+6.1} %, {:.0} instructions a tick, {:.0} at most {}",
            r.variant,
            r.load,
            r.rms_m * 1e6,
            r.max_m * 1e6,
            r.rest_m * 1e6,
            r.load_relative_error * 1e2,
            r.instructions_mean,
            r.instructions_max,
            r.fault
        )
    });
    let said = said.collect();
    Ok(Made { name: "closed-loop", svg: Some(figure.svg()?), csv, said })
}

fn load_colour(k: usize) -> RGBColor {
    colour([0, 4][k % 2], 6)
}

/// Within a fiftieth of both axes.
fn near(a: (f64, f64), b: (f64, f64), x: [f64; 2], y: [f64; 2]) -> bool {
    let close = |a: f64, b: f64, [low, high]: [f64; 2]| (a - b).abs() <= 0.03 * (high - low);
    close(a.0, b.0, x) && close(a.1, b.1, y)
}
