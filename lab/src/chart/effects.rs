//! Where the chain from homing to following breaks as one effect is turned up, drawn from the data of the study of rigs.

use super::rigs::{COMMAND, Row, made_with};
use super::{Inputs, Made};
use anyhow::{Context, Result};
use plotters::style::RGBColor;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Sample};

/// A part of the chain: the checks that tell whether it holds.
struct Part {
    name: &'static str,
    checks: &'static [&'static str],
    colour: RGBColor,
}

/// From the gravest to the mildest; the first that breaks colours a cell.
const PARTS: [Part; 5] = [
    Part { name: "homing", checks: &["zero_error_rad"], colour: RGBColor(70, 70, 70) },
    Part { name: "faults", checks: &["faults", "sank_after_fault_m"], colour: RGBColor(204, 121, 167) },
    Part { name: "rest", checks: &["rest_measured_m", "rest_reversals", "rest_true_m"], colour: RGBColor(213, 94, 0) },
    Part { name: "following", checks: &["following_rms_m", "following_most_m"], colour: RGBColor(230, 159, 0) },
    Part {
        name: "load",
        checks: &["load_after_homing", "load_after_step", "load_error_over_stated", "held_out_contraction"],
        colour: RGBColor(240, 220, 120),
    },
];
const HOLDS: RGBColor = RGBColor(190, 225, 245);

/// Draws the ramp of this folder, or of `out`.
///
/// # Errors
/// If it is not there, or cannot be read.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let rows = Row::read(&inputs.measured("effects-summary.csv", COMMAND)?).context("effects-summary.csv")?;
    let mut effects: Vec<&str> = rows.iter().map(|r| r.effect.as_str()).collect();
    effects.sort_unstable();
    effects.dedup();
    let mut factors: Vec<f64> = rows.iter().filter_map(|r| r.factor).collect();
    factors.sort_by(f64::total_cmp);
    factors.dedup();
    let (mut items, mut findings) = (Vec::new(), Vec::new());
    for (row, effect) in effects.iter().enumerate() {
        for (column, factor) in factors.iter().enumerate() {
            let here: Vec<&Row> = rows.iter().filter(|r| r.effect == *effect && r.factor == Some(*factor)).collect();
            let broken = broken(&here);
            let (x, y) = (column as f64, -(row as f64));
            let fill = broken.first().map_or(HOLDS, |part| part.0.colour);
            items.push(Item::Fill { from: (x - 0.48, y - 0.42), to: (x + 0.48, y + 0.42), colour: fill });
            let names: Vec<&str> = broken.iter().map(|part| part.0.name).collect();
            let ink =
                if broken.first().is_some_and(|part| part.0.name == "homing") { RGBColor(255, 255, 255) } else { INK };
            for (line, names) in names.chunks(3).enumerate() {
                let at = (x - 0.47, y + 0.2 - 0.4 * line as f64);
                items.push(Item::Label { at, text: names.join(", "), colour: ink });
            }
            let what = broken.iter().map(|(part, why)| format!("{}: {why}", part.name)).collect::<Vec<_>>().join("; ");
            findings.push(format!("{effect} x {factor}: {}", if what.is_empty() { "holds" } else { &what }));
        }
    }
    let last = factors.len() as f64 - 0.5;
    let columns = factors.iter().enumerate().map(|(k, factor)| (k as f64, format!("{factor}")));
    let x = Axis::linear("size of the effect, in nominal sizes", [-0.5, last]).tight([-0.5, last]).ticked(columns);
    let panel = Panel { title: String::new(), x, y: Axis::names(effects.iter().map(|e| (*e).to_owned())), items };
    let key = PARTS.iter().map(|part| KeyRow::sample(Sample::Fill(part.colour), format!("broken: {}", part.name)));
    let holds = KeyRow::sample(Sample::Fill(HOLDS), "everything holds");
    let figure = Figure {
        heading: "Where the chain breaks as one effect is turned up".into(),
        rows: vec![vec![panel]],
        panel_size: (1500, 620),
        blocks: vec![Block { rows: std::iter::once(holds).chain(key).collect() }],
        notes: vec![format!(
            "Emulated rigs of their own model but for one effect, both signs: {}. A case is a rig under one load. A part \
                 breaks where one case misses the floor for hard rigs. The words name every part that breaks, the colour \
                 the gravest of them.",
            made_with(rows.iter())
        )],
    };
    Ok(Made { name: "effects", svg: Some(figure.svg()?), csv: Row::write(&rows)?, findings, left_out: Vec::new() })
}

/// The parts whose floors do not hold, the gravest first, and a case of each.
fn broken<'a>(rows: &[&'a Row]) -> Vec<(&'static Part, &'a str)> {
    let missed = |part: &Part| {
        let checks = part.checks.iter().filter_map(|check| rows.iter().find(|r| r.check == *check));
        checks.filter(|r| r.holds == Some(false)).map(|r| r.failure.as_str()).next()
    };
    PARTS.iter().filter_map(|part| missed(part).map(|why| (part, why))).collect()
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
        let rows = Row::read(text).unwrap();
        let named: Vec<(&str, &str)> =
            broken(&rows.iter().collect::<Vec<_>>()).into_iter().map(|(part, why)| (part.name, why)).collect();
        assert_eq!(named, [("homing", "poor-fit"), ("load", "too light")]);
    }
}
