//! `cargo xtask compare`: every controller through the scenarios of the comparison on random plants.

use anyhow::{Result, anyhow, bail};
use clap::Parser;
use host_tests::compare::baseline::{Law, Loop, PAPER_SPEED};
use host_tests::compare::plants::RandomPlant;
use host_tests::compare::report::{Reached, Results};
use host_tests::compare::tune::Goal;
use host_tests::compare::{Comparison, Controller, untuned};
use host_tests::scenario;
use rigctl::out_file::write_file;
use sim_link::{PlantChange, PlantKey};
use std::path::PathBuf;

#[derive(Parser)]
#[command(about = "The firmware's control beside the usual ways to drive a twisted string", version)]
struct Arguments {
    /// Random plants, each under every load of the scenarios
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u16).range(1..))]
    plants: u16,
    /// The same for all plants instead of drawn by chance, for example friction=0N
    #[arg(long, value_name = "KEY=VALUE")]
    plant: Vec<PlantChange>,
    /// Folder for comparison.svg and comparison.csv
    #[arg(long, value_name = "DIR", default_value = "docs")]
    out: PathBuf,
}

/// Those without anything to tune.
const OTHERS: [(&str, Law); 3] = [
    ("c  open loop by table", Law::OpenLoop),
    ("d  constant speed, matched", Law::MatchedSpeed),
    ("d' constant 12.5 rpm (paper)", Law::ConstantSpeed(PAPER_SPEED)),
];

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    if let Some(s) = arguments.plant.iter().find(|s| [PlantKey::Load, PlantKey::TwistAtBoot].contains(&s.key)) {
        bail!("--plant {}: the scenarios say that", s.key);
    }
    let scenarios = scenario::comparison()?;
    let fixed = |plant: RandomPlant| arguments.plant.iter().fold(plant, |plant, change| plant.with(*change));
    let plants: Vec<RandomPlant> = RandomPlant::list(arguments.plants.into()).into_iter().map(fixed).collect();
    eprintln!("{} scenarios on {} plants by the firmware's control …", scenarios.len(), plants.len());
    let comparison = Comparison::new(&scenarios, &plants).map_err(|e| anyhow!(e))?;
    let contestants = contestants(&comparison, &RandomPlant::extremes(&plants))?;
    let same = arguments.plant.iter().map(|s| format!("On every plant {} = {} (SI units).", s.key, s.value));
    let notes = same.chain(contestants.iter().filter_map(|c| c.note.clone())).collect();
    let mut reached = Vec::new();
    for Contestant { name, controller, .. } in contestants {
        eprintln!("{name} …");
        reached.push(Reached { name: name.into(), entries: comparison.play(controller).map_err(|e| anyhow!(e))? });
    }
    let results = Results::new(&scenarios, plants.len(), &comparison.failures, &reached, notes);
    print!("{}", results.table());
    for (name, text) in [("comparison.csv", results.csv()?), ("comparison.svg", results.figure()?)] {
        write_file(&arguments.out, name, &text).map_err(|e| anyhow!(e.message().unwrap_or_default()))?;
    }
    println!("\n{0}/comparison.svg   {0}/comparison.csv", arguments.out.display());
    Ok(())
}

/// Whoever drives the rig.
struct Contestant {
    name: &'static str,
    controller: Controller,
    /// How a tuned one came to its settings.
    note: Option<String>,
}

/// Everybody, the baselines tuned.
fn contestants(comparison: &Comparison<'_>, tuned_on: &[u64]) -> Result<Vec<Contestant>> {
    // Begins near what earlier searches found, which only saves time: its first steps are wide.
    let fixed = Loop { gain_per_s: 6.0, corner_rad_per_s: 24.0, ..untuned() };
    let by_table = Loop { tr_rad_per_m: None, ..fixed };
    let crossing = Loop { crossing_rad: 1.0, ..fixed };
    let mut all = vec![Contestant { name: "a  this controller", controller: Controller::Firmware, note: None }];
    for (name, start, goal, wanted) in [
        ("b  fixed ratio, most settled", fixed, Goal::Settling, "the most settled moves, then the least rms error"),
        ("b' fixed ratio, least error", fixed, Goal::LeastError, "the least rms error without load steps"),
        ("b\" fixed ratio and crossing", crossing, Goal::LeastError, "the same, with a fixed crossing of friction"),
        ("e  b' by the table's ratio", by_table, Goal::LeastError, "the same (the table's ratio under the known load)"),
    ] {
        eprintln!("{name}: tuning on {} plants …", tuned_on.len());
        let tuned = comparison.tune(start, goal, tuned_on).map_err(|e| anyhow!(e))?;
        let ratio = tuned.tr_rad_per_m.map_or("by the table".into(), |tr| format!("{:.2} rad/mm", tr * 1e-3));
        let crossing = match tuned.crossing_rad {
            0.0 => String::new(),
            rad => format!(", crossing {rad:.2} rad"),
        };
        let note = format!(
            "{}: TR {ratio}, gain {:.2} 1/s, corner {:.1} rad/s{crossing}, searched for {wanted} on the {} plants with the least or \
             the most friction, damping, k2, modulus, backlash or noise.",
            name[..2].trim(),
            tuned.gain_per_s,
            tuned.corner_rad_per_s,
            tuned_on.len()
        );
        all.push(Contestant { name, controller: Controller::Baseline(Law::Loop(tuned)), note: Some(note) });
    }
    all.extend(OTHERS.map(|(name, law)| Contestant { name, controller: Controller::Baseline(law), note: None }));
    Ok(all)
}
