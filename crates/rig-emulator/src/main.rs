//! `rig-emulator`: the firmware's ELF on an emulated board with an emulated rig, for `rigctl` to talk to.

use anyhow::{Context, Result};
use clap::Parser;
use rig_emulator::flash_file::FlashFile;
use rig_emulator::gdb;
use rig_emulator::jumpers::{self, Broken, JumperBoard};
use rig_emulator::machine::{Config, Machine};
use rig_emulator::rig::Rig;
use rig_emulator::rig::outside::Outside;
use rig_emulator::rig::outside::measured::Measured;
use rig_emulator::rig::plant_settings::PlantSettings;
use rig_emulator::serve::serve;
use rig_scene::{Scene, files};
use sim_link::{PlantChange, RigPreset};
use std::io::{self, BufRead, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

/// Runs a firmware ELF on an emulated NUCLEO-F446RE with the actuator's rig around it.
/// Speaks JSON lines on standard input and output; `rigctl` is the tool for people.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// The firmware.
    #[arg(long)]
    elf: PathBuf,
    /// Scene file: the rig's true constants, unless `--plant` changes them.
    #[arg(long, required_unless_present = "bare")]
    scene: Option<PathBuf>,
    /// A board with jumper wires and no rig, for the self-test: print its log until it has ended.
    #[arg(long, conflicts_with_all = ["scene", "rig", "plant", "plant_program", "plant_surface", "flash"])]
    bare: bool,
    /// Rig of the seed: `ideal` is its own model; `nominal` and `hard` have what a well-made and a poor rig have besides.
    #[arg(long, value_name = "RIG", default_value_t = RigPreset::Ideal)]
    rig: RigPreset,
    /// A change of the plant that the firmware does not know of, for example `load=1.2kg`.
    #[arg(long, value_name = "KEY=VALUE")]
    plant: Vec<PlantChange>,
    /// Program and arguments that stand in for mechanism and load: docs/plants.md.
    #[arg(long, value_name = "CMD ARGS", conflicts_with = "plant_surface")]
    plant_program: Option<String>,
    /// Measured gaps that stand in for the mechanism: docs/plants.md. Two files are those of a growing and of a falling
    /// twist.
    #[arg(long, value_name = "FILE.csv")]
    plant_surface: Vec<PathBuf>,
    /// Seed of all noise, and of the rig that `--rig` draws.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// File that keeps the board's flash from one run to the next; created if it does not exist.
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,
    /// Address for a GDB to connect to, for example `127.0.0.1:1234`; port 0 is any free one. Reported on
    /// standard error.
    #[arg(long, value_name = "ADDR:PORT")]
    gdb: Option<String>,
    /// Do not start before a GDB has connected.
    #[arg(long, requires = "gdb")]
    gdb_wait: bool,
    /// Level of the chip's brown-out reset, an option byte: 0 (off) as delivered, 3 on a board set up as documented.
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
    let elf = files::read(&arguments.elf).with_context(|| format!("firmware {}", arguments.elf.display()))?;
    let config = Config { strict: !arguments.lenient, brown_out_level: arguments.brown_out_level, ..Config::default() };
    let Some(scene_file) = &arguments.scene else {
        let mut machine = Machine::new(&elf, JumperBoard::new(Broken::default()), config)?;
        // A reader that has gone has read enough.
        return Ok(jumpers::run(&mut machine, |line, _| _ = writeln!(std::io::stdout(), "{line}"))?);
    };
    let (requests, gone) = requests();
    files::check_regular(scene_file).with_context(|| format!("scene {}", scene_file.display()))?;
    let scene = Scene::load(scene_file)?;
    scene.check_rig().map_err(|error| error.in_file(scene_file))?;
    let rig = match outside(arguments)? {
        Some(outside) => Rig::from_outside(&scene, arguments.rig, &arguments.plant, arguments.seed, &outside)?,
        None => {
            let mut settings = PlantSettings::preset(arguments.rig, arguments.seed);
            for change in &arguments.plant {
                settings.apply(*change)?;
            }
            Rig::new(&scene, settings, arguments.seed)?
        }
    };
    let mut machine = Machine::new(&elf, rig, config)?;
    let flash = arguments.flash.as_ref().map(|path| FlashFile::open(path, &mut machine)).transpose()?;
    if let Some(address) = &arguments.gdb {
        let server = gdb::Server::bind(address, arguments.gdb_wait, gone)?;
        eprintln!("gdb: listening at {}", server.address()?);
        machine.attach(Box::new(server));
    }
    serve(&mut machine, flash, requests, std::io::stdout().lock())
}

/// The plant from outside, if one is asked for.
fn outside(arguments: &Arguments) -> Result<Option<Outside>> {
    if let Some(command) = &arguments.plant_program {
        return Ok(Some(Outside::Program(command.clone())));
    }
    let named = |path: &PathBuf| format!("plant surface {}", path.display());
    let text = |path: &PathBuf| -> Result<String> {
        files::check_regular(path).with_context(|| named(path))?;
        files::read_to_string(path).with_context(|| named(path))
    };
    Ok(match arguments.plant_surface.as_slice() {
        [] => None,
        [file] => Some(Outside::Measured(Measured::parse(&text(file)?).with_context(|| named(file))?)),
        files @ [up, down] => {
            let data = Measured::parse_two([&text(up)?, &text(down)?]);
            let data = data.map_err(|(which, error)| anyhow::Error::from(error).context(named(&files[which])))?;
            Some(Outside::Measured(data))
        }
        _ => anyhow::bail!("--plant-surface takes one file or two"),
    })
}

/// Lines of standard input. They are read by a thread that also watches the parent process: when the parent has gone,
/// no answer is needed any more and the thread ends this process, even in a long run. The flag is set when the input
/// has ended; a board that a debugger has stopped would not notice that otherwise.
fn requests() -> (impl Iterator<Item = io::Result<String>>, Arc<AtomicBool>) {
    let (sender, receiver) = mpsc::channel();
    let asker = parent();
    let gone = Arc::new(AtomicBool::new(false));
    let ended = gone.clone();
    std::thread::spawn(move || {
        for line in io::stdin().lock().lines() {
            if sender.send(line).is_err() {
                return;
            }
        }
        drop(sender);
        ended.store(true, Ordering::Relaxed);
        loop {
            std::thread::sleep(Duration::from_millis(100));
            if parent() != asker {
                std::process::exit(1);
            }
        }
    });
    (receiver.into_iter(), gone)
}

/// The parent process; another one takes its place where it has ended.
fn parent() -> u32 {
    #[cfg(unix)]
    return std::os::unix::process::parent_id();
    #[cfg(not(unix))]
    return 0;
}
