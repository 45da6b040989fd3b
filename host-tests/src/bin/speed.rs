//! How fast changed loads are back at their places and moves at full speed take, on rigs of all kinds, over what is physically
//! possible: one JSON object a line, and a figure.

use anyhow::Result;
use clap::Parser;
use host_tests::full_speed;
use host_tests::load_changes::{self, Outcome};
use host_tests::rigs::subject::Subject;
use host_tests::speed_figure::{Group, figure};
use rig_plant::RigPreset;
use rigctl::parallel::parallel_on;
use serde_json::json;
use std::path::PathBuf;

/// Kind of rig, how many, and the distances (m) within which a load counts as at its place.
const KINDS: [(RigPreset, u64, &[f64]); 3] =
    [(RigPreset::Ideal, 2, &[50e-6]), (RigPreset::Nominal, 6, &[50e-6]), (RigPreset::Hard, 6, &[150e-6, 250e-6])];

#[derive(Parser)]
#[command(about, version)]
struct Arguments {
    /// First seed
    #[arg(long, default_value_t = 1001)]
    seed: u64,
    /// The figure
    #[arg(long, value_name = "FILE.svg")]
    figure: Option<PathBuf>,
    /// Threads
    #[arg(long, default_value_t = rigctl::parallel::cores())]
    jobs: usize,
}

fn main() -> Result<()> {
    let a = Arguments::parse();
    let mut groups = Vec::new();
    for (rig, rigs, within) in KINDS {
        let subjects: Vec<Subject> = (a.seed..a.seed + rigs).map(|seed| Subject::new(rig, seed)).collect();
        let steps: Vec<Outcome> = subjects.iter().flat_map(|subject| load_changes::all(subject, a.jobs)).collect();
        let ways: Vec<Outcome> = subjects.iter().flat_map(|subject| full_speed::all(subject, a.jobs)).collect();
        let threads = a.jobs.min(subjects.len());
        let on_the_way =
            parallel_on(threads, &|_, _| {}, subjects.len(), |k| full_speed::under_steps(&subjects[k])).concat();
        for within_m in within {
            print("load step", rig, rigs, *within_m, &steps);
            print("full speed", rig, rigs, *within_m, &ways);
            print("load step at full speed", rig, rigs, *within_m, &on_the_way);
        }
        groups.push(Group { rig, within_m: within[0], outcomes: steps });
    }
    if let Some(file) = a.figure {
        std::fs::write(&file, figure(&groups).svg().map_err(anyhow::Error::msg)?)?;
    }
    Ok(())
}

fn print(test: &str, rig: RigPreset, rigs: u64, within_m: f64, outcomes: &[Outcome]) {
    let settled: Vec<(&Outcome, f64)> = outcomes.iter().filter_map(|o| o.settled_s(within_m).map(|s| (o, s))).collect();
    let spread = |value: &dyn Fn(&Outcome, f64) -> Option<f64>| {
        let mut values: Vec<f64> = settled.iter().filter_map(|(o, s)| value(o, *s)).filter(|x| x.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        json!({"median": values.get(values.len() / 2), "most": values.last()})
    };
    println!(
        "{}",
        json!({"test": test, "rig": rig.to_string(), "rigs": rigs, "within_m": within_m, "cases": outcomes.len(),
            "settled": settled.len(), "faults": outcomes.iter().filter(|o| o.failure.is_some()).count(),
            "time_s": spread(&|_, s| Some(s)), "over_motor": spread(&|o, s| Some(s / o.motor_s)),
            "over_limit": spread(&|o, s| o.limit_s(within_m).map(|least| s / least))})
    );
}
