//! The emulated board, which starts by itself.

use super::{Transport, TransportError};
use crate::emulator::{Emulator, EmulatorError};
use crate::plant::Setting;
use crate::record::Truth;
use std::path::PathBuf;

/// What the emulated board and rig are started with.
#[derive(Debug, Clone)]
pub struct SimOptions {
    /// The firmware's image.
    pub firmware: PathBuf,
    /// The scene of the plant.
    pub scene: PathBuf,
    /// Changes of the plant, of which the firmware is not told.
    pub plant: Vec<Setting>,
    /// Seed of all noise.
    pub seed: u64,
}

/// The emulated board as a transport.
pub struct Sim {
    emulator: Emulator,
    now_s: f64,
    truth: Vec<Truth>,
}

impl Sim {
    /// Boots a fresh board.
    ///
    /// # Errors
    /// [`EmulatorError`] if the emulator does not start.
    pub fn boot(options: &SimOptions) -> Result<Self, EmulatorError> {
        Ok(Self { emulator: Emulator::start(options)?, now_s: 0.0, truth: Vec::new() })
    }
}

impl Transport for Sim {
    fn now_s(&self) -> f64 {
        self.now_s
    }

    fn pass(&mut self, until_s: f64, bytes: &[u8], received: &mut Vec<u8>) -> Result<(), TransportError> {
        let ran = self.emulator.run(until_s, bytes)?;
        self.now_s = ran.t_s.max(until_s);
        received.extend(ran.uart);
        self.truth.extend(ran.truth);
        Ok(())
    }

    fn take_truth(&mut self) -> Vec<Truth> {
        std::mem::take(&mut self.truth)
    }

    fn emulator(&mut self) -> Option<&mut Emulator> {
        Some(&mut self.emulator)
    }
}
