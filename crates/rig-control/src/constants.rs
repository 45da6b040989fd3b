//! The rig's numbers. They are generated from the scene's `[rig]`; nothing here repeats one.

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
    /// Linearity error of the LVDT by its data sheet: greatest deviation of the gap from a straight line over the stroke (m).
    pub lvdt_linearity_m: f32,
    /// Relative standard error of the string radius.
    pub radius_error: f32,
    /// Standard error of the exponent with which the radius follows the twist.
    pub exponent_error: f32,
    /// Relative standard error of how the radius changes with the load.
    pub load_shape_error: f32,
    /// RMDS group.
    pub drive_group: u8,
    /// RMDS number.
    pub drive_number: u8,
    /// Least and greatest supply of the drive that is no fault (V).
    pub supply_limits_v: [f32; 2],
    /// Ratio of the divider between the supply and the drive's analog input; `None` where it is not wired.
    pub supply_divider: Option<f32>,
}

/// Limits of the strings' twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistLimits {
    /// Greatest speed (rad/s).
    pub speed: f32,
    /// Greatest acceleration (rad/s²).
    pub acceleration: f32,
}

impl TwistLimits {
    /// A share of both.
    #[must_use]
    pub fn share(self, share: f32) -> Self {
        Self { speed: share * self.speed, acceleration: share * self.acceleration }
    }
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

    /// Greatest speed and acceleration of the strings' twist.
    pub fn twist_limits(&self) -> TwistLimits {
        TwistLimits { speed: self.twist_speed_max(), acceleration: self.twist_acceleration_max() }
    }

    /// Gap (m) at a mean ADC code of the LVDT.
    pub fn lvdt_gap_m(&self, mean_code: f32) -> f32 {
        self.lvdt_gap_at_code_zero_m + self.lvdt_metres_per_code * mean_code
    }

    /// Motor shaft speed in rpm for a twist speed (rad/s), rounded up so that a limit never stops the motor short.
    pub fn motor_rpm(&self, twist_speed_rad_per_s: f32) -> i16 {
        const RPM: f32 = 60.0 / core::f32::consts::TAU;
        libm::ceilf(twist_speed_rad_per_s.abs() * self.gear_ratio * RPM).clamp(0.0, 32_767.0) as i16
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A rig for tests.
    pub(crate) const RIG: RigConstants = RigConstants {
        gear_ratio: 62.0,
        counts_per_rad: 40_416.0,
        motor_speed_max_rad_per_s: 1047.0,
        motor_acceleration_max_rad_per_s2: 12_000.0,
        motor_torque_constant_nm_per_a: 0.0229,
        current_limit_ma: 500,
        lvdt_gap_at_code_zero_m: 0.01,
        lvdt_metres_per_code: 5.372e-5,
        lvdt_linearity_m: 0.5e-3,
        radius_error: 0.06,
        exponent_error: 0.03,
        load_shape_error: 0.03,
        drive_group: 0,
        drive_number: 1,
        supply_limits_v: [19.2, 28.8],
        supply_divider: None,
    };

    #[test]
    fn a_speed_limit_is_rounded_up_and_stays_within_the_drives_numbers() {
        assert_eq!(RIG.motor_rpm(1.0), 593, "62 * 60 / tau is 592.06");
        assert_eq!(RIG.motor_rpm(-1.0), RIG.motor_rpm(1.0));
        assert_eq!((RIG.motor_rpm(0.0), RIG.motor_rpm(1e6)), (0, 32_767));
    }

    #[test]
    fn limits_and_gap_follow_from_the_constants() {
        let limits = RIG.twist_limits().share(0.5);
        assert!((limits.speed - 0.5 * 1047.0 / 62.0).abs() < 1e-5);
        assert!((limits.acceleration - 0.5 * 12_000.0 / 62.0).abs() < 1e-4);
        assert!((RIG.lvdt_gap_m(1000.0) - 0.06372).abs() < 1e-7);
        assert_eq!(RIG.twist_sign(), 1.0);
        assert_eq!(RigConstants { counts_per_rad: -1.0, ..RIG }.twist_sign(), -1.0);
    }
}
