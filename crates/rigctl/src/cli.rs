//! The command line.

use crate::units::{self, Quantity};
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Host tool of a twisted-string actuator with a load-adaptive transmission.
///
/// Lengths, speeds and loads take units (12mm, 2mm/s, 0.5kg, 4.9N); a bare number is SI.
#[derive(Debug, Parser)]
#[command(name = "rigctl", version)]
pub struct Cli {
    /// Options of every command.
    #[command(flatten)]
    pub global: Global,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// Options of every command.
#[derive(Debug, Clone, Args)]
pub struct Global {
    /// Print JSON: one object, or one a line where there are many
    #[arg(long, global = true)]
    pub json: bool,
    /// Scene file
    #[arg(long, global = true, value_name = "FILE", default_value = "scenes/default.toml")]
    pub scene: PathBuf,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// One equilibrium by the full model, or one for each row of a file
    Solve {
        /// Where.
        #[command(flatten)]
        at: At,
        /// Method of solution
        #[arg(long, default_value = METHODS[0], value_parser = METHODS)]
        method: String,
        /// Tier of the model
        #[arg(long, default_value = TIERS[0], value_parser = TIERS)]
        tier: String,
    },
    /// What the firmware would answer, by the same code and table
    Lookup {
        /// Where.
        #[command(flatten)]
        at: At,
    },
    /// Fit and certify the scene's table, and say why this one
    Table {
        /// Also write table.json and table.rs into this folder
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

/// Methods of solution.
pub const METHODS: [&str; 1] = ["first-integral"];

/// Tiers of the model.
pub const TIERS: [&str; 1] = ["full"];

/// One load and number of turns, or a file of them.
#[derive(Debug, Clone, Args)]
pub struct At {
    /// Load on the rods (N or kg)
    #[arg(long, value_name = "L", allow_hyphen_values = true, value_parser = load,
        required_unless_present = "batch", conflicts_with = "batch")]
    pub load: Option<f64>,
    /// Turns past the half-turn pre-twist
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = turns,
        required_unless_present = "batch", conflicts_with = "batch")]
    pub turns: Option<f64>,
    /// A CSV file with the columns load_n and turns
    #[arg(long, value_name = "FILE.csv")]
    pub batch: Option<PathBuf>,
}

fn load(text: &str) -> Result<f64, units::UnitError> {
    units::parse("load", Quantity::Load, text)
}

fn turns(text: &str) -> Result<f64, units::UnitError> {
    units::parse("turns", Quantity::Turns, text)
}
