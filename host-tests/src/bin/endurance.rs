//! `cargo xtask endurance`: a thousand moves with incidents, and ten million random bytes, on the emulated board.

use clap::Parser;
use host_tests::endurance::{Endurance, moves, noise};
use rig_plant::RigPreset;
use rigctl::parallel::parallel_on;

#[derive(Parser)]
#[command(about = "Long runs on the emulated board", version)]
struct Arguments {
    /// Moves, every third with an incident: a fault, a power failure, a step of the load, a stream, a new table; halfway the rig is
    /// calibrated and identified anew
    #[arg(long, default_value_t = 1000)]
    moves: u32,
    /// Random bytes on the link; about half as many go in frames on the bus
    #[arg(long, default_value_t = 7_000_000)]
    bytes: u64,
    /// Which rig: ideal, nominal or hard
    #[arg(long, default_value = "nominal")]
    rig: RigPreset,
    /// How many rigs make so many moves each
    #[arg(long, default_value_t = 1)]
    rigs: u16,
    /// Of the random numbers and of the first rig
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object for the bytes and one for the moves
    #[arg(long)]
    json: bool,
}

fn main() {
    let Arguments { moves: count, bytes, rig, rigs, seed, json } = Arguments::parse();
    if bytes > 0 {
        let noise = noise(bytes, seed);
        if json { println!("{}", noise.json()) } else { println!("{noise}") }
    }
    if count > 0 {
        // Each rig is reported as it ends: a run takes hours, and a panic on one rig must not lose the others.
        let one = |k: usize| {
            let found = moves(count, rig, seed + k as u64);
            eprintln!("{rig} rig {}: {found}", seed + k as u64);
            found
        };
        let all = parallel_on(rigctl::parallel::cores(), &|_, _| {}, usize::from(rigs), one);
        let moves = all.into_iter().reduce(Endurance::and).unwrap_or_default();
        if json { println!("{}", moves.json()) } else { println!("{moves}") }
    }
}
