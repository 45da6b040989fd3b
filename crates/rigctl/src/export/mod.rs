//! A recorded log in the formats of other tools: MCAP for Foxglove and PlotJuggler, and CSV without the comment lines, which many
//! readers of CSV do not pass over.
//!
//! [`table`]: the log by its columns; [`mod@mcap`]: the format.

pub mod mcap;
pub mod table;

pub use table::Table;

use clap::ValueEnum;

/// The format of another tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For Foxglove and PlotJuggler: JSON messages with schemas, at the times of the log
    Mcap,
    /// The rows alone, under one line of names
    Csv,
}

impl Format {
    /// The content of a file of this format.
    ///
    /// # Errors
    /// In words, without the log's name.
    pub fn encode(self, table: &Table<'_>) -> Result<Vec<u8>, String> {
        match self {
            Self::Mcap => mcap::encode(table).map_err(|e| e.to_string()),
            Self::Csv => table.csv(),
        }
    }
}
