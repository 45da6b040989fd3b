//! The shaft: whether it stands, follows its set-point, is held, and stays within the strings' range.

use super::super::fault_policy::{Latched, Response};
use super::super::sensing::DriveZero;
use super::super::{Controller, Inputs, STANDING_RPM, lasts};
use super::{BRIEF_TICKS, SHORT_TICKS, drive};
use crate::mechanism::OUTSIDE_RAD;
use crate::sensors::DriveReading;
use crate::whole_counts;
use core::f32::consts::TAU;
use rig_link::messages::State;

/// How far the shaft may stay behind its set-point, or go away from where it is held (rad): ten times the overshoot of a shaft
/// that is stopped from a fast move of the emulated rig; and how far besides while it turns (s of its speed).
const LAG_RAD: f32 = 0.8;
const LAG_S: f32 = 0.25;
/// Neither encoder input sees the shaft if both counts stay within the first of these (rad) while the set-point turns by the second:
/// several times what a drive lags before its motor starts, and little enough to end it before the motor is at full speed.
const UNSEEN_RAD: [f32; 2] = [0.02, 0.2];
/// A blocked motor draws more than this fraction of the current limit. A motor that turns unseen draws it only while it accelerates.
const BLOCKED_CURRENT: f32 = 0.5;

/// How far the shaft of a healthy drive may stay behind a set-point that turns at a speed (rad/s), rad.
pub(in crate::supervisor) fn healthy_lag_rad(speed_rad_per_s: f32) -> f32 {
    LAG_RAD + LAG_S * speed_rad_per_s.abs()
}

/// Whether the shaft is to follow its set-point.
fn follows(rig: &Controller) -> bool {
    rig.sensing.drive_zero.is_matched() && rig.state() != State::Fault
}

/// What the shaft's checks remember.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::supervisor) struct ShaftChecks {
    last_counts: Option<i64>,
    /// Own counts in this tick.
    pub(super) moved_counts: i64,
    /// How long the shaft has stood, by the own encoder and by the drive.
    pub(in crate::supervisor) still_ticks: u16,
    lag_ticks: u16,
    away_ticks: u16,
    /// Own and drive's counts when either last moved, and the set-point then (rad).
    last_seen: Option<([i64; 2], f32)>,
    unseen_ticks: u16,
    /// Twist beyond which it is out of range again, after a `clear` outside the range (rad).
    cleared_twist_rad: f32,
}

impl ShaftChecks {
    /// After a `clear` at this twist (rad).
    pub(super) fn cleared(twist_rad: Option<f32>) -> Self {
        let cleared_twist_rad = twist_rad.map_or(0.0, |twist_rad| twist_rad.abs() + OUTSIDE_RAD);
        Self { cleared_twist_rad, ..Self::default() }
    }

    /// Watches whether the shaft stands, by the own encoder and, where the drive reports, by the drive as well.
    pub(super) fn watch_standing(&mut self, rig: &Controller, inputs: &Inputs, tick_s: f32) {
        let constants = &rig.constants;
        let own = inputs.encoder_counts;
        self.moved_counts = self.last_counts.replace(own).map_or(0, |last| own - last);
        let standing_rad_per_s = f32::from(STANDING_RPM) / 60.0 * TAU / constants.gear_ratio;
        let standing_counts_per_s = standing_rad_per_s * constants.counts_per_rad.abs();
        let own_turns = self.moved_counts.abs() > whole_counts(standing_counts_per_s * tick_s);
        let drive_turns = matches!(inputs.drive,
            DriveReading::Reports { speed_rpm, t_us, .. }
                if speed_rpm.unsigned_abs() > STANDING_RPM && !drive::is_silent(inputs.now_us, t_us));
        self.still_ticks = if own_turns || drive_turns { 0 } else { self.still_ticks.saturating_add(1) };
    }

    /// The set-point turns and neither count moves, though the motor is not blocked: the encoder, which both inputs share, has no
    /// supply, and the drive turns ever faster after a count that stands; or a motor lead is off.
    pub(super) fn is_unseen(&mut self, rig: &Controller, inputs: &Inputs) -> bool {
        let DriveReading::Reports { position_qc, current_ma, .. } = inputs.drive else { return false };
        let counts = [inputs.encoder_counts, position_qc.into()];
        let set_point_rad = rig.shaft.position;
        let (last_counts, last_rad) = *self.last_seen.get_or_insert((counts, set_point_rad));
        let [still_rad, turned_rad] = UNSEEN_RAD;
        let still_counts = whole_counts(still_rad * rig.constants.counts_per_rad.abs());
        let moved = counts.iter().zip(last_counts).any(|(now, then)| (now - then).abs() > still_counts);
        if moved || !follows(rig) {
            self.last_seen = Some((counts, set_point_rad));
        }
        let blocked = f32::from(current_ma).abs() > BLOCKED_CURRENT * f32::from(rig.constants.current_limit_ma);
        let turned = (set_point_rad - last_rad).abs() > turned_rad;
        lasts(&mut self.unseen_ticks, turned && follows(rig) && !moved && !blocked, BRIEF_TICKS)
    }

    /// Held by a fault, or by the first command after a start, the shaft has gone away all the same.
    pub(super) fn not_held(&mut self, rig: &Controller, inputs: &Inputs, latched: Latched) -> bool {
        let drive_zero = rig.sensing.drive_zero;
        let by_fault =
            matches!(latched.response(), Some(Response::Hold | Response::HoldByDrive | Response::HoldIfHeard))
                && drive_zero.offset().is_some();
        let by_start = latched.response().is_none() && matches!(drive_zero, DriveZero::Rough(_));
        let held = rig.closed_loop && (by_fault || by_start);
        let shaft_rad = match (latched.own_encoder_is_wrong(), inputs.drive) {
            (false, _) => Some(rig.sensing.readings.shaft_rad),
            (true, DriveReading::Reports { position_qc, .. }) => {
                drive_zero.shaft_rad(position_qc.into(), &rig.constants)
            }
            (true, _) => None,
        };
        let away = shaft_rad.is_some_and(|shaft_rad| (shaft_rad - rig.shaft.position).abs() > LAG_RAD);
        lasts(&mut self.away_ticks, held && away, BRIEF_TICKS)
    }

    /// The twist is farther out than the strings' range, or than where it was cleared, by more than [`OUTSIDE_RAD`]. Nearer, the
    /// bound follows it.
    pub(super) fn twist_is_outside(&mut self, rig: &Controller) -> bool {
        let Some(tracking) = &rig.tracking else { return false };
        let twist_rad = tracking.twist_rad(rig.sensing.readings.shaft_rad).abs();
        let max_rad = (rig.table.metadata().twist_max_rad + OUTSIDE_RAD).max(self.cleared_twist_rad);
        self.cleared_twist_rad = self.cleared_twist_rad.min(twist_rad + OUTSIDE_RAD);
        twist_rad > max_rad
    }

    /// The shaft stays behind its set-point.
    pub(super) fn lags(&mut self, rig: &Controller) -> bool {
        let Controller { shaft, sensing, .. } = rig;
        let behind = (shaft.position - sensing.readings.shaft_rad).abs() > healthy_lag_rad(shaft.speed);
        lasts(&mut self.lag_ticks, behind && follows(rig), SHORT_TICKS)
    }
}
