//! Test programs, several at a time: `cargo test` runs one after the other, and most of the long ones have one long test
//! that leaves the other cores idle.

use crate::Folders;
use crate::process::{cargo, shown};
use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Mutex, PoisonError};

/// One executable of tests.
pub struct Program {
    /// As `cargo test` would call it: package and target.
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
    String::from_utf8_lossy(&output.stdout).lines().filter_map(|line| program(line).transpose()).collect()
}

/// The program in one of cargo's messages, if the message is about one.
fn program(message: &str) -> Result<Option<Program>> {
    let message: Value = serde_json::from_str(message).context("cargo's message")?;
    let text = |path: &str| message.pointer(path).and_then(Value::as_str);
    let (Some(executable), Some(true)) =
        (text("/executable"), message.pointer("/profile/test").and_then(Value::as_bool))
    else {
        return Ok(None);
    };
    let manifest = Path::new(text("/manifest_path").context("cargo's message has no manifest_path")?);
    let folder = manifest.parent().context("a manifest has no folder")?.to_path_buf();
    let package = folder.file_name().unwrap_or_default().to_string_lossy();
    let name = format!("{package}: {} {}", text("/target/kind/0").unwrap_or("?"), text("/target/name").unwrap_or("?"));
    Ok(Some(Program { name, executable: executable.into(), folder }))
}

/// Runs programs, as many at a time as there are cores. Goes on after a failure; what failed is printed last.
pub fn run(programs: Vec<Program>) -> Result<()> {
    let count = programs.len();
    ensure!(count > 0, "cargo has built no test program");
    let (rest, failed) = (Mutex::new(programs.into_iter()), Mutex::new(Vec::new()));
    let worker = || -> Result<()> {
        loop {
            // Locked for this one statement only.
            let next = rest.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(program) = next else { return Ok(()) };
            // One that hangs has no end to be named at.
            eprintln!("     Running {}", program.name);
            let output = Command::new(&program.executable)
                .current_dir(&program.folder)
                .env("CARGO_MANIFEST_DIR", &program.folder)
                .stdin(Stdio::null())
                .output()
                .with_context(|| format!("could not start {}", program.executable.display()))?;
            if output.status.success() {
                print(&program, &output)?;
            } else {
                failed.lock().unwrap_or_else(PoisonError::into_inner).push((program, output));
            }
        }
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().try_for_each(|worker| worker.join().unwrap_or_else(|_| bail!("a worker panicked")))
    })?;
    let failed = failed.into_inner().unwrap_or_else(PoisonError::into_inner);
    failed.iter().try_for_each(|(program, output)| print(program, output))?;
    let names: Vec<_> = failed.iter().map(|(program, _)| program.name.as_str()).collect();
    ensure!(names.is_empty(), "tests failed in {}", names.join(", "));
    println!("\n{count} test programs passed");
    Ok(())
}

/// What a program has said, in one piece.
fn print(program: &Program, output: &Output) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "\n     Ran {}", program.name)?;
    out.write_all(&output.stdout)?;
    out.write_all(&output.stderr)?;
    Ok(out.flush()?)
}
