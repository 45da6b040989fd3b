//! The sections that compare controllers: on random plants, and on rigs of a kind.

use super::Measured;
use super::sections::{cell, csv, text};
use crate::{Folders, host};
use anyhow::{Context, Result, ensure};
use std::path::Path;

/// Random plants, and rigs of each kind: few, because the others' loops are tuned anew for each kind.
const PLANTS: u16 = 50;
const RIGS: u16 = 3;
/// Kinds of rigs, and within which distance (µm) of the truth a move has settled there, as `cargo xtask compare` has it.
const KINDS: [(&str, u16); 2] = [("nominal", 150), ("hard", 300)];

pub(super) fn on_random_plants(folders: &Folders) -> Result<Measured> {
    host::compare(folders, &["--plants".into(), PLANTS.to_string()])?;
    let controllers = controllers(&folders.root.join("docs/comparison.csv"))?;
    let mut measured = Measured { table: vec![head("controller: without load steps; with")], ..Measured::default() };
    measured.table.extend(controllers.iter().map(Controller::row));
    let [ours, fixed, ..] = &controllers[..] else { anyhow::bail!("fewer than two controllers") };
    measured.values.insert("rms_um".into(), ours.without.rms_um);
    measured.values.insert("fixed_ratio_times".into(), fixed.without.rms_um / ours.without.rms_um);
    measured.values.insert("plants".into(), PLANTS.into());
    measured.notes.push(TRACKING.into());
    Ok(measured)
}

pub(super) fn on_rigs(folders: &Folders) -> Result<Measured> {
    let mut measured = Measured { table: vec![head("controller: without load steps; with")], ..Measured::default() };
    for (kind, settled_um) in KINDS {
        host::compare(folders, &["--rig".into(), kind.into(), "--plants".into(), RIGS.to_string()])?;
        let controllers = controllers(&folders.root.join(format!("docs/comparison-{kind}.csv")))?;
        let ours = controllers.first().context("no controller")?;
        for one in &controllers {
            let mut row = one.row();
            row[0] = format!("{kind}: {}", row[0]);
            measured.table.push(row);
            let letter = one.name.split_whitespace().next().unwrap_or_default();
            for (steps, [theirs, ours]) in
                [("steady", [&one.without, &ours.without]), ("steps", [&one.with, &ours.with])]
            {
                let mut value = |what: &str, value: f64| {
                    measured.values.insert(format!("{kind}_{letter}_{steps}_{what}"), value);
                };
                value("rms_times", theirs.rms_um / ours.rms_um);
                value("settled_percent", theirs.settled);
                value("not_made", theirs.not_made);
            }
        }
        measured.notes.push(format!(
            "{RIGS} {kind} rigs under each of four loads; a move has settled within {settled_um} µm of the true place. \
             Moves that were not made, without load steps and with, of all: {}.",
            controllers.iter().map(Controller::not_made).collect::<Vec<_>>().join(", ")
        ));
    }
    measured.notes.push(
        "A move that was not made, because its controller had failed, counts as not settled. Errors are those of the \
         moves that both this controller and the other made."
            .into(),
    );
    measured.notes.push(TRACKING.into());
    Ok(measured)
}

const TRACKING: &str = "Tracking counts from where the set-point sets out. A load step itself moves the load by millimetres \
    under any controller; what differs is the time after it.";

fn head(first: &str) -> Vec<String> {
    text(&[first, "rms error, µm", "largest, mm", "settled", "largest overshoot, mm", "energy, J"])
}

/// Figures over all loads: the root of the mean square, the mean, or the largest.
struct Figures {
    rms_um: f64,
    largest_mm: f64,
    settled: f64,
    overshoot_mm: f64,
    energy_j: f64,
    moves: f64,
    not_made: f64,
}

struct Controller {
    name: String,
    without: Figures,
    with: Figures,
}

impl Controller {
    fn row(&self) -> Vec<String> {
        let both = |value: fn(&Figures) -> f64, digits: usize| {
            format!("{:.digits$}; {:.digits$}", value(&self.without), value(&self.with))
        };
        vec![
            self.name.clone(),
            both(|f| f.rms_um, 0),
            both(|f| f.largest_mm, 2),
            format!("{:.0} %; {:.0} %", self.without.settled, self.with.settled),
            both(|f| f.overshoot_mm, 2),
            both(|f| f.energy_j, 2),
        ]
    }

    fn not_made(&self) -> String {
        let letter = self.name.split_whitespace().next().unwrap_or_default();
        let of = |f: &Figures| format!("{:.0} of {:.0}", f.not_made, f.moves);
        format!("{letter}: {} and {}", of(&self.without), of(&self.with))
    }
}

/// The controllers of a file that `cargo xtask compare` has written.
fn controllers(file: &Path) -> Result<Vec<Controller>> {
    let rows = csv(file)?;
    let (head, rows) = rows.split_first().with_context(|| format!("{} is empty", file.display()))?;
    // What others have published stands in the same file, with other columns.
    let own = rows.iter().map(|row| row[0].clone()).filter(|name| !name.starts_with("published"));
    let mut names: Vec<String> = own.collect();
    names.dedup();
    let controller = |name: String| -> Result<Controller> {
        let [without, with] = ["false", "true"].map(|steps| figures(head, rows, &name, steps));
        Ok(Controller { without: without?, with: with?, name })
    };
    names.into_iter().map(controller).collect()
}

fn figures(head: &[String], rows: &[Vec<String>], name: &str, steps: &str) -> Result<Figures> {
    let column = |column: &str| head.iter().position(|name| name == column).with_context(|| format!("no {column}"));
    let (loads, with) = (column("load_kg")?, column("load_steps")?);
    let rows: Vec<_> = rows.iter().filter(|r| r[0] == name && r[with] == steps && r[loads] != "all").collect();
    ensure!(!rows.is_empty(), "the comparison has no rows of {name} with load_steps = {steps}");
    let all = |column: &str| rows.iter().filter_map(|r| cell(head, r, column)).collect::<Vec<_>>();
    let sum = |values: &[f64]| values.iter().sum::<f64>();
    let mean = |values: &[f64]| sum(values) / values.len() as f64;
    let most = |values: &[f64]| values.iter().fold(0.0, |a: f64, b| a.max(*b));
    let squares: Vec<f64> = all("rms_error_um").iter().map(|e| e * e).collect();
    Ok(Figures {
        rms_um: mean(&squares).sqrt(),
        largest_mm: 1e-3 * most(&all("max_error_um")),
        settled: 100.0 * mean(&all("settled_share")),
        overshoot_mm: 1e-3 * most(&all("overshoot_um")),
        energy_j: mean(&all("energy_j")),
        moves: sum(&all("moves")),
        not_made: sum(&all("not_made")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_over_the_loads_and_count_what_was_not_made() {
        let head = text(&[
            "controller",
            "load_kg",
            "load_steps",
            "moves",
            "not_made",
            "max_error_um",
            "rms_error_um",
            "settled_share",
            "overshoot_um",
            "energy_j",
        ]);
        let row = |load: &str, steps: &str, numbers: [&str; 7]| {
            ["a  this", load, steps].into_iter().chain(numbers).map(str::to_owned).collect::<Vec<_>>()
        };
        let rows = [
            row("0.1", "false", ["4", "0", "1000", "30", "1", "10", "1"]),
            row("1.0", "false", ["4", "3", "2000", "40", "0.25", "20", "2"]),
            row("all", "false", ["8", "3", "9999", "9999", "0.6", "9999", "9999"]),
            row("0.1", "true", ["3", "0", "1", "1", "1", "1", "1"]),
        ];
        let found = figures(&head, &rows, "a  this", "false").unwrap();
        assert!((found.rms_um - (0.5f64 * (900.0 + 1600.0)).sqrt()).abs() < 1e-9, "{}", found.rms_um);
        assert_eq!((found.moves, found.not_made, found.settled, found.largest_mm), (8.0, 3.0, 62.5, 2.0));
        assert!(figures(&head, &rows, "b", "false").is_err());
    }
}
