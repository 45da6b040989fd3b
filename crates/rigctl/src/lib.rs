//! The rig's host tool: solves and looks up on the desktop, runs the firmware on the emulated board, drives the rig.
//!
//! From the command line down; no layer knows one above it:
//!
//! - [`cli`]: the list of commands; [`commands`]: each with its arguments, its help and what it does.
//! - [`options`]: the operator's options as values.
//! - [`play`]: a script on a board; [`plan`]: what an actuator can do with a load, without a board; [`diagnosis`]: the checks of `doctor`; [`recorded_move`]: what `demo` makes and draws; [`laboratory`]:
//!   commands of the laboratory's tool; [`screen`], [`monitor_input`], [`monitor_keys`]: the live view; [`backup`]: the file of a settings backup.
//! - [`log`]: a recorded conversation; [`replay`]: a log through the controller again; [`identify`]: constants from logs;
//!   [`export`]: a log for other tools.
//! - `serve`: a rig for several programs at once, on a Unix socket.
//! - [`request`]: requests in words and as objects; [`script`]: scripts; [`board_settings`]: settings as text; [`lvdt_points`]: the LVDT by points.
//! - [`session`]: a conversation with the firmware, emulated or real: connect, home, move.
//! - [`plot`]: pictures as SVG; [`outline`]: the mechanism drawn; [`csv_text`]: CSV read and written;
//!   [`parallel`]: work on all cores; [`statistics`]: sizes of errors.
//! - [`batch`], [`units`], [`scene_file`]: text and files from the operator, checked and in SI.
//! - [`output`]: lines or JSON, never both on standard output; [`out_file`]: files; [`failure`]: exit codes.
//!
//! An experiment of your own, on the emulated board or (`Serial::open("/dev/ttyACM0")`) a real one:
//!
//! ```no_run
//! use rig_link::LoadChoice;
//! use rigctl::failure::Failure;
//! use rigctl::session::sim::{Sim, SimOptions};
//! use rigctl::session::{Session, homing, motion};
//! use rigctl::units::{MM, N};
//! use rig_plant::RigPreset;
//!
//! fn main() -> anyhow::Result<()> {
//!     experiment().map_err(Failure::into_error)
//! }
//!
//! fn experiment() -> Result<(), Failure> {
//!     let plant = vec!["load=1kg".parse()?];
//!     let options = SimOptions { plant, ..SimOptions::new("scenes/default.toml".into()) };
//!     let mut session = Session::new(Box::new(Sim::start(&options)?));
//!     session.greet()?;
//!     let homed = homing::home(&mut session, LoadChoice::Auto, |_| {})?;
//!     for to_m in [0.002, 0.004, 0.008] {
//!         let end = motion::move_to(&mut session, to_m, 2e-3, LoadChoice::Auto, |_row| {})?;
//!         println!("{} at {}", N.within(homed.load_n, homed.load_error_n), MM.show(end.position_m));
//!     }
//!     Ok(())
//! }
//! ```

#![forbid(unsafe_code)]

pub mod backup;
pub mod batch;
pub mod board_settings;
pub mod cli;
pub mod commands;
pub mod csv_text;
pub mod diagnosis;
pub mod export;
pub mod failure;
#[cfg(test)]
mod fixtures;
pub mod help;
pub mod identify;
pub mod laboratory;
pub mod log;
pub mod lvdt_points;
pub mod monitor_input;
pub mod monitor_keys;
pub mod options;
pub mod out_file;
pub mod outline;
pub mod output;
pub mod parallel;
pub mod plan;
pub mod play;
pub mod plot;
pub mod recorded_move;
pub mod replay;
pub mod request;
pub mod scene_file;
pub mod screen;
pub mod script;
#[cfg(unix)]
pub mod serve;
pub mod session;
pub mod statistics;
pub mod trajectory;

pub use rig_plant::units;

use clap::{CommandFactory, Parser};
use failure::Failure;
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the tool with these arguments and returns its exit code: 0, 1 for refused or failed, 2 for wrong usage.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    started(
        help::grouped(cli::Cli::command(), &help::GROUPS),
        arguments.clone(),
        |cli: &cli::Cli| &cli.global,
        |cli, output| match cli.command.is_of_the_laboratory() {
            true => laboratory::run(arguments.get(1..).unwrap_or_default()),
            false => cli::run(cli, output),
        },
    )
}

/// Parses the arguments of a tool with these options and runs it; its exit code as of [`run`].
pub fn started<C: Parser>(
    tool: clap::Command,
    arguments: impl IntoIterator<Item = OsString>,
    global: impl Fn(&C) -> &options::Global,
    run: impl FnOnce(&C, &mut output::Output) -> Result<(), Failure>,
) -> ExitCode {
    #[cfg(target_os = "linux")]
    session::interrupt::bear_hang_ups();
    let parsed = tool.try_get_matches_from(arguments).and_then(|matches| C::from_arg_matches(&matches));
    let cli = match parsed {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version go to standard output and are no failure; clap knows which is which.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    let mut output = output::Output::stdout(global(&cli).json);
    let result = run(&cli, &mut output).and_then(|()| Ok(output.flush()?));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // The reader has gone (`rigctl … | head`).
        Err(failure) if failure.is_reader_gone() => ExitCode::SUCCESS,
        Err(failure) => {
            let _ = failure.object().map_or(Ok(()), |object| output.object(&object));
            let _ = output.flush();
            if let Some(message) = failure.message() {
                crate::output::say!("error: {message}");
            }
            match failure {
                Failure::Usage(_) => ExitCode::from(2),
                Failure::Failed(_) | Failure::Reported => ExitCode::from(1),
            }
        }
    }
}
