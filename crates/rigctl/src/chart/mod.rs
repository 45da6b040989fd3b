//! Speed against accuracy, and where methods fail: what `rigctl chart` measures and draws.
//!
//! - [`stability`]: every method over load and twist of some [`rods`]; [`limits`]: what bounds their states;
//!   `stability_figure`: both as a picture.
//! - [`work`]: what an equilibrium costs on the desktop; `work_figure` draws it.
//! - `closed_loop`: what a cheaper model or a rougher table does to the closed loop.
//! - [`sizes`]: bytes of a table against its error.
//! - [`target`]: what everything costs on the board.
//! - [`margin`]: stability of the position loop in time; `margin_figure` draws it.
//! - [`tiers`]: the cheapest model over load and twist, and what five scenes take.

mod closed_loop;
pub mod limits;
pub mod margin;
mod margin_figure;
pub mod rods;
pub mod sizes;
pub mod stability;
mod stability_figure;
pub mod target;
pub mod tiers;
pub mod work;
mod work_figure;

use crate::failure::Failure;
use crate::output::progress;
use rig_scene::Scene;
use std::path::Path;

/// The figures, in the order in which they are made.
pub const NAMES: [&str; 8] =
    ["work-precision", "target", "table-size", "closed-loop", "tiers", "scenes", "margin", "stability"];

/// Those that draw what another command has measured, and are left out where it has not been run.
pub const MEASURED_ELSEWHERE: [&str; 2] = ["target", "closed-loop"];

/// Text of a file that another command leaves in `out`, from the folder or from there.
pub(crate) fn measured(folder: &Path, file: &str, command: &str) -> Result<String, Failure> {
    let found = [folder, Path::new("out")].map(|f| f.join(file)).into_iter().find(|f| f.exists());
    let found =
        found.ok_or_else(|| Failure::failed(format!("no {file} in the folder or in out; `{command}` makes it")))?;
    std::fs::read_to_string(&found).map_err(|e| Failure::failed(format!("cannot read {}: {e}", found.display())))
}

/// Makes one of [`NAMES`].
///
/// # Errors
/// If something cannot be solved or drawn.
pub fn make(name: &str, scene: &Scene, scene_file: &Path, out: &Path) -> Result<Made, Failure> {
    Ok(match name {
        "work-precision" => work_figure::make(scene, scene_file, out)?,
        "target" => target::make(out)?,
        "closed-loop" => closed_loop::make(out)?,
        "tiers" => tiers::maps(scene, scene_file)?,
        "scenes" => tiers::scenes(scene_file)?,
        "table-size" => sizes::make(scene)?,
        "margin" => margin_figure::make(scene)?,
        "stability" => stability_figure::make(16, 20)?,
        _ => return Err(Failure::Usage(format!("chart: no figure is called {name}"))),
    })
}

/// `f` of 0 to `count`, in order, on as many threads as the machine has cores, with a progress line.
pub(crate) fn parallel<T: Send>(figure: &'static str, count: usize, f: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let workers = std::thread::available_parallelism().map_or(1, |n| n.get()).min(count.max(1));
    let next = std::sync::atomic::AtomicUsize::new(0);
    let bar = progress(count as u64, figure);
    let mut done: Vec<(usize, T)> = std::thread::scope(|scope| {
        let work = || {
            let take = || next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            let one = |k| {
                let done = (k, f(k));
                bar.inc(1);
                done
            };
            std::iter::repeat_with(take).take_while(|k| *k < count).map(one).collect::<Vec<_>>()
        };
        let threads: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        // A panic in `f` goes on in the caller.
        threads.into_iter().flat_map(|t| t.join().unwrap_or_else(|p| std::panic::resume_unwind(p))).collect()
    });
    bar.finish_and_clear();
    done.sort_by_key(|(k, _)| *k);
    done.into_iter().map(|(_, value)| value).collect()
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
    pub said: Vec<String>,
}
