//! The comparison's figures as a table, a CSV and a picture.

use super::plants::Kind;
use super::score::Summary;
use super::{Entry, Failure};
use crate::scenario::Scenario;
use rig_plant::units::STANDARD_GRAVITY;
use rig_plant::{PlantKey, RigPreset};
use rigctl::csv_text::csv_text;
use rigctl::plot::{Axis, Block, Figure, INK, Item, KeyRow, Panel, Pen, Sample, Shape, colour, extent};
use std::fmt::Write;

/// Largest tracking errors that others publish for closed loops on a twisted string: what, load (kg), errors (mm).
/// JCSE 2016, 5864918: a dual actuator, other moves than here.
const PUBLISHED: [(&str, f64, [f64; 2]); 2] =
    [("published: dual TSA, PID", 0.5, [11.6, 12.6]), ("published: dual TSA, LQR", 0.5, [4.3, 5.0])];

/// What else there is, in other measures.
const ELSEWHERE: &str = "Published beside these, on other rigs and moves: closed loop on a dual TSA under 500 g, largest \
    error 11.6 and 12.6 mm by PID, 4.3 and 5.0 mm by LQR (JCSE 2016, 5864918); open loop by an inverse model on a TSA \
    soft arm, 3.68 % (ASME JMR 16(4) 041007, 2024).";

/// What the measures mean.
const HOW: &str = "Tracking counts while the set-point travels, settling from its arrival until the next move. A load \
    step moves the load by itself under any controller, by up to 5 mm. No settling time where fewer than nine moves of ten \
    settle. A move that was not made, because its controller had failed, counts as not settled.";

/// One row of the picture.
struct Quantity {
    title: &'static str,
    label: &'static str,
    log: bool,
    /// Others publish it.
    published: bool,
    value: fn(&Summary) -> f64,
}

const QUANTITIES: [Quantity; 5] = [
    Quantity { title: "Tracking, rms", label: "error, mm", log: true, published: false, value: |s| s.rms_m * 1e3 },
    Quantity { title: "Tracking, largest", label: "error, mm", log: true, published: true, value: |s| s.max_m * 1e3 },
    Quantity { title: "Settled", label: "moves, %", log: false, published: false, value: |s| s.settled * 100.0 },
    Quantity {
        title: "Largest overshoot",
        label: "past target, mm",
        log: true,
        published: false,
        value: |s| s.overshoot_m * 1e3,
    },
    Quantity {
        title: "Electrical energy of a move",
        label: "energy, J",
        log: false,
        published: false,
        value: |s| s.energy_j,
    },
];

/// What one controller reached.
pub struct Reached {
    /// Whose, as a letter and in words.
    pub name: String,
    /// Every move's figures.
    pub entries: Vec<Entry>,
}

/// One line of the table: whose, where, and what.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The controller, as a letter and in words.
    pub name: String,
    /// Load (kg); `None` is all of them.
    pub load_kg: Option<f64>,
    /// Moves with a load step on the way.
    pub steps: bool,
    /// The figures.
    pub summary: Summary,
}

/// Everything that was found.
pub struct Results {
    lines: Vec<Line>,
    kind: Kind,
    plants: usize,
    failures: Vec<String>,
    notes: Vec<String>,
}

impl Results {
    /// Sums up; `notes` say how the baselines were set.
    pub fn new(
        scenarios: &[Scenario],
        (kind, plants): (Kind, usize),
        failures: &[Failure],
        reached: &[Reached],
        notes: Vec<String>,
    ) -> Self {
        let loads: Vec<f64> = scenarios.iter().map(load_kg).collect();
        let mut lines = Vec::new();
        for r in reached {
            for steps in [false, true] {
                let mut line = |scenario: Option<usize>| {
                    let here = |s: usize| scenario.is_none_or(|only| only == s);
                    let entries = r.entries.iter().filter(|e| here(e.scenario) && e.changed == steps);
                    lines.push(Line {
                        name: r.name.clone(),
                        load_kg: scenario.map(|s| loads[s]),
                        steps,
                        summary: Summary::new(entries.map(|e| &e.score)),
                    });
                };
                (0..scenarios.len()).for_each(|s| line(Some(s)));
                line(None);
            }
        }
        let failures =
            failures.iter().map(|f| format!("{}, plant {}: {}", scenarios[f.scenario].name, f.seed, f.reason));
        Self { lines, kind, plants, failures: failures.collect(), notes }
    }

    /// The lines.
    pub fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// The figures over all loads.
    pub fn over_all_loads(&self, name: &str, steps: bool) -> Option<&Summary> {
        let all = |l: &&Line| l.load_kg.is_none() && l.steps == steps && l.name == name;
        self.lines.iter().find(all).map(|l| &l.summary)
    }

    /// The controllers' names, in order.
    fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.lines.iter().map(|l| l.name.as_str()).collect();
        names.dedup();
        names
    }

    /// For people.
    pub fn table(&self) -> String {
        let mut text = String::new();
        let mut put = |line: String| {
            let _ = writeln!(text, "{line}");
        };
        put(format!(
            "{} {} under each load ({}); settled is to {:.0} um; all EMULATED",
            self.plants,
            self.kind,
            drawn(self.kind),
            1e6 * self.kind.settled_m()
        ));
        for steps in [false, true] {
            put(String::new());
            put(format!(
                "{:<30} {:>6} {:>6} {:>8} {:>9} {:>9} {:>13} {:>8} {:>12} {:>9}",
                if steps { "load steps on the way" } else { "no load steps" },
                "load",
                "moves",
                "not made",
                "max um",
                "rms um",
                "settling 90 %",
                "settled",
                "overshoot um",
                "energy J"
            ));
            for line in self.lines.iter().filter(|l| l.steps == steps) {
                let s = &line.summary;
                put(format!(
                    "{:<30} {:>6} {:>6} {:>8} {:>9.0} {:>9.1} {:>13} {:>6.0} % {:>12.0} {:>9.3}",
                    line.name,
                    line.load_kg.map_or("all".into(), |kg| format!("{kg:.1}")),
                    s.moves,
                    s.not_made,
                    s.max_m * 1e6,
                    s.rms_m * 1e6,
                    if s.settling_s.is_finite() { format!("{:.2}", s.settling_s) } else { "–".into() },
                    100.0 * s.settled,
                    s.overshoot_m * 1e6,
                    s.energy_j
                ));
            }
        }
        put(String::new());
        let names = self.names();
        for name in names.iter().skip(1) {
            let times = |steps| {
                let [theirs, ours] = [name, &names[0]].map(|n| self.over_all_loads(n, steps).map_or(0.0, |s| s.rms_m));
                theirs / ours
            };
            put(format!(
                "rms error over that of a: {name:<30} {:6.2} {:6.2} with load steps",
                times(false),
                times(true)
            ));
        }
        if self.kind == Kind::Random {
            put("(wanted: b and b' at least 5 without load steps)".into());
        }
        let waits = [false, true].map(|steps| self.over_all_loads(names[0], steps).map_or(0.0, |s| s.wait_s));
        put(format!(
            "before the set-point sets out it waits for the strings to take up friction: {:.2} s on average, {:.2} s with load steps",
            waits[0], waits[1]
        ));
        self.notes.iter().for_each(|note| put(note.clone()));
        for failure in &self.failures {
            put(format!("a failed: {failure}"));
        }
        put(ELSEWHERE.into());
        text
    }

    /// For machines. Lengths in um; an empty settling time means that fewer than nine moves of ten settled.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn csv(&self) -> anyhow::Result<String> {
        let header = [
            "controller",
            "load_kg",
            "load_steps",
            "moves",
            "not_made",
            "max_error_um",
            "rms_error_um",
            "settling_s",
            "settled_share",
            "overshoot_um",
            "energy_j",
        ];
        let ours = self.lines.iter().map(|line| {
            let s = &line.summary;
            let um = |m: f64| format!("{:.1}", m * 1e6);
            let settling = if s.settling_s.is_finite() { format!("{:.2}", s.settling_s) } else { String::new() };
            vec![
                line.name.clone(),
                line.load_kg.map_or("all".into(), |kg| format!("{kg:.1}")),
                line.steps.to_string(),
                s.moves.to_string(),
                s.not_made.to_string(),
                um(s.max_m),
                um(s.rms_m),
                settling,
                format!("{:.3}", s.settled),
                um(s.overshoot_m),
                format!("{:.4}", s.energy_j),
            ]
        });
        let theirs = PUBLISHED.iter().flat_map(|(what, kg, errors)| {
            errors.iter().map(move |mm| {
                let known = [(*what).to_owned(), format!("{kg:.1}"), String::new(), String::new(), String::new()];
                let mut cells = known.to_vec();
                cells.push(format!("{:.1}", mm * 1e3));
                cells.resize(header.len(), String::new());
                cells
            })
        });
        csv_text(&header, ours.chain(theirs))
    }

    /// The picture.
    ///
    /// # Errors
    /// If the drawing library fails.
    pub fn figure(&self) -> anyhow::Result<String> {
        let names = self.names();
        // Black is the seventh of the colours that are told apart.
        let colour = |k: usize| if k < 6 { colour(k, 6) } else { INK };
        let pen = |k: usize| Pen { dashed: k > 6, ..Pen::solid(colour(k)) };
        let panel = |quantity: &Quantity, steps: bool| {
            let value = |l: &Line| Some((l.load_kg?, (quantity.value)(&l.summary)));
            let drawable = |(_, v): &(f64, f64)| v.is_finite() && (!quantity.log || *v > 0.0);
            let points = |lines: &mut dyn Iterator<Item = &Line>| lines.filter_map(value).filter(drawable).collect();
            let mut items = Vec::new();
            for (k, name) in names.iter().enumerate() {
                let line: Vec<(f64, f64)> =
                    points(&mut self.lines.iter().filter(|l| l.name == *name && l.steps == steps));
                items.push(Item::Line { points: line.clone(), pen: pen(k) });
                items.extend(line.into_iter().map(|at| Item::Mark { at, shape: Shape::Circle, colour: colour(k) }));
            }
            let published: Vec<(f64, f64)> = PUBLISHED
                .iter()
                .filter(|_| quantity.published && !steps)
                .flat_map(|(_, kg, errors)| errors.iter().map(move |mm| (*kg, *mm)))
                .collect();
            items.extend(published.iter().map(|at| Item::Mark { at: *at, shape: Shape::Cross, colour: INK }));
            // Both columns have the same axes.
            let all: Vec<(f64, f64)> = points(&mut self.lines.iter());
            let heights = extent(all.iter().chain(&published).map(|p| p.1));
            let x = Axis::linear("load, kg", extent(self.lines.iter().filter_map(|l| l.load_kg)));
            let y =
                if quantity.log { Axis::log(quantity.label, heights) } else { Axis::linear(quantity.label, heights) };
            let title = format!("{}, {} load steps", quantity.title, if steps { "with" } else { "without" });
            Panel { title, x, y, items }
        };
        let sample = |k: usize, name: &str| KeyRow::sample(Sample::Line(pen(k)), name);
        let whose = names.iter().enumerate().map(|(k, name)| sample(k, name)).collect();
        let published = KeyRow::sample(Sample::Mark(Shape::Cross, INK), "published: dual TSA, 500 g, LQR and PID");
        let figure = Figure {
            heading: format!("Ways to drive the same rig: {} {} under each load (emulated)", self.plants, self.kind),
            rows: QUANTITIES.iter().map(|q| [false, true].map(|steps| panel(q, steps)).into()).collect(),
            panel_size: (640, 290),
            blocks: vec![Block { rows: whose }, Block { rows: vec![published] }],
            notes: [format!("Settled: within {:.0} µm. {HOW}", 1e6 * self.kind.settled_m())]
                .into_iter()
                .chain(self.notes.iter().cloned())
                .chain([ELSEWHERE.to_owned()])
                .collect(),
        };
        figure.svg()
    }
}

/// How plants of a kind differ from the firmware's model.
fn drawn(kind: Kind) -> &'static str {
    match kind {
        Kind::Random => {
            "constants and supply ±10 %, friction 0 to 0.3 N, LVDT noise 30 to 120 um, play of the gear 0 to 20 mrad, but for \
             what is said below"
        }
        Kind::Rig(RigPreset::Ideal) => "rigs of their own model",
        Kind::Rig(_) => "each calibrated and identified first, for all controllers",
    }
}

/// The load that a scenario starts with (kg).
fn load_kg(scenario: &Scenario) -> f64 {
    scenario.plant.iter().find(|s| s.key == PlantKey::Load).map_or(f64::NAN, |s| s.value / STANDARD_GRAVITY)
}
