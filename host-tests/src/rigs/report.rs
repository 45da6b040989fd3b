//! What the study found: rows of CSV and JSON, and the tables.

use super::Scored;
use super::floor::{Check, Finding, Floor};
use super::trial::NOT_HOMED;
use crate::study::{Sorted, Study};
use anyhow::{Context, Result};
use rig_plant::RigPreset;
use rig_plant::units::STANDARD_GRAVITY;
use serde::Serialize;

/// A check over all rigs of a group. SI units.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    rig: RigName,
    effect: Option<String>,
    factor: Option<f64>,
    table: &'static str,
    /// What.
    pub check: Check,
    #[serde(skip)]
    asked: Option<Floor>,
    /// What is asked; none where nothing is.
    floor: Option<String>,
    /// How often it was measured.
    pub cases: usize,
    /// How often it should have been but could not.
    pub missing: usize,
    /// Of the magnitudes; of [`Floor::AtLeast`] towards the other end.
    median: Option<f64>,
    p95: Option<f64>,
    worst: Option<f64>,
    /// Share of the cases that meet the floor; the mean, or the number for every 200 moves, where the floor is one of that.
    met: Option<f64>,
    /// Whether the floor holds.
    pub holds: Option<bool>,
    /// The first case that misses it.
    failure: Option<String>,
}

/// One value on one rig. SI units.
#[derive(Clone, Debug, Serialize)]
pub struct Case {
    rig: RigName,
    seed: u64,
    effect: Option<String>,
    factor: Option<f64>,
    table: &'static str,
    load_kg: Option<f64>,
    check: Check,
    value: Option<f64>,
    meets_floor: Option<bool>,
    /// When, or why there is no value.
    pub note: String,
    #[serde(skip)]
    what: String,
}

type RigName = &'static str;

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

    fn table(&self) -> &'static str {
        if self.as_built { "as-built" } else { "identified" }
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
        let at = |share: f64| values.quantile(share).map(|value| sign * value);
        let met_by = |f: &Finding| asked.and_then(|floor| floor.is_met(f.value, load_n(f))).unwrap_or(false);
        let share = || (!all.is_empty()).then(|| all.iter().filter(|f| met_by(f)).count() as f64 / all.len() as f64);
        let (met, holds) = match asked {
            None => (None, None),
            Some(Floor::Within { share: wanted, .. }) => (share(), share().map(|share| share >= wanted)),
            Some(Floor::AtLeast(_)) => (share(), share().map(|share| share >= 1.0)),
            Some(Floor::Mean([low, high])) => {
                let mean = (cases > 0).then(|| values.sum() / cases as f64);
                (mean, mean.map(|mean| (low..=high).contains(&mean)))
            }
            Some(Floor::Per200Moves(most)) => {
                let moves: f64 = findings(Check::Moves).filter_map(|f| f.value).sum();
                let rate = (moves > 0.0).then(|| 200.0 * values.sum() / moves);
                (rate, rate.map(|rate| rate <= most))
            }
        };
        let first = &self.scored[0].subject;
        let failed = self.failed().into_iter().find(|case| case.check == check);
        Line {
            rig: self.kind.name(),
            effect: first.effect.clone(),
            factor: first.factor,
            table: self.table(),
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
            failure: failed.map(|case| format!("rig {}{}: {}", case.seed, case.under(), case.shown())),
        }
    }

    /// The rows of the table.
    pub fn lines(&self) -> Vec<Line> {
        Check::all().filter(|check| check.row().is_some()).map(|check| self.line(check)).collect()
    }

    /// Everything that was measured.
    fn cases(&self) -> Vec<Case> {
        let of = |scored: &Scored, f: &Finding| Case {
            rig: self.kind.name(),
            seed: scored.subject.seed,
            effect: scored.subject.effect.clone(),
            factor: scored.subject.factor,
            table: self.table(),
            load_kg: f.load_kg,
            check: f.check,
            value: f.value,
            meets_floor: f.check.floor(self.kind, self.as_built).and_then(|floor| floor.is_met(f.value, load_n(f))),
            note: f.note.clone(),
            what: scored.subject.to_string(),
        };
        self.scored.iter().flat_map(|scored| scored.findings.iter().map(move |f| of(scored, f))).collect()
    }

    /// Every case that does not meet its floor.
    pub fn failed(&self) -> Vec<Case> {
        let missed = |case: &Case| match case.check.floor(self.kind, self.as_built) {
            Some(Floor::Per200Moves(_)) => case.value.is_some_and(|faults| faults > 0.0),
            _ => case.meets_floor == Some(false),
        };
        self.cases().into_iter().filter(missed).collect()
    }

    /// The rows, then every case that misses its floor. Of a boot that could not be homed only that is listed.
    pub fn study(&self) -> Study {
        let mut study = Study::new(["", "rigs", "floor", "cases", "median; 95 %; worst", "met"]);
        for line in self.lines() {
            let what = match (&line.effect, line.factor) {
                (Some(effect), Some(factor)) => format!("{effect} × {factor}, by the floors of {}", self.kind),
                (Some(effect), None) => format!("{}, {effect} alone", self.kind),
                _ => self.kind.to_string(),
            };
            let cases = line.cases.to_string();
            study.row([line.name(), what, line.floor(), cases, line.spread(), line.met()]);
        }
        let failed = self.failed();
        study.notes = vec![format!(
            "{} {} rigs, {}: {} cases miss their floor.",
            self.rigs(),
            self.kind,
            self.table(),
            failed.len()
        )];
        study.notes.extend(failed.iter().filter(|case| case.note != NOT_HOMED).map(ToString::to_string));
        study
    }
}

/// The three files of some groups: rows of a table as CSV, every case as CSV, and as JSON the rows with what failed.
///
/// # Errors
/// If one cannot be written.
pub fn files(groups: &[Results<'_>]) -> Result<[(&'static str, String); 3]> {
    let lines = groups.iter().flat_map(Results::lines);
    let json = groups.iter().map(|group| serde_json::json!({"rows": group.lines(), "failed": group.failed()}));
    Ok([
        ("-summary.csv", csv(lines)?),
        (".csv", csv(groups.iter().flat_map(Results::cases))?),
        (".json", serde_json::to_string_pretty(&json.collect::<Vec<_>>())?),
    ])
}

fn csv(rows: impl Iterator<Item = impl Serialize>) -> Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    rows.into_iter().try_for_each(|row| writer.serialize(row))?;
    String::from_utf8(writer.into_inner().map_err(|e| e.into_error())?).context("the CSV is no text")
}

fn load_n(finding: &Finding) -> f64 {
    finding.load_kg.unwrap_or(1.0) * STANDARD_GRAVITY
}

impl Line {
    /// Median, 95th percentile and worst as people read them, and how many cases have no value. Of what is 1 or 0 only the mean says
    /// anything.
    fn spread(&self) -> String {
        let (by, unit) = self.check.unit();
        let digits = match unit {
            "" | "um" => 0,
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

    fn name(&self) -> String {
        self.check.row().unwrap_or(self.check.name()).to_owned()
    }

    fn floor(&self) -> String {
        self.floor.clone().unwrap_or("-".into())
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

impl Case {
    fn under(&self) -> String {
        self.load_kg.map_or(String::new(), |kg| format!(", {kg} kg"))
    }

    fn shown(&self) -> String {
        let (by, unit) = self.check.unit();
        let value = self.value.map_or("none".into(), |v| format!("{:.3} {unit}", by * v));
        format!("{} {}", value.trim_end(), self.note).trim_end().to_owned()
    }
}

/// Where and what, in a few words.
impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let check = self.check.row().unwrap_or(self.check.name());
        write!(f, "{}{}: {check}: {}", self.what, self.under(), self.shown())
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
            study.row([line.name(), rigs, line.floor(), line.spread(), line.met(), built.spread(), built.met()]);
            for (how, line) in [("identified", &line), ("as_built", &built)] {
                let name = format!("{kind}_{how}_{}", line.check.name());
                study.value(format!("{name}_met"), line.met);
                study.value(format!("{name}_median"), line.median);
                study.value(format!("{name}_p95"), line.p95);
                study.value(format!("{name}_worst"), line.worst);
            }
        }
        for (how, group) in [("identified", ours), ("as built", theirs), ("compared with a fixed ratio", compared)] {
            let (rigs, failed) = (group.rigs(), group.failed().len());
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
        let [(_, summary), (_, cases), _] = files(&groups).unwrap();
        assert!(
            summary
                .starts_with("rig,effect,factor,table,check,floor,cases,missing,median,p95,worst,met,holds,failure\n")
        );
        assert!(cases.contains("nominal,1,,,identified,0.5,zero_error_rad,-0.02,true,\n"), "{cases}");
    }
}
