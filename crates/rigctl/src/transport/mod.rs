//! Where the board is: a serial port, the emulated board, or (in tests) memory. Bytes and time pass through one trait.

mod serial;
mod sim;

pub use serial::Serial;
pub use sim::{Sim, SimOptions};

use crate::emulator::{Emulator, EmulatorError};
use crate::record::Truth;

/// Why bytes could not be exchanged.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// The serial port could not be opened.
    #[error("port {port}: {source}")]
    Open {
        /// Which.
        port: String,
        /// What the system said.
        source: serialport::Error,
    },
    /// The serial port failed.
    #[error("port {port}: {source}")]
    Port {
        /// Which.
        port: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The emulated board failed.
    #[error(transparent)]
    Emulator(#[from] EmulatorError),
}

/// A way to the board.
pub trait Transport {
    /// Time on this way (s): emulated, or since it was opened.
    fn now_s(&self) -> f64;

    /// Delivers `bytes`, lets time pass until `until_s`, and appends what arrived meanwhile to `received`.
    ///
    /// # Errors
    /// If the way is broken.
    fn pass(&mut self, until_s: f64, bytes: &[u8], received: &mut Vec<u8>) -> Result<(), TransportError>;

    /// What really happened since last asked; only the emulated plant knows.
    fn take_truth(&mut self) -> Vec<Truth> {
        Vec::new()
    }

    /// The emulator, if this is one.
    fn emulator(&mut self) -> Option<&mut Emulator> {
        None
    }
}
