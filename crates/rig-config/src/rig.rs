//! `[rig]`: motor, gear, drive and sensors, and the numbers that the control code takes from them.

use rig_control::RigConstants;
use serde::{Deserialize, Serialize};
use tsa_model::ParameterError;
use tsa_model::error::{positive, require};

/// The rig: motor, gear, drive, sensors. All defaults are assumed, not measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RigConfig {
    /// Motor turns per output turn, numerator and denominator.
    pub gear_ratio: [u32; 2],
    /// Encoder lines per motor turn (ENX16 EASY: 1024); quadrature counts are four times as many.
    pub encoder_lines: u32,
    /// Maximum motor speed (rad/s at the motor shaft).
    pub motor_speed_max_rad_per_s: f64,
    /// Maximum motor acceleration (rad/s² at the motor shaft).
    pub motor_acceleration_max_rad_per_s2: f64,
    /// Torque constant (N m/A).
    pub motor_torque_constant_nm_per_a: f64,
    /// Winding resistance (Ω).
    pub motor_resistance_ohm: f64,
    /// Rotor inertia (kg m²).
    pub rotor_inertia_kg_m2: f64,
    /// Drive supply (V).
    pub supply_voltage_v: f64,
    /// Ratio of the divider from the supply to the drive's analog input ASIN; leave it out where that is not wired.
    pub supply_divider: Option<f64>,
    /// Current limit sent to the drive with every command (A).
    pub drive_current_limit_a: f64,
    /// RMDS group, 0 to 7.
    pub drive_group: u8,
    /// RMDS number, 1 to 15.
    pub drive_number: u8,
    /// How the board talks to the drive.
    pub drive_transport: DriveTransport,
    /// LVDT stroke (m).
    pub lvdt_stroke_m: f64,
    /// Volts at the ADC pin at the start of the stroke, after the divider.
    pub lvdt_volts_at_zero: f64,
    /// Volts at the ADC pin at the end of the stroke.
    pub lvdt_volts_at_stroke: f64,
    /// Gap between the clamps at the start of the stroke (m).
    pub lvdt_gap_at_zero_m: f64,
    /// Linearity error of the LVDT by its data sheet: maximum deviation from a straight line, as a fraction of the stroke.
    pub lvdt_linearity: f64,
    /// ADC reference (V).
    pub adc_reference_v: f64,
}

/// How the board talks to the drive: `"can"` or `"uart"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DriveTransport {
    /// CAN1 at 1 Mbit/s, which the vendor's manual describes.
    Can,
    /// USART1 over RS232. Experimental: the framing is assumed (crates/rmds405/README.md section 5).
    Uart,
}

impl Default for RigConfig {
    fn default() -> Self {
        Self {
            gear_ratio: [62, 1],
            encoder_lines: 1024,
            motor_speed_max_rad_per_s: 1047.0,
            motor_acceleration_max_rad_per_s2: 12_000.0,
            motor_torque_constant_nm_per_a: 0.0229,
            motor_resistance_ohm: 10.0,
            rotor_inertia_kg_m2: 1.2e-7,
            supply_voltage_v: 24.0,
            supply_divider: None,
            drive_current_limit_a: 0.5,
            drive_group: 0,
            drive_number: 1,
            drive_transport: DriveTransport::Can,
            lvdt_stroke_m: 0.2,
            lvdt_volts_at_zero: 0.0,
            lvdt_volts_at_stroke: 3.0,
            lvdt_gap_at_zero_m: 0.0,
            lvdt_linearity: 0.005,
            adc_reference_v: 3.3,
        }
    }
}

impl RigConfig {
    /// Gear ratio as a number.
    pub fn gear(&self) -> f64 {
        f64::from(self.gear_ratio[0]) / f64::from(self.gear_ratio[1])
    }

    /// Quadrature counts per radian of twist: 4 for each encoder line (crates/rmds405/README.md section 1), times the
    /// gear.
    pub fn counts_per_rad(&self) -> f64 {
        4.0 * f64::from(self.encoder_lines) * self.gear() / std::f64::consts::TAU
    }

    /// Gap per code of the 12-bit ADC (m); code 4095 is the reference voltage.
    pub fn lvdt_metres_per_code(&self) -> f64 {
        self.lvdt_metres_per_volt() * self.adc_reference_v / 4095.0
    }

    /// Gap at ADC code 0 (m).
    pub fn lvdt_gap_at_code_zero_m(&self) -> f64 {
        self.lvdt_gap_at_zero_m - self.lvdt_volts_at_zero * self.lvdt_metres_per_volt()
    }

    fn lvdt_metres_per_volt(&self) -> f64 {
        self.lvdt_stroke_m / (self.lvdt_volts_at_stroke - self.lvdt_volts_at_zero)
    }

    /// Current limit as the drive takes it (mA).
    pub fn drive_current_limit_ma(&self) -> i16 {
        // `validate` keeps it within an i16.
        (self.drive_current_limit_a * 1000.0).round() as i16
    }

    /// Minimum and maximum supply without a fault (V): a fifth either side, within the drive's range (10 to 58 V).
    pub fn supply_limits_v(&self) -> [f64; 2] {
        [(0.8 * self.supply_voltage_v).max(10.0), (1.2 * self.supply_voltage_v).min(58.0)]
    }

    /// These numbers for the control code.
    pub(crate) fn constants(&self) -> RigConstants {
        RigConstants {
            gear_ratio: self.gear() as f32,
            counts_per_rad: self.counts_per_rad() as f32,
            motor_speed_max_rad_per_s: self.motor_speed_max_rad_per_s as f32,
            motor_acceleration_max_rad_per_s2: self.motor_acceleration_max_rad_per_s2 as f32,
            motor_torque_constant_nm_per_a: self.motor_torque_constant_nm_per_a as f32,
            motor_resistance_ohm: self.motor_resistance_ohm as f32,
            current_limit_ma: self.drive_current_limit_ma(),
            loop_gain: 1.0,
            lvdt_gap_at_code_zero_m: self.lvdt_gap_at_code_zero_m() as f32,
            lvdt_metres_per_code: self.lvdt_metres_per_code() as f32,
            lvdt_curve: None,
            lvdt_gain: 1.0,
            lvdt_offset_m: 0.0,
            lvdt_stroke_m: self.lvdt_stroke_m as f32,
            lvdt_linearity_m: (self.lvdt_linearity * self.lvdt_stroke_m) as f32,
            drive_group: self.drive_group,
            drive_number: self.drive_number,
            supply_limits_v: self.supply_limits_v().map(|volts| volts as f32),
            supply_divider: self.supply_divider.map(|divider| divider as f32),
        }
    }

    pub(crate) fn validate(&self) -> Result<(), ParameterError> {
        if let Some(divider) = self.supply_divider {
            positive(&[("rig.supply_divider", divider)])?;
        }
        positive(&[
            ("rig.gear_ratio", f64::from(self.gear_ratio[0].min(self.gear_ratio[1]))),
            ("rig.encoder_lines", f64::from(self.encoder_lines)),
            ("rig.motor_speed_max_rad_per_s", self.motor_speed_max_rad_per_s),
            ("rig.motor_acceleration_max_rad_per_s2", self.motor_acceleration_max_rad_per_s2),
            ("rig.motor_torque_constant_nm_per_a", self.motor_torque_constant_nm_per_a),
            ("rig.motor_resistance_ohm", self.motor_resistance_ohm),
            ("rig.rotor_inertia_kg_m2", self.rotor_inertia_kg_m2),
            ("rig.supply_voltage_v", self.supply_voltage_v),
            ("rig.drive_current_limit_a", self.drive_current_limit_a),
            ("rig.lvdt_stroke_m", self.lvdt_stroke_m),
            ("rig.adc_reference_v", self.adc_reference_v),
        ])?;
        let (lines, group, number) = (self.encoder_lines, self.drive_group, self.drive_number);
        let (speed, current) = (self.motor_speed_max_rad_per_s, self.drive_current_limit_a);
        let [at_zero, at_stroke] = [self.lvdt_volts_at_zero, self.lvdt_volts_at_stroke];
        let volts = |volts: f64| volts >= 0.0 && volts.is_finite();
        let (span, gap, linearity) = ((at_stroke - at_zero).abs(), self.lvdt_gap_at_zero_m, self.lvdt_linearity);
        let rpm = speed * 60.0 / std::f64::consts::TAU;
        // The command carries an i16 in rpm, the limit an i16 in mA (crates/rmds405/README.md section 1).
        for (good, parameter, value, reason) in [
            (lines <= 65_536, "rig.encoder_lines", f64::from(lines), "must be at most 65536"),
            (rpm <= 32_767.0, "rig.motor_speed_max_rad_per_s", speed, "must be below 32767 rpm, the drive's range"),
            (current <= 32.767, "rig.drive_current_limit_a", current, "must be at most 32.767 A"),
            (group <= 7, "rig.drive_group", f64::from(group), "must be from 0 to 7"),
            ((1..=15).contains(&number), "rig.drive_number", f64::from(number), "must be from 1 to 15"),
            (volts(at_zero), "rig.lvdt_volts_at_zero", at_zero, "must be at least 0 and finite"),
            (volts(at_stroke), "rig.lvdt_volts_at_stroke", at_stroke, "must be at least 0 and finite"),
            (
                span >= 0.1 * self.adc_reference_v,
                "rig.lvdt_volts_at_stroke",
                span,
                "the stroke must use at least a tenth of the ADC's range",
            ),
            (gap.is_finite(), "rig.lvdt_gap_at_zero_m", gap, "must be finite"),
            (
                (0.0..=0.05).contains(&linearity),
                "rig.lvdt_linearity",
                linearity,
                "must be from 0 to 0.05, a share of the stroke",
            ),
        ] {
            require(good, parameter, value, reason)?;
        }
        Ok(())
    }
}
