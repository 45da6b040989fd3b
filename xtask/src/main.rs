//! `cargo xtask …`: every command that CI and the README run, and the choice of tools behind them.
//!
//! - [`firmware`]: the board's image, with whichever toolchain this machine has ([`toolchain`]), and its size ([`image`]).
//! - [`selftest`]: the image that tests a board without a rig, on a real one.
//! - [`host`]: the tools for the desktop, the demo, and the tests of everything.
//! - [`results`]: every measured number of the README and `docs/results.md`.
//! - [`mod@bench`]: what the model costs, beside an independent solver.
//! - [`system`]: what has to be installed beside cargo: installed if we may, else said.
//! - [`programs`]: test programs, several at a time.
//! - [`process`]: running other programs, loudly when they fail.

mod bench;
mod closed_loop;
mod firmware;
mod host;
mod image;
mod process;
mod programs;
mod results;
mod selftest;
mod system;
mod toolchain;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Parser)]
#[command(name = "cargo xtask", about = "Builds, tests and shows the rig", version)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Build the firmware image (target/firmware/tsa-firmware.elf) and print its size
    Firmware {
        /// Which compiler: `auto` tries the others in this order
        #[arg(long, value_enum, default_value_t)]
        toolchain: toolchain::Choice,
        /// The default scene, but with the drive on the serial line (target/firmware/uart/tsa-firmware.elf)
        #[arg(long)]
        uart: bool,
    },
    /// Build the firmware, flash it over the board's ST-LINK with probe-rs, and show its log
    Flash {
        /// Passed on to `probe-rs run`: --probe, --connect-under-reset
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        rest: Vec<String>,
    },
    /// Test a board without a rig: build the self-test, flash it over the ST-LINK, show its table (docs/selftest.md)
    Selftest {
        /// On the emulated board instead
        #[arg(long)]
        emulated: bool,
        /// Passed on to `probe-rs run`: --probe, --connect-under-reset
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, conflicts_with = "emulated")]
        rest: Vec<String>,
    },
    /// Build the desktop tools (target/release/rigctl, target/release/rig-emulator)
    Build,
    /// Check formatting, lint and test everything, the firmware on the emulated board included
    Test,
    /// Measure what an equilibrium costs: time, instructions (callgrind), and a rod by scipy (target/bench/model.json)
    Bench,
    /// Count what each way of knowing the mechanism costs: instructions on the emulated board
    Cost,
    /// Move with tables from cheaper models and of other accuracies built into the firmware (out/loop.csv)
    Loop,
    /// A thousand moves with faults, and ten million random bytes at both doors, on the emulated board (an hour)
    Endurance {
        /// Passed on: --moves, --bytes, --seed
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        rest: Vec<String>,
    },
    /// Play the scenarios of the comparison with this controller and others on random plants (docs/comparison.svg, .csv)
    Compare {
        /// Passed on: --plants, --plant, --out
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        rest: Vec<String>,
    },
    /// Measure every number that README.md and docs/results.md state, and write both pages (hours; one section: minutes)
    Results {
        /// Sections to measure again; all of them where none is named
        sections: Vec<String>,
    },
    /// Build everything and show three loads being homed and moved by the real firmware on an emulated board
    Demo {
        /// Passed on to `rigctl demo`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        rest: Vec<String>,
    },
}

/// The folders that all tasks share.
struct Folders {
    root: PathBuf,
    target: PathBuf,
}

impl Folders {
    fn find() -> Result<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask has no parent folder")?.to_path_buf();
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
    let folders = Folders::find()?;
    match arguments.task {
        Task::Firmware { toolchain, uart: false } => firmware::build(&folders, &toolchain::choose(toolchain)?),
        Task::Firmware { toolchain, uart: true } => firmware::build_uart(&folders, &toolchain::choose(toolchain)?),
        Task::Flash { rest } => firmware::flash(&folders, &toolchain::choose(toolchain::Choice::Auto)?, &rest),
        Task::Selftest { emulated: true, .. } => host::selftest(&folders),
        Task::Selftest { rest, .. } => selftest::run(&folders, &toolchain::choose(toolchain::Choice::Auto)?, &rest),
        Task::Build => host::build(&folders),
        Task::Test => host::test(&folders),
        Task::Bench => bench::bench(&folders),
        Task::Cost => host::cost(&folders),
        Task::Loop => closed_loop::run(&folders),
        Task::Endurance { rest } => host::endurance(&folders, &rest),
        Task::Compare { rest } => host::compare(&folders, &rest),
        Task::Results { sections } => results::run(&folders, &sections),
        Task::Demo { rest } => host::demo(&folders, &rest),
    }
}
