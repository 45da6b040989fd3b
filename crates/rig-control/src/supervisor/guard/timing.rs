//! Ticks that come late.

use crate::sensors::OLD_US;
use crate::{TICK_US, seconds};

/// A tick this long (µs) after the one before is late. One after which every report is old ([`OLD_US`]) is a fault by itself: the
/// encoder's 16 bits could wrap unseen at full speed, and the drive has stood at an old target.
pub(super) const LATE_US: u64 = TICK_US + TICK_US / 2;
/// Each late tick costs this much, each tick in time takes 1 off, and more than four times as much is a fault: five in a second.
const LATE_COST: u16 = 25;

/// When ticks came.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::supervisor) struct TickTiming {
    /// Time between this tick and the one before (µs).
    apart_us: u64,
    last_tick_us: Option<u64>,
    /// Time since the newest late tick (µs), if one was late.
    since_late_us: Option<u64>,
    late_cost: u16,
    /// Since boot.
    pub(in crate::supervisor) late_ticks: u32,
}

impl TickTiming {
    /// As new, but for the count of late ticks.
    pub(super) fn restarted(&self) -> Self {
        Self { late_ticks: self.late_ticks, ..Self::default() }
    }

    /// One tick; whether ticks come so late that it is a fault.
    pub(super) fn step(&mut self, now_us: u64) -> bool {
        self.apart_us = self.last_tick_us.replace(now_us).map_or(TICK_US, |last| now_us.saturating_sub(last));
        self.since_late_us = self.since_late_us.map(|us| us.saturating_add(self.apart_us));
        if self.apart_us > LATE_US {
            self.since_late_us = Some(0);
            self.late_ticks = self.late_ticks.saturating_add(1);
            self.late_cost = self.late_cost.saturating_add(LATE_COST);
        } else {
            self.late_cost = self.late_cost.saturating_sub(1);
        }
        self.apart_us > OLD_US || self.late_cost > 4 * LATE_COST
    }

    /// The next tick is not late, however long it takes to come.
    pub(in crate::supervisor) fn pause(&mut self) {
        self.last_tick_us = None;
    }

    /// Time of this tick (s), at least the usual one.
    pub(super) fn tick_s(&self) -> f32 {
        seconds(self.apart_us.max(TICK_US))
    }

    /// Whether ticks were missing so lately that drive and sensors may not have been heard since.
    pub(super) fn ticks_missed_lately(&self) -> bool {
        self.since_late_us.is_some_and(|us| us <= OLD_US)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    /// Whether a last tick is a fault, after ticks so far apart (µs).
    fn is_fault(apart_us: &[u64]) -> (bool, u32) {
        let (mut timing, mut now_us) = (TickTiming::default(), 1_000_000);
        let mut fault = timing.step(now_us);
        for apart_us in apart_us {
            now_us += apart_us;
            fault = timing.step(now_us);
        }
        (fault, timing.late_ticks)
    }

    #[test]
    fn one_very_late_tick_or_five_late_ones_in_a_second_are_a_fault() {
        assert_eq!(is_fault(&[OLD_US]), (false, 1));
        assert_eq!(is_fault(&[OLD_US + 1]), (true, 1));
        assert_eq!(is_fault(&[15_000; 100]), (false, 0));
        assert_eq!(is_fault(&[15_001; 4]), (false, 4));
        assert_eq!(is_fault(&[15_001; 5]), (true, 5));
        // A quarter of a second without a late tick makes up for one.
        let spread: std::vec::Vec<u64> = (0..9).flat_map(|_| [[15_001].as_slice(), &[10_000; 25]].concat()).collect();
        assert_eq!(is_fault(&spread), (false, 9));
    }

    #[test]
    fn a_pause_is_not_late_and_a_restart_keeps_the_count() {
        let mut timing = TickTiming::default();
        timing.step(0);
        timing.pause();
        assert!(!timing.step(10_000_000) && timing.late_ticks == 0);
        assert!(timing.step(20_000_000) && timing.ticks_missed_lately());
        let restarted = timing.restarted();
        assert!(restarted.late_ticks == 1 && !restarted.ticks_missed_lately());
    }
}
