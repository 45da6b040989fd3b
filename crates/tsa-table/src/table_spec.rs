//! What a table must cover and how well, and why there may be none.

use crate::table::Uncertainty;
use serde::{Deserialize, Serialize};
use tsa_model::SolveError;

pub use crate::record::MAX_BYTES;

/// How well a table must reproduce the full model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accuracy {
    /// Largest error of the contraction (m).
    pub contraction_m: f64,
    /// Largest relative error of the transmission ratio.
    pub tr_relative: f64,
}

/// What a table must cover, and how well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableSpec {
    /// Minimum and maximum load (N).
    pub load_n: [f64; 2],
    /// Maximum twist (rad); the least is the half-turn pre-twist, from which contraction is counted.
    pub twist_max_rad: f64,
    /// How well.
    pub accuracy: Accuracy,
    /// How well the constants are known, for the table's metadata.
    pub uncertainty: Uncertainty,
    /// Hash of the scene that demands it, for the table's metadata.
    pub scene_hash: u32,
}

/// Why no table could be made.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// The envelope reaches past a limit of the model.
    #[error("the envelope reaches past a limit of the model: at {load_n:.3} N and {turns:.3} turns: {source}")]
    Envelope {
        /// Load of the first point that broke it (N).
        load_n: f64,
        /// Motor turns of that point.
        turns: f64,
        /// The limit.
        source: SolveError,
    },
    /// No table reaches the accuracy within [`MAX_BYTES`].
    #[error(
        "no table of at most {MAX_BYTES} bytes reaches accuracy.contraction_m = {contraction_m} and \
         accuracy.tr_relative = {tr_relative}; the best has {best}"
    )]
    Accuracy {
        /// Wanted (m).
        contraction_m: f64,
        /// Wanted.
        tr_relative: f64,
        /// The errors and the size of the best candidate.
        best: String,
    },
}
