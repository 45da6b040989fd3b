//! `jog`: turns the strings at a constant speed for a while.

use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::session::{motion, status};

/// Runs the command: twist speed (rad/s), time (s).
///
/// # Errors
/// The board's refusal or failure in words.
pub fn run(global: &Global, speed: f64, seconds: f64, output: &mut Output) -> Result<(), Failure> {
    if !(0.0..=600.0).contains(&seconds) {
        return Err(Failure::Usage(format!("--seconds {seconds}: must be from 0 to 600")));
    }
    let mut session = global.target()?.connect()?;
    motion::jog(&mut session, speed, seconds)?;
    if let Some(row) = status::newest_row(&mut session)? {
        output.object(&row)?;
        output.line(row.text())?;
    }
    Ok(())
}
