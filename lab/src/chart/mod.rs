//! Speed against accuracy, and where methods fail: what `tsa-lab chart` measures and draws.
//!
//! - [`stability`]: every method over load and twist of some [`rods`]; [`limits`]: what bounds their states; [`grid`]: the
//!   states; `stability_figure`: all of it as a picture.
//! - `mechanism`: the mechanism drawn to scale under a light and a heavy load.
//! - [`work`]: what an equilibrium costs on the desktop; `work_figure` draws it.
//! - `closed_loop`: what a cheaper model or a less accurate table does to the closed loop.
//! - [`sizes`]: bytes of a table against its error.
//! - [`target`]: what every way of knowing the mechanism costs on the board.
//! - `rigs`: errors on rigs that are not their own model; `effects`: where the chain breaks as one effect is turned up.
//! - [`margin`]: stability of the position loop in time; `margin_figure` draws it.
//! - [`tiers`]: the cheapest model over load and twist, and which model and table each of five scenes needs.

mod closed_loop;
mod damped;
mod effects;
pub mod grid;
pub mod limits;
pub mod margin;
mod margin_figure;
mod mechanism;
mod mechanism_drawing;
mod rigs;
pub mod rods;
pub mod sizes;
pub mod stability;
mod stability_figure;
pub mod target;
pub mod tiers;
pub mod work;
mod work_figure;

use anyhow::{Context, Result, bail};
use rig_config::Scene;
use rigctl::parallel::Progress;
use std::ffi::OsString;
use std::path::Path;

/// The figures, in the order in which they are made.
pub const NAMES: [&str; 11] = [
    "mechanism",
    "work-precision",
    "target",
    "table-size",
    "closed-loop",
    "rigs",
    "effects",
    "tiers",
    "scenes",
    "margin",
    "stability",
];

/// The figures that draw what another command has measured; they cannot be made before it has been run.
pub const MEASURED_ELSEWHERE: [&str; 4] = ["target", "closed-loop", "rigs", "effects"];

/// What figures are made from.
pub struct Inputs<'a> {
    /// The operator's scene.
    pub scene: &'a Scene,
    /// Its file; other scenes are looked for beside it.
    pub scene_file: &'a Path,
    /// The folder in which the measurements of other commands are looked for, before `out`.
    pub folder: &'a Path,
    /// Program and arguments that call [`work::kernel`] for a scene; the scene's file follows as the last argument.
    pub kernel: &'a [OsString],
    /// Called as the work proceeds.
    pub progress: &'a Progress<'a>,
}

impl Inputs<'_> {
    /// Text of a file that another command leaves in the folder or in `out`.
    fn measured(&self, file: &str, command: &str) -> Result<String> {
        let found = [self.folder, Path::new("out")].map(|f| f.join(file)).into_iter().find(|f| f.exists());
        let found = found.with_context(|| format!("no {file} in the folder or in out; `{command}` makes it"))?;
        std::fs::read_to_string(&found).with_context(|| format!("cannot read {}", found.display()))
    }
}

/// Makes one of [`NAMES`].
///
/// # Errors
/// If something cannot be solved or drawn.
pub fn make(name: &str, inputs: &Inputs<'_>) -> Result<Made> {
    match name {
        "mechanism" => mechanism::make(inputs.scene),
        "work-precision" => work_figure::make(inputs),
        "target" => target::make(inputs),
        "closed-loop" => closed_loop::make(inputs),
        "rigs" => rigs::make(inputs),
        "effects" => effects::make(inputs),
        "tiers" => tiers::maps(inputs),
        "scenes" => tiers::scenes(inputs),
        "table-size" => sizes::make(inputs),
        "margin" => margin_figure::make(inputs),
        "stability" => stability_figure::make(16, 20, inputs.progress),
        _ => bail!("chart: no figure is called {name}"),
    }
}

/// A figure with its data.
pub struct Made {
    /// Its name: the files are `NAME.svg` and `NAME.csv`.
    pub name: &'static str,
    /// The picture; a table has none.
    pub svg: Option<String>,
    /// What is drawn.
    pub csv: String,
    /// What it shows, in a few lines.
    pub findings: Vec<String>,
    /// What is missing in it, and why.
    pub left_out: Vec<String>,
}
