//! Tests across crates, and the experiments on the emulated rig: with the control code alone ([`rig_plant::bench`]) or with the
//! firmware's ELF on the emulated board ([`board`]).

pub mod board;
pub mod compare;
pub mod endurance;
pub mod following;
pub mod full_speed;
pub mod fuzz;
pub mod load_changes;
pub mod margins;
pub mod physical_limit;
pub mod rigs;
pub mod rivals;
pub mod rivals_figure;
pub mod scenario;
pub mod speed_figure;
pub mod sweep;

pub use rig_plant::bench::{ControlBench, ControlTick, Controller, Tamper, constants, scene, table};
use std::path::{Path, PathBuf};

/// The repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}
