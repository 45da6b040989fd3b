//! The desktop tools, the demo, and the tests of the whole workspace.

use crate::packages::{Packages, check_used};
use crate::process::{cargo, exists, run, step};
use crate::programs::Program;
use crate::toolchain::{Choice, Toolchain, choose};
use crate::{Folders, browser, firmware, licences, programs, python, results, system, toolchain};
use anyhow::{Result, bail, ensure};
use std::process::Command;

/// Every package except the two that build for the board only.
const DESKTOP: [&str; 5] = ["--workspace", "--exclude", "tsa-firmware", "--exclude", "tsa-cost"];

/// Tool and emulator: what the demo needs.
const TOOLS: [&str; 4] = ["--package", "rigctl", "--package", "rig-emulator"];

/// Builds `rigctl`, `rig-emulator` and the laboratory's `tsa-lab`.
pub fn build(folders: &Folders) -> Result<()> {
    system::ensure_emulator_tools()?;
    toolchain::prepare_page_target();
    run(cargo(folders).args(["build", "--release"]).args(TOOLS).args(["--package", "lab"]))
}

/// Checks formatting and dependencies, lints, documents and builds everything, and runs all tests.
pub fn test(folders: &Folders) -> Result<()> {
    system::ensure_emulator_tools()?;
    toolchain::prepare_page_target();
    let toolchain = choose(Choice::Auto)?;
    run(cargo(folders).args(["fmt", "--all", "--check"]))?;
    let tests = beside(|| board(folders, &toolchain), || desktop(folders))?;
    // After the builds, which have downloaded the packages.
    let packages = Packages::find(folders)?;
    check_used(&packages)?;
    licences::check(folders, &packages)?;
    // The tests start the images and the tools, so all of them must be built first.
    // Before the tests, because building it puts files into the tree, which one of them walks.
    step("wheel of the Python package");
    let wheel = python::wheel_to_test(folders)?;
    step("tests; those that play on the emulated board take minutes each");
    let in_python = || python::test(folders, &wheel).and_then(|()| browser::test(folders));
    beside(in_python, || programs::run(tests))?;
    if exists("mdbook") {
        step("book of the documentation");
        book(folders)?;
    }
    step("examples in the documentation");
    run(cargo(folders).args(["test", "--release", "--doc"]).args(DESKTOP))
}

/// Does two things at the same time, because both have long steps that use one core only or wait. If both fail, the error names
/// both.
fn beside<T>(one: impl FnOnce() -> Result<()> + Send, other: impl FnOnce() -> Result<T>) -> Result<T> {
    std::thread::scope(|scope| {
        let one = scope.spawn(one);
        let other = other();
        match (one.join().unwrap_or_else(|_| bail!("a step panicked")), other) {
            (Ok(()), other) => other,
            (Err(one), Ok(_)) => Err(one),
            (Err(one), Err(other)) => bail!("{other:#}\n{one:#}"),
        }
    })
}

/// Lints the firmware and builds its images.
fn board(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    firmware::lint(folders, toolchain)?;
    firmware::build_variant(folders, toolchain, firmware::Variant::Uart)?;
    firmware::build_variant(folders, toolchain, firmware::Variant::OtherRig)?;
    firmware::build(folders, toolchain)?;
    firmware::build_selftest(folders, toolchain)?;
    firmware::build_cost(folders, toolchain, false)
}

/// Lints and documents the desktop packages, and builds the tools and the tests.
fn desktop(folders: &Folders) -> Result<Vec<Program>> {
    step("lints, with the emulator's C library before them: some minutes the first time");
    // In the tests' profile, so that the emulator's C code is built once.
    run(cargo(folders).args(["clippy", "--release", "--all-targets"]).args(DESKTOP).args(["--", "-D", "warnings"]))?;
    step("documentation");
    let doc = ["doc", "--release", "--no-deps"];
    run(cargo(folders).env("RUSTDOCFLAGS", "-D warnings").args(doc).args(DESKTOP))?;
    // The tools are built with the tests that start them.
    step("tools and tests: the longest step of building");
    programs::build(folders, &DESKTOP)
}

/// Measures moves with tables of cheaper models and of other accuracies.
pub fn closed_loop(folders: &Folders) -> Result<()> {
    tools_and_firmware(folders)?;
    run(Command::new(folders.target.join("release/tsa-lab")).current_dir(&folders.root).args(["loop", "--out", "out"]))
}

/// Builds the self-test and runs it on the emulated board.
pub fn selftest(folders: &Folders) -> Result<()> {
    system::ensure_emulator_tools()?;
    let toolchain = choose(Choice::Auto)?;
    beside(|| firmware::build_selftest(folders, &toolchain), || build(folders))?;
    run(Command::new(folders.target.join("release/rigctl")).current_dir(&folders.root).arg("selftest"))
}

/// Builds the image that measures costs, runs it on the emulated board and prints the instruction counts.
pub fn cost(folders: &Folders) -> Result<()> {
    system::ensure_emulator_tools()?;
    firmware::build_cost(folders, &choose(Choice::Auto)?, true)?;
    let test = ["test", "--release", "--package", "host-tests", "--test", "cost", "--", "--nocapture"];
    run(cargo(folders).args(test))
}

/// Runs the comparison of controllers.
pub fn compare(folders: &Folders, rest: &[String]) -> Result<()> {
    // The comparison needs only the emulated rig, but the emulated chip is in the same package.
    system::ensure_emulator_tools()?;
    results::study(folders, &[&["compare".into()], rest].concat())
}

/// Builds the firmware and runs the endurance test.
pub fn endurance(folders: &Folders, rest: &[String]) -> Result<()> {
    system::ensure_emulator_tools()?;
    firmware::build(folders, &choose(Choice::Auto)?)?;
    results::study(folders, &[&["endurance".into()], rest].concat())
}

/// Builds the tools and the firmware.
pub fn tools_and_firmware(folders: &Folders) -> Result<()> {
    system::ensure_emulator_tools()?;
    let toolchain = choose(Choice::Auto)?;
    beside(|| firmware::build(folders, &toolchain), || build(folders))
}

/// Builds everything and tests the Python package.
pub fn python(folders: &Folders) -> Result<()> {
    tools_and_firmware(folders)?;
    python::test(folders, &python::wheel_to_test(folders)?)
}

/// Builds everything and tests the page of `tsa-lab report`.
pub fn page(folders: &Folders) -> Result<()> {
    tools_and_firmware(folders)?;
    browser::test(folders)
}

/// Writes the pages as a book (target/book).
pub fn book(folders: &Folders) -> Result<()> {
    ensure!(exists("mdbook"), "mdbook is missing; install it with: cargo install mdbook --locked");
    run(Command::new("mdbook").current_dir(&folders.root).args(["build", "docs"]))
}

/// Builds everything and runs the demo.
pub fn demo(folders: &Folders, rest: &[String]) -> Result<()> {
    system::ensure_emulator_tools()?;
    let toolchain = choose(Choice::Auto)?;
    step("firmware and tools, with the emulator's C library: some minutes the first time");
    beside(|| firmware::build(folders, &toolchain), || run(cargo(folders).args(["build", "--release"]).args(TOOLS)))?;
    run(Command::new(folders.target.join("release/rigctl")).current_dir(&folders.root).arg("demo").args(rest))
}

#[cfg(test)]
mod tests {
    use super::beside;
    use crate::process::files_in;
    use anyhow::{Result, bail};
    use std::collections::BTreeSet;
    use std::path::Path;

    #[test]
    fn of_two_things_at_a_time_each_failure_is_named() {
        fn fails(name: &str) -> Result<u8> {
            bail!("{name} failed")
        }
        assert_eq!(beside(|| Ok(()), || Ok(3)).unwrap(), 3);
        let error = |one: fn() -> Result<()>, other: fn() -> Result<u8>| beside(one, other).unwrap_err().to_string();
        assert_eq!(error(|| Ok(()), || fails("other")), "other failed");
        assert_eq!(error(|| fails("one").map(drop), || Ok(3)), "one failed");
        assert_eq!(error(|| fails("one").map(drop), || fails("other")), "other failed\none failed");
    }

    #[test]
    fn the_book_has_every_page_once() {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
        let summary = std::fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
        let listed: Vec<_> =
            summary.split("](").skip(1).map(|rest| docs.join(rest.split(')').next().unwrap())).collect();
        let pages = files_in(&docs).unwrap().into_iter();
        let pages: BTreeSet<_> =
            pages.filter(|path| path.extension().is_some_and(|e| e == "md") && !path.ends_with("SUMMARY.md")).collect();
        assert_eq!(listed.iter().cloned().collect::<BTreeSet<_>>(), pages);
        assert_eq!(listed.len(), pages.len());
    }
}
