//! Files that commands write. What a file held before is kept beside it as `FILE~`.

use crate::failure::Failure;
use rig_config::files::{self, Replacement};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file that will be written later. Whether it can be written is checked at once; its old content, which may be a
/// recorded experiment, stays until then.
pub struct OutFile(PathBuf);

impl OutFile {
    /// Checks that this path can be written. The check leaves nothing there.
    ///
    /// # Errors
    /// Naming the file.
    pub fn new(path: &Path) -> Result<Self, Failure> {
        Replacement::new(path).map_err(|e| unwritable(path, &e))?;
        Ok(Self(path.to_owned()))
    }

    /// Begins to write. The file takes its place when its first bytes are on the disk, so that it can be followed while it
    /// grows.
    ///
    /// # Errors
    /// Naming the file.
    pub fn begin(self) -> Result<Box<dyn Write + Send>, Failure> {
        let new = Replacement::new(&self.0).map_err(|e| unwritable(&self.0, &e))?;
        Ok(Box::new(BufWriter::new(Growing { path: self.0, new })))
    }

    /// Writes the whole content, or changes nothing.
    ///
    /// # Errors
    /// Naming the file.
    pub fn write(self, content: impl AsRef<[u8]>) -> Result<(), Failure> {
        let kept = files::replace(&self.0, content.as_ref(), true).map_err(|e| unwritable(&self.0, &e))?;
        report_kept(&self.0, kept);
        Ok(())
    }
}

/// Checks that two options name different files.
///
/// # Errors
/// Naming both.
pub fn distinct(option: &str, path: Option<&Path>, other_option: &str, other: Option<&Path>) -> Result<(), Failure> {
    let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    match (path, other) {
        (Some(path), Some(other)) if whole(path) == whole(other) => {
            Err(Failure::Usage(format!("{option} {}: this is the file of {other_option}", path.display())))
        }
        _ => Ok(()),
    }
}

fn unwritable(path: &Path, error: &io::Error) -> Failure {
    Failure::failed(format!("cannot write {}: {error}", path.display()))
}

fn report_kept(path: &Path, kept: Option<PathBuf>) {
    if let Some(kept) = kept {
        crate::output::say!("what {} held is now {}", path.display(), kept.display());
    }
}

/// A file that grows in its final place from its first bytes on.
struct Growing {
    path: PathBuf,
    new: Replacement,
}

impl Write for Growing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let named = |e: io::Error| io::Error::new(e.kind(), format!("cannot write {}: {e}", self.path.display()));
        let count = self.new.write(bytes).map_err(named)?;
        if !self.new.is_in_place() {
            let kept = self.new.take_place(true).map_err(named)?;
            report_kept(&self.path, kept);
        }
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.new.flush()
    }
}

/// Makes a folder if necessary, before the computation of what goes there begins.
///
/// # Errors
/// Naming the folder.
pub fn folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|e| Failure::failed(format!("cannot write into {}: {e}", folder.display())))
}

/// Writes a file into a folder, which is made if necessary.
///
/// # Errors
/// Naming the file.
pub fn write_file(folder: &Path, name: &str, content: &str) -> Result<(), Failure> {
    let path = folder.join(name);
    self::folder(folder)?;
    OutFile(path).write(content)
}
