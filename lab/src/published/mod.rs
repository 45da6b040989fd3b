//! The numbers that the paper prints beside the same numbers computed for one or several scenes.
//!
//! - [`numbers`]: the printed numbers and quoted ratios, each with its computation, and geometry that the paper does not state.
//! - [`contradictions`]: what no law can meet.
//! - [`identify`]: constants fitted to them.
//! - `comparison`: both as rows, tables and CSV; `figures`: the paper's Figs 6 to 11 and 13 redrawn.

mod comparison;
pub mod contradictions;
mod figures;
pub mod identify;
pub mod numbers;

use comparison::Comparison;
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::out_file::write_file;
use rigctl::output::Output;
use rigctl::scene_file;
use std::path::PathBuf;

/// The paper's three parameter sets, as scene files: what was fitted, the same with eq. 6 kept, and Table 1 as printed.
pub const SETS: [&str; 3] = ["paper-identified", "paper-identified-eq6", "paper-printed"];

/// `tsa-lab published`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The three parameter sets of the paper's scenes side by side, instead of --scene
    #[arg(long)]
    all: bool,
    /// With the geometry that is inferred for some of the paper's sweeps instead of Table 1's (lab/paper.md)
    #[arg(long)]
    inferred_geometry: bool,
    /// Also write published.csv, ratios.csv and the paper's figures, redrawn, into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// If a scene cannot be read, or the folder cannot be written.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let scenes = if self.all {
            let load = |name: &&str| {
                Ok(((*name).to_owned(), scene_file::load(&scene_file::find(format!("scenes/{name}.toml").into()))?))
            };
            SETS.iter().map(load).collect::<Result<_, Failure>>()?
        } else {
            vec![(global.scene.display().to_string(), global.scene()?)]
        };
        let comparison = Comparison::new(scenes, self.inferred_geometry)?;
        comparison.json().iter().try_for_each(|row| output.object(row))?;
        comparison.text()?.iter().try_for_each(|line| output.line(line))?;
        if let Some(folder) = &self.out {
            let mut files = comparison.data()?;
            for (name, figure) in comparison.figures()? {
                files.push((name, figure.svg()?));
            }
            files.iter().try_for_each(|(name, content)| write_file(folder, name, content))?;
            let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
            output.line(format!("written: {} in {}", names.join(", "), folder.display()))?;
        }
        Ok(())
    }
}
