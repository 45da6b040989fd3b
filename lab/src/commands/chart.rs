//! `chart`: speed against accuracy, and where methods fail.

use crate::chart::{self, Made};
use crate::commands::figure::make;
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::out_file::{folder, write_file};
use rigctl::output::Output;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// One figure, for machines.
#[derive(Debug, Serialize)]
struct Report<'a> {
    figure: &'a str,
    svg: Option<String>,
    csv: String,
    seconds: f64,
    said: &'a [String],
}

/// Runs the command.
///
/// # Errors
/// If something cannot be solved, drawn or written.
pub fn run(global: &Global, out: &Path, only: &[String], output: &mut Output) -> Result<(), Failure> {
    let scene = global.scene()?;
    folder(out)?;
    for name in chart::NAMES {
        if !only.is_empty() && only.iter().all(|wanted| wanted != name) {
            continue;
        }
        let begin = Instant::now();
        match make(name, &scene, &global.scene, out) {
            Ok(made) => report(&made, begin.elapsed().as_secs_f64(), out, output)?,
            // What only another program measures may not be there; the rest is of use without it.
            Err(e) if only.is_empty() && chart::MEASURED_ELSEWHERE.contains(&name) => {
                eprintln!("left out: {name}: {}", e.message().unwrap_or_default());
            }
            Err(e) => return Err(e),
        }
        output.flush()?;
    }
    Ok(())
}

fn report(made: &Made, seconds: f64, out: &Path, output: &mut Output) -> Result<(), Failure> {
    let written = |kind: &str, content: &str| {
        let file = format!("{}.{kind}", made.name);
        write_file(out, &file, content).map(|()| out.join(file).display().to_string())
    };
    let svg = made.svg.as_ref().map(|svg| written("svg", svg)).transpose()?;
    let csv = written("csv", &made.csv)?;
    let files = svg.iter().chain([&csv]).map(String::as_str).collect::<Vec<_>>().join(", ");
    output.object(&Report { figure: made.name, svg, csv, seconds, said: &made.findings })?;
    output.line(format!("{}: {files} ({seconds:.1} s)", made.name))?;
    made.findings.iter().try_for_each(|line| output.line(format!("  {line}")))?;
    Ok(())
}
