//! The board's flash in a file, so that it outlives the process as the real one outlives its supply.

use crate::machine::Machine;
use crate::rig::Rig;
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};

/// The file, and what stands in it.
pub struct FlashFile {
    path: PathBuf,
    image: Vec<u8>,
}

impl FlashFile {
    /// Puts what the file holds into a machine that has not run yet, all but the firmware itself. Without a file the board
    /// is a new one, and the file is made when its flash is first written.
    ///
    /// # Errors
    /// If it cannot be read or is no image of this flash; names it.
    pub fn open(path: &Path, machine: &mut Machine<Rig>) -> Result<Self> {
        if path.exists() {
            let image = std::fs::read(path).with_context(|| format!("flash {}", path.display()))?;
            machine.set_flash_image(&image).with_context(|| format!("flash {}", path.display()))?;
        }
        Ok(Self { path: path.into(), image: machine.flash_image() })
    }

    /// Writes the file if flash has changed: whole or not at all, whenever the process ends.
    ///
    /// # Errors
    /// If it cannot be written; names it.
    pub fn follow(&mut self, machine: &Machine<Rig>) -> Result<()> {
        let image = machine.flash_image();
        if image != self.image {
            let beside = self.path.with_extension("new");
            std::fs::write(&beside, &image)
                .and_then(|()| std::fs::rename(&beside, &self.path))
                .with_context(|| format!("flash {}", self.path.display()))?;
            self.image = image;
        }
        Ok(())
    }
}
