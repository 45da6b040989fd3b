//! `rig-emulator`: the firmware's ELF on an emulated board with an emulated rig, for `rigctl` to talk to.

use anyhow::{Context, Result, anyhow};
use clap::Parser;
use rig_emulator::flash_file::FlashFile;
use rig_emulator::machine::{Config, Machine};
use rig_emulator::rig::Rig;
use rig_emulator::rig::settings::PlantSettings;
use rig_emulator::serve::serve;
use std::path::PathBuf;
use std::process::ExitCode;
use tsa_model::Scene;

/// Runs a firmware ELF on an emulated NUCLEO-F446RE with the actuator's rig around it.
/// Speaks JSON lines on standard input and output; `rigctl` is the tool for people.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// The firmware.
    #[arg(long)]
    elf: PathBuf,
    /// Scene file: the rig's true constants, unless `--plant` changes them.
    #[arg(long)]
    scene: PathBuf,
    /// Something about the plant that the firmware is not told, for example `load=1.2kg`.
    #[arg(long, value_name = "KEY=VALUE")]
    plant: Vec<String>,
    /// Seed of all noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// File that keeps the board's flash from one run to the next; made if it is not there.
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
    /// Level of the chip's brown-out reset, an option byte: 0 (off) as delivered, 3 on a board set up as the documentation says.
    #[arg(long, value_name = "LEVEL", default_value_t = 3, value_parser = clap::value_parser!(u8).range(0..=3))]
    brown_out_level: u8,
    /// Only count what the real chip would not do, instead of stopping there.
    #[arg(long)]
    lenient: bool,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let scene = Scene::load(&arguments.scene)?;
    let elf = std::fs::read(&arguments.elf).with_context(|| format!("firmware {}", arguments.elf.display()))?;
    let mut settings = PlantSettings::default();
    for pair in &arguments.plant {
        let (key, value) = pair.split_once('=').ok_or_else(|| anyhow!("--plant {pair}: not KEY=VALUE"))?;
        settings.set(key, value)?;
    }
    let rig = Rig::new(&scene, settings, arguments.seed)?;
    let config = Config { strict: !arguments.lenient, brown_out_level: arguments.brown_out_level, ..Config::default() };
    let mut machine = Machine::new(&elf, rig, config)?;
    let flash = arguments.flash.as_ref().map(|path| FlashFile::open(path, &mut machine)).transpose()?;
    serve(&mut machine, flash, std::io::stdin().lock(), std::io::stdout().lock())
}
