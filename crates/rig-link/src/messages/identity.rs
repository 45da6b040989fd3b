//! What the board is, and what its firmware was built for.

use crate::codes::{Clock, ResetCause};
use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// The board, and what its firmware was built for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identity {
    /// Firmware version.
    pub version: String<24>,
    /// Short commit, with `-dirty` if the tree had changes.
    pub git: String<24>,
    /// The board's [`crate::PROTOCOL_HASH`].
    pub protocol_hash: u32,
    /// Hash of the scene that the table was fitted to.
    pub scene_hash: u32,
    /// Hash of the `[rig]` that was built in: gear, encoder, motor, drive, LVDT.
    pub rig_hash: u32,
    /// The embedded table.
    pub table: TableIdentity,
    /// Why the board last started.
    pub reset_cause: ResetCause,
    /// Boots since power came on, counting this one.
    pub boot_count: u32,
    /// Source of the clock.
    pub clock: Clock,
    /// Level of the chip's brown-out reset, 1 (2.1 V) to 3 (2.7 V), an option byte; 0 is off, as delivered.
    pub brown_out_level: u8,
    /// The message with which the previous run ended, if that was a panic or a fault of the core; as much as fits.
    pub last_panic: Option<String<88>>,
}

/// The embedded transmission table and its certificate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TableIdentity {
    /// Name of the table's form.
    pub form: String<32>,
    /// Size (bytes).
    pub bytes: u16,
    /// Certified greatest error of the contraction (m).
    pub contraction_error_m: f32,
    /// Certified greatest relative error of TR.
    pub tr_relative_error: f32,
    /// Least load (N).
    pub load_min_n: f32,
    /// Greatest load (N).
    pub load_max_n: f32,
    /// Least motor turns past the half-turn pre-twist.
    pub turns_min: f32,
    /// Greatest motor turns past the half-turn pre-twist.
    pub turns_max: f32,
    /// Checksum of the table.
    pub crc: u32,
    /// The host sent it; it is not the built-in one.
    pub sent: bool,
}
