//! Recorded logs: telemetry as CSV under a head that says what it takes to run the experiment again.
//!
//! ```text
//! # format = tsa-log 1
//! # scene_hash = 90c10a2c            one `key = value` line for each fact, see [`Header`]
//! t_s,state,fault,…                  the names of the host tool's contract, see [`Row`]
//! # at 12.34 request move 0.008 …    what was asked, in the words of a script, and
//! # at 15.92 event move-done …       what the board said, between the rows that they happened between
//! 12.35,moving,,…
//! # end rows = 1234                  the last line: without it the log was cut short
//! ```
//! Whoever reads CSV and passes over lines that begin with `#` needs to know nothing of this. [`mod@write`] and [`read`] are
//! the two ends.

pub mod read;
pub mod sweep;
pub mod write;

pub use read::{Log, LogError, LogRow, Mark, Marked};
pub use write::Recorder;

use crate::cli::Global;
use crate::session::row::Row;
use rig_link::{EventKind, Identity, PROTOCOL_HASH, Request, SettingsReport};
use std::time::SystemTime;

/// First value of the head: raise the number when a reader of the old one would misread the new one.
pub const FORMAT: &str = "tsa-log 1";
/// What stands before a setting's name in the head.
const SETTINGS: &str = "settings.";

/// What passes between host and board, in order.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// The host asked, after the telemetry of this time (s).
    Request(f64, Request),
    /// The board said, at this time (s).
    Event(f64, EventKind),
    /// Telemetry.
    Row(Row),
}

/// What is known before the first row, in order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Header(pub Vec<(String, String)>);

impl Header {
    /// For a board that has said who it is and how it is calibrated. `scene_hash` is the host's scene; `command` what is
    /// run.
    pub fn new(global: &Global, scene_hash: u32, board: &Identity, settings: &SettingsReport, command: &str) -> Self {
        let mut header = Self::default();
        header.add("format", FORMAT);
        header.add("tool", concat!("rigctl ", env!("CARGO_PKG_VERSION")));
        header.add("command", command);
        header.add("host_time", humantime::format_rfc3339_seconds(SystemTime::now()));
        header.add("scene", global.scene.display());
        header.add("scene_hash", format!("{scene_hash:08x}"));
        header.add("port", &global.port);
        if crate::commands::operate::is_sim(global) {
            header.add("seed", global.seed);
            if let Some(scene) = &global.plant_scene {
                header.add("plant_scene", scene.display());
            }
            for change in &global.plant {
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
        header.add("table.rebuilt", table.rebuilt);
        header.add("table.contraction_error_m", table.contraction_error_m);
        header.add("table.tr_relative_error", table.tr_relative_error);
        header.add("table.load_n", format!("{} to {}", table.load_min_n, table.load_max_n));
        header.add("table.turns", format!("{} to {}", table.turns_min, table.turns_max));
        header.add("settings_kept", settings.kept.name());
        for (setting, value) in settings.values.iter() {
            header.add(&format!("{SETTINGS}{setting}"), value);
        }
        header
    }

    /// One more fact. A line's end in it would end the head's line.
    pub fn add(&mut self, key: &str, value: impl std::fmt::Display) {
        self.0.push((key.to_owned(), value.to_string().replace(['\r', '\n'], " ")));
    }

    /// The value of a key.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.0.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str())
    }
}
