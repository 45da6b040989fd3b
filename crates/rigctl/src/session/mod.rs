//! A conversation with the firmware, on a serial port or on the emulated board. No room here knows a command.
//!
//! - [`connect`]: from the operator's choice of a board to a session with it.
//! - [`homing`], [`motion`], [`status`], [`table`]: what a session is used for.
//! - [`client`]: requests with replies, events, telemetry ([`Session`]); [`link`]: the frames below.
//! - [`port`]: how bytes get there and back; `ports`: which serial port is the board's; [`sim`]: the emulated board, a process that is stepped in emulated time;
//!   [`serial`]: a real port.
//! - [`order`]: frames that arrive twice, and restarts of the board.
//! - [`silence`]: whether the board is heard, and which of its rows were lost.
//! - [`row`]: one line of telemetry with the [`truth`] beside it; [`entry`]: what a recorder sees.
//! - [`interrupt`]: Ctrl-C stops the motion first.

pub mod client;
pub mod connect;
pub mod entry;
pub mod homing;
pub mod interrupt;
pub mod link;
pub mod motion;
pub mod order;
pub mod port;
mod ports;
pub mod row;
pub mod serial;
pub mod silence;
pub mod sim;
pub mod status;
pub mod stream;
pub mod table;
pub mod truth;

pub use client::Session;
pub use connect::{Place, Target};
pub use link::STEP_S;
pub use port::Port;
pub use ports::auto;
pub use rig_plant::Truth;
