//! What the study found, as a table, JSON and CSV.

use super::Scored;
use super::floor::{Check, Finding, Floor};
use super::subject::Subject;
use super::trial::NOT_HOMED;
use lab::csv_text::{csv_text, optional};
use serde_json::{Value, json};
use sim_link::RigPreset;
use sim_link::units::STANDARD_GRAVITY;
use std::fmt::Write;

/// A check over all rigs of a kind.
#[derive(Clone, Debug)]
pub struct Line {
    /// Of which rigs.
    pub kind: RigPreset,
    /// What.
    pub check: Check,
    /// What is asked; none where nothing is.
    pub floor: Option<Floor>,
    /// How often it was measured, and how often it should have been but could not.
    pub cases: [usize; 2],
    /// Median, 95th percentile and greatest of the magnitudes; of [`Floor::AtLeast`] the other end.
    pub spread: Option<[f64; 3]>,
    /// Share of the cases that meet the floor; the mean, or the number for every 200 moves, where the floor is one of that.
    pub met: Option<f64>,
    /// Whether the floor holds.
    pub holds: Option<bool>,
}

/// A case that does not meet its floor.
#[derive(Clone, Debug)]
pub struct Failed<'a> {
    /// Which rig.
    pub subject: &'a Subject,
    /// What.
    pub finding: &'a Finding,
}

/// The study's results.
pub struct Results<'a> {
    scored: &'a [Scored],
    as_built: bool,
}

impl<'a> Results<'a> {
    /// Of these rigs, all commissioned or all as built.
    pub fn new(scored: &'a [Scored]) -> Self {
        Self { scored, as_built: scored.first().is_some_and(|s| s.as_built) }
    }

    fn findings(&self, kind: RigPreset, check: Check) -> impl Iterator<Item = (&'a Subject, &'a Finding)> {
        let rigs = self.scored.iter().filter(move |s| s.subject.kind == kind);
        rigs.flat_map(move |s| s.findings.iter().filter(move |f| f.check == check).map(|f| (&s.subject, f)))
    }

    /// The kinds of rigs that there are.
    pub fn kinds(&self) -> Vec<RigPreset> {
        let there = |kind: &RigPreset| self.scored.iter().any(|s| s.subject.kind == *kind);
        RigPreset::ALL.into_iter().filter(there).collect()
    }

    /// One row for one kind of rigs.
    pub fn line(&self, kind: RigPreset, check: Check) -> Line {
        let floor = check.floor(kind, self.as_built);
        let all: Vec<&Finding> = self.findings(kind, check).map(|(_, finding)| finding).collect();
        let mut values: Vec<f64> = all.iter().filter_map(|f| f.value).map(f64::abs).collect();
        let best_last = matches!(floor, Some(Floor::AtLeast(_)));
        values.sort_by(|a, b| if best_last { b.total_cmp(a) } else { a.total_cmp(b) });
        let sum: f64 = values.iter().sum();
        let (count, asked) = (values.len(), all.len());
        // Rank k of n lies at (k - 1/2)/n; the nearest one above is taken.
        let at = |share: f64| values[((share * count as f64).ceil() as usize).clamp(1, count) - 1];
        let spread = (count > 0).then(|| [at(0.5), at(0.95), values[count - 1]]);
        let share = || {
            let met = all.iter().filter(|f| floor.and_then(|l| l.is_met(f.value, load_n(f))).unwrap_or(false)).count();
            (asked > 0).then(|| met as f64 / asked as f64)
        };
        let (met, holds) = match floor {
            None => (None, None),
            Some(Floor::Within { share: wanted, .. }) => (share(), share().map(|share| share >= wanted)),
            Some(Floor::AtLeast(_)) => (share(), share().map(|share| share >= 1.0)),
            Some(Floor::Mean([low, high])) => {
                let mean = (count > 0).then(|| sum / count as f64);
                (mean, mean.map(|mean| (low..=high).contains(&mean)))
            }
            Some(Floor::Per200Moves(most)) => {
                let moves: f64 = self.findings(kind, Check::Moves).filter_map(|(_, f)| f.value).sum();
                let rate = (moves > 0.0).then(|| 200.0 * sum / moves);
                (rate, rate.map(|rate| rate <= most))
            }
        };
        Line { kind, check, floor, cases: [count, asked - count], spread, met, holds }
    }

    /// The rows of the table, kind by kind.
    pub fn lines(&self) -> Vec<Line> {
        let rows = || Check::ALL.into_iter().filter(|check| check.row().is_some());
        self.kinds().into_iter().flat_map(|kind| rows().map(move |check| self.line(kind, check))).collect()
    }

    /// Every case that does not meet its floor.
    pub fn failed(&self) -> Vec<Failed<'a>> {
        let mut failed = Vec::new();
        for scored in self.scored {
            for finding in &scored.findings {
                let Some(floor) = finding.check.floor(scored.subject.kind, self.as_built) else { continue };
                let missed = match floor {
                    Floor::Per200Moves(_) => finding.value.is_some_and(|faults| faults > 0.0),
                    Floor::Mean(_) => false,
                    _ => floor.is_met(finding.value, load_n(finding)) == Some(false),
                };
                if missed {
                    failed.push(Failed { subject: &scored.subject, finding });
                }
            }
        }
        failed
    }

    /// For people.
    pub fn table(&self) -> String {
        let mut text = String::new();
        let mut put = |line: String| {
            let _ = writeln!(text, "{}", line.trim_end());
        };
        for kind in self.kinds() {
            let rigs = self.scored.iter().filter(|s| s.subject.kind == kind).count();
            let how = if self.as_built { "default table" } else { "constants identified" };
            put(format!("{rigs} {kind} rigs, {how}, all EMULATED"));
            put(format!(
                "{:<32} {:<24} {:>6} {:>5} {:>10} {:>10} {:>10} {:>10}  holds",
                "", "floor", "cases", "none", "median", "95 %", "worst", "met"
            ));
            for line in self.lines().iter().filter(|line| line.kind == kind) {
                put(line.text());
            }
            put(String::new());
        }
        let failed = self.failed();
        put(format!("{} cases miss their floor (of a boot that is not homed only that is listed):", failed.len()));
        failed.iter().filter(|f| f.finding.note != NOT_HOMED).for_each(|f| put(format!("  {f}")));
        text
    }

    /// For machines: the rows of the table by kind, and what failed.
    pub fn json(&self) -> Value {
        let failed: Vec<Value> = self.failed().iter().map(Failed::json).collect();
        let kinds: serde_json::Map<String, Value> = self
            .kinds()
            .into_iter()
            .map(|kind| {
                let lines = self.lines();
                let rows: Vec<Value> = lines.iter().filter(|l| l.kind == kind).map(Line::json).collect();
                (kind.name().to_owned(), Value::Array(rows))
            })
            .collect();
        json!({ "as_built": self.as_built, "rigs": self.scored.len(), "rows": kinds, "failed": failed })
    }
}

/// Header of [`csv`].
const HEADER: [&str; 10] =
    ["rig", "seed", "effect", "factor", "table", "load_kg", "check", "value", "meets_floor", "note"];

/// One row for each rig, load and check; SI units.
///
/// # Errors
/// If it cannot be written.
pub fn csv(scored: &[Scored]) -> anyhow::Result<String> {
    let rows = scored.iter().flat_map(|s| {
        s.findings.iter().map(|f| {
            let floor = f.check.floor(s.subject.kind, s.as_built);
            let met = floor.and_then(|floor| floor.is_met(f.value, load_n(f)));
            vec![
                s.subject.kind.name().into(),
                s.subject.seed.to_string(),
                s.subject.effect.clone().unwrap_or_default(),
                optional(s.subject.factor),
                if s.as_built { "as-built" } else { "identified" }.into(),
                optional(f.load_kg),
                f.check.name().into(),
                optional(f.value),
                met.map_or(String::new(), |met| met.to_string()),
                f.note.clone(),
            ]
        })
    });
    csv_text(&HEADER, rows)
}

fn load_n(finding: &Finding) -> f64 {
    finding.load_kg.unwrap_or(1.0) * STANDARD_GRAVITY
}

impl Line {
    fn text(&self) -> String {
        let (by, unit) = self.check.unit();
        let digits = if by >= 1e6 || unit.is_empty() {
            0
        } else if unit == "rad" || unit == "mm" {
            3
        } else {
            1
        };
        let shown = |v: Option<f64>| v.map_or("-".into(), |v| format!("{:.digits$} {unit}", by * v));
        let [median, high, worst] = [0, 1, 2].map(|k| shown(self.spread.map(|s| s[k])));
        let met = match self.floor {
            Some(Floor::Per200Moves(_)) => self.met.map_or("-".into(), |rate| format!("{rate:.1} / 200")),
            _ => self.met.map_or("-".into(), |share| format!("{:.1} %", 100.0 * share)),
        };
        let holds = self.holds.map_or("-", |holds| if holds { "yes" } else { "NO" });
        format!(
            "{:<32} {:<24} {:>6} {:>5} {median:>10} {high:>10} {worst:>10} {met:>10}  {holds}",
            self.check.row().unwrap_or(self.check.name()),
            self.floor.map_or("-".into(), |floor| floor.text(self.check)),
            self.cases[0],
            self.cases[1],
        )
    }

    fn json(&self) -> Value {
        let at = |k: usize| self.spread.map(|s| s[k]);
        json!({
            "check": self.check.name(), "row": self.check.row(),
            "floor": self.floor.map(|floor| floor.text(self.check)),
            "cases": self.cases[0], "missing": self.cases[1],
            "median": at(0), "p95": at(1), "worst": at(2), "met": self.met, "holds": self.holds,
        })
    }
}

impl Failed<'_> {
    fn json(&self) -> Value {
        json!({
            "rig": self.subject.kind.name(), "seed": self.subject.seed, "effect": self.subject.effect,
            "factor": self.subject.factor, "load_kg": self.finding.load_kg, "check": self.finding.check.name(),
            "value": self.finding.value, "note": self.finding.note,
        })
    }
}

impl std::fmt::Display for Failed<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (by, unit) = self.finding.check.unit();
        let load = self.finding.load_kg.map_or(String::new(), |kg| format!(", {kg} kg"));
        let what = self.finding.check.row().unwrap_or(self.finding.check.name());
        let value = self.finding.value.map_or("none".into(), |v| format!("{:.3} {unit}", by * v));
        write!(f, "{}{load}: {what}: {value} {}", self.subject, self.finding.note)
    }
}
