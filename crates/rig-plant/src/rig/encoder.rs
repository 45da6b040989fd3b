//! Quadrature counts of the encoder on the motor shaft. Drive and microcontroller share its lines
//! (docs/reference/hardware.md 2.1).

use rig_config::RigConfig;
use std::f64::consts::TAU;

/// What [`Encoder::jump`] adds: one turn of the default encoder.
const JUMP_COUNTS: i64 = 4096;
/// While it slips, one count in this many is lost.
const LOST_FRACTION: i64 = 5;
/// Counts by which the drive's count dithers, where it does.
const DITHER_COUNTS: i64 = 4;
/// Quadrature counts of a motor turn for which a drive is set when it is delivered (500 lines).
const DELIVERED_COUNTS: f64 = 2000.0;

/// Quadrature counts for one motor turn, 4 for each line (crates/rmds405/README.md 1).
pub fn counts_per_turn(parameters: &RigConfig) -> u32 {
    parameters.encoder_lines.saturating_mul(4)
}

/// What is wrong with the wires of one counting input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wires {
    /// Nothing.
    Good,
    /// A and B are swapped: it counts backwards.
    Swapped,
    /// One channel is dead: the other one's edges count up and down in turn.
    OneChannel,
    /// Neither channel has edges.
    Dead,
}

/// A counting input on the encoder's lines.
#[derive(Clone, Copy, Debug)]
struct Input {
    wires: Wires,
    /// True counts, and what the input showed, when its wires last changed.
    since: [i64; 2],
}

impl Input {
    const GOOD: Self = Self { wires: Wires::Good, since: [0; 2] };

    fn count(&self, counts: i64) -> i64 {
        let [from, shown] = self.since;
        let moved = counts - from;
        shown
            + match self.wires {
                Wires::Good => moved,
                Wires::Swapped => -moved,
                Wires::OneChannel => moved & 1,
                Wires::Dead => 0,
            }
    }

    /// What has been counted stays; from here on the wires are others.
    fn rewire(&mut self, wires: Wires, counts: i64) {
        *self = Self { wires, since: [counts, self.count(counts)] };
    }
}

/// The encoder, and what the drive's and the microcontroller's inputs count of it.
#[derive(Clone, Debug)]
pub struct Encoder {
    counts_per_turn: f64,
    drive: Input,
    mcu: Input,
    /// The drive is set for the encoder that it is delivered for.
    pub delivered: bool,
    /// The drive's input counts edges of noise.
    pub dithers: bool,
    slipping_from: Option<i64>,
    jumped: i64,
}

impl Encoder {
    /// With `counts_per_turn` quadrature counts for each turn of the motor.
    pub fn new(counts_per_turn: u32) -> Self {
        Self {
            counts_per_turn: f64::from(counts_per_turn),
            drive: Input::GOOD,
            mcu: Input::GOOD,
            delivered: false,
            dithers: false,
            slipping_from: None,
            jumped: 0,
        }
    }

    fn true_counts(&self, angle_rad: f64) -> i64 {
        (angle_rad * self.counts_per_turn / TAU).floor() as i64
    }

    /// What the drive counts at a shaft angle in its `tick`-th millisecond.
    pub fn counts(&self, angle_rad: f64, tick: u64) -> i64 {
        let counts = self.drive.count(self.true_counts(angle_rad));
        // A drive that takes its encoder for one of 500 lines counts its edges all the same; it is its loops and speeds that
        // are then wrong by this factor. Its position is in the units that it is set to.
        let counts = if self.delivered {
            (counts as f64 * DELIVERED_COUNTS / self.counts_per_turn).floor() as i64
        } else {
            counts
        };
        let dither = if self.dithers && !tick.is_multiple_of(2) { DITHER_COUNTS } else { 0 };
        counts + dither
    }

    /// What the microcontroller counts.
    pub fn counts_at_mcu(&self, angle_rad: f64) -> i64 {
        let counts = self.mcu.count(self.true_counts(angle_rad));
        counts + self.jumped - self.slipped(counts)
    }

    fn slipped(&self, counts: i64) -> i64 {
        self.slipping_from.map_or(0, |from| (counts - from) / LOST_FRACTION)
    }

    /// The microcontroller's receiver loses every fifth count from here on; lost counts do not come back.
    pub fn set_slipping(&mut self, slipping: bool, angle_rad: f64) {
        let counts = self.mcu.count(self.true_counts(angle_rad));
        self.jumped -= self.slipped(counts);
        self.slipping_from = slipping.then_some(counts);
    }

    /// The wires of the microcontroller's receiver are these from here on.
    pub fn wire_mcu(&mut self, wires: Wires, angle_rad: f64) {
        self.mcu.rewire(wires, self.true_counts(angle_rad));
    }

    /// The wires of the drive's input are these from here on.
    pub fn wire_drive(&mut self, wires: Wires, angle_rad: f64) {
        self.drive.rewire(wires, self.true_counts(angle_rad));
    }

    /// The microcontroller's receiver gains a turn, once.
    pub fn jump(&mut self) {
        self.jumped += JUMP_COUNTS;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_faults() {
        let mut encoder = Encoder::new(4096);
        assert_eq!(encoder.counts(TAU * 2.0 + 1e-9, 0), 8192);
        assert_eq!(encoder.counts(-1e-9, 0), -1);
        encoder.wire_mcu(Wires::Dead, 0.0);
        assert_eq!((encoder.counts(TAU * 1.01, 0), encoder.counts_at_mcu(TAU * 1.01)), (4136, 0));
        encoder.wire_mcu(Wires::Good, 0.0);
        encoder.jump();
        assert_eq!(encoder.counts_at_mcu(0.0), 4096);
        encoder.set_slipping(true, 0.0);
        assert_eq!(encoder.counts_at_mcu(TAU * 5.0 + 1e-9), 4096 + 4 * 4096);
        encoder.set_slipping(false, TAU * 5.0 + 1e-9);
        assert_eq!(encoder.counts_at_mcu(TAU * 6.0 + 1e-9), 4096 + 5 * 4096);
    }

    #[test]
    fn each_input_has_its_own_wires() {
        let turns = |n: f64| TAU * n + 1e-9;
        let mut encoder = Encoder::new(4096);
        encoder.wire_drive(Wires::Swapped, turns(1.0));
        assert_eq!((encoder.counts(turns(3.0), 0), encoder.counts_at_mcu(turns(3.0))), (4096 - 2 * 4096, 3 * 4096));
        encoder.wire_drive(Wires::OneChannel, turns(3.0));
        assert!((0..100).all(|k| (encoder.counts(turns(3.0 + f64::from(k) * 1e-3), 0) + 4096).abs() <= 1));
        let mut encoder = Encoder::new(4096);
        (encoder.delivered, encoder.dithers) = (true, true);
        assert_eq!([0, 1, 2].map(|tick| encoder.counts(turns(2.0), tick)), [4000, 4004, 4000]);
        assert_eq!(encoder.counts_at_mcu(turns(2.0)), 8192);
    }
}
