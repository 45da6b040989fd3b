//! Rigs that are not their own model, drawn from the data of the study of rigs: errors of load and position, and where the chain from
//! homing to following breaks as one effect is turned up.

use super::{Inputs, Made, distinct};
use anyhow::Result;
use rigctl::plot::{Axis, Block, Figure, GREY, INK, Item, KeyRow, Panel, Pen, RGBColor, Shape, colour, extent};
use serde::Deserialize;

/// The command that measures what is drawn here.
const COMMAND: &str = "cargo xtask results rigs";
/// The files that it leaves, in the order of the rows: the rig of its own model, single effects, all of them together.
const FILES: [&str; 3] = ["ideal-summary.csv", "each-summary.csv", "rigs-summary.csv"];

/// A line of a summary: one check over the rigs of a group. SI units.
#[derive(Debug, Deserialize)]
struct Row {
    rig: String,
    effect: String,
    factor: Option<f64>,
    table: String,
    check: String,
    cases: usize,
    missing: usize,
    median: Option<f64>,
    worst: Option<f64>,
    holds: Option<bool>,
}

impl Row {
    fn name(&self) -> String {
        match self.effect.as_str() {
            "" if self.rig == "ideal" => "its own model".into(),
            "" => "all together".into(),
            effect => effect.into(),
        }
    }
}

/// Which tables the rigs of these rows had, and how many cases each kind of rig has.
fn made_with<'a>(rows: impl Iterator<Item = &'a Row>) -> String {
    let homed: Vec<&Row> = rows.filter(|r| r.check == "zero_error_rad").collect();
    let identified = homed.iter().filter(|r| r.table == "identified").count();
    let how = match identified {
        0 => "the default scene's table",
        count if count == homed.len() => {
            "constants identified on the same rig first, or the default scene's table where that fails"
        }
        _ => "constants identified on some rigs, and the default scene's table on others",
    };
    let cases = |pick: fn(usize, usize) -> usize| homed.iter().map(|r| r.cases + r.missing).reduce(pick).unwrap_or(0);
    match [cases(usize::min), cases(usize::max)] {
        [min, max] if min == max => format!("{how}, {max} cases of each"),
        [min, max] => format!("{how}, {min} to {max} cases of each"),
    }
}

/// What a panel shows: check, label, factor to the label's unit.
const CHECKS: [(&str, &str, f64); 4] = [
    ("load_after_homing", "load after homing off by, %", 1e2),
    ("load_after_step", "load after a step off by, %", 1e2),
    ("rest_true_m", "true error at rest, um", 1e6),
    ("following_most_m", "error while following, um", 1e6),
];

/// Draws the summaries of this folder, or of `out`.
///
/// # Errors
/// If one is not there, or cannot be read.
pub fn make(inputs: &Inputs<'_>) -> Result<Made> {
    let (mut csv, mut rows) = (String::new(), Vec::new());
    for file in FILES {
        let (text, more) = inputs.measured::<Row>(file, COMMAND)?;
        csv += if rows.is_empty() { &text } else { text.split_once('\n').map_or("", |(_header, lines)| lines) };
        rows.extend(more);
    }
    let names = distinct(rows.iter().map(Row::name));
    let draw_row = |checks: &[_]| Panel::side_by_side(checks.iter().map(|check| panel(&rows, &names, check)));
    let kinds = ["ideal", "nominal", "hard"].map(|kind| KeyRow::mark(Shape::Dot, kind_colour(kind), kind));
    let figure = Figure {
        heading: "Rigs that are not their own model: each effect alone, and all together".into(),
        rows: CHECKS.chunks(2).map(draw_row).collect(),
        panel_size: (620, 420),
        blocks: vec![
            Block::new(kinds),
            Block::new([
                KeyRow::mark(Shape::Dot, GREY, "median"),
                KeyRow::line(Pen::solid(GREY), "from there to the worst"),
                KeyRow::mark(Shape::Cross, INK, "cases without a value, all of how many"),
            ]),
        ],
        notes: vec![format!(
            "Emulated. All together: {}. Single effects: {}. A case is a rig under one load; one without a value is a \
                 homing or a move that was refused, or a fault.",
            made_with(rows.iter().filter(|r| r.effect.is_empty() && r.rig != "ideal")),
            made_with(rows.iter().filter(|r| !r.effect.is_empty())),
        )],
    };
    Made::new(&figure, csv, Vec::new())
}

fn panel(rows: &[Row], names: &[String], (check, label, by): &(&str, &str, f64)) -> Panel {
    let rows: Vec<&Row> = rows.iter().filter(|r| r.check == *check).collect();
    let values = rows.iter().flat_map(|r| [r.median, r.worst]).flatten().map(|v| by * v).filter(|v| *v > 0.0);
    let [low, high] = extent(values);
    let low = low.max(1e-3 * high);
    let mut items = Vec::new();
    for r in rows {
        let row = names.iter().position(|name| *name == r.name()).unwrap_or_default();
        // One above the other, so that neither hides the other.
        let y = if r.rig == "hard" { -0.15 } else { 0.15 } - row as f64;
        let colour = kind_colour(&r.rig);
        let place = |v: f64| ((by * v).max(low), y);
        if let (Some(median), Some(worst)) = (r.median, r.worst) {
            items.push(Item::line([place(median), place(worst)], Pen::solid(colour)));
            items.push(Item::mark(place(median), Shape::Dot, colour));
        }
        if r.missing > 0 {
            let at = r.worst.map_or((low, y), place);
            items.push(Item::mark(at, Shape::Cross, colour));
            items.push(Item::label(at, format!("{}/{}", r.missing, r.cases + r.missing), colour));
        }
    }
    // Room for the labels.
    Panel::new("", Axis::log(*label, [low, 3.0 * high]), Axis::names(names.iter().cloned()), items)
}

fn kind_colour(kind: &str) -> RGBColor {
    match kind {
        "nominal" => colour(0, 6),
        "hard" => colour(4, 6),
        _ => colour(2, 6),
    }
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
            for (line, parts) in broken.chunks(3).enumerate() {
                let names: Vec<&str> = parts.iter().map(|(name, ..)| *name).collect();
                items.push(Item::label((x - 0.47, y + 0.2 - 0.4 * line as f64), names.join(", "), ink));
            }
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
    Made::new(&figure, csv, Vec::new())
}

/// The parts whose floors do not hold, the most severe first.
fn broken<'a>(rows: impl Iterator<Item = &'a Row> + Clone) -> Vec<Part> {
    let misses = |check: &&str| rows.clone().find(|r| r.check == **check).is_some_and(|r| r.holds == Some(false));
    PARTS.into_iter().filter(|(_, checks, _)| checks.iter().any(misses)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(lines: &[&str]) -> Vec<Row> {
        let header = "rig,effect,factor,table,check,floor,cases,missing,median,p95,worst,met,holds,failure\n";
        let text = header.to_owned() + &lines.join("\n");
        csv::Reader::from_reader(text.as_bytes()).deserialize().map(Result::unwrap).collect()
    }

    #[test]
    fn a_note_says_what_the_rows_were_made_with() {
        let said = |lines: &[&str]| made_with(rows(lines).iter());
        let identified =
            ["hard,,,identified,zero_error_rad,,76,4,,,,,,", "hard,,,identified,zero_error_rad,,80,0,,,,,,"];
        assert!(said(&identified).ends_with("fails, 80 cases of each"));
        let as_built =
            ["hard,,2,as-built,zero_error_rad,,1,0,,,0.5,,true,", "hard,,,as-built,zero_error_rad,,2,1,,,,,,"];
        assert_eq!(said(&as_built), "the default scene's table, 1 to 3 cases of each");
        assert!(said(&[as_built[0], identified[0]]).contains("some rigs"));
    }

    #[test]
    fn the_gravest_broken_part_comes_first_and_is_named() {
        let rows = rows(&[
            "hard,e,2,identified,load_after_homing,x,3,1,1,1,1,0.5,false,too light",
            "hard,e,2,identified,zero_error_rad,x,3,1,,,,0.5,false,poor-fit",
            "hard,e,2,identified,rest_true_m,x,3,0,1,1,1,1,true,",
        ]);
        assert_eq!(broken(rows.iter()).into_iter().map(|(name, ..)| name).collect::<Vec<_>>(), ["homing", "load"]);
    }
}
