//! Options of the commands that have many.

use super::values::{gap, gauge_error, load, radius_law, seconds, turns, twist_speed};
use crate::calibration::Point;
use crate::identify::laws::Law;
use clap::{Args, Subcommand};
use std::path::PathBuf;

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
