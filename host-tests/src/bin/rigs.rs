//! The study of rigs that are not their own model: see [`host_tests::rigs`].

use anyhow::{Context, Result, anyhow, ensure};
use clap::{Parser, ValueEnum};
use host_tests::rigs::report::{Results, csv, groups, summary};
use host_tests::rigs::subject::{EFFECTS, FACTORS, Subject};
use host_tests::rigs::{LOADS_KG, Plan, study};
use rig_plant::{PlantChange, RigPreset};
use std::ops::Range;
use std::path::PathBuf;

#[derive(Parser)]
#[command(about = "Tries the control code on emulated rigs that are not their own model", version)]
struct Arguments {
    /// Seeds of the rigs, the last one not among them: 1..41 to tune on, 1001..1041 to report
    #[arg(long, value_name = "A..B", default_value = "1..41", value_parser = seeds)]
    seeds: Range<u64>,
    /// Which rigs
    #[arg(long, value_enum, default_value_t = Rigs::Both)]
    rigs: Rigs,
    /// Use the default scene's table instead of identifying the rig's constants first
    #[arg(long)]
    as_built: bool,
    /// Only calibrate and identify each rig, and judge what is predicted
    #[arg(long, conflicts_with = "as_built")]
    only_identify: bool,
    /// Loads (kg), ascending
    #[arg(long, value_name = "KG,KG", value_delimiter = ',', default_values_t = LOADS_KG)]
    loads: Vec<f64>,
    /// Threads
    #[arg(long, value_name = "N", default_value_t = rigctl::parallel::cores())]
    jobs: usize,
    /// Leave out the comparison with loops of a fixed ratio
    #[arg(long)]
    no_fixed_ratio: bool,
    /// Rigs of their own model but for each effect in turn, as large as --rigs have it at most
    #[arg(long, conflicts_with_all = ["ramp", "effect"])]
    each: bool,
    /// Rigs of their own model but for each effect in turn, turned up from half to eight times its nominal size
    #[arg(long, conflicts_with = "effect")]
    ramp: bool,
    /// Rigs of their own model but for these plant keys
    #[arg(long, value_name = "KEY=VALUE", num_args = 1..)]
    effect: Vec<PlantChange>,
    /// Folder for NAME.csv, NAME-summary.csv and NAME.json
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Begin of the files' names
    #[arg(long, default_value = "rigs")]
    name: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Rigs {
    /// Rigs of their own model
    Ideal,
    /// Well-made rigs
    Nominal,
    /// The worst one in ten
    Hard,
    /// Nominal and hard
    Both,
}

fn seeds(text: &str) -> Result<Range<u64>, String> {
    let number = |text: &str| text.parse::<u64>().map_err(|_| format!("`{text}` is not a number"));
    let (from, to) = text.split_once("..").ok_or("not A..B")?;
    let range = number(from)?..number(to)?;
    if range.is_empty() { Err("no seed lies in it".into()) } else { Ok(range) }
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let ascending = arguments.loads.windows(2).all(|pair| pair[0] < pair[1]);
    ensure!(ascending && arguments.loads.iter().all(|kg| *kg > 0.0), "--loads: must be above 0 and ascending");
    let subjects = subjects(&arguments);
    let plan = Plan {
        loads_kg: if arguments.only_identify { Vec::new() } else { arguments.loads },
        as_built: arguments.as_built,
        against_fixed_ratio: !arguments.no_fixed_ratio && !arguments.only_identify,
        jobs: arguments.jobs,
    };
    let scored = study(&subjects, &plan, &|done, of| eprintln!("{done} of {of} rigs"));
    let groups = groups(&scored);
    std::fs::create_dir_all(&arguments.out).with_context(|| arguments.out.display().to_string())?;
    let json: Vec<_> = groups.iter().map(Results::json).collect();
    let json = serde_json::to_string_pretty(&json)?;
    let name = &arguments.name;
    for (file, text) in [
        (format!("{name}.csv"), csv(&scored)?),
        (format!("{name}-summary.csv"), summary(&scored)?),
        (format!("{name}.json"), json),
    ] {
        let path = arguments.out.join(file);
        rig_config::files::replace(&path, text.as_bytes(), false).map_err(|e| anyhow!("{}: {e}", path.display()))?;
    }
    for group in &groups {
        println!("{}", group.table());
    }
    Ok(())
}

/// The rigs that are asked for.
fn subjects(arguments: &Arguments) -> Vec<Subject> {
    let seeds = || arguments.seeds.clone();
    if !arguments.effect.is_empty() {
        let name = arguments.effect.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
        let rig = |seed| Subject {
            kind: RigPreset::Hard,
            effect: Some(name.clone()),
            changes: arguments.effect.clone(),
            ..Subject::new(RigPreset::Ideal, seed)
        };
        return seeds().map(rig).collect();
    }
    let kinds: &[RigPreset] = match arguments.rigs {
        Rigs::Ideal => &[RigPreset::Ideal],
        Rigs::Nominal => &[RigPreset::Nominal],
        Rigs::Hard => &[RigPreset::Hard],
        Rigs::Both => &[RigPreset::Nominal, RigPreset::Hard],
    };
    let with = |kind, factor| {
        EFFECTS.iter().flat_map(move |effect| seeds().map(move |seed| Subject::with_effect(effect, kind, factor, seed)))
    };
    if arguments.each {
        return kinds.iter().flat_map(|kind| with(*kind, None)).collect();
    }
    if arguments.ramp {
        return FACTORS.iter().flat_map(|factor| with(RigPreset::Nominal, Some(*factor))).collect();
    }
    kinds.iter().flat_map(|kind| seeds().map(|seed| Subject::new(*kind, seed))).collect()
}
