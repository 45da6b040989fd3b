//! The command to the drive, and what the host is shown, read from the rig after a step.

use super::fault_policy::{Response, UNHEARD};
use super::guard::{LAG_S, drive_is_silent, healthy_lag_rad};
use super::modes::Mode;
use super::{Controller, Inputs};
use crate::sensors::DriveReading;
use crate::{TICK_S, whole_counts};
use core::f32::consts::TAU;
use rig_link::messages::{Counters, Doubts, Fault, Sensors, Telemetry};
use rmds405::DriveCommand;

/// Part of the current limit that is allowed before the shaft has been seen to stand: several times what the heaviest load of
/// the default scene needs.
const STARTING_CURRENT: f32 = 0.25;

impl Controller {
    pub(super) fn drive_command(&mut self, inputs: &Inputs) -> DriveCommand {
        let restart = core::mem::take(&mut self.restart_drive);
        if restart {
            self.speed_lately = 0.0;
        }
        match (&self.mode, self.guard.latched.response()) {
            // A Reset when the contact opens, again while it is open, and once more when it closes: a motor that is
            // connected again must find no old target.
            (Mode::EStop { closing: true, .. }, _) => DriveCommand::LetGo,
            (Mode::EStop { .. }, _) => DriveCommand::PowerOff,
            // It cannot be told to let go.
            (_, Some(Response::LetGo)) if self.guard.latched.all.meets(UNHEARD) => DriveCommand::PowerOff,
            (_, Some(Response::LetGo)) => DriveCommand::LetGo,
            // At the wrong bit rate nothing is to be sent.
            _ if self.faults().contains(Fault::ClockSource) => DriveCommand::Silence,
            _ if restart && self.closed_loop => DriveCommand::Restart,
            _ if restart => DriveCommand::RestartOpenLoop,
            (_, Some(Response::Wait)) => DriveCommand::Silence,
            (mode, Some(Response::Hold | Response::HoldByDrive | Response::HoldIfHeard) | None) => {
                if !self.closed_loop {
                    let pwm = if let Mode::Proving(proving) = mode { proving.pwm } else { 0 };
                    return DriveCommand::Voltage { pwm };
                }
                self.follow(inputs).unwrap_or(DriveCommand::Silence)
            }
        }
    }

    /// To the shaft's set-point; `None` where the drive's zero is not known, or the set-point is not finite.
    fn follow(&mut self, inputs: &Inputs) -> Option<DriveCommand> {
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
        // Room to catch up, not more: a wrong target must not be reached at full speed. A shaft that could not follow a fast set-point
        // has its speed for a while after that has stopped, but not in a fault.
        let lately = if matches!(self.mode, Mode::Fault) { 0.0 } else { (1.0 - TICK_S / LAG_S) * self.speed_lately };
        self.speed_lately = self.shaft.speed.abs().max(lately);
        let speed = (1.3 * self.speed_lately + 1.0).min(self.constants.twist_speed_max());
        // The first hold after a start needs no more, and cannot do much.
        let current = if self.sensing.drive_zero.is_matched() { 1.0 } else { STARTING_CURRENT };
        Some(DriveCommand::Follow {
            position_qc: position as i32,
            speed_limit_rpm: self.constants.motor_rpm(speed),
            current_limit_ma: (current * f32::from(self.constants.current_limit_ma)) as i16,
        })
    }

    /// Telemetry of the tick that these inputs were stepped in.
    pub(super) fn telemetry(&self, inputs: &Inputs) -> Telemetry {
        let (drive_current_a, drive_speed_rad_per_s) = match inputs.drive {
            DriveReading::Reports { t_us, .. } if drive_is_silent(inputs.now_us, t_us) => (f32::NAN, f32::NAN),
            DriveReading::Reports { speed_rpm, current_ma, .. } => {
                (f32::from(current_ma) * 1e-3, f32::from(speed_rpm) * (TAU / 60.0))
            }
            // It gives no torque.
            _ => (0.0, 0.0),
        };
        let planner = self.mode.load_control().map(|control| &control.planner);
        let tracking = self.tracking.as_ref();
        let gap_m = self.sensing.readings.lvdt.gap_m();
        let observed = tracking.and_then(|tracking| gap_m.and(Some((tracking, tracking.observation?))));
        Telemetry {
            t_us: inputs.now_us,
            state: self.state(),
            fault: self.fault(),
            faults: self.faults(),
            limit: self.limit,
            doubts: tracking.map_or(Doubts::NONE, |tracking| tracking.doubts(gap_m.is_some())),
            target_m: planner.map(|planner| planner.target_m),
            setpoint_m: planner.map(|planner| planner.set_point_m()),
            position_m: tracking.zip(gap_m).map(|(tracking, gap_m)| tracking.homed.found.reference_gap_m - gap_m),
            twist_rad: tracking.map(|tracking| tracking.twist_rad(self.sensing.readings.shaft_rad)),
            load_n: observed.map(|(tracking, _)| tracking.observer.load_n()),
            load_error_n: observed.map(|(_, observation)| observation.load_error_n),
            position_error_m: tracking.zip(gap_m).map(|(tracking, _)| tracking.position_error_m(&self.constants)),
            tr_rad_per_m: observed.map(|(_, observation)| observation.point.tr_rad_per_m()),
            drive_current_a,
            drive_speed_rad_per_s,
            time_left_s: match &self.mode {
                Mode::Moving(planned) => planned.time_left_s(),
                // At its target.
                Mode::Holding(_) => Some(0.0),
                _ => None,
            },
            twist_scale: tracking.map(|tracking| tracking.homed.found.twist_scale),
            gap_m,
            shaft_rad: self.sensing.readings.shaft_rad,
            supply_v: inputs.supply.and_then(|supply| supply.volts),
        }
    }

    /// What the sensors showed in the tick that these inputs were stepped in, beside what the board has counted.
    pub fn sensors(&self, inputs: &Inputs, counters: Counters) -> Sensors {
        Sensors {
            gap_m: self.sensing.readings.lvdt.gap_m(),
            shaft_rad: self.sensing.readings.shaft_rad,
            drive_rad: match inputs.drive {
                DriveReading::Reports { position_qc, .. } => Some(position_qc as f32 / self.constants.counts_per_rad),
                _ => None,
            },
            supply_v: inputs.supply.and_then(|supply| supply.volts),
            estop_open: inputs.estop_open,
            upper_limit_open: inputs.upper_limit_open,
            lower_limit_open: inputs.lower_limit_open,
            rest_tolerance_m: self
                .tracking
                .as_ref()
                .zip(self.mode.load_control())
                .map(|(tracking, control)| control.position_loop.rest.left_alone_m(&tracking.homed.found)),
            counters,
        }
    }
}
