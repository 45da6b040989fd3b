//! The emulated board: `rig-emulator` as a child process, stepped in emulated time. Nothing runs between two steps, so
//! the same seed and the same requests give the same bytes.

use super::interrupt;
use super::link::Port;
use crate::failure::Failure;
use crate::scene_file;
use anyhow::{Context, anyhow};
use clap::Args;
use rig_plant::{Answer, Fault, PlantChange, PlantKey, Request, RigPreset, Run, Stats};
use std::ffi::OsStr;
use std::fmt;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex};

/// Heading of the options in the tool's help.
const HEADING: &str = "Emulated board (--port sim)";

/// The help of `--plant`.
fn plant_help() -> String {
    format!(
        "Changes of the emulated plant that the firmware does not know, for example load=1.2kg,friction=0.1. Keys and their \
         units:\n{}",
        PlantKey::help()
    )
}

/// How to start an emulated board: the tool's options for it.
#[derive(Clone, Debug, Default, Args)]
pub struct SimOptions {
    /// Folder of the emulator; `None` is that of the running program. The firmware is in `../firmware`.
    #[arg(skip)]
    pub programs: Option<PathBuf>,
    /// Scene that the rig is built by.
    #[arg(skip)]
    pub scene: PathBuf,
    /// Emulated rig of the seed: `ideal` is its own model, for testing arithmetic; `nominal` has what a well-made real rig has
    /// besides, `hard` what the worst in ten has [default: nominal]
    #[arg(long, global = true, help_heading = HEADING, value_name = "ideal|nominal|hard", hide_possible_values = true)]
    pub rig: Option<RigPreset>,
    /// Changes of the emulated plant that the firmware does not know, for example load=1.2kg,friction=0.1
    #[arg(long, global = true, help_heading = HEADING, value_name = "KEY=VALUE", value_delimiter = ',',
        long_help = plant_help())]
    pub plant: Vec<PlantChange>,
    /// Scene that the emulated plant is built from, if it differs from the operator's --scene [default: --scene]
    #[arg(long, global = true, help_heading = HEADING, value_name = "FILE", value_parser = scene_file::parser())]
    pub plant_scene: Option<PathBuf>,
    /// Program and arguments that stand in for the emulated mechanism and load: docs/reference/simulator.md
    #[arg(long, global = true, help_heading = HEADING, value_name = "CMD ARGS", conflicts_with = "plant_surface")]
    pub plant_program: Option<String>,
    /// Measured gaps that stand in for the emulated mechanism, one file or those of either way of the twist:
    /// docs/reference/simulator.md
    #[arg(long, global = true, help_heading = HEADING, value_name = "FILE")]
    pub plant_surface: Vec<PathBuf>,
    /// Seed of the emulated rig's noise, and of the rig that --rig draws
    #[arg(long, global = true, help_heading = HEADING, default_value_t = 1)]
    pub seed: u64,
    /// File that keeps the emulated board's flash from one call to the next [default: each call has a new board]
    #[arg(long, global = true, help_heading = HEADING, value_name = "FILE")]
    pub flash: Option<PathBuf>,
    /// Firmware for the emulated board [default: what `cargo xtask firmware` made]
    #[arg(long, global = true, help_heading = HEADING, value_name = "ELF")]
    pub firmware: Option<PathBuf>,
    /// Let a GDB connect to the emulated board there, for example 127.0.0.1:1234; see emulator/debugger.md
    #[arg(long, global = true, help_heading = HEADING, value_name = "ADDR:PORT")]
    pub gdb: Option<String>,
    /// The emulated board waits until a GDB has connected
    #[arg(long, global = true, help_heading = HEADING, requires = "gdb")]
    pub gdb_wait: bool,
}

impl fmt::Display for SimOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "emulated board, {} rig, seed {}", self.preset(), self.seed)
    }
}

impl SimOptions {
    /// The firmware of `cargo xtask firmware` on a new board with the nominal rig of a scene.
    pub fn new(scene: PathBuf) -> Self {
        Self { scene, seed: 1, ..Self::default() }
    }

    /// What the rig has besides its own model.
    pub fn preset(&self) -> RigPreset {
        self.rig.unwrap_or_default()
    }
}

/// A running emulated board.
pub struct Sim {
    child: Arc<Mutex<Child>>,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    now_s: f64,
}

/// A file in the folder of the programs: a given one, or that of our own executable, or one up from it, as for examples.
pub(crate) fn beside(programs: Option<&Path>, name: &str) -> Result<PathBuf, Failure> {
    if let Some(folder) = programs {
        return Ok(folder.join(name));
    }
    let own = std::env::current_exe().context("where rigctl itself is")?;
    let folders = own.ancestors().skip(1).take(2).map(|folder| folder.join(name));
    Ok(folders.clone().find(|file| file.exists()).or(folders.clone().next()).unwrap_or_else(|| name.into()))
}

/// Checks that a file is there; the error names the command that makes it.
pub(crate) fn there(path: &Path, made_by: &str) -> Result<(), Failure> {
    if path.exists() {
        return Ok(());
    }
    Err(Failure::failed(format!("{} is not there: run `{made_by}`", path.display())))
}

/// The emulator's executable.
///
/// # Errors
/// If it is not built.
pub(crate) fn emulator(programs: Option<&Path>) -> Result<PathBuf, Failure> {
    let emulator = beside(programs, if cfg!(windows) { "rig-emulator.exe" } else { "rig-emulator" })?;
    there(&emulator, "cargo xtask build")?;
    Ok(emulator)
}

impl Sim {
    /// Boots a fresh board.
    ///
    /// # Errors
    /// If emulator or firmware are not built, or the scene is refused.
    pub fn start(options: &SimOptions) -> Result<Self, Failure> {
        let programs = options.programs.as_deref();
        let emulator = emulator(programs)?;
        let firmware = match &options.firmware {
            Some(path) => path.clone(),
            None => beside(programs, "../firmware/tsa-firmware.elf")?,
        };
        there(&firmware, "cargo xtask firmware")?;
        let mut command = Command::new(&emulator);
        command.arg("--elf").arg(&firmware).arg("--scene").arg(&options.scene);
        command.args(["--rig", options.preset().name(), "--seed", &options.seed.to_string()]);
        command.args(options.flash.iter().flat_map(|file| [OsStr::new("--flash"), file.as_os_str()]));
        command.args(options.gdb.iter().flat_map(|address| ["--gdb", address]));
        command.args(options.gdb_wait.then_some("--gdb-wait"));
        command.args(options.plant.iter().flat_map(|change| ["--plant".to_owned(), change.to_string()]));
        command.args(options.plant_program.iter().flat_map(|program| ["--plant-program", program]));
        command.args(options.plant_surface.iter().flat_map(|f| [OsStr::new("--plant-surface"), f.as_os_str()]));
        // Ctrl-C is for this tool, which stops the emulated board as it would a real one.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("starting {}", emulator.display()))?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(Failure::failed("the emulator has no standard input and output"));
        };
        let child = Arc::new(Mutex::new(child));
        interrupt::takes_along(&child);
        let mut sim = Self { child, input, output: BufReader::new(output), now_s: 0.0 };
        // Its answer tells at once whether scene, plant and ELF were accepted.
        sim.stats()?;
        Ok(sim)
    }

    /// Changes the plant.
    ///
    /// # Errors
    /// If the key cannot change while the rig runs, or the emulator is gone.
    pub fn plant(&mut self, change: PlantChange) -> Result<(), Failure> {
        self.ask(&Request::Plant(change)).map(drop)
    }

    /// Begins or ends a fault.
    ///
    /// # Errors
    /// If the rig cannot have it, or the emulator is gone.
    pub fn fault(&mut self, fault: Fault, on: bool) -> Result<(), Failure> {
        self.ask(&Request::Fault { fault, on }).map(drop)
    }

    /// Takes the board's power away for a moment.
    ///
    /// # Errors
    /// If the emulator is gone.
    pub fn power_cycle(&mut self) -> Result<(), Failure> {
        self.ask(&Request::PowerCycle).map(drop)
    }

    /// What the firmware cost so far.
    ///
    /// # Errors
    /// If the emulator is gone.
    pub fn stats(&mut self) -> Result<Stats, Failure> {
        match self.ask(&Request::Stats)? {
            Answer::Stats(stats) => Ok(stats),
            answer => Err(unexpected(&answer)),
        }
    }

    fn ask(&mut self, request: &Request) -> Result<Answer, Failure> {
        // A child that refuses its arguments writes the reason to standard error, which is ours.
        let gone = || Failure::failed("the emulator has stopped");
        writeln!(self.input, "{}", serde_json::to_string(request)?).map_err(|_| gone())?;
        self.input.flush().map_err(|_| gone())?;
        let mut line = String::new();
        if self.output.read_line(&mut line)? == 0 {
            return Err(gone());
        }
        match serde_json::from_str(&line).context("the emulator's answer")? {
            Answer::Error { kind, message } => Err(anyhow!("emulator ({kind}): {message}").into()),
            answer => Ok(answer),
        }
    }
}

/// The emulator answers each kind of request in its own way; anything else is an emulator of another version.
fn unexpected(answer: &Answer) -> Failure {
    Failure::failed(format!("the emulator answers {answer:?}: build both programs again with `cargo xtask build`"))
}

impl Port for Sim {
    fn pass(&mut self, bytes: &[u8], seconds: f64) -> Result<Run, Failure> {
        match self.ask(&Request::Run { until_s: self.now_s + seconds, uart: bytes.to_vec() })? {
            Answer::Run(run) => {
                self.now_s = run.t_s;
                Ok(run)
            }
            answer => Err(unexpected(&answer)),
        }
    }

    fn now_s(&self) -> f64 {
        self.now_s
    }

    fn emulated(&mut self) -> Option<&mut Sim> {
        Some(self)
    }
}

impl Drop for Sim {
    fn drop(&mut self) {
        // Closing its input would end it as well; this does not wait for a run to finish.
        interrupt::kill(&self.child);
    }
}
