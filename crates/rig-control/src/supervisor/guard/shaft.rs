//! The shaft: whether it stands, follows its set-point, is held, and stays within the strings' range.

use super::super::fault_policy::{Latched, Response};
use super::super::sensing::{DriveZero, Sensing};
use super::super::{Controller, Inputs, STANDING_RPM, lasts};
use super::{BRIEF_TICKS, SHORT_TICKS, drive};
use crate::RigConstants;
use crate::mechanism::OUTSIDE_RAD;
use crate::sensors::DriveReading;
use crate::whole_counts;
use core::f32::consts::TAU;
use rig_link::messages::State;

/// How far the shaft may stay behind its set-point, or go away from where it is held (rad): ten times the overshoot of a shaft
/// that is stopped from a fast move of the emulated rig; and how far besides while it turns (s of its speed).
const LAG_RAD: f32 = 0.8;
pub(in crate::supervisor) const LAG_S: f32 = 0.25;
/// Neither encoder input sees the shaft if both counts stay within the first of these (rad of the motor) while they are off the
/// set-point by more than the second, at which a healthy drive turns its motor at once.
const UNSEEN_MOTOR_RAD: [f32; 2] = [1.2, 3.1];
/// A blocked motor draws more than this fraction of the current limit. A motor that turns unseen draws it only while it accelerates.
const BLOCKED_CURRENT: f32 = 0.5;
/// Fraction of the motor's maximum speed above which a voltage shows that the motor turns.
const TURNS_FRACTION: f32 = 0.25;

/// How far the shaft of a healthy drive may stay behind a set-point that turns at a speed (rad/s), rad.
pub(in crate::supervisor) fn healthy_lag_rad(speed_rad_per_s: f32) -> f32 {
    LAG_RAD + LAG_S * speed_rad_per_s.abs()
}

/// Whether the shaft is to follow its set-point.
fn follows(rig: &Controller) -> bool {
    rig.sensing.drive_zero.is_matched() && rig.state() != State::Fault
}

/// Whether the drive puts more voltage on the motor than its resistance needs for its current (mA): the rest is what a turning motor
/// induces.
fn turns_by_voltage(inputs: &Inputs, current_ma: i16, rig: &RigConstants) -> bool {
    let Some(supply) = drive::supply(inputs) else { return false };
    let [min_v, max_v] = rig.supply_limits_v;
    let on_motor_v = supply.on_motor * supply.volts.unwrap_or(0.5 * (min_v + max_v));
    let induced_v = on_motor_v - f32::from(current_ma) * 1e-3 * rig.motor_resistance_ohm;
    induced_v.abs() > TURNS_FRACTION * rig.motor_speed_max_rad_per_s * rig.motor_torque_constant_nm_per_a
}

/// Whether the drive holds the shaft because of a fault.
fn is_held_by_fault(rig: &Controller, latched: Latched) -> bool {
    let holds = matches!(latched.response(), Some(Response::Hold | Response::HoldByDrive | Response::HoldIfHeard));
    holds && rig.closed_loop && rig.sensing.drive_zero.offset().is_some()
}

/// Whether the shaft is farther from its set-point than `most_rad`, by the own encoder, or by the drive's count where a fault says that
/// the own encoder is wrong.
fn off_set_point(rig: &Controller, inputs: &Inputs, latched: Latched, most_rad: f32) -> bool {
    let Sensing { readings, drive_zero, .. } = &rig.sensing;
    let shaft_rad = match (latched.own_encoder_is_wrong(), inputs.drive) {
        (false, _) => Some(readings.shaft_rad),
        (true, DriveReading::Reports { position_qc, .. }) => drive_zero.shaft_rad(position_qc.into(), &rig.constants),
        (true, _) => None,
    };
    shaft_rad.is_some_and(|shaft_rad| (shaft_rad - rig.shaft.position).abs() > most_rad)
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
    /// Own and drive's counts when either last moved.
    last_seen: Option<[i64; 2]>,
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
        let own = inputs.encoder_counts;
        self.moved_counts = self.last_counts.replace(own).map_or(0, |last| own - last);
        let standing_counts_per_s = rig.constants.counts_per_s(f32::from(STANDING_RPM) / 60.0 * TAU);
        let own_turns = self.moved_counts.abs() > whole_counts(standing_counts_per_s * tick_s);
        let drive_turns = matches!(inputs.drive,
            DriveReading::Reports { speed_rpm, t_us, .. }
                if speed_rpm.unsigned_abs() > STANDING_RPM && !drive::is_silent(inputs.now_us, t_us));
        self.still_ticks = if own_turns || drive_turns { 0 } else { self.still_ticks.saturating_add(1) };
    }

    /// Neither count moves, and the motor turns by its voltage, or the shaft is off its set-point though the motor is not blocked: the
    /// encoder, which both inputs share, has no supply, and the drive turns ever faster after a count that stands; or a motor lead is
    /// off.
    pub(super) fn is_unseen(&mut self, rig: &Controller, inputs: &Inputs, latched: Latched) -> bool {
        let DriveReading::Reports { t_us, position_qc, current_ma, .. } = inputs.drive else { return false };
        let counts = [inputs.encoder_counts, position_qc.into()];
        let last_seen = *self.last_seen.get_or_insert(counts);
        let [still_rad, off_rad] = UNSEEN_MOTOR_RAD.map(|motor_rad| motor_rad / rig.constants.gear_ratio);
        let still_counts = whole_counts(still_rad * rig.constants.counts_per_rad.abs());
        let moved = counts.iter().zip(last_seen).any(|(now, then)| (now - then).abs() > still_counts);
        if moved {
            self.last_seen = Some(counts);
        }
        let blocked = f32::from(current_ma).abs() > BLOCKED_CURRENT * f32::from(rig.constants.current_limit_ma);
        let matched = rig.sensing.drive_zero.is_matched();
        // A drive whose loops are slow lags more, and turns the motor all the same.
        let off_rad = off_rad + LAG_S * rig.shaft.speed.abs();
        let to_turn = matched && off_set_point(rig, inputs, latched, off_rad) && !blocked;
        let turns = to_turn || turns_by_voltage(inputs, current_ma, &rig.constants);
        let driven = (follows(rig) || is_held_by_fault(rig, latched)) && !drive::is_silent(inputs.now_us, t_us);
        lasts(&mut self.unseen_ticks, driven && turns && !moved, BRIEF_TICKS)
    }

    /// Held by a fault, or by the first command after a start, the shaft has gone away all the same.
    pub(super) fn not_held(&mut self, rig: &Controller, inputs: &Inputs, latched: Latched) -> bool {
        let by_start =
            rig.closed_loop && latched.response().is_none() && matches!(rig.sensing.drive_zero, DriveZero::Rough(_));
        let held = is_held_by_fault(rig, latched) || by_start;
        lasts(&mut self.away_ticks, held && off_set_point(rig, inputs, latched, LAG_RAD), BRIEF_TICKS)
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
