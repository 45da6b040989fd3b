//! The comparison's figures as a study and as a picture.

use super::score::Summary;
use super::{Entry, settled_m};
use crate::scenario::Scenario;
use crate::study::Study;
use anyhow::Result;
use rig_plant::RigPreset;
use rig_plant::units::STANDARD_GRAVITY;
use rigctl::plot::{Axis, Block, Figure, Item, KeyRow, Panel, Shape, colour, extent};

/// What others publish.
const ELSEWHERE: &str = "Published, on other actuators and moves: closed loop on a dual TSA under 500 g, largest \
    error 11.6 and 12.6 mm by PID, 4.3 and 5.0 mm by LQR (JCSE 2016, 5864918); open loop by an inverse model on a TSA \
    soft arm, 3.68 % (ASME JMR 16(4) 041007, 2024).";

/// What the measures mean.
const TRACKING: &str = "Tracking counts from where the set-point sets out. A load step itself moves the load by millimetres \
    under any controller; what differs is the time after it.";
const NOT_MADE: &str = "A move that was not made, because its controller had failed, counts as not settled. Errors are those of the \
    moves that both this controller and the other made.";

/// A controller under one load, its numbers rounded to what tells something.
#[derive(Clone, Debug, Default, PartialEq)]
struct Row {
    controller: &'static str,
    load_kg: f64,
    load_steps: bool,
    moves: usize,
    not_made: usize,
    max_error_um: f64,
    rms_error_um: f64,
    settled_share: f64,
    overshoot_um: f64,
    energy_j: f64,
}

/// A number with so many digits after the point.
fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$}").parse().unwrap_or(value)
}

impl Row {
    fn new(controller: &'static str, load_n: f64, load_steps: bool, s: &Summary) -> Self {
        let um = |m: f64| rounded(m * 1e6, 1);
        Self {
            controller,
            load_kg: rounded(load_n / STANDARD_GRAVITY, 1),
            load_steps,
            moves: s.moves,
            not_made: s.not_made,
            max_error_um: um(s.max_m),
            rms_error_um: um(s.rms_m),
            settled_share: rounded(s.settled, 3),
            overshoot_um: um(s.overshoot_m),
            energy_j: rounded(s.energy_j, 4),
        }
    }

    /// What a controller did under all loads: the root of the mean square, the mean, or the largest.
    fn over_loads(rows: &[&Self]) -> Self {
        let mean = |of: fn(&Self) -> f64| rows.iter().map(|row| of(row)).sum::<f64>() / rows.len() as f64;
        let max = |of: fn(&Self) -> f64| rows.iter().map(|row| of(row)).fold(0.0, f64::max);
        Self {
            rms_error_um: mean(|row| row.rms_error_um * row.rms_error_um).sqrt(),
            max_error_um: max(|row| row.max_error_um),
            settled_share: mean(|row| row.settled_share),
            overshoot_um: max(|row| row.overshoot_um),
            energy_j: mean(|row| row.energy_j),
            moves: rows.iter().map(|row| row.moves).sum(),
            not_made: rows.iter().map(|row| row.not_made).sum(),
            ..Self::default()
        }
    }
}

/// Everything that was found.
pub struct Results {
    rows: Vec<Row>,
    names: Vec<&'static str>,
    rig: Option<RigPreset>,
    /// How many plants, and what they are called.
    plants: (usize, String),
    /// How the baselines were set.
    notes: Vec<String>,
}

impl Results {
    /// Sums up what each controller did, ours first; `notes` say how the baselines were set.
    pub fn new(
        scenarios: &[Scenario],
        (rig, plants): (Option<RigPreset>, (usize, String)),
        reached: &[(&'static str, Vec<Entry>)],
        notes: Vec<String>,
    ) -> Self {
        let mut rows = Vec::new();
        for (name, entries) in reached {
            for steps in [false, true] {
                rows.extend(scenarios.iter().enumerate().map(|(k, scenario)| {
                    let here = entries.iter().filter(|e| e.changed == steps && e.scenario == k);
                    Row::new(name, scenario.load_n, steps, &Summary::new(here.map(|e| &e.score)))
                }));
            }
        }
        Self { rows, names: reached.iter().map(|(name, _)| *name).collect(), rig, plants, notes }
    }

    fn rows(&self, name: &str, steps: bool) -> Vec<&Row> {
        self.rows.iter().filter(|row| row.controller == name && row.load_steps == steps).collect()
    }

    fn settled_um(&self) -> f64 {
        1e6 * settled_m(self.rig.unwrap_or(RigPreset::Ideal))
    }

    /// A row for each controller: over all loads, without load steps and with.
    ///
    /// # Errors
    /// If there are not two controllers.
    pub fn study(&self) -> Result<Study> {
        let mut study = Study::new([
            "controller: without load steps; with",
            "rms error, µm",
            "largest, mm",
            "settled",
            "largest overshoot, mm",
            "energy, J",
        ]);
        let over_loads = |name: &&str| [false, true].map(|steps| Row::over_loads(&self.rows(name, steps)));
        let all: Vec<[Row; 2]> = self.names.iter().map(over_loads).collect();
        let [ours, fixed, ..] = &all[..] else { anyhow::bail!("fewer than two controllers") };
        let rig = self.rig;
        for (name, found) in self.names.iter().zip(&all) {
            let both = |of: fn(&Row) -> f64, digits: usize| {
                let [without, with] = found.each_ref().map(of);
                format!("{without:.digits$}; {with:.digits$}")
            };
            study.row([
                rig.map_or((*name).to_owned(), |rig| format!("{rig}: {name}")),
                both(|row| row.rms_error_um, 0),
                both(|row| 1e-3 * row.max_error_um, 2),
                both(|row| 100.0 * row.settled_share, 0).replace(';', " %;") + " %",
                both(|row| 1e-3 * row.overshoot_um, 2),
                both(|row| row.energy_j, 2),
            ]);
            for (steps, theirs, ours) in [("steady", &found[0], &ours[0]), ("steps", &found[1], &ours[1])] {
                let Some(rig) = rig else { continue };
                let key = format!("{rig}_{}_{steps}", letter(name));
                study.value(format!("{key}_rms_times"), theirs.rms_error_um / ours.rms_error_um);
                study.value(format!("{key}_settled_percent"), 100.0 * theirs.settled_share);
                study.value(format!("{key}_not_made"), theirs.not_made as f64);
            }
        }
        match rig {
            None => {
                study.value("rms_um", ours[0].rms_error_um);
                study.value("fixed_ratio_times", fixed[0].rms_error_um / ours[0].rms_error_um);
                study.value("plants", self.plants.0 as f64);
                study.notes.push(ELSEWHERE.into());
            }
            Some(_) => {
                let not_made = self.names.iter().zip(&all).map(|(name, found)| {
                    let [without, with] = found.each_ref().map(|f| format!("{} of {}", f.not_made, f.moves));
                    format!("{}: {without} and {with}", letter(name))
                });
                let (count, kind) = &self.plants;
                study.notes.push(format!(
                    "{count} {kind} under each of four loads; a move has settled within {:.0} µm of the true place. \
                     Moves that were not made, without load steps and with, of all: {}.",
                    self.settled_um(),
                    not_made.collect::<Vec<_>>().join(", ")
                ));
                study.notes.push(NOT_MADE.into());
            }
        }
        study.notes.push(TRACKING.into());
        study.notes.extend(self.notes.iter().cloned());
        Ok(study)
    }

    /// The picture: a row for each controller, a dot for each load.
    pub fn figure(&self) -> Figure {
        let mut loads_kg: Vec<f64> = self.rows.iter().map(|row| row.load_kg).collect();
        loads_kg.sort_by(f64::total_cmp);
        loads_kg.dedup();
        let colour = |load: usize| colour(load, loads_kg.len());
        let panel = |(what, log, value): &Quantity, steps: bool| {
            let drawn = |v: &f64| v.is_finite() && (!log || *v > 0.0);
            let mark = |row: &Row| {
                let name = self.names.iter().position(|name| *name == row.controller)?;
                let load = loads_kg.iter().position(|load_kg| *load_kg == row.load_kg)?;
                let at = (Some(value(row)).filter(drawn)?, Axis::row(name, load, loads_kg.len()));
                Some(Item::mark(at, Shape::Dot, colour(load)))
            };
            // Both columns have the same axes.
            let all = extent(self.rows.iter().map(value).filter(drawn));
            let x = if *log { Axis::log(*what, all) } else { Axis::linear(*what, all) };
            let title = if steps { "the load changes during moves" } else { "the load stays" };
            let items = self.rows.iter().filter(|row| row.load_steps == steps).filter_map(mark);
            Panel::new(title, x, Axis::names(self.names.iter().copied()), items)
        };
        let (count, kind) = &self.plants;
        let load = |(k, load_kg): (usize, &f64)| KeyRow::mark(Shape::Dot, colour(k), format!("{load_kg} kg"));
        Figure {
            heading: format!("Controllers on the same actuator: {count} {kind} under each load (emulated)"),
            rows: QUANTITIES.iter().map(|q| Panel::side_by_side([false, true].map(|steps| panel(q, steps)))).collect(),
            panel_size: (640, 370),
            blocks: Block::split(4, loads_kg.iter().enumerate().map(load)),
            notes: vec![format!(
                "Settled: within {:.0} µm, from the set-point's arrival to the next move.",
                self.settled_um()
            )],
        }
    }
}

/// A row of the picture: label, whether its axis is logarithmic, and what it shows.
type Quantity = (&'static str, bool, fn(&Row) -> f64);

const QUANTITIES: [Quantity; 2] = [
    ("tracking error, rms, mm", true, |row| 1e-3 * row.rms_error_um),
    ("settled moves, %", false, |row| 100.0 * row.settled_share),
];

/// A controller's letter.
fn letter(name: &str) -> &str {
    name.split_whitespace().next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_over_the_loads_and_count_what_was_not_made() {
        let row = |moves, not_made, [max_error_um, rms_error_um, settled_share]: [f64; 3]| Row {
            moves,
            not_made,
            max_error_um,
            rms_error_um,
            settled_share,
            ..Row::default()
        };
        let found = Row::over_loads(&[&row(4, 0, [1000.0, 30.0, 1.0]), &row(4, 3, [2000.0, 40.0, 0.25])]);
        assert!((found.rms_error_um - (0.5f64 * (900.0 + 1600.0)).sqrt()).abs() < 1e-9, "{}", found.rms_error_um);
        assert_eq!((found.moves, found.not_made, found.settled_share, found.max_error_um), (8, 3, 0.625, 2000.0));
    }

    #[test]
    fn a_row_is_kept_as_it_is_written() {
        let summary = Summary { moves: 4, max_m: 1.234_56e-4, settled: 2.0 / 3.0, ..Summary::default() };
        let row = Row::new("a", 0.1499 * STANDARD_GRAVITY, true, &summary);
        assert_eq!((row.load_kg, row.max_error_um, row.settled_share), (0.1, 123.5, 0.667));
    }
}
