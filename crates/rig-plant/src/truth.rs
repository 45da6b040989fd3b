//! What really happens in the emulated rig, which the firmware never sees.

use serde::{Deserialize, Serialize};

/// A snapshot. SI units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// Time since power-up.
    pub t_s: f64,
    /// How far the load is above where it would hang at the half-turn pre-twist under the load at boot.
    pub position_m: f64,
    /// Gap between the clamps.
    pub gap_m: f64,
    /// Gap at which the present load would hang at the half-turn pre-twist.
    pub pretwist_gap_m: f64,
    /// Speed of the gap, positive sinks.
    pub gap_speed_m_per_s: f64,
    /// Twist of the strings.
    pub twist_rad: f64,
    /// Weight on the rail.
    pub load_n: f64,
    /// What the mechanism carries at this moment.
    pub pull_n: f64,
    /// Tension of one string. Its fraction of the pull is computed again every 10 ms while the rig records, else only at
    /// power-up.
    pub string_tension_n: f64,
    /// Torque of the strings on the output shaft.
    pub string_torque_nm: f64,
    /// Angle of the motor shaft since power-up.
    pub motor_angle_rad: f64,
    /// Speed of the motor shaft.
    pub motor_speed_rad_per_s: f64,
    /// Winding current.
    pub motor_current_a: f64,
    /// Electrical energy that the motor has taken since power-up.
    pub motor_energy_j: f64,
    /// Angle that the motor has turned the output shaft by its own torque since power-up, in both directions together.
    /// What the load turns does not count, whether the drive gives no torque or brakes it.
    pub driven_rad: f64,
    /// Code of the drive's mode, 0 while un-moded or off.
    pub drive_mode: u8,
}
