//! Errors of load and position on rigs that are not their own model, drawn from the data of the study of rigs.

use super::{Inputs, Made};
use anyhow::{Context, Result};
use plotters::style::RGBColor;
use rigctl::csv_text::{csv_text, optional};
use rigctl::plot::{Axis, Block, Figure, GREY, INK, Item, KeyRow, Panel, Pen, Sample, Shape, colour, extent};
use serde::{Deserialize, Serialize};

/// The command that measures what is drawn here.
pub(super) const COMMAND: &str = "cargo xtask results rigs";
/// The files that it leaves, in the order of the rows: the rig of its own model, single effects, all of them together.
const FILES: [&str; 3] = ["ideal-summary.csv", "each-summary.csv", "rigs-summary.csv"];

/// A line of a summary: one check over the rigs of a group. SI units.
#[derive(Debug, Deserialize, Serialize)]
pub(super) struct Row {
    pub rig: String,
    pub effect: String,
    pub factor: Option<f64>,
    pub table: String,
    pub check: String,
    pub floor: String,
    pub cases: usize,
    pub missing: usize,
    pub median: Option<f64>,
    pub p95: Option<f64>,
    pub worst: Option<f64>,
    pub met: Option<f64>,
    pub holds: Option<bool>,
    pub failure: String,
}

impl Row {
    /// Reads a summary.
    pub fn read(text: &str) -> Result<Vec<Self>> {
        Ok(csv::Reader::from_reader(text.as_bytes()).deserialize().collect::<Result<_, _>>()?)
    }

    /// Writes one.
    pub fn write(rows: &[Self]) -> Result<String> {
        let header = [
            "rig", "effect", "factor", "table", "check", "floor", "cases", "missing", "median", "p95", "worst", "met",
            "holds", "failure",
        ];
        let cells = |r: &Self| {
            vec![
                r.rig.clone(),
                r.effect.clone(),
                optional(r.factor),
                r.table.clone(),
                r.check.clone(),
                r.floor.clone(),
                r.cases.to_string(),
                r.missing.to_string(),
                optional(r.median),
                optional(r.p95),
                optional(r.worst),
                optional(r.met),
                r.holds.map_or(String::new(), |holds| holds.to_string()),
                r.failure.clone(),
            ]
        };
        csv_text(&header, rows.iter().map(cells))
    }

    fn name(&self) -> String {
        match self.effect.as_str() {
            "" if self.rig == "ideal" => "its own model".into(),
            "" => "all together".into(),
            effect => effect.into(),
        }
    }
}

/// Which tables the rigs of these rows had, and how many cases each kind of rig has.
pub(super) fn made_with<'a>(rows: impl Iterator<Item = &'a Row>) -> String {
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
        [least, most] if least == most => format!("{how}, {most} cases of each"),
        [least, most] => format!("{how}, {least} to {most} cases of each"),
    }
}

/// What a panel shows: check, label, factor to the label's unit.
const PANELS: [(&str, &str, f64); 4] = [
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
    let mut rows = Vec::new();
    for file in FILES {
        rows.extend(Row::read(&inputs.measured(file, COMMAND)?).context(file)?);
    }
    let mut names: Vec<String> = Vec::new();
    for row in &rows {
        if !names.contains(&row.name()) {
            names.push(row.name());
        }
    }
    let draw_row = |panels: &[(&str, &str, f64)]| {
        panels.iter().enumerate().map(|(k, panel)| draw(&rows, &names, panel, k == 0)).collect::<Vec<_>>()
    };
    let kinds =
        ["ideal", "nominal", "hard"].map(|kind| KeyRow::sample(Sample::Mark(Shape::Dot, kind_colour(kind)), kind));
    let figure = Figure {
        heading: "Rigs that are not their own model: each effect alone, and all together".into(),
        rows: PANELS.chunks(2).map(draw_row).collect(),
        panel_size: (620, 420),
        blocks: vec![
            Block { rows: kinds.to_vec() },
            Block {
                rows: vec![
                    KeyRow::sample(Sample::Mark(Shape::Dot, GREY), "median"),
                    KeyRow::sample(Sample::Line(Pen::solid(GREY)), "from there to the worst"),
                    KeyRow::sample(Sample::Mark(Shape::Cross, INK), "cases without a value, all of how many"),
                ],
            },
        ],
        notes: vec![format!(
            "Emulated. All together: {}. Single effects: {}. A case is a rig under one load; one without a value is a \
                 homing or a move that was refused, or a fault.",
            made_with(rows.iter().filter(|r| r.effect.is_empty() && r.rig != "ideal")),
            made_with(rows.iter().filter(|r| !r.effect.is_empty())),
        )],
    };
    let findings = rows.iter().filter(|r| PANELS.iter().any(|p| p.0 == r.check)).map(|r| {
        let shown = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.3e}"));
        format!(
            "{:<20} {:<8} {:<18} median {}, worst {}, {} of {} without a value {}",
            r.name(),
            r.rig,
            r.check,
            shown(r.median),
            shown(r.worst),
            r.missing,
            r.cases + r.missing,
            r.failure
        )
    });
    Ok(Made {
        name: "rigs",
        svg: Some(figure.svg()?),
        csv: Row::write(&rows)?,
        findings: findings.collect(),
        left_out: Vec::new(),
    })
}

fn draw(rows: &[Row], names: &[String], (check, label, by): &(&str, &str, f64), first: bool) -> Panel {
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
        if let (Some(median), Some(worst)) = (r.median, r.worst) {
            let [median, worst] = [median, worst].map(|v| (by * v).max(low));
            items.push(Item::Line { points: vec![(median, y), (worst, y)], pen: Pen::solid(colour) });
            items.push(Item::Mark { at: (median, y), shape: Shape::Dot, colour });
        }
        if r.missing > 0 {
            let at = (r.worst.map_or(low, |v| (by * v).max(low)), y);
            items.push(Item::Mark { at, shape: Shape::Cross, colour });
            items.push(Item::Label { at, text: format!("{}/{}", r.missing, r.cases + r.missing), colour });
        }
    }
    let y = Axis::names(names.iter().cloned());
    // Room for the labels.
    let x = Axis::log(*label, [low, 3.0 * high]);
    Panel { title: String::new(), x, y: if first { y } else { y.unnamed() }, items }
}

fn kind_colour(kind: &str) -> RGBColor {
    match kind {
        "nominal" => colour(0, 6),
        "hard" => colour(4, 6),
        _ => colour(2, 6),
    }
}

#[cfg(test)]
mod tests {
    use super::Row;

    #[test]
    fn a_note_says_what_the_rows_were_made_with() {
        let row = |table: &str, cases: usize, missing: usize| Row {
            table: table.into(),
            check: "zero_error_rad".into(),
            cases,
            missing,
            ..Row::read(
                "rig,effect,factor,table,check,floor,cases,missing,median,p95,worst,met,holds,failure\n\
                         hard,,,identified,zero_error_rad,,1,0,,,,,,\n",
            )
            .unwrap()
            .remove(0)
        };
        let said = |rows: &[Row]| super::made_with(rows.iter());
        assert!(said(&[row("identified", 76, 4), row("identified", 80, 0)]).ends_with("fails, 80 cases of each"));
        assert_eq!(
            said(&[row("as-built", 1, 0), row("as-built", 2, 1)]),
            "the default scene's table, 1 to 3 cases of each"
        );
        assert!(said(&[row("as-built", 1, 0), row("identified", 1, 0)]).contains("some rigs"));
    }

    #[test]
    fn a_summary_comes_back() {
        let text = "rig,effect,factor,table,check,floor,cases,missing,median,p95,worst,met,holds,failure\n\
                    hard,twist play,2,identified,rest_true_m,0.3 mm,3,1,0.0001,0.0002,0.0003,0.75,false,\"rig 1: homing, refused\"\n\
                    nominal,,,identified,zero_error_rad,\"0.05 rad, 99 %\",0,0,,,,,,\n";
        let rows = Row::read(text).unwrap();
        assert_eq!((rows[0].factor, rows[0].holds, rows[1].worst), (Some(2.0), Some(false), None));
        assert_eq!(Row::write(&rows).unwrap(), text);
    }
}
