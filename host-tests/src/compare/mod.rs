//! The comparison: what control by the transmission's own ratio gains over what is usual, on the same plants, moves and
//! drive frames.
//!
//! - [`plants`]: random plants. [`play`]: a controller through a scenario on a plant.
//! - [`baseline`]: what the firmware's control is held against. [`tune`]: the best gains for it.
//! - [`score`]: tracking, settling, overshoot, energy. [`report`]: table, CSV and figure.
//!
//! What is fair: a fixed ratio gets the same feedback, set by search on the comparison's own plants, and (b") even a fixed
//! crossing of the friction band, its size searched for too. What takes the table and the load stays with the firmware: TR
//! by load and twist, the friction band in twist, and seeing when a load comes free.
//!
//! Every baseline follows the set-points that the firmware's planner made on the same plant, so that all are asked the
//! same. A plant on which the firmware fails has none: its failure is a result, and what it had played is left out.

pub mod baseline;
pub mod plants;
pub mod play;
pub mod report;
pub mod score;
pub mod tune;

use crate::ControlBench;
use crate::scenario::Scenario;
use baseline::{Baseline, Law, Loop};
use plants::RandomPlant;
use play::Record;
use score::Score;
use std::num::NonZero;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use tune::{Goal, Tally};

/// Who drives the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Controller {
    /// (a) The firmware's.
    Firmware,
    /// (b) to (d) Another.
    Baseline(Law),
}

/// One scenario on one plant: the firmware's moves, and a baseline that stands ready on the same plant.
pub struct Case {
    /// Which scenario of the list.
    pub scenario: usize,
    /// Seed of the plant.
    pub seed: u64,
    /// What the firmware did, move by move.
    pub records: Vec<Record>,
    /// The baseline, homed.
    pub ready: ControlBench<Baseline>,
}

/// A scenario on a plant that the firmware did not get through.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Which scenario of the list.
    pub scenario: usize,
    /// Seed of the plant.
    pub seed: u64,
    /// What happened.
    pub reason: String,
}

/// One move's figures and whose they are.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Which scenario of the list.
    pub scenario: usize,
    /// Seed of the plant.
    pub seed: u64,
    /// The plant changed during the move.
    pub changed: bool,
    /// The figures.
    pub score: Score,
}

/// Every scenario on every plant, played by the firmware.
pub struct Comparison<'s> {
    scenarios: &'s [Scenario],
    /// What it got through.
    pub cases: Vec<Case>,
    /// What it did not.
    pub failures: Vec<Failure>,
}

impl<'s> Comparison<'s> {
    /// Plays the firmware, and brings a baseline to its reference, everywhere.
    ///
    /// # Errors
    /// In words, if a baseline does not come to its reference.
    pub fn new(scenarios: &'s [Scenario], plants: &[RandomPlant]) -> Result<Self, String> {
        let all: Vec<(usize, &RandomPlant)> =
            (0..scenarios.len()).flat_map(|s| plants.iter().map(move |p| (s, p))).collect();
        let played = in_parallel(&all, |(scenario, plant)| {
            let played = play::firmware(&scenarios[*scenario], plant);
            let ready = play::ready(&scenarios[*scenario], plant);
            (played, ready)
        });
        let mut comparison = Self { scenarios, cases: Vec::new(), failures: Vec::new() };
        for ((scenario, plant), (played, ready)) in all.into_iter().zip(played) {
            let seed = plant.seed;
            match played.failure {
                Some(reason) => comparison.failures.push(Failure { scenario, seed, reason }),
                None => comparison.cases.push(Case { scenario, seed, records: played.records, ready: ready? }),
            }
        }
        Ok(comparison)
    }

    /// The figures of every move under a controller.
    ///
    /// # Errors
    /// In words, if a plant refuses a change.
    pub fn play(&self, controller: Controller) -> Result<Vec<Entry>, String> {
        let cases: Vec<&Case> = self.cases.iter().collect();
        let entries = in_parallel(&cases, |case| -> Result<Vec<Entry>, String> {
            let theirs;
            let records = match controller {
                Controller::Firmware => &case.records,
                Controller::Baseline(law) => {
                    let scenario = &self.scenarios[case.scenario];
                    theirs = play::baseline(case.ready.clone(), law, scenario, &case.records)?;
                    &theirs
                }
            };
            let entry = |record: &Record| Entry {
                scenario: case.scenario,
                seed: case.seed,
                changed: record.changed,
                score: Score::new(record),
            };
            Ok(records.iter().map(entry).collect())
        });
        Ok(entries.into_iter().collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// The loop that comes nearest to a goal on the plants with these seeds, searched for from `start`.
    ///
    /// # Errors
    /// As [`Comparison::play`].
    pub fn tune(&self, start: Loop, goal: Goal, seeds: &[u64]) -> Result<Loop, String> {
        // Heavy loads are the hardest: whoever fails is dropped there.
        let cases: Vec<&Case> = self.cases.iter().rev().filter(|case| seeds.contains(&case.seed)).collect();
        let steady =
            |case: &&Case| case.records.iter().filter(|r| !r.changed).map(|r| Score::new(r).ticks).sum::<usize>();
        let ticks = cases.iter().map(steady).sum();
        let mut refused = None;
        let best = tune::search(start, |candidates, limit| {
            let mut tallies = vec![Tally::default(); candidates.len()];
            for some in cases.chunks(8) {
                let alive = (0..candidates.len()).filter(|k| goal.cost(&tallies[*k], ticks) < limit);
                let runs: Vec<(usize, &Case)> = alive.flat_map(|k| some.iter().map(move |case| (k, *case))).collect();
                let played = in_parallel(&runs, |(k, case)| {
                    let counts = |r: &&Record| goal == Goal::Settling || !r.changed;
                    let along = &case.records[..case.records.iter().take_while(counts).count()];
                    let law = Law::Loop(candidates[*k]);
                    play::baseline(case.ready.clone(), law, &self.scenarios[case.scenario], along)
                });
                for ((k, _), records) in runs.iter().zip(played) {
                    match records {
                        Ok(records) => records.iter().for_each(|r| tallies[*k].add(r.changed, &Score::new(r))),
                        Err(error) => refused = Some(error),
                    }
                }
            }
            tallies.iter().map(|tally| goal.cost(tally, ticks)).collect()
        });
        refused.map_or(Ok(best), Err)
    }
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
    Loop { tr_rad_per_m: Some(mean), gain_per_s: 3.0, corner_rad_per_s: 9.0, crossing_rad: 0.0 }
}

/// `f` of every item, on all cores, in the items' order.
fn in_parallel<T: Sync, R: Send>(items: &[T], f: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(items.len()));
    let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some((k, item)) =
                    Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|k| Some((k, items.get(k)?)))
                {
                    let result = f(item);
                    done.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((k, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(|(k, _)| *k);
    done.into_iter().map(|(_, result)| result).collect()
}
