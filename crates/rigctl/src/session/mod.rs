//! A conversation with the firmware, on a serial port or on the emulated board. No room here knows a command.
//!
//! - [`connect`]: from the operator's choice of a board to a session with it.
//! - [`motion`], [`homing`], [`stream`], [`table`]: what a session is used for.
//! - [`client`]: requests with replies, events, telemetry ([`Session`]); [`link`]: the frames below, and the [`Port`] that they
//!   go over; [`sim`]: the emulated board, a process that is stepped in emulated time; [`serial`]: a real port.
//! - [`order`]: frames that arrive twice, and restarts of the board.
//! - [`silence`]: whether the board is heard, and which of its rows were lost.
//! - [`row`]: one line of telemetry with the truth beside it, and whatever else a recorder sees.
//! - [`interrupt`]: Ctrl-C stops the motion first.

pub mod client;
pub mod connect;
pub mod homing;
pub mod interrupt;
pub mod link;
pub mod motion;
pub mod order;
pub mod row;
pub mod serial;
pub mod silence;
pub mod sim;
pub mod stream;
pub mod table;

pub use client::Session;
pub use connect::{Place, Target, Wanted};
pub use link::{Port, STEP_S};
pub use rig_plant::Truth;
pub use serial::auto;
