//! The rig's numbers. They are generated from the scene's `[rig]`; nothing here repeats one.

use crate::TICK_S;
use core::f32::consts::{SQRT_2, TAU};
use rig_link::messages::LvdtCurve;

/// 90 % of the LVDTs whose non-linearity is a sine over the stroke, of any phase and of 0.3 to 1 times the data sheet's size,
/// have a smaller slope error than this fraction of the maximum that the data sheet allows.
const SLOPE_FRACTION: f32 = 0.77;

/// Half the width of the interval around a change of the gap that holds the true change in 90 of 100 cases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangeError {
    /// For each metre of the change, where that is small.
    slope: f32,
    /// Of any change, however large (m).
    max_m: f32,
}

impl ChangeError {
    /// Of a change (m), in metres.
    pub fn of(&self, change_m: f32) -> f32 {
        (self.slope * change_m.abs()).min(self.max_m)
    }
}

/// Constants of one rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigConstants {
    /// Motor turns per turn of the strings; positive.
    pub gear_ratio: f32,
    /// Quadrature counts per radian of twist: 4 × lines × gear ratio / 2π; negative where the strings are twisted against
    /// the encoder's count.
    pub counts_per_rad: f32,
    /// Maximum motor speed (rad/s at the motor shaft).
    pub motor_speed_max_rad_per_s: f32,
    /// Maximum motor acceleration (rad/s² at the motor shaft).
    pub motor_acceleration_max_rad_per_s2: f32,
    /// Motor torque for each ampere (N m/A).
    pub motor_torque_constant_nm_per_a: f32,
    /// Resistance of the motor's winding (Ω).
    pub motor_resistance_ohm: f32,
    /// Current limit sent with every command (mA).
    pub current_limit_ma: i16,
    /// Fraction of the position loop's feedback that is used: what the settings say.
    pub loop_gain: f32,
    /// Gap at ADC code 0 (m).
    pub lvdt_gap_at_code_zero_m: f32,
    /// Gap per ADC code (m).
    pub lvdt_metres_per_code: f32,
    /// Correction of the LVDT, gain and offset (m) by its calibration: what the settings say.
    pub lvdt_curve: Option<LvdtCurve>,
    /// True change of the gap for one of the LVDT's corrected reading.
    pub lvdt_gain: f32,
    /// Gap where the LVDT's corrected reading is 0 (m).
    pub lvdt_offset_m: f32,
    /// Stroke of the LVDT (m).
    pub lvdt_stroke_m: f32,
    /// Linearity error of the LVDT by its data sheet: maximum deviation of the gap from a straight line over the stroke (m).
    pub lvdt_linearity_m: f32,
    /// RMDS group.
    pub drive_group: u8,
    /// RMDS number.
    pub drive_number: u8,
    /// Minimum and maximum supply of the drive that is no fault (V).
    pub supply_limits_v: [f32; 2],
    /// Ratio of the divider between the supply and the drive's analog input; `None` where it is not wired.
    pub supply_divider: Option<f32>,
}

/// Limits of the strings' twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistLimits {
    /// Maximum speed (rad/s).
    pub speed: f32,
    /// Maximum acceleration (rad/s²).
    pub acceleration: f32,
}

impl TwistLimits {
    /// The speed (rad/s) one tick later, as near to a wanted one as they allow.
    pub fn after_a_tick(&self, now: f32, wanted: f32) -> f32 {
        let change = self.acceleration * TICK_S;
        wanted.clamp(now - change, now + change).clamp(-self.speed, self.speed)
    }
}

impl RigConstants {
    /// The same constants with a motor that is no faster than a supply (V) allows: its back-EMF cannot exceed the supply. A supply
    /// below its limits is a fault of its own.
    #[must_use]
    pub fn on_supply(&self, volts: f32) -> Self {
        let fastest = volts.max(self.supply_limits_v[0]) / self.motor_torque_constant_nm_per_a;
        Self { motor_speed_max_rad_per_s: self.motor_speed_max_rad_per_s.min(fastest), ..*self }
    }

    /// Maximum speed of the strings' twist (rad/s).
    pub fn twist_speed_max(&self) -> f32 {
        self.motor_speed_max_rad_per_s / self.gear_ratio
    }

    /// Maximum speed and acceleration of the strings' twist.
    pub fn twist_limits(&self) -> TwistLimits {
        let acceleration = self.motor_acceleration_max_rad_per_s2 / self.gear_ratio;
        TwistLimits { speed: self.twist_speed_max(), acceleration }
    }

    /// How fast the encoders count (counts/s) while the motor turns at a speed (rad/s).
    pub(crate) fn counts_per_s(&self, motor_rad_per_s: f32) -> f32 {
        motor_rad_per_s / self.gear_ratio * self.counts_per_rad.abs()
    }

    /// Gap (m) at a mean ADC code of the LVDT, calibrated.
    pub fn lvdt_gap_m(&self, mean_code: f32) -> f32 {
        let sensor_m = self.lvdt_gap_at_code_zero_m + self.lvdt_metres_per_code * mean_code;
        self.lvdt_offset_m + self.lvdt_gain * self.lvdt_curve.map_or(sensor_m, |curve| curve.gap_m(sensor_m))
    }

    /// Mean ADC code of the LVDT at a calibrated gap (m): the inverse of [`RigConstants::lvdt_gap_m`].
    pub fn lvdt_mean_code(&self, gap_m: f32) -> f32 {
        let corrected_m = (gap_m - self.lvdt_offset_m) / self.lvdt_gain;
        let sensor_m = self.lvdt_curve.map_or(corrected_m, |curve| curve.sensor_m(corrected_m));
        (sensor_m - self.lvdt_gap_at_code_zero_m) / self.lvdt_metres_per_code
    }

    /// Error of a change of the gap by the LVDT. Without points of a calibration it is the data sheet's non-linearity; with
    /// points it is that of both ends, which over less than the distance of two points have a part of it in common.
    pub fn lvdt_change_error(&self) -> ChangeError {
        match self.lvdt_curve {
            None => ChangeError {
                slope: SLOPE_FRACTION * TAU * self.lvdt_linearity_m / self.lvdt_stroke_m,
                max_m: f32::INFINITY,
            },
            Some(curve) => {
                let max_m = SQRT_2 * curve.error_m();
                ChangeError { slope: max_m / curve.spacing_m(), max_m }
            }
        }
    }

    /// Standard error of the LVDT's reading (m) beside that of its zero. Without points of a calibration it is that of a sine of any
    /// phase, whose amplitude is as likely anywhere up to the data sheet's non-linearity: √(1/2 · 1/3) of that.
    pub fn lvdt_reading_error_m(&self) -> f32 {
        let sheet_m = self.lvdt_linearity_m / libm::sqrtf(6.0);
        self.lvdt_curve.map_or(sheet_m, |curve| curve.error_m() / crate::homing::NINETY_PERCENT)
    }

    /// Standard error of the LVDT's slope between two gaps of a sweep.
    pub fn lvdt_slope_error(&self) -> f32 {
        self.lvdt_change_error().slope / crate::homing::NINETY_PERCENT
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
        motor_resistance_ohm: 10.0,
        current_limit_ma: 500,
        loop_gain: 1.0,
        lvdt_gap_at_code_zero_m: 0.01,
        lvdt_metres_per_code: 5.372e-5,
        lvdt_curve: None,
        lvdt_gain: 1.0,
        lvdt_offset_m: 0.0,
        lvdt_stroke_m: 0.2,
        lvdt_linearity_m: 0.5e-3,
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
    fn a_supply_that_is_too_low_for_the_motors_speed_lowers_it() {
        // 22.9 mV for each rad/s, of 19.2 V at least.
        for (volts, expected) in [(22.9, 1000.0), (20.61, 900.0), (0.0, 838.428), (-1.0, 838.428), (28.0, 1047.0)] {
            let rig = RIG.on_supply(volts);
            assert!((rig.motor_speed_max_rad_per_s - expected).abs() < 1e-2, "{volts} V: {rig:?}");
            assert_eq!(RigConstants { motor_speed_max_rad_per_s: 1047.0, ..rig }, RIG);
        }
    }

    #[test]
    fn a_wanted_speed_is_reached_as_fast_as_the_motor_allows_and_no_faster() {
        let limits = TwistLimits { speed: 10.0, acceleration: 200.0 };
        assert_eq!([0.0, 9.5, -1.0].map(|now| limits.after_a_tick(now, 50.0)), [2.0, 10.0, 1.0]);
        assert_eq!(limits.after_a_tick(1.0, 1.5), 1.5);
        assert_eq!(limits.after_a_tick(-9.0, -99.0), -10.0);
    }

    #[test]
    fn limits_and_gap_follow_from_the_constants() {
        let limits = RIG.twist_limits();
        assert!((limits.speed - 1047.0 / 62.0).abs() < 1e-5);
        assert!((limits.acceleration - 12_000.0 / 62.0).abs() < 1e-4);
        assert!((RIG.lvdt_gap_m(1000.0) - 0.06372).abs() < 1e-7);
        let calibrated = RigConstants {
            lvdt_curve: LvdtCurve::new(&[[0.05, 0.5e-3], [0.06, -0.2e-3], [0.08, 0.0]], 2e-5).ok(),
            lvdt_gain: 1.01,
            lvdt_offset_m: -3e-3,
            ..RIG
        };
        // At code 838 the sensor shows 55 mm: corrected by +0.15 mm, then gain and offset.
        let code = (0.055 - 0.01) / RIG.lvdt_metres_per_code;
        assert!((calibrated.lvdt_gap_m(code) - (1.01 * 0.05515 - 3e-3)).abs() < 2e-8);
        for code in [500.0, 800.0, 1000.0, 2000.0] {
            assert!((calibrated.lvdt_mean_code(calibrated.lvdt_gap_m(code)) - code).abs() < 2e-3, "{code}");
        }
        // A sine of any phase and an amplitude of up to 0.5 mm, and points with an error of 20 um, 90 %.
        let [sheet_m, points_m] = [RIG, calibrated].map(|rig| rig.lvdt_reading_error_m());
        assert!((sheet_m - 0.204e-3).abs() < 2e-7 && (points_m - 2e-5 / 1.645).abs() < 1e-9);
        let [sheet, points] = [RIG, calibrated].map(|rig| rig.lvdt_change_error());
        // A sine of 0.5 mm over 200 mm has 0.0157 of slope error.
        assert!((sheet.of(-0.01) - 0.77 * 0.0157e-2).abs() < 1e-7, "{}", sheet.of(-0.01));
        // The points are 15 mm apart on average.
        assert!(
            (points.of(0.02) - 2e-5 * 2f32.sqrt()).abs() < 1e-9
                && (points.of(3e-3) / points.of(0.02) - 0.2).abs() < 1e-5
        );
    }
}
