//! Random bytes at both doors of a homed rig.

use crate::board::Bench;
use rand::{RngExt, SeedableRng};
use rig_link::messages::{Request, State};
use rig_plant::board::{CanFrame, Stimulus};
use std::fmt;

/// What random bytes came to.
#[derive(Clone, Debug, Default)]
pub struct Noise {
    /// Bytes on the host link and in frames on the bus.
    pub bytes: [u64; 2],
    /// Good requests among them, all of them answered.
    pub requests: u32,
    /// Largest true twist that the noise made (rad).
    pub moved_rad: f64,
    /// Emulated time (s).
    pub seconds: f64,
}

impl fmt::Display for Noise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [link, bus] = self.bytes;
        write!(
            f,
            "{link} random bytes on the link and {bus} on the bus in {:.0} s of emulated time: {} good requests all \
             answered, twist moved by {:.4} rad, no reset",
            self.seconds, self.requests, self.moved_rad
        )
    }
}

impl Noise {
    /// The same as a JSON object.
    pub fn json(&self) -> String {
        let [link, bus] = self.bytes;
        serde_json::json!({
            "random_bytes_on_the_link": link,
            "random_bytes_on_the_bus": bus,
            "good_requests_all_answered": self.requests,
            "moved_rad": self.moved_rad,
        })
        .to_string()
    }
}

/// Random bytes, so many on the link and as many in frames on the bus, while the homed rig holds.
///
/// # Panics
/// At a reset, a movement, or a good request without its answer.
pub fn noise(bytes: u64, seed: u64) -> Noise {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let mut b = Bench::new(&[], seed);
    b.home();
    let before = b.machine.board().truth().twist_rad;
    let mut result = Noise::default();
    // In bursts of what 10 ms of either line can carry.
    while result.bytes[0] < bytes {
        let mut burst: Vec<u8> = (0..100).map(|_| random.random()).collect();
        // A burst ends with the delimiter, as any line that was quiet once does.
        burst.push(0);
        result.bytes[0] += burst.len() as u64;
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
            result.bytes[1] += u64::from(dlc);
        }
        b.step();
        if result.bytes[0] % 5_000 < 101 {
            b.ask(&Request::Status).unwrap_or_else(|e| panic!("a good request was refused: {e}"));
            result.requests += 1;
        }
    }
    b.run(0.2);
    let stats = b.machine.stats();
    assert!(stats.resets.is_empty(), "{:?}", stats.resets);
    assert!(matches!(b.state(), State::Ready | State::Holding), "{:?}", b.last);
    result.moved_rad = (b.machine.board().truth().twist_rad - before).abs();
    assert!(result.moved_rad < 0.05, "moved by {} rad", result.moved_rad);
    result.seconds = b.machine.now_s();
    result
}
