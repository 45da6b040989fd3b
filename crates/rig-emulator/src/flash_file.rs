//! The board's flash in a file, so that it outlives the process as the real one outlives its supply.

use crate::machine::Machine;
use crate::rig::Rig;
use anyhow::{Context, Result, bail};
use rig_scene::files;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The file, what stands in it, and the flash as it was then.
pub struct FlashFile {
    path: PathBuf,
    held: Option<Vec<u8>>,
    image: Vec<u8>,
    /// What the file held before this process is kept beside it.
    kept: bool,
}

impl FlashFile {
    /// Puts what the file holds into a machine that has not run yet, all but the firmware itself. Without a file the board
    /// is a new one, and the file is made when its flash is first written.
    ///
    /// # Errors
    /// If it cannot be read or is no image of this flash; names it.
    pub fn open(path: &Path, machine: &mut Machine<Rig>) -> Result<Self> {
        let held = read(path)?;
        if let Some(image) = &held {
            machine.set_flash_image(image).with_context(|| format!("flash {}", path.display()))?;
        }
        Ok(Self { path: path.into(), held, image: machine.flash_image(), kept: false })
    }

    /// Writes the file if flash has changed: whole or not at all, whenever the process ends. What it held before this
    /// process stays beside it as `FILE~`.
    ///
    /// # Errors
    /// If it cannot be written, or another board has written it meanwhile; names it.
    pub fn follow(&mut self, machine: &Machine<Rig>) -> Result<()> {
        let image = machine.flash_image();
        if image != self.image {
            if read(&self.path)? != self.held {
                bail!(
                    "flash {}: another emulated board has written it meanwhile; nothing is kept",
                    self.path.display()
                );
            }
            files::replace(&self.path, &image, !self.kept).with_context(|| format!("flash {}", self.path.display()))?;
            self.kept = true;
            self.held = Some(image.clone());
            self.image = image;
        }
        Ok(())
    }
}

fn read(path: &Path) -> Result<Option<Vec<u8>>> {
    match files::read(path) {
        Ok(image) => Ok(Some(image)),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
        Err(e) => Err(e).with_context(|| format!("flash {}", path.display())),
    }
}
