//! What each command does: [`solve`], [`lookup`] and [`table`], on the desktop alone.

pub mod lookup;
pub mod solve;
pub mod table;

use crate::cli::{Cli, Command, Global};
use crate::failure::Failure;
use crate::output::Output;
use tsa_model::Scene;

/// Runs the command.
///
/// # Errors
/// [`Failure`], with the exit code in its kind.
pub fn run(cli: &Cli, output: &mut Output) -> Result<(), Failure> {
    let global = &cli.global;
    match &cli.command {
        Command::Solve { at, method, tier } => solve::run(global, at, method, tier, output),
        Command::Lookup { at } => lookup::run(global, at, output),
        Command::Table { out } => table::run(global, out.as_deref(), output),
    }
}

/// The scene that the operator named.
pub(crate) fn scene(global: &Global) -> Result<Scene, Failure> {
    Ok(Scene::load(&global.scene)?)
}
