//! Runs other programs. A failure always names the command that failed.

use crate::Folders;
use anyhow::{Context, Result, bail};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Variables that the surrounding `cargo run` sets and that would mislead another toolchain.
const CARGO_RUN_VARIABLES: [&str; 6] =
    ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "LD_LIBRARY_PATH", "RUSTC", "RUSTUP_TOOLCHAIN", "CARGO"];

/// The cargo that runs this task.
pub fn cargo(folders: &Folders) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(&folders.root);
    // A relative folder is relative to the folder where the user started the task, not to the root.
    if std::env::var_os("CARGO_TARGET_DIR").is_some() {
        command.env("CARGO_TARGET_DIR", &folders.target);
    }
    command
}

/// A program that must not inherit the toolchain of the surrounding `cargo run`.
pub fn foreign(program: &str, root: &Path) -> Command {
    let mut command = Command::new(program);
    command.current_dir(root);
    for name in CARGO_RUN_VARIABLES {
        command.env_remove(name);
    }
    command
}

/// The command as a user would type it, with the variables that are set for it.
pub fn shown(command: &Command) -> String {
    let variables = command.get_envs().filter_map(|(name, value)| Some((name, value?)));
    let variables = variables.map(|(name, value)| format!("{}={}", name.to_string_lossy(), value.to_string_lossy()));
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    variables.chain(words.map(quoted)).collect::<Vec<_>>().join(" ")
}

fn quoted(word: &OsStr) -> String {
    let word = word.to_string_lossy();
    if word.contains([' ', '"', '[']) { format!("'{word}'") } else { word.into_owned() }
}

/// Runs the command with the output streams of this program.
pub fn run(command: &mut Command) -> Result<()> {
    eprintln!("> {}", shown(command));
    let status = command.status().with_context(|| format!("could not start: {}", shown(command)))?;
    if !status.success() {
        bail!("failed ({status}): {}", shown(command));
    }
    Ok(())
}

/// The output of the command, or `None` if the command is missing or failed.
pub fn output_of(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Whether a program of this name can be started.
pub fn exists(program: &str) -> bool {
    output_of(Command::new(program).arg("--version")).is_some()
}

/// Runs the command with its standard output and error in the two files. A command that exceeds the limit is killed,
/// with everything that it has started; its status is then `None`.
pub fn run_within(limit: Duration, command: &mut Command, files: [&Path; 2]) -> Result<Option<ExitStatus>> {
    let create = |file: &Path| File::create(file).with_context(|| format!("cannot write {}", file.display()));
    let [stdout, stderr] = [create(files[0])?, create(files[1])?];
    let began = Instant::now();
    let mut child = command
        .stdin(Stdio::null())
        .stdout(stdout)
        .stderr(stderr)
        .spawn()
        .with_context(|| format!("could not start: {}", shown(command)))?;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if began.elapsed() > limit {
            kill(&mut child);
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Kills a program and, on Linux, everything that it has started. A process group of its own would be simpler, but
/// Ctrl-C would then no longer reach the program.
fn kill(child: &mut Child) {
    let mut ids = vec![child.id().to_string()];
    let mut index = 0;
    while let Some(id) = ids.get(index) {
        let threads = fs::read_dir(format!("/proc/{id}/task")).into_iter().flatten().flatten();
        let children: String =
            threads.filter_map(|thread| fs::read_to_string(thread.path().join("children")).ok()).collect();
        ids.extend(children.split_whitespace().map(str::to_owned));
        index += 1;
    }
    // The child has ended already if this fails; so have its descendants.
    let _ = Command::new("sh").args(["-c", &format!("kill -KILL {}", ids.join(" "))]).status();
    let _ = child.kill();
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A shell stands for a test program that hangs, with another shell and a `sleep` below it.
    #[test]
    fn a_program_that_hangs_is_killed_with_its_children() {
        let folder = std::env::temp_dir().join(format!("xtask-hang-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let [out, err] = ["out", "err"].map(|name| folder.join(name));
        let run = |script: &str| {
            run_within(Duration::from_secs(2), Command::new("sh").args(["-c", script]), [&out, &err]).unwrap()
        };
        assert!(run("echo fine").is_some_and(|status| status.success()));
        assert!(run("exit 3").is_some_and(|status| status.code() == Some(3)));

        assert_eq!(run("echo begun; sh -c 'while sleep 0.1; do echo running; done'; true"), None);
        assert!(fs::read_to_string(&out).unwrap().starts_with("begun\nrunning"));
        std::thread::sleep(Duration::from_millis(200));
        let length = fs::metadata(&out).unwrap().len();
        std::thread::sleep(Duration::from_millis(500));
        assert_eq!(fs::metadata(&out).unwrap().len(), length, "a child still runs");
        let _ = fs::remove_dir_all(&folder);
    }
}
