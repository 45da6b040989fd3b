//! Scene files: what one rig and one task need, in TOML.
//!
//! `[geometry]`, `[string]` and `[material]` are the mechanism's constants. `[rig]` holds what the paper leaves open
//! about the rig; its defaults are assumptions (hardware.md sections 6 and 8) and every key may be left out.
//! `[envelope]` and `[accuracy]` say what a table must cover and how well: optional for a solve, required for a table.

mod checks;

pub use checks::Misfit;

use crate::error::{ParameterError, SolveError, positive};
use crate::material::Material;
use crate::mechanism::Mechanism;
use crate::parameters::Geometry;
use crate::string::StringParameters;
use crate::twist_from_turns;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Why a scene file was refused. Each names the key, or the line of the file.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// Any of the others, in a file.
    #[error("scene file {path}: {source}")]
    InFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: Box<SceneError>,
    },
    /// The file could not be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
    /// Not TOML, or a key is missing, misspelt or of the wrong type.
    #[error(transparent)]
    Parse(#[from] toml::de::Error),
    /// A value that cannot describe a real rig.
    #[error(transparent)]
    Value(#[from] ParameterError),
    /// Values that cannot go together, or would hurt hardware.
    #[error("{}", one_a_line(.0))]
    Impossible(Vec<Misfit>),
    /// The envelope reaches past a limit of the model.
    #[error("envelope.load_n, envelope.turns: {limit}, at {load_n} N and {turns} turns")]
    Unsolvable {
        /// Load (N).
        load_n: f64,
        /// Turns past the half-turn pre-twist; -0.5 is zero twist.
        turns: f64,
        /// The limit.
        limit: SolveError,
    },
    /// A table was asked for, but the scene does not say what it must cover.
    #[error("scene: [{table}] is missing, which a table needs")]
    Missing {
        /// `envelope` or `accuracy`.
        table: &'static str,
    },
}

impl SceneError {
    /// The same, naming the file.
    pub fn in_file(self, path: impl Into<PathBuf>) -> Self {
        Self::InFile { path: path.into(), source: Box::new(self) }
    }
}

fn one_a_line(misfits: &[Misfit]) -> String {
    misfits.iter().map(Misfit::to_string).collect::<Vec<_>>().join("\n  ")
}

/// One rig and one task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Lengths of the mechanism.
    pub geometry: Geometry,
    /// The strings.
    #[serde(rename = "string")]
    pub string: StringParameters,
    /// The rods' material.
    pub material: Material,
    /// The rig around the mechanism; assumed values where left out.
    #[serde(default)]
    pub rig: Rig,
    /// What a table must cover.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub envelope: Option<Envelope>,
    /// How well a table must do it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<Accuracy>,
}

/// The rig: motor, gear, drive, sensors. All defaults are assumed, not measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rig {
    /// Motor turns per output turn, numerator and denominator.
    pub gear_ratio: [u32; 2],
    /// Encoder lines per motor turn (ENX16 EASY: 1024); quadrature counts are four times as many.
    pub encoder_lines: u32,
    /// Greatest motor speed (rad/s at the motor shaft).
    pub motor_speed_max_rad_per_s: f64,
    /// Greatest motor acceleration (rad/s² at the motor shaft).
    pub motor_acceleration_max_rad_per_s2: f64,
    /// Torque constant (N m/A).
    pub motor_torque_constant_nm_per_a: f64,
    /// Winding resistance (Ω).
    pub motor_resistance_ohm: f64,
    /// Rotor inertia (kg m²).
    pub rotor_inertia_kg_m2: f64,
    /// Drive supply (V).
    pub supply_voltage_v: f64,
    /// What the supply is divided by before the drive's analog input ASIN; leave it out where that is not wired.
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
    /// ADC reference (V).
    pub adc_reference_v: f64,
}

/// How the board talks to the drive: `"can"` or `"uart"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DriveTransport {
    /// CAN1 at 1 Mbit/s, which the vendor's manual describes.
    Can,
    /// USART1 over RS232. Experimental: the framing is assumed (hardware.md section 5).
    Uart,
}

impl Default for Rig {
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
            adc_reference_v: 3.3,
        }
    }
}

impl Rig {
    /// Gear ratio as a number.
    pub fn gear(&self) -> f64 {
        f64::from(self.gear_ratio[0]) / f64::from(self.gear_ratio[1])
    }

    /// Quadrature counts per radian of twist: 4 for each encoder line (hardware.md section 1), times the gear.
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

    /// Least and greatest supply that is no fault (V): a fifth either side, within what the drive takes (10 to 58 V).
    pub fn supply_limits_v(&self) -> [f64; 2] {
        [(0.8 * self.supply_voltage_v).max(10.0), (1.2 * self.supply_voltage_v).min(58.0)]
    }

    fn validate(&self) -> Result<(), ParameterError> {
        let refuse = |parameter, value, reason| Err(ParameterError { parameter, value, reason });
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
        if self.encoder_lines > 65_536 {
            return refuse("rig.encoder_lines", f64::from(self.encoder_lines), "must be at most 65536");
        }
        // The command carries an i16 in rpm, the limit an i16 in mA (hardware.md section 1).
        if self.motor_speed_max_rad_per_s * 60.0 / std::f64::consts::TAU > 32_767.0 {
            let value = self.motor_speed_max_rad_per_s;
            return refuse("rig.motor_speed_max_rad_per_s", value, "must be below 32767 rpm, the drive's range");
        }
        if self.drive_current_limit_a > 32.767 {
            return refuse("rig.drive_current_limit_a", self.drive_current_limit_a, "must be at most 32.767 A");
        }
        if self.drive_group > 7 {
            return refuse("rig.drive_group", f64::from(self.drive_group), "must be from 0 to 7");
        }
        if !(1..=15).contains(&self.drive_number) {
            return refuse("rig.drive_number", f64::from(self.drive_number), "must be from 1 to 15");
        }
        for (parameter, value) in [
            ("rig.lvdt_volts_at_zero", self.lvdt_volts_at_zero),
            ("rig.lvdt_volts_at_stroke", self.lvdt_volts_at_stroke),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return refuse(parameter, value, "must be at least 0 and finite");
            }
        }
        let span = (self.lvdt_volts_at_stroke - self.lvdt_volts_at_zero).abs();
        if span < 0.1 * self.adc_reference_v {
            return refuse("rig.lvdt_volts_at_stroke", span, "the stroke must use at least a tenth of the ADC's range");
        }
        if !self.lvdt_gap_at_zero_m.is_finite() {
            return refuse("rig.lvdt_gap_at_zero_m", self.lvdt_gap_at_zero_m, "must be finite");
        }
        Ok(())
    }
}

/// What a table must cover.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Envelope {
    /// Least and greatest load (N).
    pub load_n: [f64; 2],
    /// Least and greatest motor turns past the half-turn pre-twist.
    pub turns: [f64; 2],
}

/// How well a table must do it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accuracy {
    /// Largest error of the contraction (m).
    pub contraction_m: f64,
    /// Largest relative error of the transmission ratio.
    pub tr_relative: f64,
}

impl Scene {
    /// Parses and checks a scene.
    ///
    /// # Errors
    /// [`SceneError`] naming the key.
    pub fn from_toml_str(text: &str) -> Result<Self, SceneError> {
        let scene: Self = toml::from_str(text)?;
        scene.validate()?;
        Ok(scene)
    }

    /// Reads, parses and checks a scene file.
    ///
    /// # Errors
    /// [`SceneError`] naming the file or the key.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let read = || Self::from_toml_str(&std::fs::read_to_string(path)?);
        read().map_err(|error| error.in_file(path))
    }

    /// Checks every value, and against each other those that a solve uses or that could hurt hardware.
    ///
    /// # Errors
    /// [`SceneError`] naming the keys.
    pub fn validate(&self) -> Result<(), SceneError> {
        self.values()?;
        self.check_always()
    }

    /// Checks every value by itself.
    fn values(&self) -> Result<(), ParameterError> {
        self.geometry.validate()?;
        self.string.validate()?;
        self.material.validate()?;
        self.rig.validate()?;
        let refuse = |parameter, value, reason| Err(ParameterError { parameter, value, reason });
        if let Some(Envelope { load_n, turns }) = self.envelope {
            if !(load_n[0] >= crate::mechanism::LIGHT_LOAD_N && load_n[0].is_finite()) {
                return refuse(
                    "envelope.load_n",
                    load_n[0],
                    "must start at 0.5 N or above, where the radius law holds",
                );
            }
            if !(load_n[1] > load_n[0] && load_n[1].is_finite()) {
                return refuse("envelope.load_n", load_n[1], "must end above its start");
            }
            if turns[0] < 0.0 || turns[0].is_nan() {
                return refuse("envelope.turns", turns[0], "must start at 0 or above, where the strings touch");
            }
            if !(turns[1] > turns[0] && turns[1].is_finite()) {
                return refuse("envelope.turns", turns[1], "must end above its start");
            }
        }
        if let Some(Accuracy { contraction_m, tr_relative }) = self.accuracy {
            for (parameter, value) in [("accuracy.contraction_m", contraction_m), ("accuracy.tr_relative", tr_relative)]
            {
                if !(value > 0.0 && value.is_finite()) {
                    return refuse(parameter, value, "must be above 0 and finite");
                }
            }
        }
        Ok(())
    }

    /// The solver for this scene.
    ///
    /// # Errors
    /// [`ParameterError`] naming the key.
    pub fn mechanism(&self) -> Result<Mechanism, ParameterError> {
        Mechanism::new(&self.geometry, &self.string, &self.material)
    }

    /// Envelope and accuracy, which a table needs.
    ///
    /// # Errors
    /// [`SceneError::Missing`] naming the absent one.
    pub fn table_demand(&self) -> Result<(Envelope, Accuracy), SceneError> {
        let envelope = self.envelope.ok_or(SceneError::Missing { table: "envelope" })?;
        let accuracy = self.accuracy.ok_or(SceneError::Missing { table: "accuracy" })?;
        Ok((envelope, accuracy))
    }

    /// CRC-32 of the scene's canonical form: the same for files that differ only in comments, order or defaults.
    pub fn hash(&self) -> u32 {
        hash(self)
    }

    /// The same of `[rig]` alone, which a table does not depend on and a board has built in.
    pub fn rig_hash(&self) -> u32 {
        hash(&self.rig)
    }

    /// The same of `[envelope]` and `[accuracy]` alone: what any table of a board has to cover.
    pub fn demand_hash(&self) -> u32 {
        #[derive(Serialize)]
        struct Demand {
            envelope: Option<Envelope>,
            accuracy: Option<Accuracy>,
        }
        hash(&Demand { envelope: self.envelope, accuracy: self.accuracy })
    }
}

fn hash(value: &impl Serialize) -> u32 {
    // Serialising plain numbers into a string cannot fail; an empty text would still be a valid hash input.
    let text = toml::to_string(value).unwrap_or_default();
    crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(text.as_bytes())
}

impl Envelope {
    /// Least and greatest twist (rad).
    pub fn twist_rad(&self) -> [f64; 2] {
        self.turns.map(twist_from_turns)
    }
}
