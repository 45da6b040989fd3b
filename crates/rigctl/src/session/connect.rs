//! From the operator's choice of a board to a session with it.

use super::client::Session;
use super::interrupt;
use super::serial::Serial;
use super::sim::{Sim, SimOptions};
use super::table;
use crate::board_settings;
use crate::failure::Failure;
use crate::scene_file;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use tsa_table::Table;

/// Which board, and the scene that the operator believes it to be built for.
#[derive(Clone, Debug)]
pub struct Target {
    /// The operator's scene file.
    pub scene: PathBuf,
    /// Where the board is.
    pub place: Place,
}

/// Where a board is.
#[derive(Clone, Debug)]
pub enum Place {
    /// An emulated board, started afresh.
    Emulated(Box<SimOptions>),
    /// A serial device.
    Device(String),
}

/// Which board a command can use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// One whose table is for the operator's scene. An emulated board is sent that table.
    OfScene,
    /// Any, whatever its table is for.
    Any,
    /// Any, from its first instant on: it is not greeted.
    FromItsStart,
}

impl Target {
    /// The place as `--port` names it.
    pub fn port(&self) -> &str {
        match &self.place {
            Place::Emulated(_) => "sim",
            Place::Device(device) => device,
        }
    }

    /// The options of the emulated board, if it is one.
    pub fn emulated(&self) -> Option<&SimOptions> {
        match &self.place {
            Place::Emulated(options) => Some(options),
            Place::Device(_) => None,
        }
    }

    /// The emulated rig's name, if it is one.
    pub fn rig(&self) -> Option<&'static str> {
        self.emulated().map(|options| options.preset().name())
    }

    /// Connects to the board and greets it. Standard error says what an emulated board is, and warns if a board does not use
    /// all settings in its flash.
    ///
    /// # Errors
    /// If the port cannot be opened, nobody answers, or the board has other messages; for [`Wanted::OfScene`] if the scene is
    /// of a rig that cannot work, or the board's is another.
    pub fn connect(&self, wanted: Wanted) -> Result<Session, Failure> {
        // A rig that cannot work is refused before anything starts.
        let scene = (wanted == Wanted::OfScene).then(|| scene_file::load_rig(&self.scene)).transpose()?;
        if let Some(options) = self.emulated() {
            crate::output::say!("{options}");
        }
        interrupt::watch();
        let mut session = self.open()?;
        if wanted == Wanted::FromItsStart {
            return Ok(session);
        }
        session.greet()?;
        if let Some(warning) = session.known_settings().and_then(board_settings::warning) {
            crate::output::say!("warning: {warning}");
        }
        if let Some(scene) = scene {
            if self.emulated().is_some() && session.require_identity()?.scene_hash != scene.hash() {
                table::send(&mut session, &scene, &self.scene)?;
                crate::output::say!("the emulated board was sent the table of {}", self.scene.display());
            }
            self.check_scene(&session)?;
        }
        Ok(session)
    }

    /// A session with a board that has not been greeted, for a program that hears of interrupts itself and says what it does.
    ///
    /// # Errors
    /// If the emulated board does not start, or the device cannot be opened.
    pub fn open(&self) -> Result<Session, Failure> {
        Ok(Session::new(match &self.place {
            Place::Emulated(options) => Box::new(Sim::start(options)?),
            Place::Device(device) => Box::new(Serial::open(device)?),
        }))
    }

    /// An emulated board for [`Wanted::FromItsStart`]: its flash has the table of the operator's scene, where the image has
    /// another one. The flash is the given file, or one that lasts as long as the result.
    ///
    /// # Errors
    /// As [`Self::connect`].
    pub fn with_its_table(&self) -> Result<(Self, Option<TemporaryFile>), Failure> {
        let scene = scene_file::load_rig(&self.scene)?;
        if self.emulated().is_none() || self.looked_at()?.require_identity()?.scene_hash == scene.hash() {
            return Ok((self.clone(), None));
        }
        let fit = table::fitted(&scene, &self.scene)?;
        let prepared = self.with_table(&fit.table.table())?;
        crate::output::say!("the emulated board was sent the table of {}", self.scene.display());
        Ok(prepared)
    }

    /// The same with any table for the scene's `[rig]`.
    ///
    /// # Errors
    /// If the emulated board does not start, or refuses the table.
    pub fn with_table(&self, table: &Table<'_>) -> Result<(Self, Option<TemporaryFile>), Failure> {
        let scene = scene_file::load_rig(&self.scene)?;
        let (mut target, mut new) = (self.clone(), None);
        if let Place::Emulated(options) = &mut target.place
            && options.flash.is_none()
        {
            let file = TemporaryFile::new("flash");
            options.flash = Some(file.path.clone());
            new = Some(file);
        }
        table::send_table(&mut target.looked_at()?, &scene, &self.scene, table)?;
        Ok((target, new))
    }

    /// The emulated board, greeted, without a debugger.
    fn looked_at(&self) -> Result<Session, Failure> {
        let mut target = self.clone();
        if let Place::Emulated(options) = &mut target.place {
            (options.gdb, options.gdb_wait) = (None, false);
        }
        interrupt::watch();
        let mut session = target.open()?;
        session.greet()?;
        Ok(session)
    }

    /// Checks that the board's table is for the operator's scene.
    ///
    /// # Errors
    /// Naming both scenes, and what to do.
    pub fn check_scene(&self, session: &Session) -> Result<(), Failure> {
        let scene = scene_file::load(&self.scene)?.hash();
        let board = session.identity().map_or(0, |id| id.scene_hash);
        if board == scene {
            return Ok(());
        }
        Err(Failure::failed(format!(
            "the board's table is for another scene ({board:08x}) than {} ({scene:08x}): name the board's with --scene, or send \
             it the table of this one (`table --board`)",
            self.scene.display(),
        )))
    }
}

/// A file of this process that is removed in the end.
pub struct TemporaryFile {
    path: PathBuf,
}

impl TemporaryFile {
    fn new(name: &str) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        Self { path: std::env::temp_dir().join(format!("rigctl-{name}-{}-{count}", std::process::id())) }
    }
}

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        // It is not there if nothing was written.
        let _ = std::fs::remove_file(&self.path);
    }
}
