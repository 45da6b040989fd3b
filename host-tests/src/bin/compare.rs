//! `cargo xtask compare`: every controller through the scenarios of the comparison on random plants, or on rigs of a kind.

use anyhow::{Result, anyhow, bail};
use clap::Parser;
use host_tests::compare::baseline::{Law, Loop, PAPER_SPEED};
use host_tests::compare::plants::{Kind, RandomPlant};
use host_tests::compare::report::{Reached, Results};
use host_tests::compare::tune::Goal;
use host_tests::compare::{Comparison, Controller, untuned};
use host_tests::scenario;
use rig_plant::{PlantChange, PlantKey, RigPreset};
use rigctl::out_file::write_file;
use std::path::PathBuf;

#[derive(Parser)]
#[command(about = "The firmware's control beside the usual ways to drive a twisted string", version)]
struct Arguments {
    /// How many plants, each under every load of the scenarios
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u16).range(1..))]
    plants: u16,
    /// Rigs of a kind (ideal, nominal or hard) instead of random plants, from seed 1001 on, each calibrated and identified first
    #[arg(long)]
    rig: Option<RigPreset>,
    /// The same for all plants instead of drawn by chance, for example friction=0N
    #[arg(long, value_name = "KEY=VALUE")]
    plant: Vec<PlantChange>,
    /// Folder for comparison.svg and comparison.csv, or with --rig comparison-RIG.svg and comparison-RIG.csv
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
    let kind = arguments.rig.map_or(Kind::Random, Kind::Rig);
    let plants: Vec<RandomPlant> = kind.list(arguments.plants.into()).into_iter().map(fixed).collect();
    eprintln!("{} scenarios on {} {kind} by the firmware's control …", scenarios.len(), plants.len());
    let comparison = Comparison::new(&scenarios, &plants).map_err(|e| anyhow!(e))?;
    let contestants = contestants(&comparison, kind, &RandomPlant::extremes(&plants));
    let same = arguments.plant.iter().map(|s| format!("On every plant {} = {} (SI units).", s.key, s.value));
    let notes = same.chain(contestants.iter().filter_map(|c| c.note.clone())).collect();
    let mut reached = Vec::new();
    for Contestant { name, controller, .. } in contestants {
        eprintln!("{name} …");
        reached.push(Reached { name: name.into(), entries: comparison.play(controller) });
    }
    let results = Results::new(&scenarios, (kind, plants.len()), &comparison.failures, &reached, notes);
    print!("{}", results.table());
    let name = arguments.rig.map_or("comparison".into(), |rig| format!("comparison-{rig}"));
    for (end, text) in [("csv", results.csv()?), ("svg", results.figure()?)] {
        write_file(&arguments.out, &format!("{name}.{end}"), &text)
            .map_err(|e| anyhow!(e.message().unwrap_or_default()))?;
    }
    println!("\n{0}/{name}.svg   {0}/{name}.csv", arguments.out.display());
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
fn contestants(comparison: &Comparison<'_>, kind: Kind, tuned_on: &[u64]) -> Vec<Contestant> {
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
        let tuned = comparison.tune(start, goal, tuned_on);
        let ratio = tuned.tr_rad_per_m.map_or("by the table".into(), |tr| format!("{:.2} rad/mm", tr * 1e-3));
        let crossing = match tuned.crossing_rad {
            0.0 => String::new(),
            rad => format!(", crossing {rad:.2} rad"),
        };
        let note = format!(
            "{}: TR {ratio}, gain {:.2} 1/s, corner {:.1} rad/s{crossing}, searched for {wanted} on the {} {kind} with the least or \
             the most {}.",
            name[..2].trim(),
            tuned.gain_per_s,
            tuned.corner_rad_per_s,
            tuned_on.len(),
            kind.felt_in_words()
        );
        all.push(Contestant { name, controller: Controller::Baseline(Law::Loop(tuned)), note: Some(note) });
    }
    all.extend(OTHERS.map(|(name, law)| Contestant { name, controller: Controller::Baseline(law), note: None }));
    all
}
