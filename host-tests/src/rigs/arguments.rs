//! The study's runs: one that a user asks for, or those of docs/results.md.

use super::report::{Results, files, groups, page};
use super::subject::{EFFECTS, FACTORS, Subject};
use super::{LOADS_KG, Plan, Scored, study};
use crate::study::{Rigs, Study, write};
use anyhow::{Result, ensure};
use rig_plant::{PlantChange, RigPreset};
use std::path::PathBuf;

/// Of the study. Rigs with seeds 1 to 40 are there to tune on.
#[derive(clap::Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    rigs: Rigs,
    /// The runs of docs/results.md, for which --seed, --rigs and --loads can be given
    #[arg(long, conflicts_with_all = ["as_built", "only_identify", "each", "ramp", "effect", "name"])]
    page: bool,
    /// Use the default scene's table instead of identifying the rig's constants first
    #[arg(long)]
    as_built: bool,
    /// Only calibrate and identify each rig, and judge what is predicted
    #[arg(long, conflicts_with = "as_built")]
    only_identify: bool,
    /// Loads (kg), ascending
    #[arg(long, value_name = "KG,KG", value_delimiter = ',', default_values_t = LOADS_KG)]
    loads: Vec<f64>,
    /// Leave out the comparison with loops of a fixed ratio
    #[arg(long)]
    no_fixed_ratio: bool,
    /// Rigs of their own model but for each effect in turn, as large as --rig has it at most
    #[arg(long, conflicts_with_all = ["ramp", "effect"])]
    each: bool,
    /// Rigs of their own model but for each effect in turn, turned up from half to eight times its nominal size
    #[arg(long, conflicts_with = "effect")]
    ramp: bool,
    /// Rigs of their own model but for these plant keys
    #[arg(long, value_name = "KEY=VALUE", num_args = 1..)]
    effect: Vec<PlantChange>,
    /// Folder for NAME-summary.csv and NAME.json
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Begin of the files' names
    #[arg(long, default_value = "rigs")]
    name: String,
}

/// Nominal and hard rigs, unless another kind is asked for; of so many seeds, unless others are.
fn subjects(a: &Arguments, count: u64) -> Vec<Subject> {
    let seeds = || a.rigs.seeds(count);
    if !a.effect.is_empty() {
        let name = a.effect.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
        let rig = |seed| Subject {
            kind: RigPreset::Hard,
            effect: Some(name.clone()),
            changes: a.effect.clone(),
            ..Subject::new(RigPreset::Ideal, seed)
        };
        return seeds().map(rig).collect();
    }
    let with = |kind, factor| {
        EFFECTS.iter().flat_map(move |effect| seeds().map(move |seed| Subject::with_effect(effect, kind, factor, seed)))
    };
    if a.ramp {
        return FACTORS.iter().flat_map(|factor| with(RigPreset::Nominal, Some(*factor))).collect();
    }
    let kinds = a.rigs.rig.map_or(vec![RigPreset::Nominal, RigPreset::Hard], |kind| vec![kind]);
    if a.each {
        return kinds.into_iter().flat_map(|kind| with(kind, None)).collect();
    }
    kinds.into_iter().flat_map(|kind| seeds().map(move |seed| Subject::new(kind, seed))).collect()
}

/// Tries the rigs of a run and writes its files.
fn run(a: &Arguments, count: u64) -> Result<Vec<Scored>> {
    let plan = Plan {
        loads_kg: if a.only_identify { Vec::new() } else { a.loads.clone() },
        as_built: a.as_built,
        against_fixed_ratio: !a.no_fixed_ratio && !a.only_identify,
        jobs: a.rigs.jobs,
    };
    let scored = study(&subjects(a, count), &plan, &|done, of| eprintln!("{}: {done} of {of} rigs", a.name));
    for (end, text) in files(&groups(&scored))? {
        write(&a.out, &format!("{}{end}", a.name), &text)?;
    }
    Ok(scored)
}

/// Measures what is asked for.
///
/// # Errors
/// If the loads are not ascending, or a file cannot be written.
pub fn measured(a: &Arguments) -> Result<Study> {
    let ascending = a.loads.windows(2).all(|pair| pair[0] < pair[1]);
    ensure!(ascending && a.loads.iter().all(|kg| *kg > 0.0), "--loads: must be above 0 and ascending");
    if !a.page {
        let a = &Arguments { rigs: Rigs { seed: a.rigs.seed.or(Some(1)), ..a.rigs.clone() }, ..a.clone() };
        let scored = run(a, 40)?;
        let studies = groups(&scored).iter().map(Results::study).reduce(Study::and);
        return Ok(studies.unwrap_or_default());
    }
    let named = |name: &str| Arguments { name: name.into(), no_fixed_ratio: true, ..a.clone() };
    // Single effects are shown under one load on rigs as built: the study of all of them under all loads takes an hour.
    let single = |name: &str| Arguments { as_built: true, loads: vec![0.5], ..named(name) };
    let identified = run(&named("rigs"), 20)?;
    let as_built = run(&Arguments { as_built: true, ..named("rigs-as-built") }, 5)?;
    let ratio = run(&Arguments { no_fixed_ratio: false, ..named("fixed-ratio") }, 2)?;
    run(&Arguments { rigs: Rigs { rig: Some(RigPreset::Ideal), ..a.rigs.clone() }, ..named("ideal") }, 1)?;
    run(&Arguments { each: true, ..single("each") }, 1)?;
    run(&Arguments { ramp: true, ..single("effects") }, 1)?;
    page([&groups(&identified), &groups(&as_built), &groups(&ratio)])
}
