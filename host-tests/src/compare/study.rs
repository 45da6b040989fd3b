//! The study: every controller through the scenarios of the comparison on random plants, or on rigs of a kind.

use super::baseline::{Law, Loop, OTHERS};
use super::report::Results;
use super::tune::Goal;
use super::{Comparison, untuned};
use crate::rigs::subject::Subject;
use crate::scenario;
use crate::study::{Study, write};
use anyhow::{Result, anyhow};
use rig_plant::{PlantKey, RigPreset};
use std::path::PathBuf;

/// Of `cargo xtask compare`.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// How many plants, each under every load of the scenarios
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u16).range(1..))]
    plants: u16,
    /// Rigs of a kind (ideal, nominal or hard) instead of random plants, from seed 1001 on, each calibrated and identified first
    #[arg(long)]
    rig: Option<RigPreset>,
    /// Folder for comparison.svg and comparison.csv, or with --rig comparison-RIG.svg and comparison-RIG.csv
    #[arg(long, value_name = "DIR", default_value = "docs")]
    out: PathBuf,
}

/// The first N of the list that every run uses, and what they are called. Nothing was tuned on rigs of these seeds
/// ([`crate::rigs`]).
pub fn plants(rig: Option<RigPreset>, count: u16) -> (Vec<Subject>, String) {
    let seeds = 1..=u64::from(count);
    match rig {
        None => (seeds.map(Subject::random).collect(), "random plants".into()),
        Some(rig) => (seeds.map(|k| Subject::new(rig, 1000 + k)).collect(), format!("{rig} rigs")),
    }
}

/// What plants differ in that a loop feels, and how that is called. On rigs of a kind every further key would add two, and the
/// searches would take as much longer.
fn felt(rig: Option<RigPreset>) -> (&'static [PlantKey], &'static str) {
    use PlantKey::{Damping, Friction, GearBacklash, K2Scale, LvdtNoise, ModulusScale};
    match rig {
        None => (
            &[Friction, Damping, K2Scale, ModulusScale, GearBacklash, LvdtNoise],
            "friction, damping, k2, modulus, backlash or noise",
        ),
        Some(_) => (&[Friction], "friction"),
    }
}

/// Seeds of the plants that have the minimum or the maximum of one of these keys: whoever manages these should manage the others.
fn extremes(plants: &[Subject], keys: &[PlantKey]) -> Vec<u64> {
    let ends = keys.iter().flat_map(|key| {
        let by_value = |a: &&Subject, b: &&Subject| a.value(*key).total_cmp(&b.value(*key));
        [plants.iter().min_by(by_value), plants.iter().max_by(by_value)]
    });
    let mut seeds: Vec<u64> = ends.flatten().map(|plant| plant.seed).collect();
    seeds.sort_unstable();
    seeds.dedup();
    seeds
}

/// Plays everybody, the baselines tuned; writes the figure and its data.
///
/// # Errors
/// If the firmware fails on the rig of its own model, or a file cannot be written.
pub fn study(arguments: &Arguments) -> Result<Study> {
    let scenarios = scenario::comparison()?;
    let (plants, kind) = plants(arguments.rig, arguments.plants);
    eprintln!("{} scenarios on {} {kind} by the firmware's control …", scenarios.len(), plants.len());
    let comparison = Comparison::new(&scenarios, &plants).map_err(|e| anyhow!(e))?;
    let mut notes = Vec::new();
    comparison.failures.iter().for_each(|failure| eprintln!("a failed: {failure}"));
    let (keys, felt) = felt(arguments.rig);
    let mut reached = vec![("a  this controller", comparison.play(None))];
    for (name, law) in baselines(
        &comparison,
        &format!("{kind} with the least or the most {felt}"),
        &extremes(&plants, keys),
        &mut notes,
    ) {
        eprintln!("{name} …");
        reached.push((name, comparison.play(Some(law))));
    }
    let results = Results::new(&scenarios, (arguments.rig, (plants.len(), kind)), &reached, notes);
    let name = arguments.rig.map_or("comparison".into(), |rig| format!("comparison-{rig}"));
    write(&arguments.out, &format!("{name}.csv"), &results.csv()?)?;
    write(&arguments.out, &format!("{name}.svg"), &results.figure().svg()?)?;
    eprintln!("{0}/{name}.svg   {0}/{name}.csv", arguments.out.display());
    results.study()
}

/// All but the firmware's; `notes` get how the tuned ones came to their settings.
fn baselines(
    comparison: &Comparison<'_>,
    chosen: &str,
    tuned_on: &[u64],
    notes: &mut Vec<String>,
) -> Vec<(&'static str, Law)> {
    // Begins near what earlier searches found, which only saves time: its first steps are wide.
    let fixed = Loop { gain_per_s: 6.0, corner_rad_per_s: 24.0, ..untuned() };
    let by_table = Loop { tr_rad_per_m: None, ..fixed };
    let crossing = Loop { breakaway_rad: 1.0, ..fixed };
    let mut all = Vec::new();
    for (name, start, goal, wanted) in [
        ("b  fixed ratio, most settled", fixed, Goal::Settling, "the most settled moves, then the least rms error"),
        ("b' fixed ratio, least error", fixed, Goal::SmallestError, "the least rms error without load steps"),
        ("b\" fixed ratio and crossing", crossing, Goal::SmallestError, "the same, with a fixed crossing of friction"),
        (
            "e  b' by the table's ratio",
            by_table,
            Goal::SmallestError,
            "the same (the table's ratio under the known load)",
        ),
    ] {
        eprintln!("{name}: tuning on {} plants …", tuned_on.len());
        let tuned = comparison.tune(start, goal, tuned_on);
        let ratio = tuned.tr_rad_per_m.map_or("by the table".into(), |tr| format!("{:.2} rad/mm", tr * 1e-3));
        let crossing = match tuned.breakaway_rad {
            0.0 => String::new(),
            rad => format!(", crossing {rad:.2} rad"),
        };
        notes.push(format!(
            "{}: TR {ratio}, gain {:.2} 1/s, corner {:.1} rad/s{crossing}, searched for {wanted} on the {} {chosen}.",
            name[..2].trim(),
            tuned.gain_per_s,
            tuned.corner_rad_per_s,
            tuned_on.len()
        ));
        all.push((name, Law::Loop(tuned)));
    }
    all.extend(OTHERS);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_searches_use_the_plants_with_the_least_and_the_most_of_what_a_loop_feels() {
        let (random, _) = plants(None, 50);
        let chosen = extremes(&random, felt(None).0);
        assert!((6..=12).contains(&chosen.len()), "{chosen:?}");
        let max = random.iter().max_by(|a, b| a.value(PlantKey::Friction).total_cmp(&b.value(PlantKey::Friction)));
        assert!(chosen.contains(&max.unwrap().seed));
        let (hard, kind) = plants(Some(RigPreset::Hard), 4);
        assert_eq!((hard[0].seed, &hard[0].changes, &*kind), (1001, &RigPreset::Hard.changes(1001), "hard rigs"));
        assert_eq!(extremes(&hard, felt(Some(RigPreset::Hard)).0).len(), 2, "the least and the most friction");
    }
}
