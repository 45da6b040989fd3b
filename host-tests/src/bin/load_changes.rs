//! Load steps on emulated rigs: see [`host_tests::load_changes`].

use clap::Parser;
use host_tests::load_changes::{Outcome, all};
use host_tests::rigs::subject::Subject;
use sim_link::RigPreset;
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
    /// Distance (um) within which a load counts as back
    #[arg(long, default_value_t = 50.0)]
    within: f64,
    /// Threads
    #[arg(long, default_value_t = lab::parallel::cores())]
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
    let outcomes: Vec<Outcome> = seeds.flat_map(|seed| all(&Subject::new(a.rig, seed), a.jobs)).collect();
    let within_m = 1e-6 * a.within;
    let settled = |o: &Outcome| o.settled_s(within_m);
    if a.each {
        for (k, o) in outcomes.iter().enumerate() {
            let [from, to] = o.step.change_kg;
            let last = o.errors_m.last().copied().unwrap_or(f64::NAN);
            let took = settled(o).map_or("-".into(), |s| format!("{s:.2} s, {:.2} times", s / o.motor_s));
            let why = o.failure.as_deref().unwrap_or("");
            println!(
                "{k:3} seed {} {:2.0} mm {from} -> {to} kg: motor {:.2} s, {took}; ends {:+.0} um {why}",
                o.step.seed,
                o.step.at_m * 1e3,
                o.motor_s,
                last * 1e6
            );
        }
    }
    if let Some(k) = a.trace {
        for (tick, m) in outcomes[k].errors_m.iter().enumerate().take(400) {
            println!("{:.2} {:+.0}", 0.01 * tick as f64, m * 1e6);
        }
    }
    let mut times: Vec<f64> = outcomes.iter().filter_map(&settled).collect();
    let mut ratios: Vec<f64> = outcomes.iter().filter_map(|o| settled(o).map(|s| s / o.motor_s)).collect();
    times.sort_by(f64::total_cmp);
    ratios.sort_by(f64::total_cmp);
    let middle = |v: &[f64]| v.get(v.len() / 2).copied().unwrap_or(f64::NAN);
    let most = |v: &[f64]| v.last().copied().unwrap_or(f64::NAN);
    let failed = outcomes.iter().filter(|o| o.failure.is_some()).count();
    println!(
        "{} to {} um: {} of {} settled, {failed} failed; ratio median {:.2}, most {:.2}; time median {:.2}, most {:.2} s",
        a.rig,
        a.within,
        times.len(),
        outcomes.len(),
        middle(&ratios),
        most(&ratios),
        middle(&times),
        most(&times)
    );
}
