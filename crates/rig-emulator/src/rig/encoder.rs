//! Quadrature counts of the encoder on the motor shaft. Drive and microcontroller share its lines (hardware.md 6.1).

use std::f64::consts::TAU;

/// What [`Encoder::jump`] adds: one turn of the default encoder.
const JUMP_COUNTS: i64 = 4096;

/// While it slips, one count in this many is lost.
const LOST_SHARE: i64 = 5;

/// The encoder, and the counts of the microcontroller's receiver.
#[derive(Clone, Debug)]
pub struct Encoder {
    counts_per_rad: f64,
    stuck_at: Option<i64>,
    slipping_from: Option<i64>,
    jumped: i64,
}

impl Encoder {
    /// With `counts_per_turn` quadrature counts for each turn of the motor.
    pub fn new(counts_per_turn: u32) -> Self {
        Self { counts_per_rad: f64::from(counts_per_turn) / TAU, stuck_at: None, slipping_from: None, jumped: 0 }
    }

    /// What the drive counts at a shaft angle.
    pub fn counts(&self, angle_rad: f64) -> i64 {
        (angle_rad * self.counts_per_rad).floor() as i64
    }

    /// What the microcontroller counts.
    pub fn counts_at_mcu(&self, angle_rad: f64) -> i64 {
        let counts = self.stuck_at.unwrap_or_else(|| self.counts(angle_rad));
        counts + self.jumped - self.slipped(counts)
    }

    fn slipped(&self, counts: i64) -> i64 {
        self.slipping_from.map_or(0, |from| (counts - from) / LOST_SHARE)
    }

    /// The microcontroller's receiver loses every fifth count from here on; lost counts do not come back.
    pub fn set_slipping(&mut self, slipping: bool, angle_rad: f64) {
        let counts = self.counts(angle_rad);
        self.jumped -= self.slipped(counts);
        self.slipping_from = slipping.then_some(counts);
    }

    /// The microcontroller's receiver stops following; the drive's own input goes on.
    pub fn set_stuck(&mut self, stuck: bool, angle_rad: f64) {
        self.stuck_at = match (stuck, self.stuck_at) {
            (true, None) => Some(self.counts(angle_rad)),
            (true, at) => at,
            (false, _) => None,
        };
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
        assert_eq!(encoder.counts(TAU * 2.0 + 1e-9), 8192);
        assert_eq!(encoder.counts(-1e-9), -1);
        encoder.set_stuck(true, 0.0);
        assert_eq!((encoder.counts(TAU * 1.01), encoder.counts_at_mcu(TAU * 1.01)), (4136, 0));
        encoder.set_stuck(false, 0.0);
        encoder.jump();
        assert_eq!(encoder.counts_at_mcu(0.0), 4096);
        encoder.set_slipping(true, 0.0);
        assert_eq!(encoder.counts_at_mcu(TAU * 5.0 + 1e-9), 4096 + 4 * 4096);
        encoder.set_slipping(false, TAU * 5.0 + 1e-9);
        assert_eq!(encoder.counts_at_mcu(TAU * 6.0 + 1e-9), 4096 + 5 * 4096);
    }
}
