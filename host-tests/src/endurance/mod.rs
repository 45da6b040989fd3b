//! Long runs on the emulated board: random moves under random loads with incidents between them, and random bytes at both
//! doors. What is looked for is what only time shows: drift, missed ticks, a stack that grows, a message lost.

mod injected_event;
mod moves;

pub use moves::{Numbers, moves};

use crate::board::Bench;
use crate::study::{Rigs, Study, each, significant};
use rand::{RngExt, SeedableRng};
use rig_link::messages::{Request, State};
use rig_plant::RigPreset;
use rig_plant::board::{CanFrame, Stimulus};

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

/// Random bytes, so many on the link and as many in frames on the bus, while the homed rig holds.
///
/// # Panics
/// At a reset, a movement, or a good request without its answer.
pub fn noise(bytes: u64, seed: u64) -> Numbers {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let mut b = Bench::new(&[], seed);
    b.home();
    let before = b.machine.board().truth().twist_rad;
    let (mut on_link, mut on_bus, mut requests) = (0, 0, 0);
    // In bursts of what 10 ms of either line can carry.
    while on_link < bytes {
        let mut burst: Vec<u8> = (0..100).map(|_| random.random()).collect();
        // A burst ends with the delimiter, as any line that was quiet once does.
        burst.push(0);
        on_link += burst.len() as u64;
        b.raw(burst);
        for _ in 0..14 {
            // Never the drive's own reports: those are not noise but lies, and a fault finds them.
            let id = loop {
                let id = random.random_range(0..0x800);
                if !(0x18..0x20).contains(&id) {
                    break id;
                }
            };
            let (dlc, data) = (random.random_range(0..=8), random.random());
            let frame = CanFrame { id, extended: random.random_bool(0.2), remote: random.random_bool(0.1), dlc, data };
            b.machine.send(Stimulus::Can(frame));
            on_bus += u64::from(dlc);
        }
        b.step();
        if on_link % 5_000 < 101 {
            b.ask(&Request::Status).unwrap_or_else(|e| panic!("a good request was refused: {e}"));
            requests += 1;
        }
    }
    b.run(0.2);
    let stats = b.machine.stats();
    assert!(stats.resets.is_empty(), "{:?}", stats.resets);
    assert!(matches!(b.state(), State::Ready | State::Holding), "{:?}", b.last);
    let moved_rad = (b.machine.board().truth().twist_rad - before).abs();
    assert!(moved_rad < 0.05, "moved by {moved_rad} rad");
    let numbers = [
        ("random_bytes_on_the_link", on_link as f64),
        ("random_bytes_on_the_bus", on_bus as f64),
        ("good_requests_all_answered", requests.into()),
        ("moved_rad", moved_rad),
    ];
    numbers.map(|(name, value)| (name.to_owned(), value)).into()
}
