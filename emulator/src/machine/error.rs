//! Why a machine stopped, and where.

use crate::cpu::image::ImageError;
use crate::soc::fault::Fault;
use std::fmt;

/// Where and when the firmware was.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Program counter.
    pub pc: u32,
    /// Symbol of the function.
    pub function: String,
    /// Emulated time.
    pub t_s: f64,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at {:#010x} in {}, {:.6} s", self.pc, self.function, self.t_s)
    }
}

/// Why the machine stopped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MachineError {
    /// The ELF cannot be loaded.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The firmware did something that the real chip would not do, or that is not modelled.
    #[error("{fault}; `{}` ({place})", fault.lint.name())]
    Fault {
        /// What.
        fault: Fault,
        /// Where.
        place: Place,
    },
    /// An access to an address that nothing is mapped to: a bus fault on the chip.
    #[error("{what} at {address:#010x}, where nothing is ({place})")]
    Memory {
        /// Kind of access.
        what: &'static str,
        /// Address.
        address: u32,
        /// Where.
        place: Place,
    },
    /// An undefined instruction, with which a panic ends as well.
    #[error("undefined instruction or panic: {} ({place})", said.as_deref().unwrap_or("no message"))]
    Undefined {
        /// The last defmt line of level error, most likely the panic's message.
        said: Option<String>,
        /// Where.
        place: Place,
    },
    /// An exception that no firmware should cause, such as a breakpoint.
    #[error("unexpected exception {number} of the emulator ({place})")]
    Exception {
        /// unicorn's number.
        number: u32,
        /// Where.
        place: Place,
    },
    /// A BKPT instruction, which ends a program that a debugger watches.
    #[error("BKPT {number:#04x}{} ({place})", if *number == 0xAB && exit.is_none() { ": semihosting is not modelled" } else { "" })]
    Breakpoint {
        /// The instruction's number.
        number: u8,
        /// What it says of success: always yes, but for semihosting (number 0xAB), where only an exit says so.
        exit: Option<bool>,
        /// Where.
        place: Place,
    },
    /// A flash image of the wrong size.
    #[error("a flash image of {0} bytes")]
    FlashSize(usize),
    /// The emulator itself failed.
    #[error("unicorn: {0}")]
    Emulator(String),
}
