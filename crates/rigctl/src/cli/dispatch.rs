//! From the parsed command line to the function that runs the command.

use super::{Cli, Command};
use crate::commands::*;
use crate::failure::Failure;
use crate::laboratory;
use crate::options::Global;
use crate::output::Output;
use clap::CommandFactory;
use rig_link::Request;

/// Runs the command.
///
/// # Errors
/// [`Failure`], with the exit code in its kind.
pub fn run(cli: &Cli, output: &mut Output) -> Result<(), Failure> {
    let global = &cli.global;
    rig_options(global, &cli.command)?;
    match &cli.command {
        Command::Solve { at, how } if !cli.command.is_of_the_laboratory() => solve::run(global, at, how, output),
        Command::Identify(options) if !options.published => identify::run(global, options, output),
        Command::Lookup { at } => lookup::run(global, at, output),
        Command::Table { board: true, .. } => table_board::run(global, output),
        Command::Solve { .. } | Command::Identify(_) | Command::Table { .. } | Command::Published { .. } => {
            Err(laboratory::here())
        }
        Command::Play { script, seconds } | Command::Sim { script, seconds } => {
            play::run(global, script.as_deref(), *seconds, output)
        }
        Command::Move { to, speed, load, dry_run: true, settings } => {
            dry_run::run(global, *to, *speed, *load, settings.as_deref(), output)
        }
        Command::Move { to, speed, load, .. } => move_to::run(global, *to, *speed, *load, output),
        Command::Home { load } => home::run(global, *load, output),
        Command::Track { file } => track::run(global, file, output),
        Command::Jog { speed, seconds } => jog::run(global, *speed, *seconds, output),
        Command::Stop => request::run(global, &Request::Stop, output),
        Command::Hold => request::run(global, &Request::Stop, output),
        Command::Clear => request::run(global, &Request::Clear, output),
        Command::Config { what } => config::run(global, what, output),
        Command::Calibrate { what } => calibrate::run(global, what, output),
        Command::Status => status::run(global, output),
        Command::Sensors { seconds } => status::sensors(global, *seconds, output),
        Command::Record(options) => record::run(global, options, output),
        Command::Sweep(options) => sweep::run(global, options, output),
        Command::Replay(options) => replay::run(global, options, output),
        Command::Export(options) => export::run(options, output),
        Command::Doctor { turn, home } => doctor::run(global, *turn, *home, output),
        Command::Selftest => selftest::run(global, output),
        Command::Monitor { script } => monitor::run(global, script.as_deref(), output),
        Command::Serve { listen, fast } => serve::run(global, listen, *fast, output),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "rigctl", &mut script);
            let script = String::from_utf8_lossy(&script);
            output.object(&serde_json::json!({"shell": shell.to_string(), "script": script}))?;
            Ok(output.line(script.trim_end())?)
        }
        Command::Demo { out } => demo::run(global, out, output),
    }
}

/// Checks the options of a rig: for a command without a rig they have no effect, which is printed; for a command that is
/// always on the emulated board another port is refused.
fn rig_options(global: &Global, command: &Command) -> Result<(), Failure> {
    let port = global.given_device().is_some();
    let given = || [(port, "--port")].into_iter().chain(global.of_emulated_board());
    match command {
        Command::Sim { .. } | Command::Demo { .. } if port => Err(Failure::Usage(format!(
            "--port {}: this command is always on the emulated board; `play` takes a script to a rig",
            global.port()
        ))),
        Command::Solve { .. }
        | Command::Identify(_)
        | Command::Lookup { .. }
        | Command::Move { dry_run: true, .. }
        | Command::Replay(_)
        | Command::Export(_)
        | Command::Completions { .. } => {
            no_effect(given(), "this command uses no rig");
            Ok(())
        }
        Command::Selftest => {
            no_effect(given().skip(1).take(4), "this board has no rig, and is a new one each time");
            Ok(())
        }
        _ => Ok(()),
    }
}

/// Prints which of the given options have no effect, and why.
pub fn no_effect(given: impl Iterator<Item = (bool, &'static str)>, why: &str) {
    for (_, name) in given.filter(|(given, _)| *given) {
        eprintln!("{name} has no effect: {why}");
    }
}
