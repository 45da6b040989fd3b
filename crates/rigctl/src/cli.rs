//! The command line: every command, which carries its own arguments and help, and the function that runs it.

use crate::commands::{
    calibrate, config, demo, doctor, export, identify, lookup, monitor, motion, play, replay, response, selftest,
    serve, solve, status, sweep, table,
};
use crate::failure::Failure;
use crate::laboratory;
use crate::options::Global;
use crate::output::Output;
use crate::script;
use clap::{CommandFactory, Parser, Subcommand};
use rig_link::Request;
use std::ffi::OsString;

const FIRST_STEPS: &str = "\
First steps, on an emulated board as they stand, or with --port /dev/ttyACM0 (COM3) on yours:
  rigctl doctor              check board and actuator; print a fix for each failure
  rigctl home                find zero twist, estimate the load, stop at the half-turn pre-twist
  rigctl move --to 8mm       raise the load by 8 mm from where it hung when homed
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
#[expect(missing_docs, reason = "each command's help is at its arguments")]
pub enum Command {
    Solve(solve::Solve),
    Lookup(lookup::Lookup),
    Table(table::Table),
    /// Fit the scene's constants to recorded sweeps or to the paper's numbers
    Identify(identify::Identify),
    #[command(after_long_help = script::help())]
    Play(play::Play),
    /// Play a script, always on the emulated board
    #[command(after_long_help = script::help())]
    Sim(play::Play),
    Home(motion::Home),
    Move(motion::Move),
    Track(motion::Track),
    Jog(motion::Jog),
    Response(response::Response),
    /// Ramp down and hold
    Stop,
    /// The same as stop
    Hold,
    /// Clear a latched fault whose cause has gone
    Clear,
    /// Print the board's identity, state and readings
    Status,
    Sensors(status::Sensors),
    Config {
        #[command(subcommand)]
        what: config::Config,
    },
    /// Calibrate the LVDT or the zero, and store the result on the board
    Calibrate {
        #[command(subcommand)]
        what: calibrate::Calibrate,
    },
    /// Record telemetry to a CSV file, with all that is needed to repeat the experiment
    ///
    /// Writes CSV: one row for each telemetry message (100 a second, columns as `play --json` names them, SI units), under
    /// `# key = value` lines: scene and its hash, firmware, git commit and protocol hash, the table and its certificate, the
    /// board's settings with its calibration (`config restore` takes them from there), port, seed, plant, host time, the script. Requests and events stand between the rows as `# at SECONDS …`.
    /// `replay` plays such a file through the controller again, `identify` reads those of `sweep`. A log ends with `# end rows = …`, also when Ctrl-C or a
    /// fault ended it (`# broken_off = …` says so); one that lacks it was cut, and `replay` and `identify` take it with --partial only.
    /// What the file held before is kept beside it as FILE.csv~.
    Record(play::Record),
    /// Record the paper's experiment: turn the strings of a known load up and down
    ///
    /// Homes, then turns the strings at a constant speed from the half-turn pre-twist up and back, and records it all as
    /// `record` does. `identify FILE… --out SCENE.toml` fits the scene's constants to such files; take at least three loads, spread
    /// over the range. The load is what you weighed: nothing of the board's estimate goes into the fit. On an emulated
    /// rig this load is hung, unless --plant load=… says another.
    Sweep(sweep::Sweep),
    /// Replay a log through the controller's code and print where it differs
    ///
    /// Takes what `record` or `sweep` wrote and feeds it, tick by tick, to the same code that runs on the board. Says how much
    /// load estimate, set-point and twist speed differ (largest and rms), and when they first differ: by 1 % of the load, 10 µm of
    /// the set-point, 1 rad/s of twist speed, or by a fault that only one of them raised.
    ///
    /// Replayed: load observer, planner, position loop, adaptation and their supervision, with the settings in the log's head,
    /// from the recorded twist, position, current and requests, after each homing until a fault, an emergency stop or the next homing.
    ///
    /// Not replayed, because telemetry does not hold it: homing itself, the age of each gap (taken as 3 ms), the noise of the
    /// LVDT, the drive's own count, supply, limit switches and the host's silence (all taken for healthy). What
    /// homing found is taken from the log. The drive's lag is found from the motion and printed, so what it explains does
    /// not show as a difference. The recorded motion
    /// answers to the recorded commands: after a difference the replay is no longer what a rig would have done.
    Replay(replay::Replay),
    Export(export::Export),
    Doctor(doctor::Doctor),
    /// Test a board without an actuator: CAN, ADC, encoder inputs, flash, watchdog
    ///
    /// It needs seven jumper wires. An image of its own, here on the emulated board; `cargo xtask selftest` flashes the same to a real one and shows the same
    /// table (docs/tutorial/first-board.md). Exit code 1 if a check is not ok.
    Selftest,
    Monitor(monitor::Monitor),
    Serve(serve::Serve),
    /// Print a shell's completion script
    ///
    /// Example: `rigctl completions bash > rigctl.bash`, then source it.
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
    /// Print the paper's numbers beside the computed ones, by `tsa-lab`
    ///
    /// `tsa-lab` is a program of its own, which this one starts; `tsa-lab --help` lists its commands.
    #[command(visible_aliases = ["study", "chart", "report", "budget"], disable_help_flag = true)]
    Published {
        /// Their arguments
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<OsString>,
    },
    Demo(demo::Demo),
}

impl Command {
    /// Whether the laboratory's tool runs it, with the same arguments ([`crate::laboratory`]).
    pub fn is_of_the_laboratory(&self) -> bool {
        match self {
            Self::Published { .. } | Self::Table(table::Table { board: false, .. }) => true,
            Self::Identify(options) => options.published,
            Self::Solve(solve) => solve.is_of_the_laboratory(),
            _ => false,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`], with the exit code in its kind.
pub fn run(Cli { global, command }: &Cli, output: &mut Output) -> Result<(), Failure> {
    if command.is_of_the_laboratory() {
        return Err(laboratory::here());
    }
    match command {
        Command::Solve(_)
        | Command::Identify(_)
        | Command::Lookup(_)
        | Command::Move(motion::Move { dry_run: true, .. })
        | Command::Replay(_)
        | Command::Export(_)
        | Command::Completions { .. } => global.uses_no_rig(),
        _ => {}
    }
    match command {
        Command::Solve(options) => solve::run(global, options, output),
        Command::Identify(options) => identify::run(global, options, output),
        Command::Lookup(options) => lookup::run(global, options, output),
        Command::Table(_) | Command::Published { .. } => table::send(global, output),
        Command::Play(options) => options.run(global, output),
        Command::Sim(options) => options.run(&global.always_emulated()?, output),
        Command::Home(options) => options.run(global, output),
        Command::Move(options) => options.run(global, output),
        Command::Track(options) => options.run(global, output),
        Command::Jog(options) => options.run(global, output),
        Command::Response(options) => options.run(global, output),
        Command::Stop | Command::Hold => motion::request(global, &Request::Stop, output),
        Command::Clear => motion::request(global, &Request::Clear, output),
        Command::Config { what } => config::run(global, what, output),
        Command::Calibrate { what } => calibrate::run(global, what, output),
        Command::Status => status::run(global, output),
        Command::Sensors(options) => options.run(global, output),
        Command::Record(options) => play::record(global, options, output),
        Command::Sweep(options) => sweep::run(global, options, output),
        Command::Replay(options) => replay::run(global, options, output),
        Command::Export(options) => export::run(options, output),
        Command::Doctor(options) => doctor::run(global, options, output),
        Command::Selftest => selftest::run(global, output),
        Command::Monitor(options) => monitor::run(global, options, output),
        Command::Serve(options) => options.run(global, output),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "rigctl", &mut script);
            let script = String::from_utf8_lossy(&script);
            output.object(&serde_json::json!({"shell": shell.to_string(), "script": script}))?;
            Ok(output.line(script.trim_end())?)
        }
        Command::Demo(options) => demo::run(global, options, output),
    }
}
