//! What the host is shown, read from the rig after a step.

use super::modes::Mode;
use super::tracking::LoadTracking;
use super::{Controller, Inputs};
use crate::sensors::DriveReading;
use core::f32::consts::TAU;
use rig_link::messages::{Counters, Doubts, Sensors, Telemetry};

impl Controller {
    /// Telemetry of the tick that these inputs were stepped in.
    pub fn telemetry(&self, inputs: &Inputs) -> Telemetry {
        let (drive_current_a, drive_speed_rad_per_s) = match inputs.drive {
            DriveReading::Reports { speed_rpm, current_ma, .. } => {
                (f32::from(current_ma) * 1e-3, f32::from(speed_rpm) * (TAU / 60.0))
            }
            _ => (0.0, 0.0),
        };
        let planner = self.mode.load_control().map(|control| &control.planner);
        let tracking = self.tracking.as_ref();
        let observed = tracking.and_then(|tracking| Some((tracking, tracking.observation?)));
        let gap_m = self.sensing.readings.lvdt.gap_m();
        Telemetry {
            t_us: inputs.now_us,
            state: self.state(),
            fault: self.fault(),
            faults: self.faults(),
            limit: self.limit,
            doubts: tracking.map_or(Doubts::NONE, LoadTracking::doubts),
            target_m: planner.map(|planner| planner.target_m()),
            setpoint_m: planner.map(|planner| planner.set_point_m()),
            position_m: tracking.zip(gap_m).map(|(tracking, gap_m)| tracking.homed.found.reference_gap_m - gap_m),
            twist_rad: tracking.map(|tracking| tracking.twist_rad(self.sensing.readings.shaft_rad)),
            load_n: observed.map(|(tracking, _)| tracking.observer.load_n()),
            load_error_n: observed.and_then(|(tracking, _)| tracking.load_error_n()),
            position_error_m: tracking.zip(gap_m).and_then(|(tracking, _)| tracking.position_error_m()),
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
            supply_v: inputs.supply.map(|supply| supply.volts),
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
            supply_v: inputs.supply.map(|supply| supply.volts),
            estop_open: inputs.estop_open,
            upper_limit_open: inputs.upper_limit_open,
            lower_limit_open: inputs.lower_limit_open,
            rest_tolerance_m: self.tracking.as_ref().zip(self.mode.load_control()).map(|(tracking, control)| {
                let found = &tracking.homed.found;
                control.position_loop.rest.left_alone_m(found.gap_noise_m, found.jump_m)
            }),
            counters,
        }
    }
}
