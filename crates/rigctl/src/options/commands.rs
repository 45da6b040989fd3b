//! Options of the commands that have many.

use super::values::{gap, gauge_error, load, methods, radius_law, seconds, tiers, tolerance, turns, twist_speed};
use crate::board_settings;
use crate::calibration::Point;
use crate::export::Format;
use crate::identify::laws::Law;
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// What to do with the settings.
#[derive(Debug, Clone, Subcommand)]
pub enum Config {
    /// Show all settings, or one, with default and range
    Get {
        /// Which; all if none is named
        #[arg(value_name = "NAME", value_parser = board_settings::named)]
        name: Option<rig_link::Setting>,
    },
    /// Change one setting and keep it
    Set {
        /// Which
        #[arg(value_name = "NAME", value_parser = board_settings::named, long_help = board_settings::help())]
        name: rig_link::Setting,
        /// Its value, with or without a unit; `learned` for twist-scale takes the scale that the board has learned
        #[arg(value_name = "VALUE", allow_hyphen_values = true)]
        value: String,
    },
    /// Write all settings to a file
    Backup {
        /// File to write
        #[arg(value_name = "FILE.toml")]
        file: PathBuf,
    },
    /// Set all settings from a file, or none if anything in it is wrong. Those that correct other constants than this
    /// rig's stay as they are, and the exit code is then 1
    Restore {
        /// File to read: a backup, or a log of `record` or `sweep`, whose header holds the settings, too
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// Also those that correct other constants of the rig
        #[arg(long)]
        force: bool,
    },
}

/// What to calibrate.
#[derive(Debug, Clone, Subcommand)]
pub enum Calibrate {
    /// The LVDT, by the gap between the clamps as callipers measure it: one gap gives the offset, a second one the gain;
    /// or by up to 11 gaps in a file. Without options it only prints the reading
    Lvdt {
        /// The true gap now (m, mm)
        #[arg(long, value_name = "GAP", value_parser = gap)]
        gap: Option<f64>,
        /// A gap that was measured before (m, mm), and the uncalibrated reading of the sensor there: the first call prints both
        #[arg(long, value_name = "GAP:SENSOR", requires = "gap")]
        point: Option<Point>,
        /// Gauges' gaps at 2 to 11 places, at least 1 mm apart: a file with the columns gap_m and sensor_m (uncalibrated, as
        /// this command prints it without options). Between them the board interpolates; offset and gain become 0 and 1
        #[arg(long, value_name = "FILE.csv", conflicts_with = "gap")]
        points: Option<PathBuf>,
        /// How far a gap of --points may be from the true one: half the width of the interval that holds the truth in 90 of
        /// 100 cases (m, mm, um)
        #[arg(long, value_name = "E", default_value = "20um", requires = "points", value_parser = gauge_error)]
        gauge_error: f64,
        /// Forget the points of --points
        #[arg(long, conflicts_with_all = ["gap", "points"])]
        no_points: bool,
    },
    /// The present position becomes 0, now and whenever the rig is homed
    Zero,
}

/// What to record, and the file.
#[derive(Debug, Clone, Args)]
pub struct Record {
    /// File to write [default: standard output]
    #[arg(long, value_name = "FILE.csv")]
    pub out: Option<PathBuf>,
    /// How long to record without a script (s)
    #[arg(long, value_name = "S", default_value = "10s", allow_hyphen_values = true, value_parser = seconds,
        conflicts_with = "script")]
    pub seconds: f64,
    /// Play this script meanwhile (format as for `play`); exit code 1 if a command of it was refused
    #[arg(long, value_name = "FILE")]
    pub script: Option<PathBuf>,
}

/// A load and how far to turn.
#[derive(Debug, Clone, Args)]
pub struct Sweep {
    /// Load that hangs on the rail, as weighed (N or kg)
    #[arg(long, value_name = "L", allow_hyphen_values = true, value_parser = load)]
    pub load: f64,
    /// Heavier load that the rods have just carried (N or kg): such a sweep shows what they remember of it, beside one of the
    /// same load without it. On an emulated rig it is hung first
    #[arg(long, value_name = "L", allow_hyphen_values = true, value_parser = load)]
    pub after: Option<f64>,
    /// Turns past the half-turn pre-twist
    #[arg(long, value_name = "T", default_value = "7.5", allow_hyphen_values = true, value_parser = turns)]
    pub turns: f64,
    /// Speed of the strings (rad/s, deg/s, rpm)
    #[arg(long, value_name = "W", default_value = "12.5rpm", allow_hyphen_values = true, value_parser = twist_speed)]
    pub speed: f64,
    /// File to write
    #[arg(long, value_name = "FILE.csv")]
    pub out: PathBuf,
}

/// The log to replay.
#[derive(Debug, Clone, Args)]
pub struct Replay {
    /// Log of `record` or `sweep`, recorded with --scene
    #[arg(value_name = "FILE.csv")]
    pub file: PathBuf,
    /// Also if the log was cut short
    #[arg(long)]
    pub partial: bool,
}

/// The log to export, and the file.
#[derive(Debug, Clone, Args)]
pub struct Export {
    /// Log of `record` or `sweep`
    #[arg(value_name = "LOG.csv")]
    pub log: PathBuf,
    /// Format of the file
    #[arg(long, value_name = "mcap|csv", hide_possible_values = true)]
    pub to: Format,
    /// File to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Also if the log was cut short: its whole rows
    #[arg(long)]
    pub partial: bool,
}

/// The constants to fit, and the data.
#[derive(Debug, Clone, Args)]
pub struct Identify {
    /// Recorded sweeps: CSV with load_n, turns (or twist_rad), gap_m (from an unknown zero) or contraction_m, and if
    /// known sigma_m, lines that begin with # passed over; or what `sweep` wrote
    #[arg(value_name = "SWEEP.csv", conflicts_with = "published")]
    pub sweeps: Vec<PathBuf>,
    /// The paper's 37 numbers instead, errors taken relative
    #[arg(long)]
    pub published: bool,
    /// Scene file to write
    #[arg(long, value_name = "SCENE.toml")]
    pub out: Option<PathBuf>,
    /// Picture to write: contraction by the scene before and by the identified one, with the measured points on it
    #[arg(long, value_name = "FILE.svg", conflicts_with = "published")]
    pub figure: Option<PathBuf>,
    /// Constants to fit, by symbol or key: k1, k2, k3, p, k4, K, R, L0, modulus, odd-curve (a1, a3, a5), curve (a1 to
    /// a5) [default: those of each radius law, with modulus and with odd-curve in turn; k1,k2,k3,modulus for --published]
    #[arg(long, value_name = "KEYS", value_delimiter = ',')]
    pub fit: Vec<String>,
    /// The one radius law to fit with, instead of letting all of them compete on held-out sweeps
    #[arg(long, value_parser = radius_law, value_name = "length-ratio|length-ratio-k4|twist-power")]
    pub law: Option<Law>,
    /// Also logs of sweeps that were cut short or broken off
    #[arg(long)]
    pub partial: bool,
    /// Which of the published numbers are only predicted, by their ids or kinds
    /// [default: l0-70,r0-2.5,k-0.01,experiment,span]; `none` fits everything
    #[arg(long, value_name = "WHAT", value_delimiter = ',')]
    pub hold_out: Vec<String>,
    /// Also say which further sweep would tell most, and whether any is worth its time
    #[arg(long, conflicts_with = "published")]
    pub next: bool,
}

/// Method of solution and tier of the model.
#[derive(Debug, Clone, Args)]
pub struct How {
    /// Method of solution
    #[arg(long, default_value = "first-integral", value_parser = methods())]
    pub method: String,
    /// Steps of the method: quadrature nodes, Runge–Kutta steps, intervals, load steps [default: about 1e-9 m]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub steps: Option<u32>,
    /// Tolerance of the method's iteration, or of its integrator
    #[arg(long, value_name = "X", value_parser = tolerance)]
    pub tolerance: Option<f64>,
    /// Tier of the model; `auto` takes the cheapest that meets the scene's accuracy
    #[arg(long, default_value = "full", value_parser = tiers())]
    pub tier: String,
}

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
