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

mod homing;
mod identity;
mod refusal;
mod request;
mod telemetry;

pub use crate::codes::*;
pub use crate::corrected_constants::{CorrectedConstants, Dropped};
pub use crate::faults::{Doubts, Faults};
pub use crate::gap_curve::GapCurve;
pub use crate::lvdt_curve::{LVDT_APART_M, LVDT_POINTS_MAX, LvdtCurve};
pub use crate::versions::{VersionMismatch, Versions};
pub use homing::HomingResult;
pub use identity::{Identity, TableIdentity};
pub use refusal::Refusal;
pub use request::{LoadChoice, Request, SettingValues, TablePart, TableParts};
pub use telemetry::{Counters, EventKind, Sensors, Telemetry};

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A message of the board to the host.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Message {
    /// The greeting, which both sides understand whatever their versions. The first variant for ever, see [`Versions`].
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
