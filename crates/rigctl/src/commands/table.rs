//! `table`: the scene's table is fitted here and sent to the board. Without `--board` the command is the laboratory's.

use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::session::Wanted;
use crate::session::table::{self, Sent};
use crate::units::{PERCENT, UM};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use tsa_table::Metadata;

/// Fit the scene's table and print its error bounds; --board sends it
#[derive(Debug, Args)]
pub struct Table {
    /// Also write table.json and table.rs into this folder
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Send the table to the board at --port, which checks, uses and keeps it; home again after it
    #[arg(long, conflicts_with = "out")]
    pub board: bool,
}

/// Runs the command.
///
/// # Errors
/// The board's refusal in words.
pub fn send(global: &Global, output: &mut Output) -> Result<(), Failure> {
    let scene = global.rig_config()?;
    // The board may be built for other constants: to change that is the purpose.
    let mut session = global.target()?.connect(Wanted::Any)?;
    let Sent { fit, kept } = table::send(&mut session, &scene, &global.scene)?;
    let Metadata { contraction_error_m, tr_relative_error, .. } = fit.table.metadata;
    let bytes = fit.table.numbers.bytes();
    output.object(&json!({
        "scene_hash": format!("{:08x}", scene.hash()),
        "bytes": bytes,
        "contraction_error_m": contraction_error_m,
        "tr_relative_error": tr_relative_error,
        "kept": kept,
    }))?;
    let lasts = if kept { "kept in flash" } else { "NOT kept: it is lost with the next reset" };
    output.line(format!(
        "table of {bytes} bytes sent: contraction within {}, TR within {}; {lasts}. Home again before the next move",
        UM.error(contraction_error_m),
        PERCENT.error(tr_relative_error)
    ))?;
    Ok(())
}
