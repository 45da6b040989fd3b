//! What passes between host and board.

use super::row::Row;
use rig_link::{EventKind, Request};

/// One thing that passed.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// The host sent a request, after the telemetry of this time (s).
    Request(f64, Request),
    /// The board reported an event of this time (s).
    Event(f64, EventKind),
    /// Telemetry.
    Row(Row),
}
