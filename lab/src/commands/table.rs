//! `table`: fits and certifies the scene's table and says why this one.

use crate::table_report::TableReport;
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::out_file::write_file;
use rigctl::output::Output;
use rigctl::scene_file;
use std::path::Path;

/// Runs the command.
///
/// # Errors
/// If the scene allows no table, or the folder cannot be written.
pub fn run(global: &Global, out: Option<&Path>, output: &mut Output) -> Result<(), Failure> {
    let scene = global.scene()?;
    // The fit says where an envelope first reaches past the model, the check of the rig only that it does.
    let fit = scene.fit_table()?;
    scene_file::check_rig(&global.scene, &scene)?;
    let report = TableReport::new(&scene, &fit)?;
    output.object(&report)?;
    report.text().iter().try_for_each(|line| output.line(line))?;
    if let Some(folder) = out {
        write_file(folder, "table.json", &(serde_json::to_string_pretty(&report)? + "\n"))?;
        write_file(folder, "table.rs", &tsa_table::emit::rust_source(&fit))?;
        output.line(format!("written: table.json, table.rs in {}", folder.display()))?;
    }
    Ok(())
}
