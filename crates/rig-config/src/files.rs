//! Files of the operator, read and written by the tool and by the emulator alike.
//!
//! Reading accepts regular files only, because opening a FIFO waits for a writer that may never come. Writing goes to a
//! new file beside the target, which replaces the target once it is complete: a full disk or a kill leaves the target
//! as it was. A symbolic link remains a link, and the file behind it is replaced.

use std::fs::{File, FileType, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Longest chain of symbolic links that is followed, as Linux has it.
const MAX_LINKS: usize = 40;

/// The kind of a file that is not regular, in words.
fn kind(file: FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if file.is_fifo() {
            return "a FIFO";
        }
        if file.is_socket() {
            return "a socket";
        }
        if file.is_char_device() || file.is_block_device() {
            return "a device";
        }
    }
    if file.is_dir() { "a directory" } else { "something else" }
}

/// Checks that a path leads to a regular file, directly or by links.
///
/// # Errors
/// If there is no file, or one of another kind, which the message names. It does not name the path.
pub fn check_regular(path: &Path) -> io::Result<()> {
    let found = std::fs::metadata(path)?.file_type();
    if found.is_file() {
        return Ok(());
    }
    Err(io::Error::new(io::ErrorKind::InvalidInput, format!("is {}, not a regular file", kind(found))))
}

/// The bytes of a regular file.
///
/// # Errors
/// As [`check_regular`], or if it cannot be read.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    check_regular(path)?;
    std::fs::read(path)
}

/// The text of a regular file.
///
/// # Errors
/// As [`read`], or if it is not UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    check_regular(path)?;
    std::fs::read_to_string(path)
}

/// The file behind symbolic links; behind a dangling link, the path at which its file would be created.
fn behind_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        if !std::fs::symlink_metadata(&path).is_ok_and(|m| m.is_symlink()) {
            return Ok(path);
        }
        let to = std::fs::read_link(&path)?;
        path = path.parent().map_or_else(|| to.clone(), |folder| folder.join(&to));
    }
    Err(io::Error::new(io::ErrorKind::InvalidInput, "is a chain of too many symbolic links"))
}

/// The file of this name with `~` behind it.
fn backup_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push("~");
    name.into()
}

/// A new file that takes the place of another, or of nothing. It is a [`Write`]r without a buffer.
#[derive(Debug)]
pub struct Replacement {
    target: PathBuf,
    beside: PathBuf,
    file: File,
    /// Whether a file is at `beside` that is to be removed if it is not wanted.
    pending: bool,
}

impl Replacement {
    /// Makes an empty file in the target's folder, with a name that no file has. The target stays as it is.
    ///
    /// # Errors
    /// If the target is there and is no regular file that may be written to, or if its folder cannot be written to.
    pub fn new(path: &Path) -> io::Result<Self> {
        let target = behind_links(path)?;
        let permissions = match std::fs::metadata(&target) {
            Ok(found) => {
                check_regular(&target)?;
                lock(&OpenOptions::new().append(true).open(&target)?)?;
                Some(found.permissions())
            }
            Err(e) if e.kind() == io::ErrorKind::NotFound => None,
            Err(e) => return Err(e),
        };
        let folder = target.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut number = 0_u32;
        let (beside, file) = loop {
            // Short, so that a target of any permitted length has room for it.
            let beside = folder.join(format!(".tsa-{}-{number}.part", std::process::id()));
            match OpenOptions::new().write(true).create_new(true).open(&beside) {
                Ok(file) => break (beside, file),
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists && number < u32::MAX => number += 1,
                Err(e) => return Err(e),
            }
        };
        lock(&file)?;
        let new = Self { target, beside, file, pending: true };
        if let Some(permissions) = permissions {
            new.file.set_permissions(permissions)?;
        }
        Ok(new)
    }

    /// Takes the target's place, which is never empty meanwhile. With `keep` the former file stays as `FILE~`, whose
    /// path is returned, unless it was empty. Writing may go on after it.
    ///
    /// # Errors
    /// If what was written is not on the disk, or a file cannot be renamed; the target is then as it was.
    pub fn take_place(&mut self, keep: bool) -> io::Result<Option<PathBuf>> {
        self.file.sync_all()?;
        let held = keep && std::fs::metadata(&self.target).is_ok_and(|m| m.len() > 0);
        let backup = held.then(|| backup_of(&self.target));
        if let Some(backup) = &backup {
            match std::fs::remove_file(backup) {
                Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
                _ => {}
            }
            // Not every file system has hard links; without them there is a moment in which only the backup is there.
            std::fs::hard_link(&self.target, backup).or_else(|_| std::fs::rename(&self.target, backup))?;
        }
        std::fs::rename(&self.beside, &self.target)?;
        self.pending = false;
        Ok(backup)
    }

    /// Whether the target is this file already.
    pub fn is_in_place(&self) -> bool {
        !self.pending
    }
}

/// Locks a file as long as it is open, against another program that would take its place while it is written.
///
/// # Errors
/// [`io::ErrorKind::ResourceBusy`] if somebody has locked it. A file system without locks is no error.
fn lock(file: &File) -> io::Result<()> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            Err(io::Error::new(io::ErrorKind::ResourceBusy, "another program is writing it"))
        }
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

impl Write for Replacement {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Replacement {
    fn drop(&mut self) {
        if self.pending {
            let _ = std::fs::remove_file(&self.beside);
        }
    }
}

/// Replaces a file by one with this content: all of it, or nothing is changed. With `keep` the former file stays as
/// `FILE~`, whose path is returned.
///
/// # Errors
/// As [`Replacement::new`] and [`Replacement::take_place`], or if the content cannot be written.
pub fn replace(path: &Path, content: &[u8], keep: bool) -> io::Result<Option<PathBuf>> {
    let mut new = Replacement::new(path)?;
    new.write_all(content)?;
    new.take_place(keep)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An empty folder of its own for each test.
    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("tsa-files-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("made");
        folder
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).expect("a folder").flatten();
        let mut names: Vec<String> = entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn the_former_file_is_kept_and_others_are_left_alone() {
        let folder = folder("kept");
        let file = folder.join("x.bin");
        for (name, content) in [("x.bin", "old"), ("x.new", "other"), ("x.bin~", "older")] {
            std::fs::write(folder.join(name), content).expect("written");
        }
        assert_eq!(replace(&file, b"new", true).expect("replaced"), Some(folder.join("x.bin~")));
        let held = |name: &str| std::fs::read_to_string(folder.join(name)).expect("there");
        assert_eq!([held("x.bin"), held("x.new"), held("x.bin~")], ["new", "other", "old"]);
        assert_eq!(replace(&file, b"newer", false).expect("replaced"), None);
        assert_eq!([held("x.bin"), held("x.bin~")], ["newer", "old"]);
        assert_eq!(names(&folder), ["x.bin", "x.bin~", "x.new"]);
        std::fs::remove_dir_all(folder).expect("was there");
    }

    #[test]
    fn two_files_on_the_way_have_two_names() {
        let folder = folder("two");
        let (mut one, mut two) =
            (Replacement::new(&folder.join("x.a")).expect("one"), Replacement::new(&folder.join("x.b")).expect("two"));
        one.write_all(b"one").and_then(|()| two.write_all(b"two")).expect("written");
        assert_eq!(names(&folder).len(), 2);
        one.take_place(true).expect("in place");
        // Dropped before it took its place: its file is removed.
        drop(two);
        assert_eq!(names(&folder), ["x.a"]);
        // Written on, where it has taken its place.
        one.write_all(b" and more").expect("written");
        assert_eq!(std::fs::read_to_string(folder.join("x.a")).expect("there"), "one and more");
        // Nobody else takes its place as long as it is written.
        let refused = Replacement::new(&folder.join("x.a")).map(|_| ()).map_err(|e| e.kind());
        assert_eq!(refused, Err(io::ErrorKind::ResourceBusy));
        drop(one);
        assert!(Replacement::new(&folder.join("x.a")).is_ok());
        std::fs::remove_dir_all(folder).expect("was there");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link_and_its_target_is_replaced() {
        let folder = folder("links");
        std::fs::create_dir(folder.join("deep")).expect("made");
        std::fs::write(folder.join("deep/target"), "old").expect("written");
        for (to, link) in [("deep/target", "one"), ("one", "two"), ("deep/none", "dangling"), ("ring", "ring")] {
            std::os::unix::fs::symlink(to, folder.join(link)).expect("linked");
        }
        let backup = replace(&folder.join("two"), b"new", true).expect("replaced");
        assert_eq!(backup, Some(folder.join("deep/target~")));
        replace(&folder.join("dangling"), b"made", true).expect("made");
        let held = |name: &str| std::fs::read_to_string(folder.join(name)).expect("there");
        assert_eq!(
            [held("two"), held("deep/target"), held("deep/target~"), held("deep/none")],
            ["new", "new", "old", "made"]
        );
        for link in ["one", "two", "dangling"] {
            assert!(std::fs::symlink_metadata(folder.join(link)).expect("there").is_symlink(), "{link}");
        }
        assert!(replace(&folder.join("ring"), b"", true).is_err_and(|e| e.to_string().contains("links")));
        std::fs::remove_dir_all(folder).expect("was there");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_that_is_not_regular_is_named() {
        let folder = folder("kinds");
        let (fifo, socket) = (folder.join("fifo"), folder.join("socket"));
        assert!(std::process::Command::new("mkfifo").arg(&fifo).status().is_ok_and(|s| s.success()));
        let _listener = std::os::unix::net::UnixListener::bind(&socket).expect("a socket");
        for (path, named) in [
            (fifo.as_path(), "is a FIFO, not a regular file"),
            (&socket, "is a socket"),
            (&folder, "is a directory"),
            (Path::new("/dev/null"), "is a device"),
        ] {
            let refused = [read(path).err(), read_to_string(path).err(), replace(path, b"x", true).err()];
            for error in refused {
                let message = error.map(|e| e.to_string()).unwrap_or_default();
                assert!(message.contains(named), "{}: {message}", path.display());
            }
        }
        assert_eq!(read(&folder.join("none")).map_err(|e| e.kind()), Err(io::ErrorKind::NotFound));
        std::fs::remove_dir_all(folder).expect("was there");
    }
}
