//! Scene files: what one rig and one task need, in TOML.
//!
//! `[geometry]`, `[string]` and `[material]` are the mechanism's constants. `[rig]` holds what the paper leaves open
//! about the rig; its defaults are assumptions (docs/reference/hardware.md sections 2 and 3) and every key may be left
//! out. `[uncertainty]` says how well the mechanism's constants are known; it may be left out as well.
//! `[envelope]` and `[accuracy]` say what a table must cover and how well: optional for a solve, required for a table.
//!
//! - [`scene`]: the file, its hashes, the solver and the table that follow from it.
//! - [`rig`]: `[rig]`, and its conversion to [`rig_control::RigConstants`].
//! - [`uncertainty`] has the table of that name.
//! - [`checks`]: whether the values of a scene fit each other.
//! - [`files`]: reading and replacing files without losing any.

#![forbid(unsafe_code)]

pub mod checks;
pub mod error;
pub mod files;
pub mod rig;
pub mod scene;
pub mod uncertainty;

pub use checks::Residual;
pub use error::{SceneError, TableError};
pub use rig::{DriveTransport, RigConfig};
pub use scene::{Envelope, Scene};
pub use tsa_table::Accuracy;
pub use uncertainty::Uncertainty;
