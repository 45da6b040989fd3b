//! Tests across crates, and the studies on the emulated rig: with the control code alone ([`rig_plant::bench`]) or with the
//! firmware's ELF on the emulated board ([`board`]). A study makes a [`study::Study`]; [`results`] keeps it and writes the pages.

pub mod agreement;
pub mod board;
pub mod compare;
pub mod coverage;
pub mod endurance;
pub mod following;
pub mod full_speed;
pub mod limit;
pub mod load_changes;
pub mod loop_gain;
pub mod margins;
pub mod oracle;
pub mod physical_limit;
pub mod results;
pub mod rigs;
pub mod scenario;
pub mod slow;
pub mod speed;
pub mod study;
pub mod sweep;

pub use rig_plant::bench::{ControlBench, ControlLaw, Tamper, booted, constants, scene, table};
use std::path::{Path, PathBuf};

/// The repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}
