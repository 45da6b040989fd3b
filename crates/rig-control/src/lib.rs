//! All decisions of the firmware, as pure step functions: time, readings and requests come in as arguments, commands and
//! events go out. The same code runs on the board and in desktop tests.
//!
//! A tick begins and ends in [`supervisor`]: [`supervisor::Controller::step`]. It uses, from the sensors to the motor:
//! - [`constants`]: the rig's numbers, generated from the scene; [`settings`]: how settings correct them, and their record
//!   in flash.
//! - [`sensors`]: readings with their time and validity; raw codes to SI.
//! - [`mechanism`]: the table, with this rig's own scale of the twist and its own gap curve.
//! - [`direction`]: which way motor and encoders turn, before the drive closes a loop.
//! - [`homing`]: zero twist without switches, then load, friction, scale of the twist and gap curve, with their errors.
//! - [`observer`]: the load and its stated error, from twist and gap; [`hysteresis`]: what the rods remember; [`adaptation`]: slow
//!   drift of the strings.
//! - [`load_motion`]: how the load oscillates on its strings, and how it will move when a command acts.
//! - [`move_check`]: whether a move is possible.
//! - [`limits`]: what the motor allows of a move; [`planner`]: acceleration- and jerk-limited motion, and how long it will take.
//! - [`position_loop`]: set-point and motion of the load to twist speed, damping the oscillation; [`friction_compensation`]: the rail's friction
//!   before a move and at rest; [`rest`]: when a load is left alone, and which error stiction leaves. All work on a [`load_state`].

#![no_std]
#![forbid(unsafe_code)]

pub mod adaptation;
pub mod constants;
pub mod direction;
pub mod friction_compensation;
pub mod homing;
pub mod hysteresis;
mod least_squares;
pub mod limits;
pub mod load_motion;
pub mod load_state;
pub mod mechanism;
pub mod move_check;
pub mod observer;
pub mod planner;
pub mod position_loop;
pub mod ramp;
pub mod rest;
pub mod sensors;
pub mod settings;
pub mod supervisor;

pub use constants::RigConstants;
pub use rmds405::DriveCommand;
pub use sensors::{DriveReading, LvdtBlock, LvdtReading, SupplyReading};
pub use supervisor::{Controller, Inputs, Outputs};

/// Control period (s): one tick, one drive command, one telemetry message. The drive's recommended data period
/// (crates/rmds405/README.md 2.5) and its feedback period.
pub const TICK_S: f32 = 0.01;

/// [`TICK_S`] in microseconds.
pub const TICK_US: u64 = 10_000;

// The core converts between f32 and 32 bits by itself, and 64 bits by a function that is ten times as long.

/// A time (s), at most an hour, from microseconds.
fn seconds(us: u64) -> f32 {
    u32::try_from(us).unwrap_or(u32::MAX) as f32 * 1e-6
}

/// Whole counts, saturating at 32 bits.
fn whole_counts(counts: f32) -> i64 {
    i64::from(counts as i32)
}

/// Angle (rad) of a count, saturating at 32 bits, which are thousands of turns.
fn angle_rad(counts: i64, counts_per_rad: f32) -> f32 {
    counts.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32 as f32 / counts_per_rad
}
