//! What a host and an emulated rig say to each other.
//!
//! The emulator (`rig-emulator`, GPL) and the tool (`rigctl`, MIT) are two programs. They share this crate, so that
//! each name, unit and record is written once.
//!
//! - [`control`]: requests and answers, one JSON value on each line.
//! - [`plant`]: what can be changed about the emulated rig without telling the firmware.
//! - [`preset`]: rigs that differ from their own model, drawn from a seed.
//! - [`effects`]: constants of what real rigs have besides their model.
//! - [`faults`]: what can be broken in the emulated rig and its board.
//! - [`truth`]: what really happens in the emulated rig.
//! - [`units`]: numbers with units, as an operator types them.

#![forbid(unsafe_code)]

pub mod control;
pub mod effects;
pub mod faults;
pub mod plant;
pub mod preset;
pub mod truth;
pub mod units;

pub use control::{Answer, Request, Run, Stats};
pub use faults::{ChipFault, Fault, RigFault};
pub use plant::{PlantChange, PlantError, PlantKey};
pub use preset::RigPreset;
pub use truth::Truth;
