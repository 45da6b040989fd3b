//! `study`: one value of the scene varied over any range.

use crate::range::{TurnRange, Vary};
use crate::scene_key::KeyError;
use crate::study::{Options, Study};
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::out_file::write_file;
use rigctl::output::Output;
use std::path::Path;

/// Runs the command.
///
/// # Errors
/// If the scene has no such key, one of the values can describe no rig, or the folder cannot be written.
pub fn run(
    global: &Global,
    vary: &Vary,
    load_n: f64,
    turns: TurnRange,
    out: Option<&Path>,
    output: &mut Output,
) -> Result<(), Failure> {
    let scene = global.scene()?;
    let options = Options { key: vary.key.clone(), values: vary.values(), load_n, turns: [turns.from, turns.to] };
    let study = Study::new(&scene, options).map_err(|e| match e {
        KeyError::Value(_) => Failure::failed(format!("vary: {e}")),
        KeyError::Form(_) | KeyError::Unknown { .. } => Failure::Usage(format!("vary: {e}")),
    })?;
    study.points().iter().try_for_each(|point| output.object(point))?;
    study.text().iter().try_for_each(|line| output.line(line))?;
    if let Some(folder) = out {
        let files = study.files(&global.scene.display().to_string())?;
        files.iter().try_for_each(|(name, content)| write_file(folder, name, content))?;
        output.line(format!("written: {} in {}", files.map(|(name, _)| name).join(", "), folder.display()))?;
    }
    Ok(())
}
