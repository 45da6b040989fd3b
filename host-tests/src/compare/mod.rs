//! The comparison: what control by the transmission's own ratio gains over what is usual, on the same plants, moves and
//! drive frames.
//!
//! - [`play`]: a controller through a scenario on a plant.
//! - [`baseline`]: what the firmware's control is held against. [`tune`]: the best gains for it.
//! - [`score`]: tracking, settling, overshoot, energy. [`report`]: table, CSV and figure. [`study`]: all of it.
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
pub mod report;
pub mod score;
pub mod study;
pub mod tune;

use crate::ControlBench;
use crate::rigs::commission::{Firmware, commission};
use crate::rigs::subject::Subject;
use crate::scenario::Scenario;
use crate::study::each;
use baseline::{Baseline, Law, Loop};
use play::{Played, Record};
use rig_plant::RigPreset;
use rigctl::parallel::cores;
use score::{SETTLED_M, Score};
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
        _ => commission(plant, false).0,
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
    fn play(&self, law: Law, scenario: &Scenario, along: &[Record]) -> Vec<Record> {
        self.ready.clone().map_or_else(|_| Vec::new(), |bench| play::baseline(bench, law, scenario, along))
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
        for ((scenario, k), (played, ready)) in all.into_iter().zip(played) {
            let seed = plants[k].seed;
            let mut along = played.records;
            let made = along.len();
            if let Some(reason) = played.failure {
                along.extend(of_its_own_model(&scenarios[scenario])?.into_iter().skip(made));
                comparison.failures.push(format!("{}, plant {seed}: {reason}", scenarios[scenario].name));
            }
            comparison.cases.push(Case { scenario, seed, along, made, ready });
        }
        Ok(comparison)
    }

    /// The figures of every move under a baseline's law, or under the firmware's control.
    pub fn play(&self, law: Option<Law>) -> Vec<Entry> {
        let entries = each(cores(), &self.cases, |case| {
            let count = case.along.len();
            let theirs;
            let records = match law {
                None => &case.along[..case.made],
                Some(law) => {
                    theirs = case.play(law, &self.scenarios[case.scenario], &case.along);
                    &theirs[..]
                }
            };
            let scores = case.scores(records, count, self.settled_m);
            let entry =
                |(score, along): (Score, &Record)| Entry { scenario: case.scenario, changed: along.changed, score };
            scores.into_iter().zip(&case.along).map(entry).collect::<Vec<_>>()
        });
        entries.concat()
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
            let records = case.play(Law::Loop(candidate), &self.scenarios[case.scenario], along);
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
    let Played { records, failure } = play::firmware(scenario, &plant, &Firmware::as_built());
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
        let records = case.play(Law::OpenLoop, &scenario, &case.along);
        let scores = case.scores(&records, 1, SETTLED_M);
        assert!(records.is_empty() && !scores[0].made && scores[0].settling_s.is_none());
    }
}
