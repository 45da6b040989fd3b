//! The desktop's tools, the demo, and the tests of everything.

use crate::process::{cargo, run};
use crate::toolchain::{Choice, choose};
use crate::{Folders, firmware, system};
use anyhow::Result;
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
    // In release, as the tests: the emulator's C code is then built once.
    run(cargo(folders).args(["clippy", "--release", "--all-targets"]).args(DESKTOP).args(["--", "-D", "warnings"]))?;
    firmware::lint(folders, &toolchain)?;
    let doc = ["doc", "--release", "--no-deps"];
    run(cargo(folders).env("RUSTDOCFLAGS", "-D warnings").args(doc).args(DESKTOP))?;
    // Tests start the image and the tools, so both must be there, and new.
    firmware::build_uart(folders, &toolchain)?;
    firmware::build(folders, &toolchain)?;
    firmware::build_cost(folders, &toolchain)?;
    build(folders)?;
    run(cargo(folders).args(["test", "--release"]).args(DESKTOP))
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
