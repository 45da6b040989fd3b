//! `track`: leads the load along a course.

use crate::course::Course;
use crate::failure::Failure;
use crate::options::Global;
use crate::output::Output;
use crate::session::{homing, stream};
use rig_link::LoadChoice;
use std::path::Path;

/// Runs the command. An emulated board is homed first.
///
/// # Errors
/// What is wrong with the file, or the board's refusal, or why it ended the stream, in words.
pub fn run(global: &Global, file: &Path, output: &mut Output) -> Result<(), Failure> {
    let course = Course::load(file)?;
    let mut session = global.target()?.connect()?;
    if global.is_emulated() {
        eprintln!("the emulated board starts afresh and is not homed: homing first");
        output.line(homing::home(&mut session, LoadChoice::Auto, |_| {})?.text())?;
    }
    let r = stream::track(&mut session, &course, |_| {})?;
    output.object(&r)?;
    output.line(format!("course        {:9.2} s", r.duration_s))?;
    output.line(format!(
        "followed      {:9.1} um rms, {:.1} um at most (measured)",
        r.following_rms_m * 1e6,
        r.following_most_m * 1e6
    ))?;
    if let Some(true_rms_m) = r.true_following_rms_m {
        output.line(format!("true (emulated rig)    {:9.1} um rms", true_rms_m * 1e6))?;
    }
    if r.held_back_share > 0.0 {
        output.line(format!("limit         motor-speed on {:.0} % of the way", r.held_back_share * 100.0))?;
    }
    output.line(format!("at rest       {:+9.1} um from its end", r.error_m * 1e6))?;
    Ok(())
}
