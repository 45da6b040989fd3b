//! A figure of the laboratory, made with a progress line on standard error.

use crate::chart::{self, Inputs, Made};
use rig_config::Scene;
use rigctl::failure::Failure;
use rigctl::output::progress;
use std::ffi::OsString;
use std::path::Path;

/// Makes one figure, with a progress line on standard error; what is missing in it is printed there, too.
///
/// # Errors
/// If something cannot be solved or drawn.
pub fn make(name: &'static str, scene: &Scene, scene_file: &Path, folder: &Path) -> Result<Made, Failure> {
    let bar = progress(0, name);
    let advance = |done: usize, count: usize| {
        bar.set_length(count as u64);
        bar.set_position(done as u64);
    };
    // This program again: what callgrind counts must be built as what is timed.
    let kernel: Vec<OsString> = vec![std::env::current_exe()?.into(), "chart-kernel".into(), "--scene".into()];
    let made = chart::make(name, &Inputs { scene, scene_file, folder, kernel: &kernel, progress: &advance })?;
    bar.finish_and_clear();
    made.left_out.iter().for_each(|what| eprintln!("left out: {what}"));
    Ok(made)
}
