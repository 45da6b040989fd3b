//! How fast a changed load is back at its place by the firmware's control and by seven others, over the least time of
//! any control: one JSON object a line, and a figure.

use anyhow::Result;
use clap::Parser;
use host_tests::compare::baseline::Law;
use host_tests::load_changes::{self, Outcome};
use host_tests::rigs::subject::Subject;
use host_tests::rivals::Field;
use host_tests::rivals_figure::{Played, figure, over_limit};
use rig_plant::RigPreset;
use serde_json::json;
use std::path::PathBuf;

/// Kind of rig, how many, and the distance (m) within which a load counts as at its place.
const KINDS: [(RigPreset, u64, f64); 3] =
    [(RigPreset::Ideal, 1, 50e-6), (RigPreset::Nominal, 3, 50e-6), (RigPreset::Hard, 3, 150e-6)];
/// On how many of the rigs the loops are tuned, at most.
const TUNED_ON: usize = 2;
/// A tick (s): no time that is compared is shorter.
const TICK_S: f64 = 0.01;
/// A time this many times the limit is named.
const NAMED: f64 = 2.0;

#[derive(Parser)]
#[command(about, version)]
struct Arguments {
    /// Only this kind of rig: ideal, nominal or hard
    #[arg(long)]
    rig: Option<RigPreset>,
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
    let mut all = Vec::new();
    for (rig, rigs, within_m) in KINDS.into_iter().filter(|(rig, ..)| a.rig.is_none_or(|only| only == *rig)) {
        eprintln!("{rigs} {rig} rigs …");
        let subjects = (a.seed..a.seed + rigs).map(|seed| Subject::new(rig, seed));
        let rigs: Vec<(Subject, Vec<Outcome>)> =
            subjects.map(|subject| (subject.clone(), load_changes::all(&subject, a.jobs))).collect();
        let ours: Vec<Outcome> = rigs.iter().flat_map(|(_, outcomes)| outcomes.clone()).collect();
        let count = rigs.len();
        let field = Field::new(rigs, a.jobs);
        let mut print = |name: &str, law: Option<Law>, outcomes: Vec<Outcome>| {
            let found = Found { name, rig, rigs: count, within_m, law };
            println!("{}", found.json(&outcomes, &ours));
            all.push(Played { name: name.into(), rig, within_m, outcomes });
        };
        print("a  this controller", None, ours.clone());
        for rival in field.rivals(TUNED_ON, within_m) {
            print(rival.name, Some(rival.law), field.play(rival.law));
        }
    }
    if let Some(file) = a.figure {
        std::fs::write(&file, figure(&all).svg().map_err(anyhow::Error::msg)?)?;
    }
    Ok(())
}

/// Whose steps, and where.
struct Found<'a> {
    name: &'a str,
    rig: RigPreset,
    rigs: usize,
    within_m: f64,
    law: Option<Law>,
}

impl Found<'_> {
    /// Medians are of all steps: one that has not settled takes longer than any other. The most is of those that settled.
    fn json(&self, outcomes: &[Outcome], ours: &[Outcome]) -> serde_json::Value {
        let settled = |o: &Outcome| o.settled_s(self.within_m);
        let spread = |values: Vec<Option<f64>>| {
            let mut values: Vec<f64> = values.into_iter().map(|value| value.unwrap_or(f64::INFINITY)).collect();
            values.sort_by(f64::total_cmp);
            let most = values.iter().rev().find(|value| value.is_finite());
            json!({"median": values.get(values.len() / 2).filter(|value| value.is_finite()), "most": most})
        };
        let slow = outcomes.iter().filter_map(|o| over_limit(o, self.within_m).map(|ratio| (o, ratio)));
        let slow: Vec<(String, f64)> = slow.filter(|(_, r)| *r > NAMED).map(|(o, r)| (o.what.clone(), r)).collect();
        // Steps that neither brings back say nothing.
        let over_ours = outcomes.iter().zip(ours).filter_map(|(theirs, ours)| match (settled(theirs), settled(ours)) {
            (None, None) => None,
            (theirs_s, ours_s) => Some(theirs_s.unwrap_or(f64::INFINITY) / ours_s.unwrap_or(f64::INFINITY).max(TICK_S)),
        });
        let gain = match self.law {
            Some(Law::Loop(law)) => Some([law.gain_per_s, law.corner_rad_per_s]),
            _ => None,
        };
        let missed = outcomes.iter().filter(|o| settled(o).is_none()).map(|o| o.what.clone());
        json!({
            "controller": self.name, "rig": self.rig.to_string(), "rigs": self.rigs, "within_m": self.within_m,
            "cases": outcomes.len(), "settled": outcomes.iter().filter(|o| settled(o).is_some()).count(),
            "failed": outcomes.iter().filter(|o| o.failure.is_some()).count(),
            "time_s": spread(outcomes.iter().map(settled).collect()),
            "over_limit": spread(outcomes.iter().map(|o| over_limit(o, self.within_m)).collect()),
            "over_ours": spread(over_ours.map(Some).collect()),
            "beyond_twice": slow, "not_settled": missed.collect::<Vec<_>>(), "gain_and_corner": gain,
        })
    }
}
