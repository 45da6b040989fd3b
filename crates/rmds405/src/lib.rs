//! The protocol of the RoboModule RMDS-405 motor drive: its frames in both directions, and the order in which they go.
//!
//! There is no hardware and no clock in here: CAN frames are plain values, and time is an argument. The facts stand in
//! `crates/rmds405/README.md` (the doc comments name the section), which quotes the vendor's CAN manual as V-CAN and
//! its FAQ as V-FAQ.
//!
//! - [`address`]: group, number and function, which together make the CAN identifier.
//! - [`units`]: newtypes for what the wire carries, each with its range.
//! - [`frame`]: a frame to send, a frame received, and why a received one was ignored.
//! - [`command`]: host to drive, encoded by the firmware and decoded by the emulated drive.
//! - [`report`]: drive to host, encoded by the emulated drive and decoded by the firmware.
//! - [`start_up`]: power-up to the first data frame as a pure state machine.
//! - [`conversation`]: all of it together: what to send at each tick, what is known of the drive, motor power.
//! - [`serial`]: the same frames over RS232. Experimental: the framing is an assumption.
#![no_std]
#![forbid(unsafe_code)]

pub mod address;
pub mod command;
pub mod conversation;
pub mod frame;
pub mod report;
pub mod serial;
pub mod start_up;
pub mod units;

pub use address::{Address, Function};
pub use command::{Command, Mode, Output};
pub use conversation::{Conversation, DriveCommand, DriveReading, SupplyReading};
pub use frame::{Frame, Ignored, Received};
pub use report::{Mixed, Report};
pub use start_up::{Action, StartUp};
pub use units::{CurrentLimit, Milliamps, OutOfRange, Pwm, PwmLimit, QuadCounts, Rpm, SpeedLimit};

/// The lines to a drive. They exclude each other: the drive uses the one that it was first addressed on, until it loses
/// power or is reset (V-FAQ p24).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// CAN.
    Can,
    /// RS232 on a UART, experimental ([`serial`]).
    Uart,
}
