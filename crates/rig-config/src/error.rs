//! Why a scene was refused, or has no table.

use crate::checks::Residual;
use std::path::PathBuf;
use tsa_model::{ParameterError, SolveError};
use tsa_table::fit::FitError;

/// Why a scene file was refused. Each names the key, or the line of the file.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// Any of the others, in a file.
    #[error("scene file {path}: {what}")]
    InFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with it. No `source`, because the message has it.
        what: Box<SceneError>,
    },
    /// The file could not be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
    /// Not TOML, or a key is missing, misspelt or of the wrong type.
    #[error(transparent)]
    Parse(#[from] toml::de::Error),
    /// A value that cannot describe a real rig.
    #[error(transparent)]
    Value(#[from] ParameterError),
    /// Values that cannot go together, or would hurt hardware.
    #[error("{}", one_a_line(.0))]
    Impossible(Vec<Residual>),
    /// The envelope reaches past a limit of the model.
    #[error("envelope.load_n, envelope.turns: {limit}, at {load_n} N and {turns} turns")]
    Unsolvable {
        /// Load (N).
        load_n: f64,
        /// Turns past the half-turn pre-twist; -0.5 is zero twist.
        turns: f64,
        /// The limit.
        limit: SolveError,
    },
    /// A table was asked for, but the scene does not say what it must cover.
    #[error("scene: [{table}] is missing, which a table needs")]
    Missing {
        /// `envelope` or `accuracy`.
        table: &'static str,
    },
}

impl SceneError {
    /// The same, naming the file.
    pub fn in_file(self, path: impl Into<PathBuf>) -> Self {
        Self::InFile { path: path.into(), what: Box::new(self) }
    }
}

fn one_a_line(residuals: &[Residual]) -> String {
    residuals.iter().map(Residual::to_string).collect::<Vec<_>>().join("\n  ")
}

/// Why a scene has no table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The scene is wrong, or does not say what the table must cover.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A constant of the mechanism is wrong.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The envelope breaks the model, or no table reaches the accuracy.
    #[error(transparent)]
    Fit(#[from] FitError),
}
