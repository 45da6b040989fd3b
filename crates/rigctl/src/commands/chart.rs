//! `chart`: speed against accuracy, and where methods fail.

use crate::chart::{self, Made};
use crate::cli::Global;
use crate::failure::Failure;
use crate::output::{Output, write_file};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// One figure, for machines.
#[derive(Debug, Serialize)]
struct Report<'a> {
    figure: &'a str,
    svg: String,
    csv: String,
    seconds: f64,
    said: &'a [String],
}

/// Runs the command.
///
/// # Errors
/// If something cannot be solved, drawn or written.
pub fn run(global: &Global, out: &Path, only: &[String], output: &mut Output) -> Result<(), Failure> {
    let scene = super::scene(global)?;
    for name in chart::NAMES {
        if !only.is_empty() && only.iter().all(|wanted| wanted != name) {
            continue;
        }
        let begin = Instant::now();
        for made in chart::make(name, &scene, &global.scene, out)? {
            report(&made, begin.elapsed().as_secs_f64(), out, output)?;
        }
        output.flush()?;
    }
    Ok(())
}

fn report(made: &Made, seconds: f64, out: &Path, output: &mut Output) -> Result<(), Failure> {
    let [svg, csv] = ["svg", "csv"].map(|kind| format!("{}.{kind}", made.name));
    write_file(out, &svg, &made.svg)?;
    write_file(out, &csv, &made.csv)?;
    let [svg, csv] = [svg, csv].map(|file| out.join(file).display().to_string());
    output.object(&Report { figure: made.name, svg: svg.clone(), csv: csv.clone(), seconds, said: &made.said })?;
    output.line(format!("{}: {svg}, {csv} ({seconds:.1} s)", made.name))?;
    made.said.iter().try_for_each(|line| output.line(format!("  {line}")))?;
    Ok(())
}
