//! The effect of a cheaper model or a less accurate table on the closed loop, drawn from the data of `cargo xtask loop`.

use super::{Inputs, Made};
use anyhow::{Context, Result};
use plotters::style::RGBColor;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Sample, Shape, colour, extent};
use serde::Deserialize;

/// A line of `loop.csv`.
#[derive(Debug, Deserialize)]
struct Run {
    variant: String,
    load: String,
    /// Nothing where nothing was moved.
    rms_m: Option<f64>,
    max_m: Option<f64>,
    rest_m: Option<f64>,
    load_relative_error: Option<f64>,
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
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let csv = inputs.measured("loop.csv", "cargo xtask loop")?;
    let runs = csv::Reader::from_reader(csv.as_bytes()).deserialize().collect::<Result<Vec<Run>, _>>();
    let runs = runs.context("loop.csv")?;
    let mut variants: Vec<&str> = runs.iter().map(|r| r.variant.as_str()).collect();
    variants.dedup();
    let mut loads: Vec<&str> = runs.iter().map(|r| r.load.as_str()).collect();
    loads.sort_unstable();
    loads.dedup();
    let names = || Axis::names(variants.iter().map(|v| (*v).to_owned()));
    let panel = |label: &str, value: fn(&Run) -> Option<f64>, first: bool| {
        let mark = |r: &Run| {
            let row = variants.iter().position(|v| *v == r.variant).unwrap_or_default();
            let load = loads.iter().position(|l| *l == r.load).unwrap_or_default();
            // One above the other, so that neither hides the other.
            let at = (value(r)?, 0.12 - row as f64 - 0.24 * load as f64);
            Some(Item::Mark { at, shape: r.shape(), colour: load_colour(load) })
        };
        let [low, high] = extent(runs.iter().filter_map(value));
        Panel {
            title: String::new(),
            x: Axis::linear(label, [low.min(0.0), high]),
            y: if first { names() } else { names().unnamed() },
            items: runs.iter().filter_map(mark).collect(),
        }
    };
    let samples = loads.iter().enumerate();
    let key = samples.map(|(k, load)| KeyRow::sample(Sample::Mark(Shape::Dot, load_colour(k)), *load));
    let blocks = vec![
        Block { rows: key.collect() },
        Block { rows: vec![KeyRow::sample(Sample::Mark(Shape::Circle, INK), "a fault on the way")] },
    ];
    let figure = Figure {
        heading: "Closed loop: tables of other models and accuracies in the firmware".into(),
        rows: vec![vec![
            panel("tracking error, um rms", |r| r.rms_m.map(|m| m * 1e6), true),
            panel("error at rest, um", |r| r.rest_m.map(|m| m.abs() * 1e6), false),
            panel("load estimate off by, %", |r| r.load_relative_error.map(|error| error.abs() * 1e2), false),
            panel("thousand instructions a tick", |r| Some(r.instructions_mean * 1e-3), false),
        ]],
        panel_size: (330, 340),
        blocks,
        notes: vec![
            "Emulated board and rig, 12, 2 and 9 mm at 2 mm/s after homing. A table is fitted to its model to 5 um and 0.2 % \
             unless it says otherwise. Homing takes out what a scale of the twist and an offset of the gap can; the \
             feedback does the rest. What a cheap model costs is the load."
                .into(),
        ],
    };
    let findings = runs.iter().map(|r| {
        let shown = |value: Option<f64>, scale: f64| value.map_or("-".into(), |value| format!("{:.1}", scale * value));
        format!(
            "{:<14} {}: {} um rms, {} um at most, at rest {} um, load {} %, {:.0} instructions a tick, {:.0} at most {}",
            r.variant,
            r.load,
            shown(r.rms_m, 1e6),
            shown(r.max_m, 1e6),
            shown(r.rest_m, 1e6),
            shown(r.load_relative_error, 1e2),
            r.instructions_mean,
            r.instructions_max,
            r.fault
        )
    });
    Ok(Made { name: "closed-loop", svg: Some(figure.svg()?), csv, findings: findings.collect(), left_out: Vec::new() })
}

fn load_colour(k: usize) -> RGBColor {
    colour([0, 4][k % 2], 6)
}
