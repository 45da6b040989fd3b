//! The study of rigs that are not their own model: what is asked of the actuator on rigs that have what real ones have
//! besides the equations, each of them drawn from a seed.
//!
//! - [`subject`]: which rigs. [`commission`]: what a user does first (calibrate the LVDT, record sweeps, identify).
//! - [`trial`]: one boot of a rig under one load, from homing to the last move. [`fixed_ratio`]: the same moves by a loop
//!   with a fixed ratio.
//! - [`floor`]: what is measured, and what is asked of it. [`report`]: the tables, JSON and CSV. [`measured`]: all of it.
//!
//! Anything may be tuned on the rigs with seeds 1 to 40. What is reported is of seeds from 1001 on, at most to 1040, which
//! nothing was tuned on.

pub mod commission;
pub mod fixed_ratio;
pub mod floor;
pub mod report;
pub mod subject;
pub mod trial;

use crate::study::{Rigs, Study, write};
use anyhow::{Result, ensure};
use commission::{calibrated, judged};
use floor::Finding;
use report::{files, groups, page};
use rig_plant::RigPreset;
use rigctl::parallel::{Progress, parallel_on};
use std::path::PathBuf;
use subject::{EFFECTS, FACTORS, Subject};

/// Loads that every rig is tried with (kg).
pub const LOADS_KG: [f64; 4] = [0.15, 0.5, 1.0, 1.5];

/// Kinds of rigs whose floors are asked.
const KINDS: [RigPreset; 2] = [RigPreset::Nominal, RigPreset::Hard];

/// Of the study. Rigs with seeds 1 to 40 are there to tune on.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    rigs: Rigs,
    /// Loads (kg), ascending
    #[arg(long, value_name = "KG,KG", value_delimiter = ',', default_values_t = LOADS_KG)]
    loads: Vec<f64>,
    /// Folder for NAME-summary.csv and NAME.json of each run
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
}

impl Arguments {
    fn rigs(&self, kinds: &[RigPreset], count: u64) -> Vec<Subject> {
        kinds.iter().flat_map(|kind| self.rigs.seeds(count).map(|seed| Subject::new(*kind, seed))).collect()
    }

    /// Rigs of their own model but for each effect in turn, with a factor on its size.
    fn single(&self, kind: RigPreset, factor: Option<f64>) -> Vec<Subject> {
        let of = |effect| self.rigs.seeds(1).map(move |seed| Subject::with_effect(effect, kind, factor, seed));
        EFFECTS.iter().flat_map(of).collect()
    }

    /// Tries the rigs of a run and writes its files.
    fn run(&self, name: &str, subjects: &[Subject], plan: &Plan) -> Result<Vec<Scored>> {
        let scored = study(subjects, plan, &|done, of| eprintln!("{name}: {done} of {of} rigs"));
        for (end, text) in files(&groups(&scored))? {
            write(&self.out, &format!("{name}{end}"), &text)?;
        }
        Ok(scored)
    }
}

/// Measures all of them.
///
/// # Errors
/// If the loads are not ascending, or a file cannot be written.
pub fn measured(a: &Arguments) -> Result<Study> {
    let ascending = a.loads.windows(2).all(|pair| pair[0] < pair[1]);
    ensure!(ascending && a.loads.iter().all(|kg| *kg > 0.0), "--loads: must be above 0 and ascending");
    let plan = Plan { loads_kg: a.loads.clone(), as_built: false, against_fixed_ratio: false, jobs: a.rigs.jobs };
    // Single effects are shown under one load on rigs as built: the study of all of them under all loads takes an hour.
    let single = Plan { loads_kg: vec![0.5], as_built: true, ..plan.clone() };
    let identified = a.run("rigs", &a.rigs(&KINDS, 20), &plan)?;
    let as_built = a.run("rigs-as-built", &a.rigs(&KINDS, 5), &Plan { as_built: true, ..plan.clone() })?;
    let ratio = a.run("fixed-ratio", &a.rigs(&KINDS, 2), &Plan { against_fixed_ratio: true, ..plan.clone() })?;
    a.run("ideal", &a.rigs(&[RigPreset::Ideal], 1), &plan)?;
    a.run("each", &KINDS.map(|kind| a.single(kind, None)).concat(), &single)?;
    a.run("effects", &FACTORS.map(|factor| a.single(RigPreset::Nominal, Some(factor))).concat(), &single)?;
    page([&groups(&identified), &groups(&as_built), &groups(&ratio)])
}

/// What is done with every rig.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Loads (kg), ascending.
    pub loads_kg: Vec<f64>,
    /// Without commissioning: the default scene's table.
    pub as_built: bool,
    /// Whether the moves are also given to loops with a fixed ratio.
    pub against_fixed_ratio: bool,
    /// Threads.
    pub jobs: usize,
}

/// Everything that was found on one rig.
#[derive(Clone, Debug)]
pub struct Scored {
    /// Which rig.
    pub subject: Subject,
    /// Whether the default scene's table was used as it is.
    pub as_built: bool,
    /// What was found.
    pub findings: Vec<Finding>,
}

/// Tries every rig, several at a time.
pub fn study(subjects: &[Subject], plan: &Plan, progress: &Progress<'_>) -> Vec<Scored> {
    parallel_on(plan.jobs, progress, subjects.len(), |k| score(&subjects[k], plan))
}

/// Tries one rig.
pub fn score(subject: &Subject, plan: &Plan) -> Scored {
    let (firmware, mut findings) = if plan.as_built {
        (calibrated(subject), Vec::new())
    } else {
        let (firmware, found) = commission::commission(subject);
        (firmware, judged(subject, &found))
    };
    let loads = &plan.loads_kg;
    let mut along = Vec::new();
    for (k, load_kg) in loads.iter().enumerate() {
        let (found, records) = trial::boot(subject, &firmware, *load_kg, next_load(loads, k));
        findings.extend(found);
        along.extend(records.map(|records| (*load_kg, records)));
    }
    if plan.against_fixed_ratio {
        findings.push(fixed_ratio::compare(subject, &firmware, &along));
    }
    Scored { subject: subject.clone(), as_built: plan.as_built, findings }
}

/// The load of a load step: the next one up; from the heaviest the one below.
fn next_load(loads_kg: &[f64], k: usize) -> f64 {
    let below = k.checked_sub(1).and_then(|k| loads_kg.get(k));
    loads_kg.get(k + 1).or(below).copied().unwrap_or(1.2 * loads_kg[k])
}
