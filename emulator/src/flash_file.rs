//! The board's flash in a file, so that its contents outlive the process as those of a real board outlive its supply.

use crate::machine::Machine;
use anyhow::{Context, Result, bail};
use rig_config::files;
use rig_plant::rig::EmulatedRig;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The file, its contents, and the flash as it was when they were written.
pub struct FlashFile {
    path: PathBuf,
    held: Option<Vec<u8>>,
    image: Vec<u8>,
    /// The contents from before this process have been saved beside the file.
    kept: bool,
}

impl FlashFile {
    /// Loads the file into a machine that has not run yet, except where the firmware itself lies. Without a file the
    /// board is a new one, and the file is created when the flash is first written.
    ///
    /// # Errors
    /// If it cannot be read or is no image of this flash; names it.
    pub fn open(path: &Path, machine: &mut Machine<EmulatedRig>) -> Result<Self> {
        let held = read(path)?;
        if let Some(image) = &held {
            machine.set_flash_image(image).with_context(|| format!("flash {}", path.display()))?;
        }
        Ok(Self { path: path.into(), held, image: machine.flash_image(), kept: false })
    }

    /// Writes the file if flash has changed: completely or not at all, whenever the process ends. The contents from
    /// before this process stay beside it as `FILE~`.
    ///
    /// # Errors
    /// If it cannot be written, or another board has written it meanwhile; names it.
    pub fn follow(&mut self, machine: &Machine<EmulatedRig>) -> Result<()> {
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
