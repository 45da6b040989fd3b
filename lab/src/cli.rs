//! The command line of `tsa-lab`, and which of [`crate::commands`] runs each command. Options of every command are those of `rigctl`.

use crate::commands::{budget, chart, closed_loop, published, report, solve, study, table};
use crate::range::{TurnRange, Vary};
use clap::builder::PossibleValuesParser;
use clap::{Parser, Subcommand};
use rigctl::batch::At;
use rigctl::commands::solve::How;
use rigctl::failure::Failure;
use rigctl::options::commands::Identify;
use rigctl::options::values::{gauge_error, load};
use rigctl::options::{Global, no_effect};
use rigctl::output::Output;
use std::path::PathBuf;

/// The laboratory of a twisted-string actuator: methods, tables and models compared, the paper's numbers, error budget, figures.
///
/// Lengths, speeds and loads take units (12mm, 2mm/s, 0.5kg, 4.9N); a bare number is SI.
#[derive(Debug, Parser)]
#[command(name = "tsa-lab", version)]
pub struct Cli {
    /// Options of every command.
    #[command(flatten)]
    pub global: Global,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// The numbers that the paper prints beside the same numbers computed for the scene
    Published {
        /// The three parameter sets of the paper's scenes side by side, instead of --scene
        #[arg(long)]
        all: bool,
        /// With the geometry that is inferred for some of the paper's sweeps instead of Table 1's (docs/model.md 6)
        #[arg(long)]
        inferred_geometry: bool,
        /// Also write published.csv, ratios.csv and the paper's figures, redrawn, into this folder
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Vary one value of the scene and print contraction and TR for each
    ///
    /// Example: `tsa-lab study --vary D0=8mm..32mm:5 --out out`
    Study {
        /// Which value, between which limits, and how many (default 5); `log` spaces them in equal ratios. KEY is
        /// D0, R, L0, r0, K, c, k1, k2, k3, k4, p or a key of a scene file
        #[arg(long, value_name = "KEY=FROM..TO[:COUNT[log]]")]
        vary: Vary,
        /// Load on the rods (N or kg)
        #[arg(long, value_name = "L", default_value = "7.5N", allow_hyphen_values = true, value_parser = load)]
        load: f64,
        /// Turns past the half-turn pre-twist
        #[arg(long, value_name = "FROM..TO", default_value = "0..7.5", allow_hyphen_values = true)]
        turns: TurnRange,
        /// Also write study.csv, study-curves.csv and study.svg into this folder
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Speed against accuracy of every method, tier and table form, and where methods fail: figures and their data
    Chart {
        /// Folder for the figures (SVG) and their data (CSV)
        #[arg(long, value_name = "DIR", default_value = "out")]
        out: PathBuf,
        /// Only these figures
        #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = PossibleValuesParser::new(crate::chart::NAMES))]
        only: Vec<String>,
    },
    /// Moves of the emulated board with tables of cheaper models and of other accuracies: loop.csv
    Loop {
        /// Folder for loop.csv
        #[arg(long, value_name = "DIR", default_value = "out")]
        out: PathBuf,
    },
    /// One self-contained page: the mechanism drawn and played with, table certificate, charts, a recorded move
    ///
    /// The page has the solver inside and needs no network; any browser shows it. What cannot be made (a chart that another
    /// command measures, a move without firmware) is named in the page.
    /// Example: `tsa-lab report --out out/report.html`
    Report {
        /// File to write
        #[arg(long, value_name = "FILE.html")]
        out: PathBuf,
        /// What it is made from.
        #[command(flatten)]
        inputs: report::Inputs,
    },
    /// What each part of a rig contributes to the errors of position and load, and how accurate a table is worth having
    ///
    /// Computed from the scene, the model's sensitivities and the sizes of --rig (docs/budget.md); nothing is emulated. Half
    /// widths of intervals that hold 90 of 100 cases, a case being a rig of the kind at a state of the scene's envelope. With
    /// --json one object a part: part, position_m, load_relative.
    /// Example: `tsa-lab budget --rig hard`
    Budget {
        /// The LVDT is calibrated at points with gauges of this error, as for `calibrate lvdt --points` [default: it is not]
        #[arg(long, value_name = "E", value_parser = gauge_error)]
        gauge: Option<f64>,
        /// The table and tier that are enough, for every scene in the folder of --scene and each kind of rig, beside what is used
        #[arg(long)]
        all: bool,
    },
    /// Fit and certify the scene's table, and print why this one was chosen
    Table {
        /// Also write table.json and table.rs into this folder
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// One equilibrium by any method or tier, or one for each row of a file
    ///
    /// Example: `tsa-lab solve --load 0.5kg --turns 3 --method paper`
    Solve {
        /// Where.
        #[command(flatten)]
        at: At,
        /// How.
        #[command(flatten)]
        how: How,
    },
    /// Fit the scene's constants to the paper's numbers (`--published`), or to recorded sweeps as `rigctl` does
    Identify(Identify),
    /// The program that `chart` runs under callgrind to count instructions
    #[command(hide = true)]
    ChartKernel,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`], with the exit code in its kind.
pub fn run(cli: &Cli, output: &mut Output) -> Result<(), Failure> {
    let global = &cli.global;
    rig_options(global, &cli.command)?;
    match &cli.command {
        Command::Published { all, inferred_geometry, out } => {
            published::run(global, *all, *inferred_geometry, out.as_deref(), output)
        }
        Command::Study { vary, load, turns, out } => study::run(global, vary, *load, *turns, out.as_deref(), output),
        Command::Loop { out } => closed_loop::run(global, out, output),
        Command::Chart { out, only } => chart::run(global, out, only, output),
        Command::Report { out, inputs } => report::run(global, out, inputs, output),
        Command::Budget { gauge, all: false } => budget::run(global, *gauge, output),
        Command::Budget { gauge, all: true } => budget::all(global, *gauge, output),
        Command::Table { out } => table::run(global, out.as_deref(), output),
        Command::Solve { at, how } => solve::run(global, at, how, output),
        Command::Identify(options) => crate::published::identify::run(global, options, output),
        Command::ChartKernel => Ok(crate::chart::work::kernel(&global.scene()?)?),
    }
}

/// Prints which options of a rig have no effect; the page is always made on the emulated board.
fn rig_options(global: &Global, command: &Command) -> Result<(), Failure> {
    let port = global.given_device().is_some();
    let given = || [(port, "--port")].into_iter().chain(global.of_emulated_board());
    match command {
        Command::Report { .. } if port => Err(Failure::Usage(format!(
            "--port {}: this command is always on the emulated board; `rigctl play` takes a script to a rig",
            global.port()
        ))),
        Command::Report { .. } | Command::ChartKernel => Ok(()),
        Command::Budget { all: false, .. } => {
            no_effect(given().filter(|(_, name)| *name != "--rig"), "the budget is computed, and asks for --rig alone");
            Ok(())
        }
        Command::Budget { all: true, .. } => {
            no_effect(given(), "the budgets of all kinds of rigs are computed");
            Ok(())
        }
        _ => {
            no_effect(given(), "this command uses no rig");
            Ok(())
        }
    }
}
