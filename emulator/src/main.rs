//! `rig-emulator`: the firmware's ELF on an emulated board with an emulated rig, for `rigctl` to talk to.

use anyhow::{Context, Result};
use clap::Parser;
use rig_config::{Scene, files};
use rig_emulator::flash_file::FlashFile;
use rig_emulator::gdb;
use rig_emulator::jumpers::{self, Broken, End, Ends, Jumper, JumperBoard};
use rig_emulator::machine::{Config, Machine, MachineError};
use rig_emulator::serve::serve;
use rig_emulator::soc::fault::Lint;
use rig_plant::PlantSettings;
use rig_plant::rig::EmulatedRig;
use rig_plant::rig::outside::Outside;
use rig_plant::rig::outside::measured::Measured;
use rig_plant::{PlantChange, RigPreset};
use std::io::{self, BufRead, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

/// Runs a firmware ELF on an emulated NUCLEO-F446RE with the actuator's rig around it.
/// Speaks JSON lines on standard input and output; `rigctl` is the tool for people. With `--bare` it runs any program for
/// this chip without a rig and prints its log: docs/how-to/port-debug.md.
#[derive(Parser)]
#[command(
    version,
    after_help = "Exit status with --bare: 0 passed, 1 panic or failure, 2 refused (a lint, or something that is \
not emulated), 3 time limit."
)]
struct Arguments {
    /// The firmware.
    #[arg(long)]
    elf: PathBuf,
    /// Scene file: the rig's true constants, unless `--plant` changes them.
    #[arg(long, required_unless_present = "bare")]
    scene: Option<PathBuf>,
    /// A board without a rig, for any program: print its log and what it sends to the ST-LINK's serial port (USART2),
    /// until a BKPT instruction, a line that ends it, or the time limit.
    #[arg(long, conflicts_with_all = ["scene", "rig", "plant", "plant_program", "plant_surface", "flash"])]
    bare: bool,
    /// A wire between two pins, for example `PA9-PA10`. Can be repeated.
    #[arg(long, value_name = "PIN-PIN", requires = "bare")]
    jumper: Vec<Jumper>,
    /// Part of a log line that means success. Can be repeated. Without it, a BKPT instruction does.
    #[arg(long, value_name = "TEXT", requires = "bare")]
    ok: Vec<String>,
    /// Part of a log line that means failure, unless the line means success. Can be repeated.
    #[arg(long, value_name = "TEXT", requires = "bare")]
    fail: Vec<String>,
    /// Longest emulated time.
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, requires = "bare")]
    limit: f64,
    /// Count events of this lint instead of stopping at them. Can be repeated; an unknown name lists all.
    #[arg(long, value_name = "LINT")]
    allow: Vec<Lint>,
    /// Rig of the seed: `ideal` is its own model; `nominal` and `hard` have what a well-made and a poor rig have besides.
    #[arg(long, value_name = "RIG", default_value_t = RigPreset::Ideal)]
    rig: RigPreset,
    /// A change of the plant that the firmware does not know of, for example `load=1.2kg`.
    #[arg(long, value_name = "KEY=VALUE")]
    plant: Vec<PlantChange>,
    /// Program and arguments that stand in for mechanism and load: docs/reference/simulator.md.
    #[arg(long, value_name = "CMD ARGS", conflicts_with = "plant_surface")]
    plant_program: Option<String>,
    /// Measured gaps that stand in for the mechanism: docs/reference/simulator.md. Two files are those of a growing and
    /// of a falling twist.
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
    /// Only count what the real chip would not do or what is not emulated, instead of stopping there: all lints allowed.
    #[arg(long)]
    lenient: bool,
}

/// Exit status of a bare run.
mod status {
    pub const FAILED: u8 = 1;
    pub const REFUSED: u8 = 2;
    pub const TIME_LIMIT: u8 = 3;
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let (ended, status) = if arguments.bare {
        (run_bare(&arguments), status::REFUSED)
    } else {
        (run(&arguments).map(|()| 0), status::FAILED)
    };
    ended.map_or_else(
        |error| {
            eprintln!("error: {error:#}");
            ExitCode::from(status)
        },
        ExitCode::from,
    )
}

/// The program and how to run it.
fn inputs(arguments: &Arguments) -> Result<(Vec<u8>, Config)> {
    let elf = files::read(&arguments.elf).with_context(|| format!("firmware {}", arguments.elf.display()))?;
    let config = Config { strict: !arguments.lenient, brown_out_level: arguments.brown_out_level, ..Config::default() };
    Ok((elf, config))
}

/// Runs a program without a rig, and says how it ended and what was counted on the way. Gives the exit status.
fn run_bare(arguments: &Arguments) -> Result<u8> {
    let (elf, config) = inputs(arguments)?;
    let mut machine = Machine::new(&elf, JumperBoard::new(&arguments.jumper, Broken::default()), config)?;
    for lint in &arguments.allow {
        machine.soc_mut().faults.allow(*lint);
    }
    let ends = Ends { ok: arguments.ok.clone(), fail: arguments.fail.clone(), limit_s: arguments.limit };
    // A reader that has gone has read enough.
    let end = jumpers::run(&mut machine, &ends, |line, _| _ = writeln!(io::stdout(), "{line}"));
    let stats = machine.stats();
    for (what, times) in &stats.warnings {
        eprintln!("allowed, {times} times: {what}");
    }
    for t_s in &stats.lock_ups {
        eprintln!("the core locked up at {t_s:.6} s: a fault in the HardFault handler");
    }
    if end != End::Passed {
        stats.resets.iter().for_each(|(t_s, cause)| eprintln!("reset at {t_s:.6} s: {cause:?}"));
    }
    Ok(match end {
        End::Passed => 0,
        End::Failed => {
            eprintln!("failed at {:.6} s", machine.now_s());
            status::FAILED
        }
        End::TimeLimit => {
            eprintln!("time limit: not ended after {} s of emulated time", arguments.limit);
            status::TIME_LIMIT
        }
        End::Stopped(error) => {
            eprintln!("error: {error}");
            match error {
                MachineError::Undefined { .. } | MachineError::Memory { .. } => status::FAILED,
                _ => status::REFUSED,
            }
        }
    })
}

fn run(arguments: &Arguments) -> Result<()> {
    let (elf, config) = inputs(arguments)?;
    let scene_file = arguments.scene.as_ref().context("--scene is missing")?;
    let (requests, gone) = requests();
    files::check_regular(scene_file).with_context(|| format!("scene {}", scene_file.display()))?;
    let scene = Scene::load(scene_file)?;
    scene.check_rig().map_err(|error| error.in_file(scene_file))?;
    let rig = match outside(arguments)? {
        Some(outside) => EmulatedRig::from_outside(&scene, arguments.rig, &arguments.plant, arguments.seed, &outside)?,
        None => {
            let mut settings = PlantSettings::preset(arguments.rig, arguments.seed);
            for change in &arguments.plant {
                settings.apply(*change)?;
            }
            EmulatedRig::new(&scene, settings, arguments.seed)?
        }
    };
    let mut machine = Machine::new(&elf, rig, config)?;
    for lint in &arguments.allow {
        machine.soc_mut().faults.allow(*lint);
    }
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
