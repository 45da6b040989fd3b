//! `table --board`: the scene's table is fitted here and sent to the board.

use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::session::table::{self, Sent};
use serde_json::json;
use tsa_table::Metadata;

/// Runs the command.
///
/// # Errors
/// The board's refusal in words.
pub fn run(global: &Global, output: &mut Output) -> Result<(), Failure> {
    let scene = global.rig_config()?;
    // The board may be built for other constants: to change that is the purpose.
    let mut session = global.target()?.meet()?;
    let Sent { fit, kept } = table::send(&mut session, &scene, &global.scene)?;
    let Metadata { contraction_error_m, tr_relative_error, .. } = fit.table.metadata;
    output.object(&json!({
        "scene_hash": format!("{:08x}", scene.hash()),
        "bytes": fit.table.numbers.bytes(),
        "contraction_error_m": contraction_error_m,
        "tr_relative_error": tr_relative_error,
        "kept": kept,
    }))?;
    output.line(format!(
        "table of {} bytes sent: contraction within {:.2} um, TR within {:.3} %; {}. Home again before the next move",
        fit.table.numbers.bytes(),
        contraction_error_m * 1e6,
        tr_relative_error * 100.0,
        if kept { "kept in flash" } else { "NOT kept: it is lost with the next reset" }
    ))?;
    Ok(())
}
