//! The command to the drive.

use super::fault_policy::Response;
use super::guard::healthy_lag_rad;
use super::modes::{EStopContact, Mode};
use super::{Controller, DriveLoop, Inputs};
use crate::sensors::DriveReading;
use crate::{TICK_S, whole_counts};
use rmds405::DriveCommand;

/// Part of the current limit that is allowed before the shaft has been seen to stand: several times what the heaviest load of
/// the default scene needs.
const STARTING_CURRENT: f32 = 0.25;

impl Controller {
    pub(super) fn drive_command(&mut self, inputs: &Inputs) -> DriveCommand {
        let restart = core::mem::take(&mut self.restart_drive);
        match (&self.mode, self.guard.latched.response()) {
            // A Reset when the contact opens, again while it is open, and once more when it closes: a motor that is
            // connected again must find no old target.
            (Mode::EStop(EStopContact::Closing), _) => DriveCommand::LetGo,
            (Mode::EStop(EStopContact::Open | EStopContact::Closed), _) => DriveCommand::PowerOff,
            (_, Some(Response::LetGo)) => DriveCommand::LetGo,
            _ if restart => match self.drive_loop {
                DriveLoop::Open => DriveCommand::RestartOpenLoop,
                DriveLoop::Closed => DriveCommand::Restart,
            },
            (_, Some(Response::Wait)) => DriveCommand::Silence,
            (mode, Some(Response::Hold | Response::HoldByDrive | Response::HoldIfHeard) | None) => {
                if self.drive_loop == DriveLoop::Open {
                    let pwm = if let Mode::Proving(proving) = mode { proving.pwm } else { 0 };
                    return DriveCommand::Voltage { pwm };
                }
                self.follow(inputs).unwrap_or(DriveCommand::Silence)
            }
        }
    }

    /// To the shaft's set-point; `None` where the drive's zero is not known, or the set-point is not finite.
    fn follow(&self, inputs: &Inputs) -> Option<DriveCommand> {
        let offset = self.sensing.drive_zero.offset()?;
        let DriveReading::Reports { position_qc, .. } = inputs.drive else { return None };
        let lag_s = self.tracking.as_ref().map_or(0.0, |tracking| tracking.homed.found.drive_lag_s);
        // The set-point is where the shaft is to be at the end of this tick.
        let lead_s = (lag_s - TICK_S).max(0.0);
        let counts = (self.shaft.position + lead_s * self.shaft.speed) * self.constants.counts_per_rad;
        // A float to integer cast saturates; NaN would become 0, so it is caught before.
        if !counts.is_finite() {
            return None;
        }
        // Whatever else goes wrong, the drive is never sent farther from its reported position than it may lag.
        let max_lag = whole_counts(healthy_lag_rad(self.shaft.speed) * self.constants.counts_per_rad.abs());
        let here = i64::from(position_qc);
        let position = (whole_counts(counts) - offset).clamp(here - max_lag, here + max_lag);
        let position = position.clamp(i64::from(i32::MIN), i64::from(i32::MAX));
        // Room to catch up, not more: a wrong target must not be reached at full speed.
        let speed = (1.3 * self.shaft.speed.abs() + 1.0).min(self.constants.twist_speed_max());
        // The first hold after a start needs no more, and cannot do much.
        let current = if self.sensing.drive_zero.is_matched() { 1.0 } else { STARTING_CURRENT };
        Some(DriveCommand::Follow {
            position_qc: position as i32,
            speed_limit_rpm: self.constants.motor_rpm(speed),
            current_limit_ma: (current * f32::from(self.constants.current_limit_ma)) as i16,
        })
    }
}
