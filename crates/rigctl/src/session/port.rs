//! How bytes get to the board and back.

use crate::failure::Failure;
use rig_plant::{Fault, PlantChange, Stats, Truth};

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

/// A connection to the board.
pub trait Port: Send {
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
    /// If the key cannot change while the rig runs, or the emulator is gone.
    fn plant(&mut self, change: PlantChange) -> Result<(), Failure>;

    /// Begins or ends a fault.
    ///
    /// # Errors
    /// If the rig cannot have it, or the emulator is gone.
    fn fault(&mut self, fault: Fault, on: bool) -> Result<(), Failure>;

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
