//! Runs test programs, several at a time. `cargo test` runs one after the other, and most of the long ones have one
//! long test that leaves the other cores idle. A program that hangs is killed and fails by the names of its unfinished
//! tests.

use crate::Folders;
use crate::process::{cargo, output_of, run_within, shown};
use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Time limit of one test program. It only detects programs that hang: the longest takes a tenth of it on two cores.
const LIMIT: Duration = Duration::from_secs(20 * 60);

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
    String::from_utf8_lossy(&output.stdout).lines().filter_map(|line| program(line).transpose()).collect()
}

/// The test program that one of cargo's messages is about, if any.
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

/// Runs all programs, as many at a time as there are cores. A failure does not stop the others; the output of those
/// that failed is printed last.
pub fn run(programs: Vec<Program>) -> Result<()> {
    let count = programs.len();
    ensure!(count > 0, "cargo has built no test program");
    let (rest, failed) = (Mutex::new(programs.into_iter()), Mutex::new(Vec::new()));
    let worker = || -> Result<()> {
        loop {
            // The lock is held for this statement only.
            let next = rest.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some(program) = next else { return Ok(()) };
            eprintln!("     Running {}", program.name);
            let (failure, output) = run_one(&program)?;
            match failure {
                None => print(&program, &output)?,
                Some(failure) => {
                    failed.lock().unwrap_or_else(PoisonError::into_inner).push((program, output, failure));
                }
            }
        }
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().try_for_each(|worker| worker.join().unwrap_or_else(|_| bail!("a worker panicked")))
    })?;
    let failed = failed.into_inner().unwrap_or_else(PoisonError::into_inner);
    failed.iter().try_for_each(|(program, output, _)| print(program, output))?;
    let failures: Vec<_> = failed.iter().map(|(program, _, failure)| format!("{} {failure}", program.name)).collect();
    ensure!(failures.is_empty(), "tests failed:\n{}", failures.join("\n"));
    println!("\n{count} test programs passed");
    Ok(())
}

/// Runs a program. Returns how it failed, if it did, and what it printed.
fn run_one(program: &Program) -> Result<(Option<String>, Vec<u8>)> {
    let command = || {
        let mut command = Command::new(&program.executable);
        command.current_dir(&program.folder).env("CARGO_MANIFEST_DIR", &program.folder);
        command
    };
    let files = ["stdout", "stderr"].map(|name| program.executable.with_extension(name));
    let status = run_within(LIMIT, &mut command(), [&files[0], &files[1]])?;
    let [stdout, stderr] = files.map(|file| std::fs::read(&file).unwrap_or_default());
    let failure = match status {
        Some(status) if status.success() => None,
        Some(status) => Some(format!("({status})")),
        None => {
            let tests = output_of(command().arg("--list")).unwrap_or_default();
            let unfinished = unfinished(&tests, &String::from_utf8_lossy(&stdout)).join(", ");
            Some(format!("(killed after {} s; not finished: {unfinished})", LIMIT.as_secs()))
        }
    };
    Ok((failure, [stdout, stderr].concat()))
}

/// The tests that hang, by libtest's list of all tests and its output up to now: those that it has reported as
/// long-running and that have no result. If it has reported none, every test without a result.
fn unfinished<'a>(list: &'a str, output: &str) -> Vec<&'a str> {
    let has = |start: &str, end: &str| {
        output.lines().any(|line| line.strip_prefix(start).is_some_and(|rest| rest.starts_with(end) && rest != end))
    };
    let tests = list.lines().filter_map(|line| line.strip_suffix(": test"));
    let open: Vec<_> = tests.filter(|name| !has(&format!("test {name}"), " ... ")).collect();
    let long: Vec<_> =
        open.iter().copied().filter(|name| has(&format!("test {name}"), " has been running for")).collect();
    if long.is_empty() { open } else { long }
}

/// Prints the output of a program in one piece.
fn print(program: &Program, output: &[u8]) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "\n     Ran {}", program.name)?;
    out.write_all(output)?;
    Ok(out.flush()?)
}

#[cfg(test)]
mod tests {
    use super::unfinished;

    #[test]
    fn a_program_that_hangs_fails_by_the_names_of_its_tests() {
        let list = "ends: test\nends_never: test\nnot_begun: test\n\n3 tests, 0 benchmarks\n";
        let output = "running 3 tests\ntest ends ... ok\n";
        assert_eq!(unfinished(list, output), ["ends_never", "not_begun"]);
        // Alone, libtest prints the name before it runs a test.
        assert_eq!(unfinished(list, &format!("{output}test ends_never ... ")), ["ends_never", "not_begun"]);
        let output = format!("{output}test ends_never has been running for over 60 seconds\n");
        assert_eq!(unfinished(list, &output), ["ends_never"]);
        assert_eq!(unfinished(list, &format!("{output}test ends_never ... FAILED\n")), ["not_begun"]);
    }
}
