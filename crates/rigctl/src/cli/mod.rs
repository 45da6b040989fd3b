//! The command line: every command with its help, and which function of [`crate::commands`] runs it ([`dispatch`]).

pub mod dispatch;

use crate::options::Global;
use crate::options::commands::{At, Calibrate, Config, Export, How, Identify, Record, Replay, Sweep};
use crate::options::values::{METHODS, load_choice, seconds, speed_or_max, target, twist_speed};
use crate::script;
use clap::{Parser, Subcommand};
use rig_link::LoadChoice;
use std::ffi::OsString;
use std::path::PathBuf;

const FIRST_STEPS: &str = "\
First steps, on an emulated board as they stand, or with --port /dev/ttyACM0 (COM3) on yours:
  rigctl doctor              what is well, and what to do where it is not
  rigctl home                find zero twist, weigh the load, stop at the half-turn pre-twist
  rigctl move --to 8mm       bring the load up by 8 mm from where it hung then
  rigctl monitor             watch it

Without torque the strings untwist and the load falls: rest it on something before power goes on or off.
`rigctl stop` is always accepted. Exit codes: 0 done, 1 refused or failed, 2 wrong usage.";

/// Host tool of a twisted-string actuator with a load-adaptive transmission.
///
/// Lengths, speeds and loads take units (12mm, 2mm/s, 0.5kg, 4.9N); a bare number is SI.
#[derive(Debug, Parser)]
#[command(name = "rigctl", version, after_help = FIRST_STEPS)]
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
    /// One equilibrium by the full model, or one for each row of a file
    ///
    /// Example: `rigctl solve --load 0.5kg --turns 3`
    Solve {
        /// Where.
        #[command(flatten)]
        at: At,
        /// How.
        #[command(flatten)]
        how: How,
    },
    /// The firmware's answer at a load and number of turns, by the same code and table
    ///
    /// Example: `rigctl lookup --load 0.5kg --turns 3`
    Lookup {
        /// Where.
        #[command(flatten)]
        at: At,
    },
    /// Fit and certify the scene's table, and print why this one was chosen
    Table {
        /// Also write table.json and table.rs into this folder
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Let the board at --port make, check, use and keep a table for this scene's constants; home again after it
        #[arg(long, conflicts_with = "out")]
        board: bool,
    },
    /// Fit the scene's constants to recorded sweeps or to the paper's numbers
    Identify(Identify),
    /// Play a script on whatever is at the port, and print telemetry
    ///
    /// On the emulated board the script's time is the time since the board's start; on a real rig it is the time since the
    /// script's start, and changes of the plant and faults are announced, to be made by hand. Commands wait until the board
    /// has started. Exit code 1 if a command was refused; the last line counts them.
    /// Example: `rigctl play scenarios/example.script`
    #[command(after_long_help = script::help())]
    Play {
        /// Events, one a line: `<seconds> <event>`, the last `<seconds> end` [default: none, for --seconds]
        #[arg(value_name = "FILE")]
        script: Option<PathBuf>,
        /// How long to run without a script (s)
        #[arg(long, value_name = "S", default_value = "5s", allow_hyphen_values = true, value_parser = seconds,
            conflicts_with = "script")]
        seconds: f64,
    },
    /// The same as `play` on the emulated board, with the script as an option
    #[command(after_long_help = script::help())]
    Sim {
        /// Events, one a line: `<seconds since boot> <event>`, the last `<seconds> end`
        #[arg(long, value_name = "FILE")]
        script: Option<PathBuf>,
        /// How long to run without a script (s)
        #[arg(long, value_name = "S", default_value = "5s", allow_hyphen_values = true, value_parser = seconds,
            conflicts_with = "script")]
        seconds: f64,
    },
    /// Find zero twist, weigh the load, stop at the half-turn pre-twist
    ///
    /// From any twist at power-up, in 45 s at most: looks for the greatest gap, turns across it, then six turns up and down.
    /// That lifts the load by 10 to 23 mm (default scene): leave it room. Position 0 is where it hangs at the end.
    /// Example: `rigctl home --load 0.5kg`
    Home {
        /// `auto` (the board weighs the load) or the load as you weighed it
        #[arg(long, value_name = "auto|L", default_value = "auto", value_parser = load_choice)]
        load: LoadChoice,
    },
    /// Bring the load to a position above where it hung when homed
    ///
    /// Ends with the measured error at rest. What holds a move back (the motor's speed, acceleration or current) is shown as
    /// `limit`; a target out of reach is refused with the range that is in reach. On an emulated board it homes first.
    /// Example: `rigctl move --to 8mm --speed 2mm/s`
    Move {
        /// Target position (m, mm, um)
        #[arg(long, value_name = "P", allow_hyphen_values = true, value_parser = target)]
        to: f64,
        /// Speed of the load (m/s, mm/s), or `max`: as fast as the motor allows under this load
        #[arg(long, value_name = "V|max", default_value = "2mm/s", allow_hyphen_values = true, value_parser = speed_or_max)]
        speed: f64,
        /// `auto` (the board's own estimate) or a load
        #[arg(long, value_name = "auto|L", default_value = "auto", value_parser = load_choice)]
        load: LoadChoice,
        /// Print the planned trajectory and the table's answers, without a device; needs a load
        #[arg(long)]
        dry_run: bool,
        /// With --dry-run: the settings of a board, in a file of `config backup` or a log [default: a new board's]
        #[arg(long, value_name = "FILE", requires = "dry_run")]
        settings: Option<PathBuf>,
    },
    /// Lead the load along a course: stream set-points from a file
    ///
    /// The file has the columns `t_s`, `position_m` and optionally `speed_m_per_s`; the load first moves to where it begins.
    /// A set-point is sent every 20 ms. The board follows within the motor's limits (`limit` says when they hold it back), and
    /// ends in a hold when the next one is 0.2 s late, out of reach, or half a second of full speed ahead of the load. On an
    /// emulated board it homes first.
    /// Example: `rigctl track scenarios/sine.csv`
    Track {
        /// The course
        file: PathBuf,
    },
    /// Turn the strings at a constant speed for a while, homed or not
    ///
    /// Example: `rigctl jog --speed 2rad/s --seconds 1.5s`
    Jog {
        /// Twist speed (rad/s, deg/s, rpm of the strings), positive twists up
        #[arg(long, value_name = "W", allow_hyphen_values = true, value_parser = twist_speed)]
        speed: f64,
        /// How long (s)
        #[arg(long, value_name = "S", default_value = "1s", allow_hyphen_values = true, value_parser = seconds)]
        seconds: f64,
    },
    /// Ramp down and hold
    Stop,
    /// The same as stop
    Hold,
    /// Clear a latched fault whose cause has gone
    Clear,
    /// The board's identity, state and readings
    Status,
    /// The sensors' readings, homed or not: gap, encoder, drive, supply, contacts. For wiring a rig
    Sensors {
        /// One reading every 0.2 s for this time [default: one reading]
        #[arg(long, value_name = "S", default_value = "0s", hide_default_value = true, allow_hyphen_values = true,
            value_parser = seconds)]
        seconds: f64,
    },
    /// The board's settings: kept in its flash, changed only while nothing moves
    Config {
        /// What to do with it.
        #[command(subcommand)]
        what: Config,
    },
    /// Measure what the board cannot know by itself, and keep it on the board
    Calibrate {
        /// What.
        #[command(subcommand)]
        what: Calibrate,
    },
    /// Record telemetry with everything that is needed to run the experiment again
    ///
    /// Writes CSV: one row for each telemetry message (100 a second, columns as `play --json` names them, SI units), under
    /// `# key = value` lines: scene and its hash, firmware, git commit and protocol hash, the table and its certificate, the
    /// board's settings with its calibration (`config restore` takes them from there), port, seed, plant, host time, the script. Requests and events stand between the rows as `# at SECONDS …`.
    /// `replay` plays such a file through the controller again, `identify` reads those of `sweep`. A log ends with `# end rows = …`, also when Ctrl-C or a
    /// fault ended it (`# broken_off = …` says so); one that lacks it was cut, and `replay` and `identify` take it with --partial only.
    /// What the file held before is kept beside it as FILE.csv~.
    Record(Record),
    /// The paper's experiment, recorded: turn the strings of a known load up and down
    ///
    /// Homes, then turns the strings at a constant speed from the half-turn pre-twist up and back, and records it all as
    /// `record` does. `identify FILE… --out SCENE.toml` fits the scene's constants to such files; take at least three loads, spread
    /// over the range. The load is what you weighed: nothing of the board's estimate goes into the fit. On an emulated
    /// rig this load is hung, unless --plant load=… says another.
    Sweep(Sweep),
    /// Play a recorded log through the controller's own code and print where it would have differed
    ///
    /// Takes what `record` or `sweep` wrote and feeds it, tick by tick, to the same code that runs on the board. Says how much
    /// load estimate, set-point and twist speed differ (largest and rms), and when they first part: by 1 % of the load, 10 um of
    /// the set-point, 1 rad/s of twist speed, or by a fault that only one of them raised.
    ///
    /// Replayed: load observer, planner, position loop, adaptation and their supervision, with the settings in the log's head,
    /// from the recorded twist, position, current and requests, after each homing until a fault, an emergency stop or the next homing.
    ///
    /// Not replayed, because telemetry does not hold it: homing itself, the age of each gap (taken as 3 ms), the noise of the
    /// LVDT, the drive's own count, supply, limit switches and the host's silence (all taken for healthy). What
    /// homing found is taken from the log. The drive's lag is found from the motion and printed, so what it explains does
    /// not show as a difference. The recorded motion
    /// answers to the recorded commands: after a parting the replay is no longer what a rig would have done.
    Replay(Replay),
    /// A recorded log for other tools: MCAP (Foxglove, PlotJuggler), or CSV without comment lines
    ///
    /// Every column of the log, in SI units. In MCAP an empty cell is an absent key, the header is the file's metadata, and
    /// requests and events are messages of `/log`. docs/connect.md shows how to open the files, and how Python writes Parquet.
    /// Example: `rigctl export run.csv --to mcap --out run.mcap`
    Export(Export),
    /// Is the rig well? One line for each check, `ok` or `CHECK` with what to do; exit code 1 if any needs attention
    ///
    /// Checks versions, reset cause, last panic, scene, the table's certificate, faults, drive, supply, control ticks, link. The
    /// motor stays where it is; sensors can only be judged fully with --home. A board of another scene is reported, not refused.
    Doctor {
        /// Turn the shaft slowly by a hundredth of a turn of the strings each way: do motor and both encoders agree?
        #[arg(long)]
        turn: bool,
        /// Home, then turn the strings by a third of a turn and back: LVDT noise and range, encoder against drive
        #[arg(long)]
        home: bool,
    },
    /// The checks of a board without a rig, seven jumper wires aside: CAN, ADC, encoder inputs, serial line, flash, watchdog, clocks
    ///
    /// An image of its own, here on the emulated board; `cargo xtask selftest` flashes the same to a real one and shows the same
    /// table (docs/selftest.md). Exit code 1 if a check is not ok.
    Selftest,
    /// A live view in the terminal that moves the rig: state, position, load, TR, motor, faults, the mechanism drawn
    ///
    /// Keys: space stops, at any time. h homes, up and down move by a step (+ and - change it), m asks for a position, left and
    /// right jog while they are held, c clears a fault, q leaves and stops a motion first. The first motion of a real rig
    /// asks for a confirmation. On an emulated board time passes as on a real one.
    Monitor {
        /// Play this script meanwhile (format as for `play`)
        #[arg(long, value_name = "FILE")]
        script: Option<PathBuf>,
    },
    /// Let several programs use the rig at once: JSON lines on a Unix socket, one writer, many readers
    ///
    /// Every client gets the telemetry, one object a line as `play --json` prints it. The first one that sends an order, such as
    /// {"id": 1, "do": "move", "to_m": 0.008}, is the writer until it disconnects or sends {"release": true}; a motion that
    /// then goes on is stopped. Only the owner of the socket and root can connect. docs/connect.md has the protocol. On an emulated
    /// board time passes as on a real one. Ctrl-C stops the rig and ends.
    /// Example: `rigctl serve --listen rig.sock`
    Serve {
        /// Path of the socket. Network addresses are refused: over TCP nobody can check who connects
        #[arg(long, value_name = "ADDR")]
        listen: String,
        /// Let the time of an emulated board pass as fast as it can, for tests
        #[arg(long)]
        fast: bool,
    },
    /// A script that lets a shell complete commands and options: `rigctl completions bash > rigctl.bash`, then source it
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
    /// Commands of the laboratory, a program of its own (`tsa-lab`) that this one starts: `tsa-lab --help` lists them
    #[command(visible_aliases = ["study", "chart", "report", "budget"], disable_help_flag = true)]
    Published {
        /// Their arguments
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
    /// Three loads, each on a fresh emulated board, homed and moved alike: a table and a picture
    Demo {
        /// Folder for demo.svg and demo.csv
        #[arg(long, value_name = "DIR", default_value = "out")]
        out: PathBuf,
    },
}

impl Command {
    /// Whether the laboratory's tool runs it, with the same arguments ([`crate::laboratory`]).
    pub fn is_of_the_laboratory(&self) -> bool {
        match self {
            Self::Published { .. } | Self::Table { board: false, .. } => true,
            Self::Identify(options) => options.published,
            Self::Solve { how, .. } => how.method != METHODS[0] || how.steps.is_some() || how.tolerance.is_some(),
            _ => false,
        }
    }
}
