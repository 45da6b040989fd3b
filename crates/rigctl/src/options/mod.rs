//! The options that the operator types, as values.
//!
//! [`Global`]: the options of every command; [`values`]: texts with units, each error naming its option.

pub mod values;

use crate::failure::Failure;
use crate::scene_file;
use crate::session::sim::SimOptions;
use crate::session::{self, Place, Target};
use clap::Args;
use rig_config::Scene;
use std::path::PathBuf;

/// Headings of the options that every command has.
const EVERYWHERE: &str = "Everywhere";
/// The port of an emulated board, and the environment variable that names another default.
const SIM: &str = "sim";
const PORT_VARIABLE: &str = "RIGCTL_PORT";

/// Options of every command.
#[derive(Debug, Clone, Args)]
pub struct Global {
    /// Print JSON: one object, or one a line where there are many
    #[arg(long, global = true, help_heading = EVERYWHERE)]
    pub json: bool,
    /// Configuration: constants of the mechanism and the actuator, load range, accuracy
    #[arg(long, global = true, help_heading = EVERYWHERE, value_name = "FILE", default_value = "scenes/default.toml",
        value_parser = scene_file::parser())]
    pub scene: PathBuf,
    /// Where the firmware is: `sim` (an emulated board that starts by itself), `auto` (the one ST-LINK that is plugged in) or a
    /// serial device [default: RIGCTL_PORT of the environment, else sim]
    #[arg(long, global = true, help_heading = EVERYWHERE)]
    pub port: Option<String>,
    /// Options of the emulated board.
    #[command(flatten)]
    pub board: SimOptions,
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
        !self.is_emulated() || self.board.flash.is_some()
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
        let mut options = self.board.clone();
        options.scene = self.board.plant_scene.clone().unwrap_or_else(|| self.scene.clone());
        scene_file::check(&options.scene)?;
        Ok(options)
    }

    /// The board at `--port`. A real one that only the environment names is told on standard error.
    ///
    /// # Errors
    /// If there is no such scene file, no ST-LINK or several for `auto`, or an option of the emulated board is given for a device.
    pub fn target(&self) -> Result<Target, Failure> {
        if self.is_emulated() {
            return Ok(Target { scene: self.scene.clone(), place: Place::Emulated(Box::new(self.emulated()?)) });
        }
        if let Some((_, name)) = self.of_emulated_board().into_iter().find(|(given, _)| *given) {
            return Err(Failure::Usage(format!("{name} is for the emulated board, not for --port {}", self.port())));
        }
        let port = self.port();
        let device = if port == "auto" { session::auto()? } else { port };
        if self.port.is_none() {
            crate::output::say!("board at {device}, by {PORT_VARIABLE}");
        }
        Ok(Target { scene: self.scene.clone(), place: Place::Device(device) })
    }

    /// The options of the emulated board alone, and whether each was given.
    pub fn of_emulated_board(&self) -> [(bool, &'static str); 8] {
        let board = &self.board;
        [
            (board.rig.is_some(), "--rig"),
            (!board.plant.is_empty(), "--plant"),
            (board.plant_scene.is_some(), "--plant-scene"),
            (board.plant_program.is_some(), "--plant-program"),
            (!board.plant_surface.is_empty(), "--plant-surface"),
            (board.flash.is_some(), "--flash"),
            (board.firmware.is_some(), "--firmware"),
            (board.gdb.is_some(), "--gdb"),
        ]
    }

    /// Prints which options of a rig have no effect, because this command uses none.
    pub fn uses_no_rig(&self) {
        let port = (self.given_device().is_some(), "--port");
        no_effect([port].into_iter().chain(self.of_emulated_board()), "this command uses no rig");
    }

    /// The same for a command that is always on the emulated board, whatever port the environment names.
    ///
    /// # Errors
    /// If another port is given.
    pub fn always_emulated(&self) -> Result<Self, Failure> {
        match self.given_device() {
            None => Ok(Self { port: Some(SIM.into()), ..self.clone() }),
            Some(port) => Err(Failure::Usage(format!(
                "--port {port}: this command is always on the emulated board; `play` takes a script to a rig"
            ))),
        }
    }
}

/// Prints which of the given options have no effect, and why.
pub fn no_effect(given: impl Iterator<Item = (bool, &'static str)>, why: &str) {
    for (_, name) in given.filter(|(given, _)| *given) {
        crate::output::say!("{name} has no effect: {why}");
    }
}
