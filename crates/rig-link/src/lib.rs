//! The messages between the host tool and the firmware.
//!
//! - [`messages`]: the table of all messages; [`codes`]: the named codes in them (states, faults, limits …), each with its
//!   number and name.
//! - [`faults`]: sets of codes. [`gap_curve`]: what a rig's gap is beside the table's.
//! - [`board_settings`]: unit, default and range of every setting of the board.
//! - [`corrected_constants`]: which settings still mean the same on a rig with other constants.
//! - [`lvdt_curve`]: the LVDT's correction at several points.
//! - [`frame`]: how a message becomes bytes on a UART and comes back: sequence number, postcard, CRC-32, COBS.
//! - [`sequence`]: which requests are new, and which are old ones that arrive again.
//! - [`protocol`]: the hash over the schema of all messages; [`versions`]: the greeting with it.
//!
//! Neither side trusts the other's bytes: a damaged frame is counted and dropped, and the next good one is found.
//! Both sides compare [`PROTOCOL_HASH`] first, so that a tool never misreads a firmware with other messages.

#![no_std]
#![forbid(unsafe_code)]

pub mod board_settings;
pub mod codes;
pub mod corrected_constants;
pub mod faults;
pub mod frame;
pub mod gap_curve;
pub mod lvdt_curve;
pub mod messages;
pub mod protocol;
pub mod sequence;
pub mod versions;

pub use frame::{DecodeError, Decoder, EncodeError, Frame, MAX_FRAME, encode};
pub use messages::*;
pub use protocol::PROTOCOL_HASH;

/// Standard gravity (m/s², CODATA): what turns a mass into a load.
pub const STANDARD_GRAVITY: f64 = 9.806_65;

/// Bits per second on the UART (8 data bits, no parity, 1 stop bit).
pub const BAUD: u32 = 115_200;

/// The board sends one telemetry message every this many milliseconds.
/// It has at most 100 bytes: 10 kB/s of the 11.5 kB/s that [`BAUD`] carries. The counts of errors, which change rarely, come
/// with the sensors' readings instead.
pub const TELEMETRY_PERIOD_MS: u32 = 10;

/// The host sends a heartbeat this often (ms); the board reports a silent host after several have failed to come.
pub const HEARTBEAT_PERIOD_MS: u32 = 100;
