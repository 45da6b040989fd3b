//! `published`: the paper's numbers beside the same numbers computed.

use crate::published::{Comparison, SETS};
use rig_config::Scene;
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::out_file::write_file;
use rigctl::output::Output;
use std::path::Path;

/// Runs the command.
///
/// # Errors
/// If a scene cannot be read, or the folder cannot be written.
pub fn run(global: &Global, all: bool, inferred: bool, out: Option<&Path>, output: &mut Output) -> Result<(), Failure> {
    let scenes = if all {
        let load = |name: &&str| Ok(((*name).to_owned(), Scene::load(format!("scenes/{name}.toml"))?));
        SETS.iter().map(load).collect::<Result<_, Failure>>()?
    } else {
        vec![(global.scene.display().to_string(), global.scene()?)]
    };
    let comparison = Comparison::new(scenes, inferred)?;
    comparison.compared().iter().try_for_each(|row| output.object(row))?;
    comparison.text()?.iter().try_for_each(|line| output.line(line))?;
    if let Some(folder) = out {
        let files = comparison.files()?;
        files.iter().try_for_each(|(name, content)| write_file(folder, name, content))?;
        let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
        output.line(format!("written: {} in {}", names.join(", "), folder.display()))?;
    }
    Ok(())
}
