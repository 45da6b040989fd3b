//! Recorded logs: telemetry as CSV under a header with everything that is needed to run the experiment again.
//!
//! ```text
//! # format = tsa-log 1
//! # scene_hash = 90c10a2c            one `key = value` line for each fact, see [`Header`]
//! t_s,state,fault,…                  the names of the host tool's contract, see [`Row`](crate::session::row::Row)
//! # at 12.34 request move 0.008 …    a request, as an event of a script, and
//! # at 15.92 event move-done …       an event of the board, between the rows of their times
//! 12.35,moving,,…
//! # end rows = 1234                  the last line: without it the log was cut short
//! ```
//! A CSV reader that passes over lines beginning with `#` reads such a file. [`mod@write`] writes logs, [`read`] reads
//! them back, [`sweep`] reduces a recorded sweep to equilibria.

pub mod read;
pub mod sweep;
pub mod write;

pub use read::{Log, Mark, Marked};
pub use write::{Ended, Recorder};

use crate::board_settings;
use crate::failure::Failure;
use crate::lvdt_points;
use crate::scene_file;
use crate::session::{Session, Target};
use rig_link::PROTOCOL_HASH;
use std::time::SystemTime;

/// First value of the header: raise the number when a reader of the old format would misread the new one.
pub const FORMAT: &str = "tsa-log 1";
/// Key in the header of the host's clock when recording starts, by RFC 3339.
const HOST_TIME: &str = "host_time";
/// Prefix of a setting's name in the header.
pub const SETTINGS: &str = "settings.";
/// Prefix in the header of the name of a constant that settings correct.
const CONSTANTS: &str = "constants.";

/// The facts that are known before the first row, in order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Header(pub Vec<(String, String)>);

impl Header {
    /// Of a session that has greeted its board; `command` is the command that records.
    ///
    /// # Errors
    /// If the board has not sent its identity and settings, or the scene cannot be read.
    pub fn new(target: &Target, session: &Session, command: &str) -> Result<Self, Failure> {
        let scene_hash = scene_file::load(&target.scene)?.hash();
        let board = session.require_identity()?;
        let settings =
            session.known_settings().ok_or_else(|| Failure::failed("the board did not send its settings"))?;
        let mut header = Self::default();
        header.add("format", FORMAT);
        header.add("tool", concat!("rigctl ", env!("CARGO_PKG_VERSION")));
        header.add("command", command);
        header.add(HOST_TIME, humantime::format_rfc3339_millis(SystemTime::now()));
        header.add("scene", target.scene.display());
        header.add("scene_hash", format!("{scene_hash:08x}"));
        header.add("port", target.port());
        if let Some(options) = target.emulated() {
            header.add("rig", options.preset());
            header.add("seed", options.seed);
            if options.scene != target.scene {
                header.add("plant_scene", options.scene.display());
            }
            if let Some(program) = &options.plant_program {
                header.add("plant_program", program);
            }
            for surface in &options.plant_surface {
                header.add("plant_surface", surface.display());
            }
            for change in &options.plant {
                header.add(&format!("plant.{}", change.key), change.value);
            }
        }
        header.add("firmware", &board.version);
        header.add("git", &board.git);
        header.add("rig_hash", format!("{:08x}", board.rig_hash));
        header.add("protocol_hash", format!("{PROTOCOL_HASH:08x}"));
        header.add("boot_count", board.boot_count);
        header.add("reset_cause", board.reset_cause);
        let table = &board.table;
        header.add("table.form", &table.form);
        header.add("table.crc", format!("{:08x}", table.crc));
        header.add("table.sent", table.sent);
        header.add("table.contraction_error_m", table.contraction_error_m);
        header.add("table.tr_relative_error", table.tr_relative_error);
        header.add("table.load_n", format!("{} to {}", table.load_min_n, table.load_max_n));
        header.add("table.turns", format!("{} to {}", table.turns_min, table.turns_max));
        header.add("settings_kept", settings.kept.name());
        if !settings.dropped.is_empty() {
            header.add("settings_dropped", board_settings::dropped(&settings.dropped));
        }
        for (name, value) in board_settings::named_constants(&settings.constants) {
            header.add(&format!("{CONSTANTS}{name}"), value);
        }
        for (setting, value) in settings.values.iter() {
            header.add(&format!("{SETTINGS}{setting}"), value);
        }
        if let Some(curve) = &settings.values.lvdt_curve {
            header.add(&format!("{SETTINGS}{}", lvdt_points::NAME), lvdt_points::text(curve));
        }
        Ok(header)
    }

    /// Adds a fact. A line break in its value would end the header's line, so it becomes a blank.
    pub fn add(&mut self, key: &str, value: impl std::fmt::Display) {
        self.0.push((key.to_owned(), value.to_string().replace(['\r', '\n'], " ")));
    }

    /// The host's clock when recording started.
    pub fn host_time(&self) -> Option<SystemTime> {
        humantime::parse_rfc3339(self.get(HOST_TIME)?).ok()
    }

    /// The value of a key.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str())
    }
}
