//! The rig's host tool: solves and looks up on the desktop, runs the firmware on the emulated board, drives the rig.
//!
//! - [`cli`]: the command line; [`commands`]: what each command does; [`batch`]: files of loads and turns.
//! - [`units`], [`range`], [`script`]: text from the operator, checked and turned into SI.
//! - [`settings`]: the board's settings as text and as a file.
//! - [`session`]: a conversation with the firmware, emulated or real; [`log`]: one recorded, [`replay`]: through the controller again.
//! - [`screen`]: the live view.
//! - [`output`]: human or JSON, never both on standard output; [`failure`]: exit codes.
//!
//! An experiment of a lab's own, on the emulated board or (`Serial::open("/dev/ttyACM0")`) a real one:
//!
//! ```no_run
//! use rig_link::LoadChoice;
//! use rigctl::commands::operate::{home_session, move_session};
//! use rigctl::failure::Failure;
//! use rigctl::session::Session;
//! use rigctl::session::sim::{Sim, SimOptions};
//!
//! fn main() -> anyhow::Result<()> {
//!     experiment().map_err(Failure::into_error)
//! }
//!
//! fn experiment() -> Result<(), Failure> {
//!     let scene = "scenes/default.toml".into();
//!     let options = SimOptions { firmware: None, scene, plant: vec!["load=1kg".parse()?], seed: 1, flash: None, gdb: None };
//!     let mut session = Session::new(Box::new(Sim::start(&options)?));
//!     session.hello()?;
//!     let homed = home_session(&mut session, |_| {})?;
//!     for to_m in [0.002, 0.004, 0.008] {
//!         let end = move_session(&mut session, to_m, 2e-3, LoadChoice::Auto, |_row| {})?;
//!         println!("{} N at {:.3} mm: {} rad/mm", homed.load_n, end.position_m * 1e3, end.tr_end_rad_per_m * 1e-3);
//!     }
//!     Ok(())
//! }
//! ```

#![forbid(unsafe_code)]

pub mod batch;
pub mod cli;
pub mod commands;
pub mod failure;
pub mod identify;
pub mod log;
pub mod output;
pub mod range;
pub mod replay;
pub mod screen;
pub mod script;
pub mod session;
pub mod settings;

pub use sim_link::units;

use clap::Parser;
use failure::Failure;
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the tool with these arguments and says how it ended: 0, 1 for refused or failed, 2 for wrong usage.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match cli::Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version go to standard output and are no failure; clap knows which is which.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    let mut output = output::Output::stdout(cli.global.json);
    let result = commands::run(&cli, &mut output).and_then(|()| Ok(output.flush()?));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever reads has seen enough (`rigctl … | head`).
        Err(failure) if failure.is_reader_gone() => ExitCode::SUCCESS,
        Err(failure) => {
            let _ = failure.object().map_or(Ok(()), |object| output.object(&object));
            let _ = output.flush();
            if let Some(message) = failure.message() {
                eprintln!("error: {message}");
            }
            match failure {
                Failure::Usage(_) => ExitCode::from(2),
                Failure::Failed(_) | Failure::Reported => ExitCode::from(1),
            }
        }
    }
}
