//! The desktop's tools, the demo, and the tests of everything.

use crate::process::{cargo, run};
use crate::programs::Program;
use crate::toolchain::{Choice, Toolchain, choose};
use crate::{Folders, firmware, programs, system};
use anyhow::{Result, bail};
use std::process::Command;

/// Everything but the firmware, which builds for the board only.
const DESKTOP: [&str; 3] = ["--workspace", "--exclude", "tsa-firmware"];

/// Builds `rigctl` and `rig-emulator`.
pub fn build(folders: &Folders) -> Result<()> {
    system::ensure_emulator_tools()?;
    run(cargo(folders).args(["build", "--release", "--package", "rigctl", "--package", "rig-emulator"]))
}

/// Formatting, lints, documentation, the firmware, and all tests.
pub fn test(folders: &Folders) -> Result<()> {
    system::ensure_emulator_tools()?;
    let toolchain = choose(Choice::Auto)?;
    run(cargo(folders).args(["fmt", "--all", "--check"]))?;
    // Board and desktop are built into folders of their own, and both have long stretches for one core.
    let tests = std::thread::scope(|scope| {
        let board = scope.spawn(|| board(folders, &toolchain));
        let tests = desktop(folders)?;
        board.join().unwrap_or_else(|_| bail!("building the firmware panicked"))?;
        anyhow::Ok(tests)
    })?;
    // They start the images and the tools, so all of them must be there, and new.
    programs::run(tests)?;
    run(cargo(folders).args(["test", "--release", "--doc"]).args(DESKTOP))
}

/// Lints the firmware and builds its images.
fn board(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    firmware::lint(folders, toolchain)?;
    firmware::build_uart(folders, toolchain)?;
    firmware::build(folders, toolchain)?;
    firmware::build_selftest(folders, toolchain)?;
    firmware::build_cost(folders, toolchain)
}

/// Lints and documents the desktop's packages, builds the tools and the tests.
fn desktop(folders: &Folders) -> Result<Vec<Program>> {
    // In release, as the tests: the emulator's C code is then built once.
    run(cargo(folders).args(["clippy", "--release", "--all-targets"]).args(DESKTOP).args(["--", "-D", "warnings"]))?;
    let doc = ["doc", "--release", "--no-deps"];
    run(cargo(folders).env("RUSTDOCFLAGS", "-D warnings").args(doc).args(DESKTOP))?;
    build(folders)?;
    programs::build(folders, &DESKTOP)
}

/// Builds the self-test and runs it on the emulated board.
pub fn selftest(folders: &Folders) -> Result<()> {
    system::ensure_emulator_tools()?;
    firmware::build_selftest(folders, &choose(Choice::Auto)?)?;
    build(folders)?;
    run(Command::new(folders.target.join("release/rigctl")).current_dir(&folders.root).arg("selftest"))
}

/// Builds the image that counts costs, runs it on the emulated board and prints what it counted.
pub fn cost(folders: &Folders) -> Result<()> {
    system::ensure_emulator_tools()?;
    firmware::build_cost(folders, &choose(Choice::Auto)?)?;
    let test = ["test", "--release", "--package", "host-tests", "--test", "cost", "--", "--nocapture"];
    run(cargo(folders).args(test))
}

/// Runs the comparison of controllers.
pub fn compare(folders: &Folders, rest: &[String]) -> Result<()> {
    // The rig is emulated without the chip, but both are one package.
    system::ensure_emulator_tools()?;
    run(cargo(folders).args(["run", "--release", "--package", "host-tests", "--bin", "compare", "--"]).args(rest))
}

/// Builds the firmware and runs it for long.
pub fn endurance(folders: &Folders, rest: &[String]) -> Result<()> {
    system::ensure_emulator_tools()?;
    firmware::build(folders, &choose(Choice::Auto)?)?;
    run(cargo(folders).args(["run", "--release", "--package", "host-tests", "--bin", "endurance", "--"]).args(rest))
}

/// Builds everything and runs the demo.
pub fn demo(folders: &Folders, rest: &[String]) -> Result<()> {
    system::ensure_emulator_tools()?;
    firmware::build(folders, &choose(Choice::Auto)?)?;
    build(folders)?;
    run(Command::new(folders.target.join("release/rigctl")).current_dir(&folders.root).arg("demo").args(rest))
}
