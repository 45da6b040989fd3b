//! Drive and encoder: whether the drive answers, has restarted, has its supply, and counts as the own encoder does.

use super::super::{Controller, Inputs, lasts};
use super::BRIEF_TICKS;
use super::timing::LATE_US;
use crate::sensors::{DriveReading, OLD_US, SupplyReading};
use crate::{RigConstants, TICK_S, seconds, whole_counts};
use core::f32::consts::TAU;
use rig_link::messages::{Fault, Faults};

/// Maximum that own encoder and drive may differ (counts) at rest. A slipped motor turn, 4096 counts, must show.
const DISAGREE_COUNTS: i64 = 1500;
/// Fraction of the disagreement by which the two may grow apart further and still count alike, but for one jump; and of the
/// other's way below which one has not moved.
const ALIKE_FRACTION: i64 = 4;
/// Counts in one tick that no motor makes: this many times what its maximum speed makes, and what the two may differ.
const JUMP_FACTOR: f32 = 1.5;
/// Age (µs) past which a report of the supply says nothing.
const SUPPLY_OLD_US: u64 = 150_000;

/// What the drive's checks remember.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::supervisor) struct DriveChecks {
    disagree_ticks: u16,
    own_turns_ticks: u16,
    /// Own and drive's counts when they began to disagree.
    disagreed_at: Option<[i64; 2]>,
    /// Last reported position (the drive's own counts).
    pub(in crate::supervisor) last_drive_qc: Option<i32>,
    /// When the first of the reports came that show the supply out of its limits (µs), as long as all since then do.
    supply_off_us: Option<u64>,
}

/// Whether a report of this time says nothing about now.
pub(in crate::supervisor) fn is_silent(now_us: u64, report_us: u64) -> bool {
    now_us.saturating_sub(report_us) > OLD_US
}

/// When the report came that shows the supply out of its limits now (µs), if it is.
pub(in crate::supervisor) fn supply_off_us(inputs: &Inputs, constants: &RigConstants) -> Option<u64> {
    let [min, max] = constants.supply_limits_v;
    let supply = supply(inputs)?;
    (!(min..=max).contains(&supply.volts?)).then_some(supply.t_us)
}

/// The last report of the supply, while it says something about now.
pub(in crate::supervisor) fn supply(inputs: &Inputs) -> Option<SupplyReading> {
    inputs.supply.filter(|supply| inputs.now_us.saturating_sub(supply.t_us) < SUPPLY_OLD_US)
}

impl DriveChecks {
    /// Faults that drive and own encoder show, which has moved by so many counts in this tick of a length (s). A drive that
    /// was told to let go is not checked.
    pub(super) fn faults(&mut self, rig: &Controller, inputs: &Inputs, moved_counts: i64, tick_s: f32) -> Faults {
        let (constants, drive_zero) = (&rig.constants, rig.sensing.drive_zero);
        let started = drive_zero.is_matched();
        let mut found = Faults::NONE;
        if inputs.bus_off {
            found.insert(Fault::CanBusOff);
        }
        // One report may be wrong, and the next one lost: two must show it.
        let off_us = supply_off_us(inputs, constants).filter(|_| started);
        self.supply_off_us = off_us.and(self.supply_off_us.or(off_us));
        if self.supply_off_us < off_us {
            found.insert(Fault::Supply);
        }
        let DriveReading::Reports { t_us, position_qc, speed_rpm, .. } = inputs.drive else {
            match inputs.drive {
                DriveReading::Failed => found.insert(Fault::DriveStartUp),
                // Nobody asked it to start again.
                DriveReading::Starting if started => found.insert(Fault::DriveReset),
                _ => {}
            }
            return found;
        };
        if inputs.drive_stalled {
            found.insert(Fault::DriveStall);
        }
        if started && is_silent(inputs.now_us, t_us) {
            // Its last report does not hold any more, so nothing is compared with it.
            found.insert(Fault::DriveSilent);
            return found;
        }
        let counts_per_s = constants.counts_per_s(f32::from(speed_rpm) / 60.0 * TAU);
        let age_s = seconds(inputs.now_us.saturating_sub(t_us));
        let drive_counts = i64::from(position_qc) + whole_counts(counts_per_s * age_s);
        // Before the directions are proven the two may count as they like; the proof compares them.
        let own = inputs.encoder_counts;
        let apart = drive_zero.offset().filter(|_| rig.closed_loop).map(|offset| (own - offset - drive_counts).abs());
        let agree = apart.is_some_and(|apart| apart <= allowed_counts(counts_per_s));
        let last_qc = self.last_drive_qc.replace(position_qc);
        let max_counts_per_s = JUMP_FACTOR * constants.twist_speed_max() * constants.counts_per_rad.abs();
        let max_counts = |seconds: f32| whole_counts(max_counts_per_s * seconds) + DISAGREE_COUNTS;
        if started && !agree && was_reset(last_qc, position_qc, max_counts(TICK_S)) {
            found.insert(Fault::DriveReset);
            return found;
        }
        let Some(apart) = apart else { return found };
        let jumped = (moved_counts.abs() > max_counts(tick_s)).then_some(Fault::EncoderJump);
        if let Some(fault) =
            jumped.or_else(|| self.disagreement([own, drive_counts], moved_counts, apart, !agree)).filter(|_| started)
        {
            found.insert(fault);
        }
        found
    }

    /// How own and drive's counts, which are so far apart, disagree, if they do. The own ones have moved by so many in this tick.
    fn disagreement(&mut self, [own, drive]: [i64; 2], moved: i64, apart: i64, disagree: bool) -> Option<Fault> {
        // A standing encoder dithers by a count, and one that jumps again stands before and after.
        let own_turns = lasts(&mut self.own_turns_ticks, moved.abs() > 1, BRIEF_TICKS);
        let [own_then, drive_then] = *self.disagreed_at.get_or_insert([own, drive]);
        if !disagree {
            self.disagreed_at = None;
        }
        if !lasts(&mut self.disagree_ticks, disagree, BRIEF_TICKS) {
            return None;
        }
        let (own_way, drive_way) = (own - own_then, drive - drive_then);
        Some(if own_turns && drive_way.abs() < own_way.abs() / ALIKE_FRACTION && own_way.abs() > DISAGREE_COUNTS / 2 {
            // The drive does not see what it does, and turns on and on.
            Fault::DriveEncoder
        } else if (own_way - drive_way).abs() < apart / ALIKE_FRACTION {
            Fault::EncoderJump
        } else if own_way.abs() < drive_way.abs() / ALIKE_FRACTION {
            Fault::EncoderStuck
        } else {
            Fault::EncoderDisagrees
        })
    }
}

/// By how much own encoder and drive may differ at a speed (counts/s), once the report has been brought forward by its age
/// (src/README.md 3): as much more as the shaft turns in the longest tick that is not late, for bus, both tasks, and the drive's
/// coarse speed.
fn allowed_counts(counts_per_s: f32) -> i64 {
    DISAGREE_COUNTS + whole_counts(seconds(LATE_US) * counts_per_s.abs())
}

/// Whether a drive's count is nearer to zero than the two may differ, after having been farther away than any motor turns
/// in a tick (counts). After some lost reports a fast shaft passes zero like this as well, but then the own encoder agrees.
fn was_reset(last_qc: Option<i32>, now_qc: i32, max_counts: i64) -> bool {
    last_qc.is_some_and(|last| i64::from(last).abs() > max_counts) && i64::from(now_qc).abs() < DISAGREE_COUNTS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_at_zero_after_a_count_far_away_was_reset() {
        assert!(was_reset(Some(8001), 0, 8000) && was_reset(Some(-9000), 1499, 8000));
        for (last_qc, now_qc) in [(None, 0), (Some(7999), 0), (Some(8001), 1500)] {
            assert!(!was_reset(last_qc, now_qc, 8000), "{last_qc:?} {now_qc}");
        }
        // At 9000 counts in a tick of 10 ms, own encoder and drive may be a tick apart.
        assert!(allowed_counts(9e5) > 9000 && allowed_counts(0.0) < 4096);
    }

    /// The first fault of ticks whose own and drive's counts come from these functions of the tick.
    fn first_fault(own: fn(i64) -> i64, drive: fn(i64) -> i64) -> Option<Fault> {
        let mut checks = DriveChecks::default();
        (0..100).find_map(|k| disagreement(&mut checks, own, drive, k))
    }

    fn disagreement(checks: &mut DriveChecks, own: fn(i64) -> i64, drive: fn(i64) -> i64, k: i64) -> Option<Fault> {
        let apart = (own(k) - drive(k)).abs();
        checks.disagreement([own(k), drive(k)], own(k) - own(k - 1), apart, apart > allowed_counts(0.0))
    }

    #[test]
    fn counts_that_part_are_told_apart_by_how_they_go_on() {
        assert_eq!(first_fault(|k| 300 * k, |k| 300 * k + 1400), None);
        assert_eq!(first_fault(|k| 300 * k, |k| 300 * k + 4096), Some(Fault::EncoderJump));
        assert_eq!(first_fault(|_| 0, |k| 600 * k), Some(Fault::EncoderStuck));
        assert_eq!(first_fault(|k| 300 * k, |k| 600 * k), Some(Fault::EncoderDisagrees));
        assert_eq!(first_fault(|k| 600 * k, |k| k % 2), Some(Fault::DriveEncoder));
        // A jump while the shaft stands is the own encoder's.
        assert_eq!(first_fault(|k| if k < 10 { 0 } else { 4096 + k % 2 }, |_| 0), Some(Fault::EncoderJump));
        // So is the next one, of which the drive sees nothing either: it goes on holding the load.
        let mut checks = DriveChecks::default();
        let mut all = (0..100).map(|k| disagreement(&mut checks, |k| 4096 * (k / 20), |_| 0, k));
        assert!(all.all(|fault| fault != Some(Fault::DriveEncoder)));
        // A disagreement that ends in time is none.
        assert_eq!(first_fault(|k| if k % 8 == 7 { 0 } else { 4096 }, |_| 0), None);
    }
}
