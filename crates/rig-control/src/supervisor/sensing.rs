//! One tick's inputs as readings in SI units, and the zero of the drive's own count.

use super::Inputs;
use crate::sensors::{GAP_DELAY_S, Lvdt, LvdtReading};
use crate::{RigConstants, TICK_S, angle_rad, seconds};

/// Readings of one tick.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Readings {
    pub(super) lvdt: LvdtReading,
    /// Age of the gap (s); 0 without one.
    pub(super) gap_age_s: f32,
    /// Time between this gap and the one before (s); 0 if it is the same, or without one.
    pub(super) gap_step_s: f32,
    /// Shaft angle by the own encoder (rad).
    pub(super) shaft_rad: f32,
    /// Shaft angle when the gap was measured (rad).
    pub(super) shaft_at_gap_rad: f32,
}

/// Zero of the drive's count: own count less the drive's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum DriveZero {
    /// The drive was told to restart and still reports from before, with another zero.
    Outdated,
    /// The drive has not reported since its last start.
    #[default]
    Unknown,
    /// From a first report, which is up to 10 ms old: good enough to hold.
    Rough(i64),
    /// From a standing shaft. Own and drive's counts can be compared.
    Matched(i64),
}

impl DriveZero {
    pub(super) fn offset(self) -> Option<i64> {
        match self {
            Self::Outdated | Self::Unknown => None,
            Self::Rough(offset) | Self::Matched(offset) => Some(offset),
        }
    }

    pub(super) fn is_matched(self) -> bool {
        matches!(self, Self::Matched(_))
    }

    /// Shaft angle (rad) where the drive counts so.
    pub(super) fn shaft_rad(self, drive_counts: i64, constants: &RigConstants) -> Option<f32> {
        self.offset().map(|offset| angle_rad(drive_counts + offset, constants.counts_per_rad))
    }
}

/// Sensors and drive.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sensing {
    /// Readings of the newest tick.
    pub(super) readings: Readings,
    pub(super) drive_zero: DriveZero,
    lvdt: Lvdt,
    /// Shaft angle in the tick before (rad).
    last_shaft_rad: Option<f32>,
    /// When the last gap was complete (µs since boot).
    last_gap_us: u64,
}

impl Sensing {
    /// Reads one tick's inputs.
    pub(super) fn read(&mut self, inputs: &Inputs, constants: &RigConstants) {
        let shaft_rad = angle_rad(inputs.encoder_counts, constants.counts_per_rad);
        let lvdt = self.lvdt.read(inputs.now_us, inputs.lvdt, constants);
        let (gap_age_s, gap_step_s) = match lvdt {
            LvdtReading::Valid { t_us, .. } => {
                let step_us = t_us.saturating_sub(core::mem::replace(&mut self.last_gap_us, t_us));
                (seconds(inputs.now_us.saturating_sub(t_us)) + GAP_DELAY_S, seconds(step_us))
            }
            LvdtReading::NotYet | LvdtReading::Invalid(_) => (0.0, 0.0),
        };
        let turned_rad = shaft_rad - self.last_shaft_rad.replace(shaft_rad).unwrap_or(shaft_rad);
        let shaft_at_gap_rad = shaft_rad - turned_rad * gap_age_s / TICK_S;
        self.readings = Readings { lvdt, gap_age_s, gap_step_s, shaft_rad, shaft_at_gap_rad };
    }

    /// Reads the same tick again after the constants have changed. Angles of the old constants are not compared with new ones.
    pub(super) fn read_again(&mut self, inputs: &Inputs, constants: &RigConstants) {
        self.last_shaft_rad = None;
        self.read(inputs, constants);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::LvdtBlock;

    /// A shaft that turns by 1 rad a tick, and a gap that was measured half a tick ago (the sensor's own delay included).
    #[test]
    fn the_shaft_angle_belongs_to_the_time_of_the_gap() {
        let constants = crate::constants::tests::RIG;
        let mut sensing = Sensing::default();
        let read = |sensing: &mut Sensing, now_us: u64, shaft_rad: f32| {
            let age_us = ((0.5 * TICK_S - GAP_DELAY_S) * 1e6) as u64;
            let block = LvdtBlock { t_us: now_us - age_us, mean_code: 2000.0, variance: 1.0 };
            let inputs = Inputs {
                lvdt: Some(block),
                encoder_counts: (shaft_rad * constants.counts_per_rad) as i64,
                ..super::super::tests::inputs(now_us)
            };
            sensing.read(&inputs, &constants);
            sensing.readings
        };
        let first = read(&mut sensing, 1_000_000, 5.0);
        assert_eq!(first.shaft_at_gap_rad, first.shaft_rad, "nothing to compare with");
        let second = read(&mut sensing, 1_010_000, 6.0);
        assert!((second.gap_age_s - 0.005).abs() < 2e-6 && (second.shaft_at_gap_rad - 5.5).abs() < 1e-3, "{second:?}");
    }

    #[test]
    fn a_drives_count_is_an_angle_once_its_zero_is_known() {
        let constants = crate::constants::tests::RIG;
        assert_eq!(DriveZero::Unknown.shaft_rad(100, &constants), None);
        for zero in [DriveZero::Rough(404_160 - 100), DriveZero::Matched(404_160 - 100)] {
            assert!((zero.shaft_rad(100, &constants).unwrap() - 10.0).abs() < 1e-5);
        }
    }
}
