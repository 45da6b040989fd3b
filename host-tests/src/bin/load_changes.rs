//! Load steps and moves at full speed on emulated rigs: see [`host_tests::load_changes`] and [`host_tests::full_speed`].

use clap::Parser;
use host_tests::full_speed;
use host_tests::load_changes::{self, Outcome};
use host_tests::rigs::subject::Subject;
use rig_plant::RigPreset;
use std::ops::Range;

#[derive(Parser)]
#[command(about = "Changes the load at rest and times how it comes back, against the motor's own time", version)]
struct Arguments {
    /// Which rigs: ideal, nominal or hard
    #[arg(long, default_value = "ideal")]
    rig: RigPreset,
    /// First seed, and how many
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How many rigs
    #[arg(long, default_value_t = 1)]
    rigs: u64,
    /// Distances (um) within which a load counts as back; the first one is that of --each
    #[arg(long, value_delimiter = ',', default_value = "50")]
    within: Vec<f64>,
    /// Moves 12 mm at full speed instead
    #[arg(long)]
    full_speed: bool,
    /// Threads
    #[arg(long, default_value_t = rigctl::parallel::cores())]
    jobs: usize,
    /// One line for each step
    #[arg(long)]
    each: bool,
    /// Errors over time (um) of one step, its number
    #[arg(long)]
    trace: Option<usize>,
}

fn main() {
    let a = Arguments::parse();
    let seeds: Range<u64> = a.seed..a.seed + a.rigs;
    let outcomes: Vec<Outcome> = seeds
        .flat_map(|seed| {
            let subject = Subject::new(a.rig, seed);
            if a.full_speed { full_speed::all(&subject, a.jobs) } else { load_changes::all(&subject, a.jobs) }
        })
        .collect();
    if a.each {
        a.within.first().into_iter().for_each(|within_um| print_each(&outcomes, *within_um));
    }
    if let Some(k) = a.trace {
        for (tick, m) in outcomes[k].errors_m.iter().enumerate().take(400) {
            println!("{:.2} {:+.0}", 0.01 * tick as f64, m * 1e6);
        }
    }
    for within_um in a.within {
        println!("{} {}", a.rig, summary(&outcomes, within_um));
    }
}

fn print_each(outcomes: &[Outcome], within_um: f64) {
    for (k, o) in outcomes.iter().enumerate() {
        let last = o.errors_m.last().copied().unwrap_or(f64::NAN);
        let took =
            o.settled_s(1e-6 * within_um).map_or("-".into(), |s| format!("{s:.2} s, {:.2} times", s / o.motor_s));
        let why = o.failure.as_deref().unwrap_or("");
        println!("{k:3} {}: motor {:.2} s, {took}; ends {:+.0} um {why}", o.what, o.motor_s, last * 1e6);
    }
}

fn summary(outcomes: &[Outcome], within_um: f64) -> String {
    let settled = |o: &Outcome| o.settled_s(1e-6 * within_um);
    let mut times: Vec<f64> = outcomes.iter().filter_map(settled).collect();
    let mut ratios: Vec<f64> = outcomes.iter().filter_map(|o| settled(o).map(|s| s / o.motor_s)).collect();
    times.sort_by(f64::total_cmp);
    ratios.sort_by(f64::total_cmp);
    let middle = |v: &[f64]| v.get(v.len() / 2).copied().unwrap_or(f64::NAN);
    let most = |v: &[f64]| v.last().copied().unwrap_or(f64::NAN);
    format!(
        "to {within_um} um: {} of {} settled, {} failed; ratio median {:.2}, most {:.2}; time median {:.2}, most {:.2} s",
        times.len(),
        outcomes.len(),
        outcomes.iter().filter(|o| o.failure.is_some()).count(),
        middle(&ratios),
        most(&ratios),
        middle(&times),
        most(&times)
    )
}
