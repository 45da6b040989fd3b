//! The emulated rig around the control code: mechanism in motion, motor, drive, sensors, and what a host says to it.
//!
//! The emulated board (`rig-emulator`, under the GPL) runs the firmware's ELF against it; [`mod@bench`] runs the control code
//! itself against it, in one process.
//!
//! - [`rig`]: drive, motor, encoder, LVDT and the mechanism itself; what real rigs have besides, what can be broken.
//! - [`board`]: the seam between microcontroller and wiring.
//! - [`mod@bench`]: the control code on the rig, hundreds of times faster than the emulated chip.
//! - [`control`]: requests and answers, one JSON value on each line.
//! - [`plant`]: what can be changed about the emulated rig without telling the firmware.
//! - [`preset`]: rigs that differ from their own model, drawn from a seed.
//! - [`trial`]: one rig of a kind, tried once: what the board states next to what is true.
//! - [`truth`]: what really happens in the emulated rig.
//! - [`units`]: numbers with units, as an operator types them.

#![deny(unsafe_code)]

pub mod bench;
pub mod board;
pub mod control;
pub mod plant;
pub mod preset;
pub mod rig;
pub mod trial;
pub mod truth;
pub mod units;

pub use control::{Answer, Request, Run, Stats};
pub use plant::{PlantChange, PlantError, PlantKey, PlantSettings};
pub use preset::RigPreset;
pub use rig::faults::{ChipFault, Fault, RigFault};
pub use truth::Truth;
