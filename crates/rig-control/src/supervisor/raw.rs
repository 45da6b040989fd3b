//! What the sensors show, homed or not: for whoever wires a rig.

use super::{Inputs, Rig};
use crate::sensors::DriveReading;
use rig_link::messages::Sensors;

impl Rig<'_> {
    /// Readings of a tick; `gap_m` is what [`Rig::step`] made of the LVDT's.
    pub fn sensors(&self, inputs: &Inputs, gap_m: Option<f32>) -> Sensors {
        let counts_per_rad = self.constants.counts_per_rad;
        Sensors {
            gap_m,
            shaft_rad: inputs.encoder_counts as f32 / counts_per_rad,
            drive_rad: match inputs.drive {
                DriveReading::Reports { position_qc, .. } => Some(position_qc as f32 / counts_per_rad),
                DriveReading::Starting | DriveReading::Failed => None,
            },
            supply_v: inputs.supply.map(|supply| supply.volts),
            estop_open: inputs.estop_open,
            upper_limit_open: inputs.upper_limit_open,
            lower_limit_open: inputs.lower_limit_open,
        }
    }
}
