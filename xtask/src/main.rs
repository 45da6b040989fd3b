//! `cargo xtask …`: every command that CI and the README run, and the choice of tools behind them.
//!
//! - [`firmware`]: the board's images, their toolchain ([`toolchain`]) and their size ([`image`]).
//! - [`selftest`]: the self-test of a real board without a rig.
//! - [`host`]: the desktop tools, the demo, and the tests of the whole workspace.
//! - [`results`]: every measured number of the README and `docs/results.md`.
//! - [`mod@bench`]: the speed of the model, beside an independent solver.
//! - [`python`]: the Python package; [`browser`]: the page of `tsa-lab report`.
//! - [`release`]: the release archive.
//! - [`packages`]: which packages there are, and whether they are used; [`licences`]: what their licences allow.
//! - [`system`]: checks for programs beside cargo, and installs them where that is allowed.
//! - [`programs`]: runs test programs, several at a time.
//! - [`process`]: runs other programs, and names the command that failed.

mod bench;
mod browser;
mod firmware;
mod host;
mod image;
mod licences;
mod packages;
mod process;
mod programs;
mod python;
mod release;
mod results;
mod selftest;
mod system;
mod toolchain;

use anyhow::{Context, Result, ensure};
use clap::{Parser, Subcommand};
use packages::Packages;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Parser)]
#[command(name = "cargo xtask", about = "Builds, tests and demonstrates the firmware and the tools", version)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Build the firmware image (target/firmware/tsa-firmware.elf, and .bin for the board's drive) and print its size
    Firmware(firmware::Arguments),
    /// Build the firmware, flash it through the board's ST-LINK with probe-rs, and show its log
    Flash(firmware::Flash),
    /// Test a board without a rig: build the self-test, flash it through the ST-LINK, and show its table
    /// (docs/tutorial/first-board.md)
    Selftest(selftest::Arguments),
    /// Build the desktop tools (target/release/rigctl, rig-emulator, tsa-lab)
    Build,
    /// Build the Python package, check its types and run its tests in a virtual environment (target/python)
    Python,
    /// Build everything and test the page of `tsa-lab report` in headless Chromium
    Page,
    /// Check formatting, lint and test everything, including the firmware on the emulated board
    Test,
    /// Write the pages as a book with mdBook (target/book)
    Book,
    /// Measure an equilibrium: time, instructions (callgrind), and a rod solved by scipy (target/bench/model.json)
    Bench,
    /// Count the instructions of each method of evaluating the mechanism on the emulated board
    Cost,
    /// Measure moves with tables of cheaper models and of other accuracies on the emulated board (out/loop.csv)
    Loop,
    /// Make a thousand moves with faults and send ten million random bytes to both links of the emulated board (an
    /// hour)
    Endurance {
        /// Arguments of the test: --moves, --bytes, --seed
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        rest: Vec<String>,
    },
    /// Compare this controller with others: play scenarios on random plants or on rigs of a kind (docs/comparison.svg)
    Compare {
        /// Arguments of the comparison: --plants, --rig, --out
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        rest: Vec<String>,
    },
    /// Measure every number that README.md and docs/results.md state, and write both pages (hours; one section:
    /// minutes)
    Results {
        /// Sections to measure again (default: all)
        sections: Vec<String>,
    },
    /// List the licences of all dependencies, and fail if deny.toml does not allow one
    Licences,
    /// Build the release archive of this commit and try what is in it (target/release-archive; xtask/README.md)
    Release,
    /// Build everything and demonstrate homing and moving three loads with the firmware on an emulated board
    Demo {
        /// Arguments for `rigctl demo`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        rest: Vec<String>,
    },
}

/// The folders that all tasks use.
struct Folders {
    root: PathBuf,
    target: PathBuf,
}

impl Folders {
    fn find() -> Result<Self> {
        // As cargo says now: it does not build xtask again in a checkout that was copied with its target folder.
        let now = std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from).filter(|folder| folder.ends_with("xtask"));
        let xtask = now.unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
        let root = xtask.parent().context("xtask has no parent folder")?.to_path_buf();
        let target = match std::env::var_os("CARGO_TARGET_DIR") {
            Some(dir) => std::env::current_dir()?.join(dir),
            None => root.join("target"),
        };
        Ok(Self { root, target })
    }
}

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: Arguments) -> Result<()> {
    // Tests and measurements call the tool without `--port`, and must not meet a real rig.
    ensure!(std::env::var_os("RIGCTL_PORT").is_none(), "RIGCTL_PORT is set: unset it, xtask is for the emulated board");
    let folders = Folders::find()?;
    match arguments.task {
        Task::Firmware(arguments) => arguments.run(&folders),
        Task::Flash(arguments) => arguments.run(&folders),
        Task::Selftest(arguments) => arguments.run(&folders),
        Task::Build => host::build(&folders),
        Task::Python => host::python(&folders),
        Task::Page => host::page(&folders),
        Task::Test => host::test(&folders),
        Task::Book => host::book(&folders),
        Task::Bench => bench::bench(&folders),
        Task::Cost => host::cost(&folders),
        Task::Loop => host::closed_loop(&folders),
        Task::Endurance { rest } => host::endurance(&folders, &rest),
        Task::Compare { rest } => host::compare(&folders, &rest),
        Task::Results { sections } => results::results(&folders, &sections),
        Task::Licences => licences::check(&folders, &Packages::find(&folders)?),
        Task::Release => release::make(&folders),
        Task::Demo { rest } => host::demo(&folders, &rest),
    }
}
