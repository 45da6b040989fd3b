//! Random bytes at both doors of a homed rig.

use super::moves::Numbers;
use crate::board::Bench;
use rand::{RngExt, SeedableRng};
use rig_link::messages::{Request, State};
use rig_plant::board::{CanFrame, Stimulus};

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
