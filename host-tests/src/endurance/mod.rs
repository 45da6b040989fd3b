//! Long runs on the emulated board: random moves under random loads with incidents between them, and random bytes at both
//! doors. What is looked for is what only time shows: drift, missed ticks, a stack that grows, a message lost.

mod injected_event;
mod moves;
mod noise;

pub use moves::{Numbers, moves};
pub use noise::noise;

use crate::study::{Rigs, Study, each, significant};
use rig_plant::RigPreset;

/// Of `cargo xtask endurance`. Of --rig there is one kind, the nominal one unless another is asked for, and of --rigs and --seed one
/// unless more are.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    rigs: Rigs,
    /// Moves of each rig, every third with an incident: a fault, a power failure, a step of the load, a stream, a new table; halfway
    /// the rig is calibrated and identified again
    #[arg(long, default_value_t = 1000)]
    moves: u32,
    /// Random bytes on the link; about half as many go in frames on the bus
    #[arg(long, default_value_t = 7_000_000)]
    bytes: u64,
}

/// Makes the moves and sends the bytes.
pub fn study(Arguments { rigs, moves: count, bytes }: &Arguments) -> Study {
    let (kind, seed) = (rigs.rig.unwrap_or(RigPreset::Nominal), rigs.seed.unwrap_or(1));
    let mut parts = Vec::new();
    if *bytes > 0 {
        parts.push(noise(*bytes, seed));
    }
    if *count > 0 {
        let seeds: Vec<u64> = (seed..seed + rigs.rigs.unwrap_or(1)).collect();
        // Each rig is reported as it ends: a run takes hours, and a panic on one rig must not lose the others.
        let all = each(rigs.jobs, &seeds, |seed| {
            let found = moves(*count, kind, *seed);
            eprintln!("{kind} rig {seed}: {found:?}");
            found
        });
        parts.extend(all.into_iter().reduce(|one, other| moves::both(one, &other)));
    }
    let mut study = Study::new(["", ""]);
    for (name, value) in parts.into_iter().flatten() {
        study.row([name.replace('_', " "), significant(value)]);
        study.value(name, value);
    }
    study
}
