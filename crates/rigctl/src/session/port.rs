//! How bytes get to the board and back.

use crate::failure::Failure;
use crate::plant::Setting;
use serde::Deserialize;

/// The true state of an emulated rig. SI units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
pub struct Truth {
    /// Emulated time.
    pub t_s: f64,
    /// Gap between the clamps.
    pub gap_m: f64,
    /// Twist of the strings.
    pub twist_rad: f64,
    /// Weight on the rail.
    pub load_n: f64,
    /// Tension of one string.
    pub string_tension_n: f64,
    /// Speed of the motor shaft.
    pub motor_speed_rad_per_s: f64,
}

/// What came back in one step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Received {
    /// From the board's link.
    pub bytes: Vec<u8>,
    /// Every millisecond; empty on a real rig.
    pub truth: Vec<Truth>,
    /// The firmware's own log; empty on a real rig.
    pub log: Vec<String>,
}

/// What the firmware cost on the emulated board.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Stats {
    /// Mean instructions of a control tick.
    pub instructions_per_tick_mean: f64,
    /// Most instructions of a control tick.
    pub instructions_per_tick_max: f64,
    /// The model that the emulated mechanism runs on.
    pub plant_tier: String,
    /// Share of the time that the core was not asleep.
    pub core_busy: f64,
    /// Most bytes on the stack.
    pub stack_high_water_bytes: u64,
}

/// A connection to the board.
pub trait Port {
    /// Sends `bytes` and lets `seconds` pass.
    ///
    /// # Errors
    /// If the connection is lost, or the emulated board stopped.
    fn pass(&mut self, bytes: &[u8], seconds: f64) -> Result<Received, Failure>;

    /// Time on this connection's clock (s): emulated time, or time since it was opened.
    fn now_s(&self) -> f64;

    /// The emulated rig at its end, if it is one.
    fn emulated(&mut self) -> Option<&mut dyn Emulated> {
        None
    }
}

/// What only an emulated rig can do.
pub trait Emulated {
    /// Changes the plant.
    ///
    /// # Errors
    /// If the key cannot change while the rig runs.
    fn plant(&mut self, setting: &Setting) -> Result<(), Failure>;

    /// Whether the plant could be changed so while the rig runs. Changes nothing.
    ///
    /// # Errors
    /// If the key cannot change while the rig runs, or not to this value.
    fn check_plant(&mut self, setting: &Setting) -> Result<(), Failure>;

    /// Begins or ends a fault.
    ///
    /// # Errors
    /// If the rig does not know it.
    fn fault(&mut self, name: &str, on: bool) -> Result<(), Failure>;

    /// Takes the board's power away for a moment.
    ///
    /// # Errors
    /// If the emulator is gone.
    fn power_cycle(&mut self) -> Result<(), Failure>;

    /// What the firmware cost so far.
    ///
    /// # Errors
    /// If the emulator is gone.
    fn stats(&mut self) -> Result<Stats, Failure>;
}
