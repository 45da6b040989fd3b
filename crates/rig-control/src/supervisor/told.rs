//! What a tick tells: the drive where to go, the host what there is to see.

use super::fault_policy::Response;
use super::{Inputs, Motion, Rig};
use crate::observer::Observation;
use crate::sensors::DriveReading;
use crate::{angle_rad, whole_counts};
use rig_link::messages::{Counters, Sensors, State, Telemetry};
use rmds405::DriveCommand;

/// How far from its reported position the drive may be sent (rad, and seconds of its speed): more than it lags when well.
const LEASH_RAD: f32 = 1.0;
const LEASH_S: f32 = 0.3;

impl Rig<'_> {
    pub(super) fn drive_command(&mut self, inputs: &Inputs) -> DriveCommand {
        let restart = core::mem::take(&mut self.restart_drive);
        match (self.state, self.latched.response()) {
            // A Reset when the contact opens, again while it is open, and once more when it closes: what the motor is
            // connected to again must hold no old target.
            (State::EStop, _) if self.estop_closes => return DriveCommand::LetGo,
            (State::EStop, _) => return DriveCommand::PowerOff,
            (_, Some(Response::LetGo)) => return DriveCommand::LetGo,
            _ if restart => return DriveCommand::Restart,
            (_, Some(Response::Wait)) => return DriveCommand::Silence,
            (_, Some(Response::Hold | Response::HoldByDrive | Response::HoldIfHeard) | None) => {}
        }
        let (Some(offset), DriveReading::Reports { position_qc, .. }) = (self.drive_offset, inputs.drive) else {
            return DriveCommand::Silence;
        };
        let lag_s = self.homed.map_or(0.0, |h| h.drive_lag_s);
        let counts = (self.shaft.position + lag_s * self.shaft.speed) * self.constants.counts_per_rad;
        // A float to integer cast saturates; NaN would become 0, so it is caught before.
        if !counts.is_finite() {
            return DriveCommand::Silence;
        }
        // On a leash: whatever else goes wrong, the drive is never sent far from where it says it is.
        let leash = whole_counts((LEASH_RAD + LEASH_S * self.shaft.speed.abs()) * self.constants.counts_per_rad.abs());
        let here = i64::from(position_qc);
        let position = (whole_counts(counts) - offset).clamp(here - leash, here + leash);
        let position = position.clamp(i64::from(i32::MIN), i64::from(i32::MAX));
        // Room to catch up, not more: a wrong target must not be reached at full speed.
        let speed = (1.3 * self.shaft.speed.abs() + 1.0).min(self.constants.twist_speed_max());
        DriveCommand::Follow {
            position_qc: position as i32,
            speed_limit_rpm: self.constants.motor_rpm(speed),
            current_limit_ma: self.constants.current_limit_ma,
        }
    }

    /// Until the set-point is at its target (s): crossing friction, then the move. `None` before a move's first tick, and while it stops.
    pub(super) fn time_left_s(&self) -> Option<f32> {
        let crossing = &self.position_loop.crossing;
        let wait_s = if crossing.is_waiting() { crossing.left_s() } else { 0.0 };
        self.run_s.map(|run_s| wait_s + run_s)
    }

    pub(super) fn telemetry(
        &self,
        inputs: &Inputs,
        gap_m: Option<f32>,
        shaft_rad: f32,
        observed: Option<Observation>,
    ) -> Telemetry {
        let (drive_current_a, drive_speed_rad_per_s) = match inputs.drive {
            DriveReading::Reports { speed_rpm, current_ma, .. } => {
                (f32::from(current_ma) * 1e-3, f32::from(speed_rpm) * (core::f32::consts::TAU / 60.0))
            }
            _ => (0.0, 0.0),
        };
        let controlled = matches!(self.state, State::Moving | State::Holding) && self.homed.is_some();
        let planned = matches!(self.motion, Motion::Load { .. }) && controlled;
        Telemetry {
            t_us: inputs.now_us,
            state: self.state,
            fault: self.latched.gravest(),
            faults: self.latched.all(),
            limit: self.limit,
            target_m: planned.then(|| self.planner.target_m()),
            setpoint_m: planned.then(|| self.planner.set_point_m()),
            position_m: self.homed.zip(gap_m).map(|(h, gap)| h.reference_gap_m - gap),
            twist_rad: self.homed.map(|h| shaft_rad - h.zero_rad),
            load_n: observed.map(|_| self.observer.load_n()),
            tr_rad_per_m: observed.map(|o| o.point.tr_rad_per_m()),
            drive_current_a,
            drive_speed_rad_per_s,
            time_left_s: self.time_left_s().filter(|_| planned),
            twist_scale: self.homed.map(|h| h.twist_scale),
            counters: Counters { late_ticks: self.late_ticks, ..inputs.counters },
        }
    }

    /// Readings of a tick; `gap_m` is what [`Rig::step`] made of the LVDT's.
    pub fn sensors(&self, inputs: &Inputs, gap_m: Option<f32>) -> Sensors {
        let counts_per_rad = self.constants.counts_per_rad;
        Sensors {
            gap_m,
            shaft_rad: angle_rad(inputs.encoder_counts, counts_per_rad),
            drive_rad: match inputs.drive {
                DriveReading::Reports { position_qc, .. } => Some(position_qc as f32 / counts_per_rad),
                DriveReading::Starting | DriveReading::Failed | DriveReading::Released => None,
            },
            supply_v: inputs.supply.map(|supply| supply.volts),
            estop_open: inputs.estop_open,
            upper_limit_open: inputs.upper_limit_open,
            lower_limit_open: inputs.lower_limit_open,
        }
    }
}
