//! The laboratory: what the actuator's model and table are compared with, the charts of it, and the page.
//!
//! The program `tsa-lab` ([`cli`]) parses its command line as `rigctl` does. Each command is a module with its arguments and its
//! `run`, which prints and writes what the rest of the module computes: data, CSV, SVG or text of a scene.
//!
//! - [`published`]: the numbers that the paper prints beside the same numbers computed, and the paper's figures redrawn.
//! - [`scene_key`]: one key of a scene by name or symbol.
//! - [`study`]: one value of a scene varied over a [`range`]; [`trace`]: contraction and TR along the turns; [`curves`]: drawn.
//! - [`chart`]: speed against accuracy of every method, tier and table form, and where methods fail.
//! - [`closed_loop`]: moves of the emulated board with cheaper models and less accurate tables.
//! - [`budget`]: what each part of a rig contributes to the errors of position and load.
//! - [`table_report`]: a table's certificate and why this table was chosen.
//! - [`page`]: the page of `report`, put together from its data and the files in `web/page`.
//! - [`solve`]: one equilibrium by any method; [`mod@bench`]: what it costs.

#![forbid(unsafe_code)]

pub mod bench;
pub mod budget;
pub mod chart;
pub mod cli;
pub mod closed_loop;
pub mod curves;
pub mod page;
pub mod published;
pub mod range;
pub mod scene_key;
pub mod solve;
pub mod study;
pub mod table_report;
pub mod trace;
