//! The rig's numbers. The build script writes them from the scene's `[rig]`; nothing here repeats one.

/// Constants of one rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigConstants {
    /// Motor turns per turn of the strings; positive.
    pub gear_ratio: f32,
    /// Quadrature counts per radian of twist: 4 × lines × gear ratio / 2π; negative where the strings are twisted against
    /// the encoder's count.
    pub counts_per_rad: f32,
    /// Greatest motor speed (rad/s at the motor shaft).
    pub motor_speed_max_rad_per_s: f32,
    /// Greatest motor acceleration (rad/s² at the motor shaft).
    pub motor_acceleration_max_rad_per_s2: f32,
    /// Motor torque for each ampere (N m/A).
    pub motor_torque_constant_nm_per_a: f32,
    /// Current limit sent with every command (mA).
    pub current_limit_ma: i16,
    /// Gap at ADC code 0 (m).
    pub lvdt_gap_at_code_zero_m: f32,
    /// Gap per ADC code (m).
    pub lvdt_metres_per_code: f32,
    /// RMDS group.
    pub drive_group: u8,
    /// RMDS number.
    pub drive_number: u8,
    /// Least and greatest supply of the drive that is no fault (V).
    pub supply_limits_v: [f32; 2],
    /// What the supply is divided by before the drive's analog input; `None` where it is not wired.
    pub supply_divider: Option<f32>,
}

impl RigConstants {
    /// +1 where the strings are twisted as the encoder counts, −1 where the other way.
    pub fn twist_sign(&self) -> f32 {
        1f32.copysign(self.counts_per_rad)
    }

    /// Greatest speed of the strings' twist (rad/s).
    pub fn twist_speed_max(&self) -> f32 {
        self.motor_speed_max_rad_per_s / self.gear_ratio
    }

    /// Greatest acceleration of the strings' twist (rad/s²).
    pub fn twist_acceleration_max(&self) -> f32 {
        self.motor_acceleration_max_rad_per_s2 / self.gear_ratio
    }

    /// Motor shaft speed in rpm for a twist speed (rad/s), rounded up so that a limit never stops the motor short.
    pub fn motor_rpm(&self, twist_speed_rad_per_s: f32) -> i16 {
        const RPM: f32 = 60.0 / core::f32::consts::TAU;
        libm::ceilf(twist_speed_rad_per_s.abs() * self.gear_ratio * RPM).clamp(0.0, 32_767.0) as i16
    }
}
