//! `home`: finds zero twist and weighs the load.

use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::session::homing;
use rig_link::LoadChoice;

/// Runs the command; `load` is what the operator says of the load's weight.
///
/// # Errors
/// The board's refusal or failure in words.
pub fn run(global: &Global, load: LoadChoice, output: &mut Output) -> Result<(), Failure> {
    let mut session = global.target()?.connect()?;
    let result = homing::home(&mut session, load, |_| {})?;
    output.object(&result)?;
    Ok(output.line(result.text())?)
}
