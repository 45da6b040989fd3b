//! Where the chain from homing to following breaks as one effect is turned up, drawn from the data of the study of rigs.

use super::rigs::{COMMAND, Row, made_with};
use super::{Inputs, Made, distinct};
use anyhow::Result;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, RGBColor};

/// A part of the chain: its name, the checks that tell whether it holds, and its colour.
type Part = (&'static str, &'static [&'static str], RGBColor);

/// From the gravest to the mildest; the first that breaks colours a cell.
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
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let (csv, rows) = inputs.measured::<Row>("effects-summary.csv", COMMAND)?;
    let mut effects = distinct(rows.iter().map(|r| r.effect.clone()));
    effects.sort_unstable();
    let mut factors = distinct(rows.iter().filter_map(|r| r.factor));
    factors.sort_by(f64::total_cmp);
    let (mut items, mut findings) = (Vec::new(), Vec::new());
    for (row, effect) in effects.iter().enumerate() {
        for (column, factor) in factors.iter().enumerate() {
            let broken = broken(rows.iter().filter(|r| r.effect == *effect && r.factor == Some(*factor)));
            let (x, y) = (column as f64, -(row as f64));
            let colour = broken.first().map_or(HOLDS, |((.., colour), _)| *colour);
            items.push(Item::Fill { from: (x - 0.48, y - 0.42), to: (x + 0.48, y + 0.42), colour });
            let ink = if colour == PARTS[0].2 { WHITE } else { INK };
            for (line, parts) in broken.chunks(3).enumerate() {
                let names: Vec<&str> = parts.iter().map(|((name, ..), _)| *name).collect();
                items.push(Item::label((x - 0.47, y + 0.2 - 0.4 * line as f64), names.join(", "), ink));
            }
            let what = broken.iter().map(|((name, ..), why)| format!("{name}: {why}")).collect::<Vec<_>>().join("; ");
            findings.push(format!("{effect} x {factor}: {}", if what.is_empty() { "holds" } else { &what }));
        }
    }
    let last = factors.len() as f64 - 0.5;
    let columns = factors.iter().enumerate().map(|(k, factor)| (k as f64, format!("{factor}")));
    let x = Axis::linear("size of the effect, in nominal sizes", [-0.5, last]).tight([-0.5, last]).ticked(columns);
    let key = PARTS.iter().map(|(name, _, colour)| KeyRow::fill(*colour, format!("broken: {name}")));
    let figure = Figure {
        heading: "Where the chain breaks as one effect is turned up".into(),
        rows: vec![vec![Panel::new("", x, Axis::names(effects), items)]],
        panel_size: (1500, 620),
        blocks: vec![Block::new([KeyRow::fill(HOLDS, "everything holds")].into_iter().chain(key))],
        notes: vec![format!(
            "Emulated rigs of their own model but for one effect, both signs: {}. A case is a rig under one load. A part \
                 breaks where one case misses the floor for hard rigs. The words name every part that breaks, the colour \
                 the gravest of them.",
            made_with(rows.iter())
        )],
    };
    Made::new("effects", &figure, csv, findings)
}

/// The parts whose floors do not hold, the gravest first, and a case of each.
fn broken<'a>(rows: impl Iterator<Item = &'a Row> + Clone) -> Vec<(Part, &'a str)> {
    let missed = |part: Part| {
        let missed = |check: &&str| rows.clone().find(|r| r.check == **check).filter(|r| r.holds == Some(false));
        part.1.iter().find_map(missed).map(|row| (part, row.failure.as_str()))
    };
    PARTS.into_iter().filter_map(missed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gravest_broken_part_comes_first_and_is_named() {
        let text = "rig,effect,factor,table,check,floor,cases,missing,median,p95,worst,met,holds,failure\n\
                    hard,e,2,identified,load_after_homing,x,3,1,1,1,1,0.5,false,too light\n\
                    hard,e,2,identified,zero_error_rad,x,3,1,,,,0.5,false,poor-fit\n\
                    hard,e,2,identified,rest_true_m,x,3,0,1,1,1,1,true,\n";
        let rows: Vec<Row> = csv::Reader::from_reader(text.as_bytes()).deserialize().map(Result::unwrap).collect();
        let named: Vec<(&str, &str)> = broken(rows.iter()).into_iter().map(|((name, ..), why)| (name, why)).collect();
        assert_eq!(named, [("homing", "poor-fit"), ("load", "too light")]);
    }
}
