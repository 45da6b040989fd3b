//! The commands of the laboratory's tool, `tsa-lab`: a program of its own beside this one, which depends on this library.

use crate::failure::Failure;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::process::Command;

const PROGRAM: &str = "tsa-lab";

/// Runs the tool with these arguments; this process ends with it.
///
/// # Errors
/// If it is not there, or does not start.
pub fn run(arguments: &[OsString]) -> Result<(), Failure> {
    let program = std::env::current_exe()?.with_file_name(format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX));
    let error = match replaced_by(Command::new(&program).args(arguments)) {
        Ok(code) => std::process::exit(code),
        Err(error) => error,
    };
    Err(Failure::failed(match error.kind() {
        ErrorKind::NotFound => format!(
            "this command is of {PROGRAM}, and there is no {}: `cargo xtask build` builds it",
            program.display()
        ),
        _ => format!("{} does not start: {error}", program.display()),
    }))
}

/// Where it succeeds on Unix, it does not return: signals and exit code are then the other program's.
#[cfg(unix)]
fn replaced_by(command: &mut Command) -> std::io::Result<i32> {
    Err(std::os::unix::process::CommandExt::exec(command))
}

#[cfg(not(unix))]
fn replaced_by(command: &mut Command) -> std::io::Result<i32> {
    Ok(command.status()?.code().unwrap_or(1))
}

/// Why a program on this library cannot run such a command.
pub fn here() -> Failure {
    Failure::failed(format!("this command is of {PROGRAM}, a program of its own"))
}
