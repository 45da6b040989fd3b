//! What the study found: rows of CSV and JSON, and the tables.

use super::Scored;
use super::floor::{Check, Finding, Floor};
use crate::study::{Sorted, Study};
use anyhow::{Context, Result};
use rig_plant::RigPreset;
use rig_plant::units::STANDARD_GRAVITY;
use rigctl::csv_text;
use serde::Serialize;

/// A check over all rigs of a group. SI units.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    rig: &'static str,
    effect: Option<String>,
    factor: Option<f64>,
    table: &'static str,
    /// What.
    pub check: Check,
    #[serde(skip)]
    asked: Option<Floor>,
    /// What is asked.
    floor: Option<String>,
    /// How often it was measured.
    pub cases: usize,
    /// How often it should have been but could not.
    pub missing: usize,
    /// Of the magnitudes; of [`Floor::AtLeast`] towards the other end.
    median: Option<f64>,
    p95: Option<f64>,
    worst: Option<f64>,
    /// Fraction of the cases that meet the floor; the mean, or the number for every 200 moves, where the floor is one of that.
    met: Option<f64>,
    /// Whether the floor holds.
    pub holds: Option<bool>,
}

/// The rigs of one kind, with the same effects, all commissioned or all as built.
pub struct Results<'a> {
    scored: Vec<&'a Scored>,
    /// Whose floors they are held against.
    pub kind: RigPreset,
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

impl Results<'_> {
    /// How many rigs.
    pub fn rigs(&self) -> usize {
        self.scored.len()
    }

    /// One row.
    pub fn line(&self, check: Check) -> Line {
        let asked = check.floor(self.kind, self.as_built);
        let findings = |check: Check| self.scored.iter().flat_map(|s| &s.findings).filter(move |f| f.check == check);
        let all: Vec<&Finding> = findings(check).collect();
        // The worst comes last.
        let sign = if matches!(asked, Some(Floor::AtLeast(_))) { -1.0 } else { 1.0 };
        let values = Sorted::new(all.iter().filter_map(|f| f.value).map(|value| sign * value.abs()));
        let cases = values.count();
        let at = |fraction: f64| values.quantile(fraction).map(|value| sign * value);
        let met_by = |f: &Finding| asked.and_then(|floor| floor.is_met(f.value, load_n(f))).unwrap_or(false);
        let fraction = || (!all.is_empty()).then(|| all.iter().filter(|f| met_by(f)).count() as f64 / all.len() as f64);
        let (met, holds) = match asked {
            None => (None, None),
            Some(Floor::Within { fraction: wanted, .. }) => (fraction(), fraction().map(|fraction| fraction >= wanted)),
            Some(Floor::AtLeast(_)) => (fraction(), fraction().map(|fraction| fraction >= 1.0)),
            Some(Floor::Mean([low, high])) => {
                let mean = (cases > 0).then(|| values.sum() / cases as f64);
                (mean, mean.map(|mean| (low..=high).contains(&mean)))
            }
            Some(Floor::Per200Moves(max)) => {
                let moves: f64 = findings(Check::Moves).filter_map(|f| f.value).sum();
                let rate = (moves > 0.0).then(|| 200.0 * values.sum() / moves);
                (rate, rate.map(|rate| rate <= max))
            }
        };
        let first = &self.scored[0].subject;
        Line {
            rig: self.kind.name(),
            effect: first.effect.clone(),
            factor: first.factor,
            table: if self.as_built { "as-built" } else { "identified" },
            check,
            asked,
            floor: asked.map(|floor| floor.text(check)),
            cases,
            missing: all.len() - cases,
            median: at(0.5),
            p95: at(0.95),
            worst: at(1.0),
            met,
            holds,
        }
    }

    /// The rows of the table.
    pub fn lines(&self) -> Vec<Line> {
        Check::all().filter(|check| !check.row().is_empty()).map(|check| self.line(check)).collect()
    }

    /// Every finding that does not meet its floor, and on which rig.
    pub fn failed(&self) -> impl Iterator<Item = (&Scored, &Finding)> {
        let floor = |f: &Finding| f.check.floor(self.kind, self.as_built);
        let findings = self.scored.iter().flat_map(|scored| scored.findings.iter().map(move |f| (*scored, f)));
        findings.filter(move |(_, f)| floor(f).is_some_and(|floor| floor.is_met(f.value, load_n(f)) == Some(false)))
    }

    /// The same in words: where, what, and when or why.
    pub fn failures(&self) -> Vec<String> {
        let words = |(scored, f): (&Scored, &Finding)| {
            format!("{}{}: {}: {}", scored.subject, under(f), f.check.row(), shown(f))
        };
        self.failed().map(words).collect()
    }
}

/// The two files of some groups: rows of a table as CSV, and as JSON the rows with what failed.
///
/// # Errors
/// If one cannot be written.
pub fn files(groups: &[Results<'_>]) -> Result<[(&'static str, String); 2]> {
    let json = groups.iter().map(|group| serde_json::json!({"rows": group.lines(), "failed": group.failures()}));
    let json = serde_json::to_string_pretty(&json.collect::<Vec<_>>())?;
    Ok([("-summary.csv", csv_text::named(groups.iter().flat_map(Results::lines))?), (".json", json)])
}

fn load_n(finding: &Finding) -> f64 {
    finding.load_kg.unwrap_or(1.0) * STANDARD_GRAVITY
}

fn under(finding: &Finding) -> String {
    finding.load_kg.map_or(String::new(), |kg| format!(", {kg} kg"))
}

/// A value, and when, or why there is none.
fn shown(finding: &Finding) -> String {
    let (by, unit) = finding.check.unit();
    let value = finding.value.map_or("none".into(), |v| format!("{:.3} {unit}", by * v));
    format!("{} {}", value.trim_end(), finding.note).trim_end().to_owned()
}

impl Line {
    /// Median, 95th percentile and worst as people read them, and how many cases have no value. Of what is 1 or 0 only the mean says
    /// anything.
    fn spread(&self) -> String {
        let (by, unit) = self.check.unit();
        let digits = match unit {
            "" | "µm" => 0,
            "rad" | "mm" => 3,
            _ => 1,
        };
        let only_mean = matches!(self.asked, Some(Floor::Mean(_)));
        let [median, p95, worst] = [self.median, self.p95, self.worst].map(|value| {
            let value = value.filter(|_| !only_mean);
            value.map_or("-".into(), |v| format!("{:.digits$} {unit}", by * v).trim_end().to_owned())
        });
        let all = self.cases + self.missing;
        match self.missing {
            _ if all == 0 => "-".into(),
            0 => format!("{median}; {p95}; {worst}"),
            missing => format!("{median}; {p95}; {worst} ({missing} of {all} without a value)"),
        }
    }

    /// How much meets the floor.
    fn met(&self) -> String {
        let met = self.met.map_or("-".into(), |met| match self.asked {
            Some(Floor::Per200Moves(_)) => format!("{met:.1} / 200"),
            _ => format!("{:.1} %", 100.0 * met),
        });
        met + if self.holds == Some(false) { ", missed" } else { "" }
    }
}

/// Floors and measured values of both kinds of rigs: identified, as built, and compared with a fixed ratio.
///
/// # Errors
/// If a kind of rig is missing.
pub fn page([identified, as_built, ratio]: [&[Results<'_>]; 3]) -> Result<Study> {
    let mut study = Study::new(["", "rigs", "floor", "identified: median; 95 %; worst", "met", "as built", "met"]);
    for kind in [RigPreset::Nominal, RigPreset::Hard] {
        let group = |groups: &'_ [Results<'_>]| {
            groups.iter().position(|group| group.kind == kind).context("a kind of rig is missing")
        };
        let (ours, theirs, compared) =
            (&identified[group(identified)?], &as_built[group(as_built)?], &ratio[group(ratio)?]);
        for line in ours.lines() {
            // It takes several times as long as all others, so that fewer rigs have it.
            let line = if line.check == Check::FixedRatio { compared.line(line.check) } else { line };
            let built = theirs.line(line.check);
            let rigs = kind.to_string();
            study.row([
                line.check.row().to_owned(),
                rigs,
                line.floor.clone().unwrap_or("-".into()),
                line.spread(),
                line.met(),
                built.spread(),
                built.met(),
            ]);
            for (how, line) in [("identified", &line), ("as_built", &built)] {
                let name = format!("{kind}_{how}_{}", line.check.name());
                study.value(format!("{name}_met"), line.met);
                study.value(format!("{name}_median"), line.median);
                study.value(format!("{name}_p95"), line.p95);
                study.value(format!("{name}_worst"), line.worst);
            }
        }
        for (how, group) in [("identified", ours), ("as built", theirs), ("compared with a fixed ratio", compared)] {
            let (rigs, failed) = (group.rigs(), group.failed().count());
            study.notes.push(format!("{kind} rigs, {how}: {rigs} rigs, {failed} cases miss their floor."));
        }
    }
    study.notes.push(
        "A case without a value (homing or a move refused, or a fault) misses its floor; its number stands in brackets. `out/rigs.json` \
         and `out/rigs-as-built.json` list every case that misses its floor, by seed, load and check."
            .into(),
    );
    Ok(study)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rigs::subject::Subject;

    #[test]
    fn a_missed_floor_and_missing_cases_are_said() {
        let finding = |value| Finding { load_kg: Some(0.5), check: Check::Zero, value, note: String::new() };
        let scored = |kind| Scored {
            subject: Subject::new(kind, 1),
            as_built: false,
            findings: [Some(0.01), Some(-0.02), Some(0.03), None].map(finding).to_vec(),
        };
        let scored = [RigPreset::Nominal, RigPreset::Hard].map(scored);
        let groups = groups(&scored);
        let study = page([&groups, &groups, &groups]).unwrap();
        assert_eq!(
            study.table[1][3..5],
            ["0.020 rad; 0.030 rad; 0.030 rad (1 of 4 without a value)", "75.0 %, missed"]
        );
        assert_eq!(study.values["hard_as_built_zero_error_rad_worst"], 0.03);
        assert!(study.notes[0].contains("1 cases miss"), "{}", study.notes[0]);
        assert!(page([&groups[..1], &groups, &groups]).is_err(), "hard rigs are missing");
        let [(_, summary), (_, json)] = files(&groups).unwrap();
        assert!(summary.starts_with("rig,effect,factor,table,check,floor,cases,missing,median,p95,worst,met,holds\n"));
        assert!(json.contains("hard rig 1, 0.5 kg: homing succeeds, zero: none"), "{json}");
    }
}
