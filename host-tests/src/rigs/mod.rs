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

mod arguments;
pub mod commission;
pub mod fixed_ratio;
pub mod floor;
pub mod report;
pub mod subject;
pub mod trial;

pub use arguments::{Arguments, measured};

use floor::Finding;
use rigctl::parallel::{Progress, parallel_on};
use subject::Subject;

/// Loads that every rig is tried with (kg).
pub const LOADS_KG: [f64; 4] = [0.15, 0.5, 1.0, 1.5];

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
    let (firmware, mut findings) = commission::commission(subject, plan.as_built);
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
