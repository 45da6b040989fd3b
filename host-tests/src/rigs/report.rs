//! What the study found, as a table, JSON and CSV.

use super::Scored;
use super::floor::{Check, Finding, Floor};
use super::subject::Subject;
use super::trial::NOT_HOMED;
use rig_plant::RigPreset;
use rig_plant::units::STANDARD_GRAVITY;
use rigctl::csv_text::{csv_text, optional};
use serde_json::{Value, json};

/// A check over all rigs of a kind.
#[derive(Clone, Debug)]
pub struct Line {
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

/// The rigs of one kind, with the same effects, all commissioned or all as built.
pub struct Results<'a> {
    scored: Vec<&'a Scored>,
    kind: RigPreset,
    as_built: bool,
}

/// The results of each group of rigs that belong together, in the order in which they first come.
pub fn groups(scored: &[Scored]) -> Vec<Results<'_>> {
    let same = |a: &Scored, b: &Scored| {
        let of = |s: &Scored| (s.subject.kind, s.subject.effect.clone(), s.subject.factor, s.as_built);
        of(a) == of(b)
    };
    let mut groups: Vec<Vec<&Scored>> = Vec::new();
    for one in scored {
        match groups.iter_mut().find(|group| same(group[0], one)) {
            Some(group) => group.push(one),
            None => groups.push(vec![one]),
        }
    }
    let results = groups.into_iter();
    results.map(|scored| Results { kind: scored[0].subject.kind, as_built: scored[0].as_built, scored }).collect()
}

impl<'a> Results<'a> {
    fn findings(&self, check: Check) -> impl Iterator<Item = &'a Finding> {
        self.scored.iter().flat_map(move |s| s.findings.iter().filter(move |f| f.check == check))
    }

    /// One row.
    pub fn line(&self, check: Check) -> Line {
        let floor = check.floor(self.kind, self.as_built);
        let all: Vec<&Finding> = self.findings(check).collect();
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
                let moves: f64 = self.findings(Check::Moves).filter_map(|f| f.value).sum();
                let rate = (moves > 0.0).then(|| 200.0 * sum / moves);
                (rate, rate.map(|rate| rate <= most))
            }
        };
        Line { check, floor, cases: [count, asked - count], spread, met, holds }
    }

    /// The rows of the table.
    pub fn lines(&self) -> Vec<Line> {
        Check::ALL.into_iter().filter(|check| check.row().is_some()).map(|check| self.line(check)).collect()
    }

    /// Every case that does not meet its floor.
    pub fn failed(&self) -> Vec<Failed<'a>> {
        let mut failed = Vec::new();
        for scored in &self.scored {
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

    /// What the rigs are, in words.
    pub fn title(&self) -> String {
        let first = &self.scored[0].subject;
        let what = match (&first.effect, first.factor) {
            (Some(effect), Some(factor)) => format!("{effect}, {factor} times its nominal size, against the floors of"),
            (Some(effect), None) => format!("{effect} alone, as large as in"),
            _ => "all effects:".to_owned(),
        };
        let how = if self.as_built { "default table" } else { "constants identified" };
        format!("{what} {} rigs; {} rigs, {how}, all EMULATED", self.kind, self.scored.len())
    }

    /// For people: the rows, then every case that misses its floor. Of a boot that could not be homed only that is listed.
    pub fn table(&self) -> String {
        let mut lines = vec![
            self.title(),
            format!(
                "{:<32} {:<24} {:>6} {:>5} {:>10} {:>10} {:>10} {:>10}  holds",
                "", "floor", "cases", "none", "median", "95 %", "worst", "met"
            ),
        ];
        lines.extend(self.lines().iter().map(Line::text));
        let failed = self.failed();
        lines.push(format!("{} cases miss their floor{}", failed.len(), if failed.is_empty() { "" } else { ":" }));
        lines.extend(failed.iter().filter(|f| f.finding.note != NOT_HOMED).map(|f| format!("  {f}")));
        lines.iter().map(|line| format!("{}\n", line.trim_end())).collect()
    }

    /// For machines: the rows of the table, and what failed.
    pub fn json(&self) -> Value {
        let first = &self.scored[0].subject;
        let failed: Vec<Value> = self.failed().iter().map(Failed::json).collect();
        let rows: Vec<Value> = self.lines().iter().map(Line::json).collect();
        json!({
            "rig": self.kind.name(), "effect": first.effect, "factor": first.factor, "as_built": self.as_built,
            "rigs": self.scored.len(), "rows": rows, "failed": failed,
        })
    }
}

/// Header of [`summary`].
const SUMMARY: [&str; 14] = [
    "rig", "effect", "factor", "table", "check", "floor", "cases", "missing", "median", "p95", "worst", "met", "holds",
    "failure",
];

/// One row for each group of rigs and each check that has a floor; SI units.
///
/// # Errors
/// If it cannot be written.
pub fn summary(scored: &[Scored]) -> anyhow::Result<String> {
    let groups = groups(scored);
    let rows = groups.iter().flat_map(|group| {
        let (first, failed) = (&group.scored[0].subject, group.failed());
        group.lines().into_iter().map(move |line| {
            let at = |k: usize| optional(line.spread.map(|spread| spread[k]));
            vec![
                group.kind.name().into(),
                first.effect.clone().unwrap_or_default(),
                optional(first.factor),
                if group.as_built { "as-built" } else { "identified" }.into(),
                line.check.name().into(),
                line.floor.map_or(String::new(), |floor| floor.text(line.check)),
                line.cases[0].to_string(),
                line.cases[1].to_string(),
                at(0),
                at(1),
                at(2),
                optional(line.met),
                line.holds.map_or(String::new(), |holds| holds.to_string()),
                failed.iter().find(|f| f.finding.check == line.check).map_or(String::new(), Failed::case),
            ]
        })
    });
    csv_text(&SUMMARY, rows)
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
    /// Median, 95th percentile and worst as people read them, and how much meets the floor.
    fn shown(&self) -> [String; 4] {
        let (by, unit) = self.check.unit();
        let digits = if by >= 1e6 || unit.is_empty() {
            0
        } else if unit == "rad" || unit == "mm" {
            3
        } else {
            1
        };
        let shown =
            |v: Option<f64>| v.map_or("-".into(), |v| format!("{:.digits$} {unit}", by * v).trim_end().to_owned());
        // Of what is 1 or 0 only the mean says anything.
        let spread = self.spread.filter(|_| !matches!(self.floor, Some(Floor::Mean(_))));
        let [median, high, worst] = [0, 1, 2].map(|k| shown(spread.map(|s| s[k])));
        let met = match self.floor {
            Some(Floor::Per200Moves(_)) => self.met.map_or("-".into(), |rate| format!("{rate:.1} / 200")),
            _ => self.met.map_or("-".into(), |share| format!("{:.1} %", 100.0 * share)),
        };
        [median, high, worst, met]
    }

    fn text(&self) -> String {
        let [median, high, worst, met] = self.shown();
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
            "shown": self.shown(), "median": at(0), "p95": at(1), "worst": at(2), "met": self.met, "holds": self.holds,
        })
    }
}

impl Failed<'_> {
    /// Where and why, in a few words.
    fn case(&self) -> String {
        let load = self.finding.load_kg.map_or(String::new(), |kg| format!(", {kg} kg"));
        format!("rig {}{load}: {} {}", self.subject.seed, self.value(), self.finding.note).trim_end().to_owned()
    }

    fn value(&self) -> String {
        let (by, unit) = self.finding.check.unit();
        self.finding.value.map_or("none".into(), |v| format!("{:.3} {unit}", by * v)).trim_end().to_owned()
    }

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
        let load = self.finding.load_kg.map_or(String::new(), |kg| format!(", {kg} kg"));
        let what = self.finding.check.row().unwrap_or(self.finding.check.name());
        let text = format!("{}{load}: {what}: {} {}", self.subject, self.value(), self.finding.note);
        write!(f, "{}", text.trim_end())
    }
}
