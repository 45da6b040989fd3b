//! `cargo xtask compare`: every controller through the scenarios of the comparison on random plants.

use anyhow::{Context, Result, anyhow};
use clap::Parser;
use host_tests::compare::plants::RandomPlant;
use host_tests::compare::report::{Reached, Results};
use host_tests::compare::{Comparison, Controller, baselines, untuned};
use host_tests::scenario;
use std::path::PathBuf;

#[derive(Parser)]
#[command(about = "The firmware's control beside the usual ways to drive a twisted string", version)]
struct Arguments {
    /// Random plants, each under every load of the scenarios
    #[arg(long, default_value_t = 50)]
    plants: usize,
    /// Of these plants, how many the fixed ratio is tuned on
    #[arg(long, default_value_t = 10)]
    tuned_on: u64,
    /// Folder for comparison.svg and comparison.csv
    #[arg(long, value_name = "DIR", default_value = "docs")]
    out: PathBuf,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let scenarios = scenario::comparison()?;
    let plants = RandomPlant::list(arguments.plants);
    eprintln!("{} scenarios on {} plants by the firmware's control …", scenarios.len(), plants.len());
    let comparison = Comparison::new(&scenarios, &plants).map_err(|e| anyhow!(e))?;
    let start = untuned();
    eprintln!("tuning the fixed ratio on {} plants, from {start:?} …", arguments.tuned_on);
    let (tuned, rms_m) = comparison.tune(start, arguments.tuned_on).map_err(|e| anyhow!(e))?;
    eprintln!("{tuned:?}: {:.1} um rms on them", rms_m * 1e6);
    let mut rows = Vec::new();
    for controller in [Controller::Firmware].into_iter().chain(baselines(tuned).map(Controller::Baseline)) {
        rows.push(Reached { controller, entries: comparison.play(controller).map_err(|e| anyhow!(e))? });
    }
    let results = Results::new(&scenarios, plants.len(), &comparison.failures, &rows);
    print!("{}", results.table());
    let write = |name: &str, text: String| {
        let path = arguments.out.join(name);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    };
    write("comparison.csv", results.csv()?)?;
    write("comparison.svg", results.figure()?)?;
    println!("\n{0}/comparison.svg   {0}/comparison.csv", arguments.out.display());
    Ok(())
}
