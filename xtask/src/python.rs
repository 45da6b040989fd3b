//! The Python package: built, installed in a virtual environment below `target`, its types checked and its tests run.

use crate::Folders;
use crate::process::{exists, foreign, output_of, run};
use crate::system;
use anyhow::{Result, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folder of the package.
const PACKAGE: &str = "crates/tsa-python";

/// The interpreter of the virtual environment, which is made if it is not there.
fn interpreter(folders: &Folders) -> Result<PathBuf> {
    let environment = folders.target.join("python");
    let python = environment.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    if python.exists() {
        return Ok(python);
    }
    let can = |module: &str| output_of(Command::new("python3").args(["-c", &format!("import {module}")])).is_some();
    system::ensure(
        &[(exists("python3"), "python3"), (can("ensurepip"), "python3-venv")],
        "test the Python package",
        "Install Python 3.10 or newer with venv and pip.",
    )?;
    run(foreign("python3", &folders.root).args(["-m", "venv"]).arg(&environment))?;
    ensure!(python.exists(), "{} is not there after `python3 -m venv`", python.display());
    Ok(python)
}

/// Installs packages into the virtual environment. Returns what makes a command of its interpreter, run in a folder.
pub fn with(folders: &Folders, packages: &[&str]) -> Result<impl Fn(&Path) -> Command + use<>> {
    let python = interpreter(folders)?.to_string_lossy().into_owned();
    let python = move |folder: &Path| foreign(&python, folder);
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    run(python(&folders.root).args(install).args(packages))?;
    Ok(python)
}

/// Builds the package as a wheel in a folder, which is empty before.
pub fn wheel(folders: &Folders, into: &Path) -> Result<()> {
    let python = interpreter(folders)?;
    let mut build = foreign(&python.to_string_lossy(), &folders.root.join(PACKAGE));
    build.env("CARGO_TARGET_DIR", &folders.target);
    run(build
        .args(["-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps", "--wheel-dir"])
        .arg(into)
        .arg("."))
}

/// Installs the package with what its tests need, checks its types and its style, and runs its tests. Tools and firmware must be built.
pub fn test(folders: &Folders) -> Result<()> {
    let python = interpreter(folders)?;
    let python = python.to_string_lossy();
    let python = || foreign(&python, &folders.root.join(PACKAGE));
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--upgrade", ".[test]"];
    run(python().env("CARGO_TARGET_DIR", &folders.target).args(install))?;
    run(python().args(["-m", "mypy", "--cache-dir"]).arg(folders.target.join("mypy")).args(["python", "tests"]))?;
    run(python().args(["-m", "ruff", "check", "--quiet", "--no-cache", "."]))?;
    let programs = folders.target.join("release");
    run(python().env("PYTHONDONTWRITEBYTECODE", "1").env("TSA_PROGRAMS", programs).args([
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "tests",
    ]))
}
