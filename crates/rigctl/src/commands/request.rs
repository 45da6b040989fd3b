//! `stop`, `hold`, `clear`: one request to any board, whatever scene it is for, in any fault.

use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::session::status;
use rig_link::Request;

/// Runs the command.
///
/// # Errors
/// The board's refusal in words.
pub fn run(global: &Global, request: &Request, output: &mut Output) -> Result<(), Failure> {
    let mut session = global.target()?.meet()?;
    if global.is_emulated() {
        session.wait_started()?;
    }
    session.request(request)?;
    session.until(0.2, |_| false)?;
    if let Some(row) = status::newest_row(&mut session)? {
        output.object(&row)?;
        output.line(row.text())?;
    }
    Ok(())
}
