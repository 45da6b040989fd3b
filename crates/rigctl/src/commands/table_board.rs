//! `table --board`: the board makes its own table for the scene's constants.

use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::session::table::{self, Rebuilt};
use serde_json::json;

/// Runs the command.
///
/// # Errors
/// The board's refusal in words.
pub fn run(global: &Global, output: &mut Output) -> Result<(), Failure> {
    let scene = global.rig_config()?;
    // The board may be built for other constants: to change that is the purpose.
    let mut session = global.target()?.meet()?;
    table::check(&session, &scene, &global.scene.display().to_string())?;
    let Rebuilt { contraction_error_m, tr_relative_error, states, duration_s: took_s, kept } =
        table::rebuild(&mut session, &scene)?;
    output.object(&json!({
        "scene_hash": format!("{:08x}", scene.hash()),
        "contraction_error_m": contraction_error_m,
        "tr_relative_error": tr_relative_error,
        "states": states,
        "duration_s": took_s,
        "kept": kept,
    }))?;
    output.line(format!(
        "table made on the board: contraction within {:.2} um, TR within {:.3} %, {states} equilibria in \
         {took_s:.1} s; {}. Home again before the next move",
        contraction_error_m * 1e6,
        tr_relative_error * 100.0,
        if kept { "kept in flash" } else { "NOT kept: it is lost with the next reset" }
    ))?;
    Ok(())
}
