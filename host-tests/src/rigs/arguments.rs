//! The runs of docs/results.md.

use super::report::{files, groups, page};
use super::subject::{EFFECTS, FACTORS, Subject};
use super::{LOADS_KG, Plan, Scored, study};
use crate::study::{Rigs, Study, write};
use anyhow::{Result, ensure};
use rig_plant::RigPreset;
use std::path::PathBuf;

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
