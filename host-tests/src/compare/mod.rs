//! The comparison: what control by the transmission's own ratio gains over what is usual, on the same plants, moves and
//! drive frames.
//!
//! - [`play`]: a controller through a scenario on a plant.
//! - [`baseline`]: what the firmware's control is held against. [`tune`]: the best gains for it. [`program`]: others' programs.
//! - [`score`]: tracking, settling, overshoot, energy. [`report`]: table and figure. [`study()`]: all of it.
//!
//! What is fair: a fixed ratio gets the same feedback, set by search on the comparison's own plants, and (b") even a fixed
//! crossing of the friction band, its size searched for too. What takes the table and the load stays with the firmware: TR
//! by load and twist, the friction band in twist, and seeing when a load comes free. Where a rig has been calibrated and
//! identified, every controller has the calibration and the table.
//!
//! Every baseline follows the set-points that the firmware's planner made on the same plant, so that all are asked the
//! same. Moves that the firmware did not make there, because it had failed, count as not settled for it; the baselines
//! make them along the set-points that it made on the rig of its own model. Errors of tracking are those of the moves
//! that both made.

pub mod baseline;
pub mod play;
pub mod program;
pub mod report;
pub mod score;
pub mod tune;

use crate::ControlBench;
use crate::rigs::commission::{Firmware, commission};
use crate::rigs::subject::Subject;
use crate::scenario::{self, Scenario};
use crate::study::{Study, each, write};
use anyhow::{Result, anyhow};
use baseline::{Baseline, Law, Loop, OTHERS};
use play::{Played, Record};
use report::Results;
use rig_plant::{PlantKey, RigPreset};
use rigctl::parallel::cores;
use score::{SETTLED_M, Score};
use std::path::PathBuf;
use tune::{Goal, Tally};

/// Twist at power-up (rad) for the baselines, whose zero is given: the half-turn pre-twist as the decimal of an `f32`, with which
/// docs/results.md was measured.
#[expect(clippy::approx_constant, reason = "see above")]
const PRETWIST_RAD: f64 = 3.141_592_7;

/// How near the target counts as settled on a kind of rig (m). A calibrated LVDT is as wrong as the floors of rest against the
/// truth allow ([`crate::rigs::floor`]), so that no controller could do better by it.
pub fn settled_m(kind: RigPreset) -> f64 {
    match kind {
        RigPreset::Ideal => SETTLED_M,
        RigPreset::Nominal => 150e-6,
        RigPreset::Hard => 300e-6,
    }
}

/// What every controller is built and set up with on a plant: the default scene's table and no calibration. A nominal or a hard
/// rig is calibrated and identified first, as its user would do; where that fails, nothing is changed.
fn firmware(plant: &Subject) -> Firmware {
    match plant.kind {
        RigPreset::Ideal => Firmware::as_built(),
        _ => commission(plant).0,
    }
}

/// One scenario on one plant: the firmware's moves, and a baseline that stands ready on the same plant.
pub struct Case {
    /// Which scenario of the list.
    pub scenario: usize,
    /// Seed of the plant.
    pub seed: u64,
    /// What the firmware did, move by move; from the one on in which it failed, what it did on the rig of its own model.
    pub along: Vec<Record>,
    /// How many of the moves it made here.
    pub made: usize,
    /// The baseline at its reference, or why it did not come there.
    pub ready: Result<ControlBench<Baseline>, String>,
}

impl Case {
    /// A baseline's moves, or as many as it made.
    fn play(&self, law: Law, scenario: &Scenario, along: &[Record]) -> Played {
        match self.ready.clone() {
            Ok(bench) => play::baseline(bench, law, scenario, along),
            Err(why) => (Vec::new(), Some(why)),
        }
    }

    /// The figures of the first `count` moves, settled within a distance (m).
    fn scores(&self, records: &[Record], count: usize, settled_m: f64) -> Vec<Score> {
        let score = |k: usize| match records.get(k) {
            None => Score::default(),
            Some(record) if k < self.made => Score::within(record, settled_m),
            // The firmware has no error here to compare with.
            Some(record) => Score { max_m: 0.0, squares_m2: 0.0, ticks: 0, ..Score::within(record, settled_m) },
        };
        (0..count).map(score).collect()
    }
}

/// One move's figures and whose they are.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Which scenario of the list.
    pub scenario: usize,
    /// The plant changed during the move.
    pub changed: bool,
    /// The figures.
    pub score: Score,
}

/// Every scenario on every plant, played by the firmware.
pub struct Comparison<'s> {
    scenarios: &'s [Scenario],
    settled_m: f64,
    /// All of them.
    pub cases: Vec<Case>,
    /// What the firmware did not get through: scenario, plant, and what happened.
    pub failures: Vec<String>,
}

impl<'s> Comparison<'s> {
    /// Commissions the plants, plays the firmware, and brings a baseline to its reference, everywhere.
    ///
    /// # Errors
    /// In words, if the firmware fails on a plant and on the rig of its own model as well.
    pub fn new(scenarios: &'s [Scenario], plants: &[Subject]) -> Result<Self, String> {
        let settled_m = settled_m(plants.first().map_or(RigPreset::Ideal, |plant| plant.kind));
        let firmware = each(cores(), plants, firmware);
        let all: Vec<(usize, usize)> =
            (0..scenarios.len()).flat_map(|s| (0..plants.len()).map(move |p| (s, p))).collect();
        let played = each(cores(), &all, |(scenario, k)| {
            let (scenario, plant, firmware) = (&scenarios[*scenario], &plants[*k], &firmware[*k]);
            let ready = baseline::at_reference(plant, firmware, [scenario.load_n, PRETWIST_RAD]);
            (play::firmware(scenario, plant, firmware), ready)
        });
        let mut comparison = Self { scenarios, settled_m, cases: Vec::new(), failures: Vec::new() };
        for ((scenario, k), ((mut along, failure), ready)) in all.into_iter().zip(played) {
            let seed = plants[k].seed;
            let made = along.len();
            if let Some(reason) = failure {
                along.extend(of_its_own_model(&scenarios[scenario])?.into_iter().skip(made));
                comparison.failures.push(format!("{}, plant {seed}: {reason}", scenarios[scenario].name));
            }
            comparison.cases.push(Case { scenario, seed, along, made, ready });
        }
        Ok(comparison)
    }

    /// The figures of every move under a baseline's law, or under the firmware's control.
    pub fn play(&self, law: Option<Law>) -> Vec<Entry> {
        self.played(law).0
    }

    /// The same, and what ended a baseline's moves: scenario, plant, and what happened.
    pub fn played(&self, law: Option<Law>) -> (Vec<Entry>, Vec<String>) {
        let played = each(cores(), &self.cases, |case| {
            let count = case.along.len();
            let scenario = &self.scenarios[case.scenario];
            let theirs;
            let (records, failure) = match law {
                None => (&case.along[..case.made], None),
                Some(law) => {
                    theirs = case.play(law, scenario, &case.along);
                    (&theirs.0[..], theirs.1.as_ref())
                }
            };
            let failure = failure.map(|why| format!("{}, plant {}: {why}", scenario.name, case.seed));
            let scores = case.scores(records, count, self.settled_m);
            let entry =
                |(score, along): (Score, &Record)| Entry { scenario: case.scenario, changed: along.changed, score };
            (scores.into_iter().zip(&case.along).map(entry).collect::<Vec<_>>(), failure)
        });
        let (entries, failures): (Vec<_>, Vec<_>) = played.into_iter().unzip();
        (entries.concat(), failures.into_iter().flatten().collect())
    }

    /// The loop that comes nearest to a goal on the plants with these seeds, searched for from `start`.
    pub fn tune(&self, start: Loop, goal: Goal, seeds: &[u64]) -> Loop {
        // Heavy loads are the hardest: whoever fails is dropped there.
        let cases: Vec<&Case> = self.cases.iter().rev().filter(|case| seeds.contains(&case.seed)).collect();
        let steady = |case: &&Case| {
            let scores = case.scores(&case.along, case.along.len(), self.settled_m);
            scores.iter().zip(&case.along).filter(|(_, r)| !r.changed).map(|(score, _)| score.ticks).sum::<usize>()
        };
        let ticks = cases.iter().map(steady).sum();
        let play = |case: &&Case, candidate: Loop| {
            let counts = |r: &&Record| goal == Goal::Settling || !r.changed;
            let along = &case.along[..case.along.iter().take_while(counts).count()];
            let (records, _) = case.play(Law::Loop(candidate), &self.scenarios[case.scenario], along);
            case.scores(&records, along.len(), self.settled_m)
        };
        let add = |tally: &mut Tally, case: &&Case, scores: Vec<Score>| {
            scores.iter().zip(&case.along).for_each(|(score, r)| tally.add(r.changed, score));
        };
        tune::search_in((cores(), start), cases.chunks(8), play, add, |tally| goal.cost(tally, ticks))
    }
}

/// The firmware's moves of a scenario on the rig of its own model.
fn of_its_own_model(scenario: &Scenario) -> Result<Vec<Record>, String> {
    let plant = Subject::new(RigPreset::Ideal, 1001);
    let (records, failure) = play::firmware(scenario, &plant, &Firmware::as_built());
    failure.map_or(Ok(records), |why| Err(format!("{} on the rig of its own model: {why}", scenario.name)))
}

/// Where the search for a fixed ratio begins: the table's mean ratio over its range, the firmware's gain and corner as
/// they were when this was written.
pub fn untuned() -> Loop {
    const STEPS: u16 = 24;
    let table = crate::table();
    let m = &table.metadata;
    let along = |low: f32, high: f32, k: u16| low + (high - low) * (f32::from(k) + 0.5) / f32::from(STEPS);
    let ratios = (0..STEPS).flat_map(|i| {
        (0..STEPS).map(move |k| {
            let load_n = along(m.load_min_n, m.load_max_n, i);
            table.point_inside(load_n, along(m.twist_min_rad, m.twist_max_rad, k)).tr_rad_per_m()
        })
    });
    let mean = ratios.sum::<f32>() / f32::from(STEPS * STEPS);
    Loop { tr_rad_per_m: Some(mean), gain_per_s: 3.0, corner_rad_per_s: 9.0, breakaway_rad: 0.0 }
}

/// Of `cargo xtask compare`.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// How many plants, each under every load of the scenarios
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u16).range(1..))]
    plants: u16,
    /// Rigs of a kind (ideal, nominal or hard) instead of random plants, from seed 1001 on, each calibrated and identified first
    #[arg(long)]
    rig: Option<RigPreset>,
    /// Folder for comparison.svg, or with --rig comparison-RIG.svg
    #[arg(long, value_name = "DIR", default_value = "docs")]
    out: PathBuf,
    /// Program and arguments of another controller to compare with, asked by lines: docs/reference/results.md
    #[arg(long, value_name = "CMD ARGS", requires = "out")]
    controller: Option<String>,
}

/// The first N of the list that every run uses, and what they are called. Nothing was tuned on rigs of these seeds
/// ([`crate::rigs`]).
pub fn plants(rig: Option<RigPreset>, count: u16) -> (Vec<Subject>, String) {
    let seeds = 1..=u64::from(count);
    match rig {
        None => (seeds.map(Subject::random).collect(), "random plants".into()),
        Some(rig) => (seeds.map(|k| Subject::new(rig, 1000 + k)).collect(), format!("{rig} rigs")),
    }
}

/// What plants differ in that a loop feels, and how that is called. On rigs of a kind every further key would add two, and the
/// searches would take as much longer.
fn felt(rig: Option<RigPreset>) -> (&'static [PlantKey], &'static str) {
    use PlantKey::{Damping, Friction, GearBacklash, K2Scale, LvdtNoise, ModulusScale};
    match rig {
        None => (
            &[Friction, Damping, K2Scale, ModulusScale, GearBacklash, LvdtNoise],
            "friction, damping, k2, modulus, backlash or noise",
        ),
        Some(_) => (&[Friction], "friction"),
    }
}

/// Seeds of the plants that have the minimum or the maximum of one of these keys: whoever manages these should manage the others.
fn extremes(plants: &[Subject], keys: &[PlantKey]) -> Vec<u64> {
    let ends = keys.iter().flat_map(|key| {
        let by_value = |a: &&Subject, b: &&Subject| a.value(*key).total_cmp(&b.value(*key));
        [plants.iter().min_by(by_value), plants.iter().max_by(by_value)]
    });
    let mut seeds: Vec<u64> = ends.flatten().map(|plant| plant.seed).collect();
    seeds.sort_unstable();
    seeds.dedup();
    seeds
}

/// Plays everybody, the baselines tuned; writes the figure.
///
/// # Errors
/// If the firmware fails on the rig of its own model, or a file cannot be written.
pub fn study(arguments: &Arguments) -> Result<Study> {
    let scenarios = scenario::comparison()?;
    let (plants, kind) = plants(arguments.rig, arguments.plants);
    eprintln!("{} scenarios on {} {kind} by the firmware's control …", scenarios.len(), plants.len());
    let comparison = Comparison::new(&scenarios, &plants).map_err(|e| anyhow!(e))?;
    let mut notes = Vec::new();
    comparison.failures.iter().for_each(|failure| eprintln!("a failed: {failure}"));
    let (keys, felt) = felt(arguments.rig);
    let mut reached = vec![("a  this controller", comparison.play(None))];
    for (name, law) in baselines(
        &comparison,
        &format!("{kind} with the least or the most {felt}"),
        &extremes(&plants, keys),
        &mut notes,
    ) {
        eprintln!("{name} …");
        reached.push((name, comparison.play(Some(law))));
    }
    if let Some(command) = &arguments.controller {
        // Laws are copied, and names are constants: this one lasts as long as the study.
        let command: &'static str = command.clone().leak();
        let (entries, failures) = comparison.played(Some(Law::Program(command)));
        let failed = if failures.is_empty() { "" } else { " (failed)" };
        notes.extend(failures.first().map(|first| format!("f failed {} times; {first}.", failures.len())));
        reached.push((format!("f  {command}{failed}").leak(), entries));
    }
    let results = Results::new(&scenarios, (arguments.rig, (plants.len(), kind)), &reached, notes);
    let name = arguments.rig.map_or("comparison".into(), |rig| format!("comparison-{rig}"));
    write(&arguments.out, &format!("{name}.svg"), &results.figure().svg()?)?;
    results.study()
}

/// All but the firmware's; `notes` get how the tuned ones came to their settings.
fn baselines(
    comparison: &Comparison<'_>,
    chosen: &str,
    tuned_on: &[u64],
    notes: &mut Vec<String>,
) -> Vec<(&'static str, Law)> {
    // Begins near what earlier searches found, which only saves time: its first steps are wide.
    let fixed = Loop { gain_per_s: 6.0, corner_rad_per_s: 24.0, ..untuned() };
    let by_table = Loop { tr_rad_per_m: None, ..fixed };
    let crossing = Loop { breakaway_rad: 1.0, ..fixed };
    let mut all = Vec::new();
    for (name, start, goal, wanted) in [
        ("b  fixed ratio, most settled", fixed, Goal::Settling, "the most settled moves, then the least rms error"),
        ("b' fixed ratio, least error", fixed, Goal::SmallestError, "the least rms error without load steps"),
        ("b\" fixed ratio and crossing", crossing, Goal::SmallestError, "the same, with a fixed crossing of friction"),
        (
            "e  b' by the table's ratio",
            by_table,
            Goal::SmallestError,
            "the same (the table's ratio under the known load)",
        ),
    ] {
        eprintln!("{name}: tuning on {} plants …", tuned_on.len());
        let tuned = comparison.tune(start, goal, tuned_on);
        let ratio = tuned.tr_rad_per_m.map_or("by the table".into(), |tr| format!("{:.2} rad/mm", tr * 1e-3));
        let crossing = match tuned.breakaway_rad {
            0.0 => String::new(),
            rad => format!(", crossing {rad:.2} rad"),
        };
        notes.push(format!(
            "{}: TR {ratio}, gain {:.2} 1/s, corner {:.1} rad/s{crossing}, searched for {wanted} on the {} {chosen}.",
            name[..2].trim(),
            tuned.gain_per_s,
            tuned.corner_rad_per_s,
            tuned_on.len()
        ));
        all.push((name, Law::Loop(tuned)));
    }
    all.extend(OTHERS);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A move of 1 mm that is followed exactly but for so much (m), and ends at its target.
    fn record(behind_m: f64) -> Record {
        let set_points_m: Vec<f32> = (1..=400).map(|k| (k as f32 * 1e-5).min(1e-3)).collect();
        let positions_m = set_points_m.iter().map(|s| f64::from(*s) - if *s < 1e-3 { behind_m } else { 0.0 });
        Record { ends_m: [0.0, 1e-3], positions_m: positions_m.collect(), set_points_m, ..Record::default() }
    }

    #[test]
    fn a_move_that_the_firmware_did_not_make_has_no_error_for_the_others_but_has_to_settle() {
        let case = Case { scenario: 0, seed: 1, along: vec![record(0.0); 2], made: 1, ready: Err("stuck".into()) };
        let ours = case.scores(&case.along[..case.made], 2, SETTLED_M);
        assert_eq!(
            ours.iter().map(|s| (s.made, s.settling_s.is_some())).collect::<Vec<_>>(),
            [(true, true), (false, false)]
        );
        let theirs = case.scores(&[record(1e-4), record(1e-4)], 2, SETTLED_M);
        assert!(theirs.iter().all(|s| s.made && s.settling_s.is_some()));
        assert!(theirs[0].squares_m2 > 0.0 && theirs[0].ticks > 0);
        assert_eq!((theirs[1].squares_m2, theirs[1].ticks, theirs[1].max_m), (0.0, 0, 0.0));
    }

    #[test]
    fn a_baseline_that_does_not_come_to_its_reference_makes_no_move() {
        let case = Case { scenario: 0, seed: 1, along: vec![record(0.0)], made: 1, ready: Err("stuck".into()) };
        let scenario = Scenario { name: String::new(), load_n: 5.0, moves: Vec::new() };
        let (records, _) = case.play(Law::OpenLoop, &scenario, &case.along);
        let scores = case.scores(&records, 1, SETTLED_M);
        assert!(records.is_empty() && !scores[0].made && scores[0].settling_s.is_none());
    }

    #[test]
    fn the_searches_use_the_plants_with_the_least_and_the_most_of_what_a_loop_feels() {
        let (random, _) = plants(None, 50);
        let chosen = extremes(&random, felt(None).0);
        assert!((6..=12).contains(&chosen.len()), "{chosen:?}");
        let max = random.iter().max_by(|a, b| a.value(PlantKey::Friction).total_cmp(&b.value(PlantKey::Friction)));
        assert!(chosen.contains(&max.unwrap().seed));
        let (hard, kind) = plants(Some(RigPreset::Hard), 4);
        assert_eq!((hard[0].seed, &hard[0].changes, &*kind), (1001, &RigPreset::Hard.changes(1001), "hard rigs"));
        assert_eq!(extremes(&hard, felt(Some(RigPreset::Hard)).0).len(), 2, "the least and the most friction");
    }
}
