//! The options that the operator types, as values.
//!
//! [`Global`]: the options of every command; [`commands`]: those of the commands that have many; [`values`]: texts with
//! units, each error naming its option.

pub mod commands;
pub mod values;

use crate::failure::Failure;
use crate::scene_file;
use crate::session::sim::{Gdb, SimOptions};
use crate::session::{self, Place, Target};
use clap::Args;
use rig_config::Scene;
use rig_plant::{PlantChange, PlantKey, RigPreset};
use std::path::PathBuf;

/// Headings of the options that every command has.
const EVERYWHERE: &str = "Everywhere";
/// The port of an emulated board, and the environment variable that names another default.
const SIM: &str = "sim";
const PORT_VARIABLE: &str = "RIGCTL_PORT";
const EMULATED: &str = "Emulated board (--port sim)";

/// The help of `--plant`.
fn plant_help() -> String {
    format!(
        "Changes of the emulated plant that the firmware does not know, for example load=1.2kg,friction=0.1. Keys and their \
         units:\n{}",
        PlantKey::help()
    )
}

/// Options of every command.
#[derive(Debug, Clone, Args)]
pub struct Global {
    /// Print JSON: one object, or one a line where there are many
    #[arg(long, global = true, help_heading = EVERYWHERE)]
    pub json: bool,
    /// Scene: the constants that tool and table believe in, load range, travel, accuracy
    #[arg(long, global = true, help_heading = EVERYWHERE, value_name = "FILE", default_value = "scenes/default.toml")]
    pub scene: PathBuf,
    /// Where the firmware is: `sim` (an emulated board that starts by itself), `auto` (the one ST-LINK that is plugged in) or a
    /// serial device [default: RIGCTL_PORT of the environment, else sim]
    #[arg(long, global = true, help_heading = EVERYWHERE)]
    pub port: Option<String>,
    /// Emulated rig of the seed: `ideal` is its own model, for testing arithmetic; `nominal` has what a well-made real rig has
    /// besides, `hard` what the worst in ten has [default: nominal]
    #[arg(long, global = true, help_heading = EMULATED, value_name = "ideal|nominal|hard", hide_possible_values = true)]
    pub rig: Option<RigPreset>,
    /// Changes of the emulated plant that the firmware does not know, for example load=1.2kg,friction=0.1
    #[arg(long, global = true, help_heading = EMULATED, value_name = "KEY=VALUE", value_delimiter = ',',
        long_help = plant_help())]
    pub plant: Vec<PlantChange>,
    /// Scene that the emulated plant is built from, if it differs from the operator's --scene [default: --scene]
    #[arg(long, global = true, help_heading = EMULATED, value_name = "FILE")]
    pub plant_scene: Option<PathBuf>,
    /// Program and arguments that stand in for the emulated mechanism and load: docs/plants.md
    #[arg(long, global = true, help_heading = EMULATED, value_name = "CMD ARGS", conflicts_with = "plant_surface")]
    pub plant_program: Option<String>,
    /// Measured gaps that stand in for the emulated mechanism, one file or those of either way of the twist: docs/plants.md
    #[arg(long, global = true, help_heading = EMULATED, value_name = "FILE")]
    pub plant_surface: Vec<PathBuf>,
    /// Seed of the emulated rig's noise, and of the rig that --rig draws
    #[arg(long, global = true, help_heading = EMULATED, default_value_t = 1)]
    pub seed: u64,
    /// File that keeps the emulated board's flash from one call to the next [default: each call has a new board]
    #[arg(long, global = true, help_heading = EMULATED, value_name = "FILE")]
    pub flash: Option<PathBuf>,
    /// Firmware for the emulated board [default: what `cargo xtask firmware` made]
    #[arg(long, global = true, help_heading = EMULATED, value_name = "ELF")]
    pub firmware: Option<PathBuf>,
    /// Let a GDB connect to the emulated board there, for example 127.0.0.1:1234; see docs/debugging.md
    #[arg(long, global = true, help_heading = EMULATED, value_name = "ADDR:PORT")]
    pub gdb: Option<String>,
    /// Start the emulated board when it has
    #[arg(long, global = true, help_heading = EMULATED, requires = "gdb")]
    pub gdb_wait: bool,
}

impl Global {
    /// Where the firmware is, by the option or the environment.
    pub fn port(&self) -> String {
        let of_environment = || std::env::var(PORT_VARIABLE).ok().filter(|port| !port.is_empty());
        self.port.clone().or_else(of_environment).unwrap_or_else(|| SIM.into())
    }

    /// The port of a real board, if the operator named one on the command line.
    pub fn given_device(&self) -> Option<&str> {
        self.port.as_deref().filter(|port| *port != SIM)
    }

    /// Whether the board is the emulated one.
    pub fn is_emulated(&self) -> bool {
        self.port() == SIM
    }

    /// Whether the board's flash outlives this call of the tool.
    pub fn flash_lasts(&self) -> bool {
        !self.is_emulated() || self.flash.is_some()
    }

    /// The operator's scene.
    ///
    /// # Errors
    /// Naming the file, and what is wrong with it.
    pub fn scene(&self) -> Result<Scene, Failure> {
        scene_file::load(&self.scene)
    }

    /// The operator's scene, of a rig that can work.
    ///
    /// # Errors
    /// As [`Global::scene`], or naming the keys that do not fit.
    pub fn rig_config(&self) -> Result<Scene, Failure> {
        scene_file::load_rig(&self.scene)
    }

    /// Options of the emulated board.
    ///
    /// # Errors
    /// If there is no such scene file.
    pub fn emulated(&self) -> Result<SimOptions, Failure> {
        let scene = self.plant_scene.as_ref().unwrap_or(&self.scene);
        scene_file::check(scene)?;
        Ok(SimOptions {
            programs: None,
            firmware: self.firmware.clone(),
            scene: scene.clone(),
            rig: self.rig.unwrap_or_default(),
            plant: self.plant.clone(),
            plant_program: self.plant_program.clone(),
            plant_surface: self.plant_surface.clone(),
            seed: self.seed,
            flash: self.flash.clone(),
            gdb: self.gdb.clone().map(|address| Gdb { address, wait: self.gdb_wait }),
        })
    }

    /// The board at `--port`. A real one that only the environment names is told on standard error.
    ///
    /// # Errors
    /// If there is no such scene file, no ST-LINK or several for `auto`, or an option of the emulated board is given for a device.
    pub fn target(&self) -> Result<Target, Failure> {
        if self.is_emulated() {
            return Ok(Target { scene: self.scene.clone(), place: Place::Emulated(self.emulated()?) });
        }
        if let Some((_, name)) = self.of_emulated_board().into_iter().find(|(given, _)| *given) {
            return Err(Failure::Usage(format!("{name} is for the emulated board, not for --port {}", self.port())));
        }
        let port = self.port();
        let device = if port == "auto" { session::auto()? } else { port };
        if self.port.is_none() {
            eprintln!("board at {device}, by {PORT_VARIABLE}");
        }
        Ok(Target { scene: self.scene.clone(), place: Place::Device(device) })
    }

    /// The options of the emulated board alone, and whether each was given.
    pub fn of_emulated_board(&self) -> [(bool, &'static str); 8] {
        [
            (self.rig.is_some(), "--rig"),
            (!self.plant.is_empty(), "--plant"),
            (self.plant_scene.is_some(), "--plant-scene"),
            (self.plant_program.is_some(), "--plant-program"),
            (!self.plant_surface.is_empty(), "--plant-surface"),
            (self.flash.is_some(), "--flash"),
            (self.firmware.is_some(), "--firmware"),
            (self.gdb.is_some(), "--gdb"),
        ]
    }
}
