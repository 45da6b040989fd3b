//! The table of all messages; the named codes in them are in [`crate::codes`]. A change of a type, field, variant or order
//! in either changes [`crate::PROTOCOL_HASH`].
//!
//! | from  | message     | when                                                             |
//! |-------|-------------|------------------------------------------------------------------|
//! | host  | [`Request`] | as the operator wishes; `Heartbeat` all the time                 |
//! | board | `Hello`     | after `Hello`, whatever the versions                             |
//! | board | `Reply`     | once for each request except `Heartbeat`, with its number        |
//! | board | `Identity`  | after `Hello` and after `Status`, following the reply            |
//! | board | `Settings`  | after `GetSettings`, and when settings are in flash              |
//! | board | `Sensors`   | after `ReadSensors`                                              |
//! | board | `Telemetry` | every 10 ms, without a request                                   |
//! | board | `Event`     | when something ends or fails                                     |
//!
//! SI units throughout; the unit is in the name. `None` means "not known", never "zero".
//! Position is how far the load has come up from where it hung, at the half-turn pre-twist, when the rig was homed.

mod refusal;
mod request;
mod telemetry;

pub use crate::codes::*;
pub use crate::corrected_constants::{CorrectedConstants, Dropped};
pub use crate::faults::{Doubts, Faults};
pub use crate::gap_curve::GapCurve;
pub use crate::lvdt_curve::{LVDT_APART_M, LVDT_POINTS_MAX, LvdtCurve};
pub use crate::versions::{VersionMismatch, Versions};
pub use refusal::Refusal;
pub use request::{LoadChoice, Request, SettingValues, TablePart, TableParts};
pub use telemetry::{Counters, EventKind, HomingResult, Sensors, Telemetry};

use heapless::String;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A message of the board to the host.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Message {
    /// The greeting, which both sides understand whatever their versions. It stays the first variant, see [`Versions`].
    Hello(Versions),
    /// The answer to one request.
    Reply {
        /// Sequence number of the request's frame.
        to: u16,
        /// Accepted, or why not.
        result: Result<Accepted, Refusal>,
    },
    /// Who the board is.
    Identity(Identity),
    /// State and measurements.
    Telemetry(Telemetry),
    /// The settings.
    Settings(SettingsReport),
    /// Readings of the sensors.
    Sensors(Sensors),
    /// Something ended or went wrong.
    Event {
        /// Time since boot (µs).
        t_us: u64,
        /// What happened.
        kind: EventKind,
    },
}

/// The settings of a board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SettingsReport {
    /// In use.
    pub values: SettingValues,
    /// The defaults; that of the current limit is the scene's.
    pub defaults: SettingValues,
    /// The constants that they correct.
    pub constants: CorrectedConstants,
    /// What flash holds.
    pub kept: Kept,
    /// With [`Kept::Partly`] the settings in flash that are not used.
    pub dropped: Dropped,
}

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
    /// Certified maximum error of the contraction (m).
    pub contraction_error_m: f32,
    /// Certified maximum relative error of TR.
    pub tr_relative_error: f32,
    /// Minimum load (N).
    pub load_min_n: f32,
    /// Maximum load (N).
    pub load_max_n: f32,
    /// Minimum motor turns past the half-turn pre-twist.
    pub turns_min: f32,
    /// Maximum motor turns past the half-turn pre-twist.
    pub turns_max: f32,
    /// Checksum of the table.
    pub crc: u32,
    /// The host sent it; it is not the built-in one.
    pub sent: bool,
}
