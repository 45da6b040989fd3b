//! Speed against accuracy, and where methods fail: what `tsa-lab chart` measures and draws.
//!
//! Each figure is described ([`rigctl::plot`]) by a file of its name, beside its data as rows that serialise:
//!
//! - [`work_precision`]: what an equilibrium costs on the desktop.
//! - `table_size`: bytes of a table against its error.
//! - `measured`: what other commands have measured.
//! - `tiers`: the cheapest model over load and twist, and which model and table each of five scenes needs.
//! - `margin_figure`: stability of the position loop in time, computed by [`margin`].
//! - `stability`: every method over load and twist of some rods; [`grid`]: the states.

mod damped;
pub mod grid;
pub mod margin;
mod margin_figure;
mod measured;
pub mod stability;
mod table_size;
mod tiers;
pub mod work_precision;

use anyhow::{Context, Result};
use clap::builder::PossibleValuesParser;
use rig_config::Scene;
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::out_file::{folder, write_file};
use rigctl::output::{Output, progress};
use rigctl::parallel::Progress;
use rigctl::plot::Figure;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A figure: its name, what it shows, whether it draws what another command has measured, and how it is made.
type Kind = (&'static str, &'static str, bool, fn(&Inputs<'_>) -> Result<Made>);

/// The figures, in the order in which they are made.
pub const FIGURES: [Kind; 10] = [
    ("work-precision", "Work against precision of every method", false, work_precision::make),
    ("target", "What each way of knowing the mechanism costs on the board", true, measured::target),
    ("table-size", "Bytes against error of every form of table", false, table_size::make),
    ("closed-loop", "A cheaper model or a coarser table in the closed loop", true, measured::closed_loop),
    ("rigs", "One effect at a time that the model leaves out", true, measured::rigs),
    ("effects", "Where the chain breaks as one effect is turned up", true, measured::effects),
    ("tiers", "The cheapest sufficient model over load and twist", false, tiers::maps),
    ("scenes", "The model and the table that each scene needs", false, tiers::scenes),
    ("margin", "Stability in time: gain, delay and sampling", false, margin_figure::make),
    ("stability", "Which equilibrium each method finds, over load and twist of four rods", false, stability::make),
];

/// `tsa-lab chart`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder for the figures (SVG) and their data (CSV)
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
    /// Only these figures
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = PossibleValuesParser::new(FIGURES.map(|f| f.0)))]
    only: Vec<String>,
}

/// What figures are made from.
pub struct Inputs<'a> {
    /// The operator's scene.
    scene: &'a Scene,
    /// Its file; other scenes are looked for beside it.
    scene_file: &'a Path,
    /// The folder in which the measurements of other commands are looked for, before `out`.
    folder: &'a Path,
    /// Called as the work proceeds.
    progress: &'a Progress<'a>,
}

impl Inputs<'_> {
    /// The scene and, if it is there, the one with a plateau beside it, by their files' names.
    fn with_plateau(&self) -> Vec<(String, Scene)> {
        let plateau = self.scene_file.with_file_name("niti-plateau.toml");
        let beside = (plateau != self.scene_file).then(|| Scene::load(&plateau).ok()).flatten();
        let scenes = [Some((self.scene_file, self.scene.clone())), beside.map(|scene| (plateau.as_path(), scene))];
        let stem = |file: &Path| file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        scenes.into_iter().flatten().map(|(file, scene)| (stem(file), scene)).collect()
    }

    /// A file that another command leaves in the folder or in `out`: its text, and its lines.
    fn measured<T: DeserializeOwned>(&self, file: &str, command: &str) -> Result<(String, Vec<T>)> {
        let found = [self.folder, Path::new("out")].map(|f| f.join(file)).into_iter().find(|f| f.exists());
        let found = found.with_context(|| format!("no {file} in the folder or in out; `{command}` makes it"))?;
        let text = std::fs::read_to_string(&found).with_context(|| format!("cannot read {}", found.display()))?;
        let rows = csv::Reader::from_reader(text.as_bytes()).deserialize().collect::<Result<_, _>>();
        Ok((text.clone(), rows.with_context(|| file.to_owned())?))
    }
}

/// A figure with its data.
#[derive(Default)]
pub struct Made {
    /// The picture; a table has none.
    pub svg: Option<String>,
    /// What is drawn.
    pub csv: String,
    /// What it shows, in a few lines, where that is more than the data says.
    pub findings: Vec<String>,
    /// What is missing in it, and why.
    left_out: Vec<String>,
}

impl Made {
    fn new(figure: &Figure, csv: String, findings: Vec<String>) -> Result<Self> {
        Ok(Self { svg: Some(figure.svg()?), csv, findings, left_out: Vec::new() })
    }
}

/// Makes one of [`FIGURES`], with a progress line on standard error; what is missing in it is printed there, too. Measurements of
/// other commands are looked for in the folder.
///
/// # Errors
/// If something cannot be solved or drawn.
pub fn make((name, _, _, figure): Kind, scene: &Scene, scene_file: &Path, folder: &Path) -> Result<Made> {
    let bar = progress(0, name);
    let advance = |done: usize, count: usize| {
        bar.set_length(count as u64);
        bar.set_position(done as u64);
    };
    let made = figure(&Inputs { scene, scene_file, folder, progress: &advance })?;
    bar.finish_and_clear();
    made.left_out.iter().for_each(|what| eprintln!("left out: {what}"));
    Ok(made)
}

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// If something cannot be solved, drawn or written.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let scene = global.scene()?;
        folder(&self.out)?;
        for kind in FIGURES {
            let (name, _, measured_elsewhere, _) = kind;
            if !self.only.is_empty() && self.only.iter().all(|wanted| wanted != name) {
                continue;
            }
            let begin = Instant::now();
            match make(kind, &scene, &global.scene, &self.out).map_err(Failure::from) {
                Ok(made) => self.write(name, &made, begin.elapsed().as_secs_f64(), output)?,
                // What only another program measures may not be there; the rest is of use without it.
                Err(e) if self.only.is_empty() && measured_elsewhere => {
                    eprintln!("left out: {name}: {}", e.message().unwrap_or_default());
                }
                Err(e) => return Err(e),
            }
            output.flush()?;
        }
        Ok(())
    }

    fn write(&self, name: &str, made: &Made, seconds: f64, output: &mut Output) -> Result<(), Failure> {
        let written = |kind: &str, content: &String| {
            let file = format!("{name}.{kind}");
            write_file(&self.out, &file, content).map(|()| self.out.join(file).display().to_string())
        };
        let svg = made.svg.as_ref().map(|svg| written("svg", svg)).transpose()?;
        let csv = written("csv", &made.csv)?;
        let files = svg.iter().chain([&csv]).map(String::as_str).collect::<Vec<_>>().join(", ");
        let object =
            serde_json::json!({ "figure": name, "svg": svg, "csv": csv, "seconds": seconds, "said": made.findings });
        output.object(&object)?;
        output.line(format!("{name}: {files} ({seconds:.1} s)"))?;
        made.findings.iter().try_for_each(|line| output.line(format!("  {line}")))?;
        Ok(())
    }
}

/// Each value once, in the order of its first appearance.
fn distinct<T: PartialEq>(values: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for value in values {
        if !found.contains(&value) {
            found.push(value);
        }
    }
    found
}
