//! Everything that the firmware decides, as pure step functions: time, readings and requests come in as arguments,
//! commands and events go out. The same code runs on the board and in desktop tests.
//!
//! - [`adaptation`]: slow drift of the strings.
//! - [`constants`]: the rig's numbers, generated from the scene.
//! - [`sensors`]: readings with their time and validity; raw codes to SI.
//! - [`limits`]: what the motor allows of a move.
//! - [`mechanism`]: the table, with this rig's own scale of the twist.
//! - [`planner`]: acceleration- and jerk-limited motion.
//! - [`observer`]: the load, from twist and gap.
//! - [`position_loop`]: set-point and measured position to twist speed, through TR.
//! - [`crossing`]: taking up the rail's friction before a move.
//! - [`forecast`]: how long a move will take.
//! - [`homing`]: zero twist without switches, then the load.
//! - [`settings`]: what the rig is told for good: applied to its constants, and as bytes in flash.
//! - [`supervisor`]: states, faults, requests; [`supervisor::Rig::step`] is one control tick.

#![no_std]
#![forbid(unsafe_code)]

pub mod adaptation;
pub mod constants;
pub mod crossing;
pub mod forecast;
pub mod homing;
pub mod limits;
pub mod mechanism;
pub mod observer;
pub mod planner;
pub mod position_loop;
pub mod sensors;
pub mod settings;
pub mod supervisor;

pub use constants::RigConstants;
pub use sensors::{DriveReading, LvdtBlock, LvdtReading, SupplyReading};
pub use supervisor::{DriveCommand, Inputs, Outputs, Rig};

/// Control period (s): one tick, one drive command, one telemetry message. The drive's recommended data period
/// (hardware.md 2.5) and its feedback period.
pub const TICK_S: f32 = 0.01;

/// [`TICK_S`] in microseconds.
pub const TICK_US: u64 = 10_000;
