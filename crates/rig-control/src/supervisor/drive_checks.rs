//! Drive and encoder: is it there, did it restart, do both count the same.

use super::checks::{lasts, tick_seconds};
use super::{Inputs, Rig, ticks};
use crate::sensors::DriveReading;
use crate::{seconds, whole_counts};
use core::f32::consts::TAU;
use rig_link::messages::{Fault, Faults};

/// Age (µs) at which the drive's reports count as missing: five of its 10 ms periods (hardware.md 2.6).
const DRIVE_SILENT_US: u64 = 55_000;
/// Most that own encoder and drive may differ (counts), at rest and for each count per second of speed, once the report
/// has been brought forward by its age (hardware.md 6.3): what is left is the bus, both tasks, and the drive's coarse
/// speed. A slipped motor turn, 4096 counts, must show.
const DISAGREE_COUNTS: i64 = 1500;
const DISAGREE_S: f32 = 0.012;
const DISAGREE_TICKS: u16 = ticks(8);
/// Share of the disagreement by which the two may grow apart further and still count alike, but for one jump.
const ALIKE_SHARE: i64 = 4;
/// Share of the drive's way below which the own encoder has not moved.
const STUCK_SHARE: i64 = 10;
/// Counts in one tick that no motor makes: this many times what its greatest speed makes, and some for a tick's jitter.
const JUMP_FACTOR: f32 = 1.5;
const JUMP_COUNTS: f32 = 500.0;
/// A drive position this near to zero after having been this far away has been reset (counts).
const RESET_NEAR: i32 = 400;
const RESET_FAR: i32 = 8000;
/// How long the supply must be out of its limits: two of the drive's reports.
const SUPPLY_TICKS: u16 = ticks(10);
/// Age (µs) past which a report of the supply tells nothing.
const SUPPLY_OLD_US: u64 = 150_000;

/// What has to last, and what was seen last.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DriveChecks {
    disagree_ticks: u16,
    /// Own and drive's counts when they began to disagree.
    disagreed_at: Option<[i64; 2]>,
    pub(super) last_drive_qc: Option<i32>,
    supply_ticks: u16,
}

/// Whether a report of this time says nothing about now.
pub(super) fn is_silent(now_us: u64, report_us: u64) -> bool {
    now_us.saturating_sub(report_us) > DRIVE_SILENT_US
}

impl Rig<'_> {
    /// Whether the supply is known to be out of its limits now.
    pub(super) fn supply_is_off(&self, inputs: &Inputs) -> bool {
        let [least, most] = self.constants.supply_limits_v;
        inputs
            .supply
            .is_some_and(|s| inputs.now_us.saturating_sub(s.t_us) < SUPPLY_OLD_US && !(least..=most).contains(&s.volts))
    }

    /// What the drive and the own encoder show. A drive that was told to let go is asked nothing.
    pub(super) fn drive_faults(&mut self, inputs: &Inputs) -> Faults {
        let started = self.matched;
        let mut found = Faults::NONE;
        if inputs.bus_off {
            found.insert(Fault::CanBusOff);
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
            found.insert(Fault::DriveSilent);
            // What it said last is no longer so.
            return found;
        }
        let far_before = self.checks.drive.last_drive_qc.is_some_and(|last| last.saturating_abs() > RESET_FAR);
        self.checks.drive.last_drive_qc = Some(position_qc);
        if started && far_before && position_qc.saturating_abs() < RESET_NEAR {
            found.insert(Fault::DriveReset);
            return found;
        }
        let off = started && self.supply_is_off(inputs);
        if lasts(&mut self.checks.drive.supply_ticks, off, SUPPLY_TICKS) {
            found.insert(Fault::Supply);
        }
        let age_s = seconds(inputs.now_us.saturating_sub(t_us));
        let encoder = self.encoder_fault(inputs, position_qc, speed_rpm, age_s);
        encoder.filter(|_| started).into_iter().for_each(|fault| found.insert(fault));
        found
    }

    fn encoder_fault(&mut self, inputs: &Inputs, position_qc: i32, speed_rpm: i16, age_s: f32) -> Option<Fault> {
        let c = self.constants;
        let own = inputs.encoder_counts;
        let most = JUMP_FACTOR * c.twist_speed_max() * c.counts_per_rad.abs() * tick_seconds(self.checks.apart_us);
        if self.checks.moved.abs() > whole_counts(most + JUMP_COUNTS) {
            return Some(Fault::EncoderJump);
        }
        let offset = self.drive_offset?;
        let counts_per_s = f32::from(speed_rpm) / 60.0 * TAU / c.gear_ratio * c.counts_per_rad.abs();
        let drive = i64::from(position_qc) + whole_counts(counts_per_s * age_s);
        let apart = (own - offset - drive).abs();
        let bad = apart > DISAGREE_COUNTS + whole_counts(DISAGREE_S * counts_per_s.abs());
        let [own_then, drive_then] = *self.checks.drive.disagreed_at.get_or_insert([own, drive]);
        if !bad {
            self.checks.drive.disagreed_at = None;
        }
        if !lasts(&mut self.checks.drive.disagree_ticks, bad, DISAGREE_TICKS) {
            return None;
        }
        let (own_way, drive_way) = (own - own_then, drive - drive_then);
        Some(if (own_way - drive_way).abs() < apart / ALIKE_SHARE {
            Fault::EncoderJump
        } else if own_way.abs() < drive_way.abs() / STUCK_SHARE {
            Fault::EncoderStuck
        } else {
            Fault::EncoderDisagrees
        })
    }
}
