//! A conversation with the firmware, on a serial port or on the emulated board.
//!
//! - [`port`]: how bytes get there and back, and what only an emulated rig can tell.
//! - [`sim`]: the emulated board, a process that is stepped in emulated time.
//! - [`serial`]: a real port.
//! - [`client`]: requests with replies, events, telemetry: [`client::Session`].
//! - [`order`]: frames that come once more, and restarts.
//! - [`interrupt`]: Ctrl-C stops the motion first.
//! - [`row`]: one line of telemetry with the truth beside it.

pub mod client;
pub mod interrupt;
pub mod order;
pub mod port;
pub mod row;
pub mod serial;
pub mod sim;

pub use client::Session;
pub use port::Port;
pub use sim_link::Truth;
