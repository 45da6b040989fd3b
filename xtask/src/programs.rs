//! Builds and runs test programs, as many at a time as there are cores. `cargo test` runs one after the other, and most of
//! the long ones have one long test that leaves the other cores idle.

use crate::Folders;
use crate::process::{cargo, shown};
use anyhow::{Context, Result, bail, ensure};
use cargo_metadata::Message;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// One executable of tests.
pub struct Program {
    /// Package and target, as `cargo test` calls it.
    name: String,
    executable: PathBuf,
    /// Folder of its package, where `cargo test` would start it.
    folder: PathBuf,
}

/// Builds all test programs of the packages that `what` selects.
pub fn build(folders: &Folders, what: &[&str]) -> Result<Vec<Program>> {
    let mut command = cargo(folders);
    command.args(["test", "--release", "--no-run", "--message-format=json-render-diagnostics"]).args(what);
    eprintln!("> {}", shown(&command));
    let output = command.stderr(Stdio::inherit()).output().context("could not start cargo")?;
    ensure!(output.status.success(), "failed ({}): {}", output.status, shown(&command));
    let mut programs = Vec::new();
    for message in Message::parse_stream(output.stdout.as_slice()) {
        let Message::CompilerArtifact(built) = message.context("cargo's message")? else { continue };
        if let Some(executable) = built.executable.filter(|_| built.profile.test) {
            let folder = built.manifest_path.parent().context("a manifest has no folder")?;
            let kind = built.target.kind.first().map(ToString::to_string).unwrap_or_default();
            let name = format!("{}: {kind} {}", folder.file_name().unwrap_or_default(), built.target.name);
            programs.push(Program { name, executable: executable.into(), folder: folder.into() });
        }
    }
    Ok(programs)
}

/// Runs all programs. A failure does not stop the others; the output of those that failed is printed last.
pub fn run(programs: Vec<Program>) -> Result<()> {
    let count = programs.len();
    ensure!(count > 0, "cargo has built no test program");
    let rest = Mutex::new(programs.into_iter());
    let worker = || -> Result<Vec<(Program, Output)>> {
        let mut failed = Vec::new();
        loop {
            // The lock is held for this statement only.
            let next = rest.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(program) = next else { return Ok(failed) };
            eprintln!("     Running {}", program.name);
            let mut command = Command::new(&program.executable);
            command.current_dir(&program.folder).env("CARGO_MANIFEST_DIR", &program.folder).stdin(Stdio::null());
            let began = Instant::now();
            let output = command.output().with_context(|| format!("could not start {}", program.name))?;
            eprintln!("         Ran {} in {:.0?}", program.name, began.elapsed());
            if output.status.success() {
                print(&program, &output)?;
            } else {
                failed.push((program, output));
            }
        }
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let failed = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(worker)).collect();
        let ended = workers.into_iter().map(|worker| worker.join().unwrap_or_else(|_| bail!("a worker panicked")));
        ended.collect::<Result<Vec<_>>>()
    })?;
    let failed: Vec<_> = failed.into_iter().flatten().collect();
    failed.iter().try_for_each(|(program, output)| print(program, output))?;
    let names: Vec<_> =
        failed.iter().map(|(program, output)| format!("{} ({})", program.name, output.status)).collect();
    ensure!(names.is_empty(), "tests failed:\n{}", names.join("\n"));
    println!("\n{count} test programs passed");
    Ok(())
}

/// Prints the output of a program in one piece.
fn print(program: &Program, output: &Output) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "\n     Ran {}", program.name)?;
    out.write_all(&output.stdout)?;
    out.write_all(&output.stderr)?;
    Ok(out.flush()?)
}
