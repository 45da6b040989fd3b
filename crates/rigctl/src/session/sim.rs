//! The emulated board: `rig-emulator` as a child process, stepped in emulated time. Nothing runs between two steps, so
//! the same seed and the same requests give the same bytes.

use super::interrupt;
use super::port::{Emulated, Port, Received};
use crate::failure::Failure;
use anyhow::{Context, anyhow};
use rig_plant::{Answer, Fault, PlantChange, Request, RigPreset, Stats};
use std::fmt;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex};

/// How to start an emulated board.
#[derive(Clone, Debug)]
pub struct SimOptions {
    /// Folder of the emulator; `None` is that of the running program. The firmware is in `../firmware`.
    pub programs: Option<PathBuf>,
    /// The firmware; `None` is the one that `cargo xtask firmware` made.
    pub firmware: Option<PathBuf>,
    /// Scene that the rig is built by.
    pub scene: PathBuf,
    /// What the rig has besides its own model.
    pub rig: RigPreset,
    /// Changes of the plant that the firmware does not know.
    pub plant: Vec<PlantChange>,
    /// Program and arguments in the place of mechanism and load.
    pub plant_program: Option<String>,
    /// Files of measured gaps in the place of the mechanism.
    pub plant_surface: Vec<PathBuf>,
    /// Seed of all noise, and of the rig.
    pub seed: u64,
    /// File that keeps the board's flash; without it the board is a new one.
    pub flash: Option<PathBuf>,
    /// A debugger of the board.
    pub gdb: Option<Gdb>,
}

impl fmt::Display for SimOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "emulated board, {} rig, seed {}", self.rig, self.seed)
    }
}

impl SimOptions {
    /// The firmware of `cargo xtask firmware` on a new board with the nominal rig of a scene.
    pub fn new(scene: PathBuf) -> Self {
        Self {
            programs: None,
            firmware: None,
            scene,
            rig: RigPreset::default(),
            plant: Vec::new(),
            plant_program: None,
            plant_surface: Vec::new(),
            seed: 1,
            flash: None,
            gdb: None,
        }
    }
}

/// A GDB that may connect to the board.
#[derive(Clone, Debug)]
pub struct Gdb {
    /// Where, as `127.0.0.1:1234`.
    pub address: String,
    /// The board starts when it has.
    pub wait: bool,
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
        command.arg("--rig").arg(options.rig.name()).arg("--seed").arg(options.seed.to_string());
        if let Some(flash) = &options.flash {
            command.arg("--flash").arg(flash);
        }
        if let Some(gdb) = &options.gdb {
            command.arg("--gdb").arg(&gdb.address);
            if gdb.wait {
                command.arg("--gdb-wait");
            }
        }
        for change in &options.plant {
            command.arg("--plant").arg(change.to_string());
        }
        if let Some(program) = &options.plant_program {
            command.arg("--plant-program").arg(program);
        }
        for surface in &options.plant_surface {
            command.arg("--plant-surface").arg(surface);
        }
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
    fn pass(&mut self, bytes: &[u8], seconds: f64) -> Result<Received, Failure> {
        match self.ask(&Request::Run { until_s: self.now_s + seconds, uart: bytes.to_vec() })? {
            Answer::Run(run) => {
                self.now_s = run.t_s;
                Ok(Received { bytes: run.uart, truth: run.truth, log: run.log })
            }
            answer => Err(unexpected(&answer)),
        }
    }

    fn now_s(&self) -> f64 {
        self.now_s
    }

    fn emulated(&mut self) -> Option<&mut dyn Emulated> {
        Some(self)
    }
}

impl Emulated for Sim {
    fn plant(&mut self, change: PlantChange) -> Result<(), Failure> {
        self.ask(&Request::Plant(change)).map(drop)
    }

    fn fault(&mut self, fault: Fault, on: bool) -> Result<(), Failure> {
        self.ask(&Request::Fault { fault, on }).map(drop)
    }

    fn power_cycle(&mut self) -> Result<(), Failure> {
        self.ask(&Request::PowerCycle).map(drop)
    }

    fn stats(&mut self) -> Result<Stats, Failure> {
        match self.ask(&Request::Stats)? {
            Answer::Stats(stats) => Ok(stats),
            answer => Err(unexpected(&answer)),
        }
    }
}

impl Drop for Sim {
    fn drop(&mut self) {
        // Closing its input would end it as well; this does not wait for a run to finish.
        interrupt::kill(&self.child);
    }
}
