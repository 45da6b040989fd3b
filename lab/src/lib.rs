//! The laboratory: what the actuator's model and table are compared with, and the charts of it.
//!
//! The functions here take a scene and options and return data, CSV, SVG or text; the tool `rigctl` parses its command
//! line, calls them, prints and writes files.
//!
//! - [`published`]: the numbers that the paper prints beside the same numbers computed, and the paper's figures redrawn.
//! - [`study`]: one value of a scene varied over any range; [`trace`]: contraction and TR along the turns;
//!   [`scene_key`]: one key of a scene by name or by the paper's symbol.
//! - [`chart`]: speed against accuracy of every method, tier and table form, and where methods fail.
//! - [`budget`]: what each part of a rig contributes to the errors of position and load.
//! - [`table_report`]: a table's certificate and why this table was chosen.
//! - [`plot`]: pictures as SVG; [`curves`], [`move_figure`] and [`mechanism_figure`]: what is drawn with it.
//! - [`csv_text`]: data as CSV; [`parallel`]: work on all cores.

#![forbid(unsafe_code)]

pub mod budget;
pub mod calibration_figure;
pub mod chart;
pub mod csv_text;
pub mod curves;
pub mod mechanism_figure;
pub mod move_figure;
pub mod parallel;
pub mod plot;
pub mod published;
pub mod scene_key;
pub mod study;
pub mod table_report;
pub mod trace;

use serde::Serialize;

/// Standard gravity (m/s²).
pub use rig_plant::units::STANDARD_GRAVITY as STANDARD_GRAVITY_M_PER_S2;

/// Why a number could not be computed, as `--json` prints it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ErrorBody {
    /// Short stable name.
    pub kind: String,
    /// In words.
    pub message: String,
}
