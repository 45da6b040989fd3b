//! The page of `tsa-lab report`: its tests in headless Chromium, driven from Python.

use crate::process::{exists, run};
use crate::{Folders, python, system};
use anyhow::{Context, Result};
use std::path::Path;
use std::process::Command;

/// Names under which systems know the browser. Debian's is a script that finds the program.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome-stable", "google-chrome"];

/// Folder of the tests.
const TESTS: &str = "lab/web/tests";

/// A Chromium that this machine has, or gets from Debian.
fn chromium() -> Result<&'static str> {
    let found = || NAMES.into_iter().find(|name| exists(name));
    if found().is_none() {
        let elsewhere = "Install Chromium or Chrome with your system's package manager.";
        system::install(&["chromium"], "test the page of `tsa-lab report`", elsewhere)?;
    }
    found().context("chromium is installed, but does not start")
}

/// A command of the virtual environment with the driver in it, told where browser and tools are.
pub fn driver(folders: &Folders) -> Result<Command> {
    let browser = chromium()?;
    let python = python::with(folders, &["playwright>=1.50,<2", "pytest"])?;
    let mut command = python(&folders.root);
    // The driver starts a program by its path, not by its name.
    let path = std::env::var_os("PATH").unwrap_or_default();
    let mut places = std::env::split_paths(&path).map(|folder| folder.join(browser));
    let browser = places.find(|place| place.is_file()).unwrap_or_else(|| Path::new(browser).to_owned());
    command.env("TSA_CHROMIUM", browser).env("TSA_PROGRAMS", folders.target.join("release"));
    command.env("PYTHONDONTWRITEBYTECODE", "1");
    Ok(command)
}

/// Runs the tests of the page. Tools and firmware must be built.
pub fn test(folders: &Folders) -> Result<()> {
    run(driver(folders)?.args(["-m", "pytest", "-q", "-p", "no:cacheprovider", TESTS]))
}
