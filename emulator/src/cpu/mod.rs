//! Cortex-M4F around unicorn: time, sleep, exceptions, reset.
//!
//! unicorn executes instructions and implements priority masks and the FPU. The rest of a microcontroller's core is
//! here:
//! - [`image`]: the firmware's ELF. - `run`: the core's run loop, sleep and reset.
//! - [`core`]: the state that the hooks share; `blocks` and [`timing`]: instructions and cycles; [`watch`]: costs of
//!   chosen functions.
//! - `hooks`: time and peripherals from inside the CPU.
//! - `exceptions`: frames and returns.
//! - [`debug`]: breakpoints, steps and registers for a debugger; `stops`: where it has stopped the core.

mod blocks;
pub mod core;
pub mod debug;
mod exceptions;
mod hooks;
pub mod image;
mod run;
mod stops;
pub mod timing;
pub mod watch;

pub use self::run::{Cpu, Outcome};
