//! `home`: finds zero twist and weighs the load.

use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::session::homing;

/// Runs the command.
///
/// # Errors
/// The board's refusal or failure in words.
pub fn run(global: &Global, output: &mut Output) -> Result<(), Failure> {
    let mut session = global.target()?.connect()?;
    let result = homing::home(&mut session, |_| {})?;
    output.object(&result)?;
    Ok(output.line(result.text())?)
}
