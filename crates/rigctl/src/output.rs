//! Standard output: either lines for people or JSON objects, one a line.

use crate::failure::Failure;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// The reader of standard output has gone: who says `rigctl … | head` has seen enough.
#[derive(Debug, thiserror::Error)]
#[error("nobody reads the output any more")]
pub struct ReaderGone;

/// Standard output, whose broken pipe is told from that of a serial line.
struct Stdout(io::Stdout);

impl Write for Stdout {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes).map_err(marked)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush().map_err(marked)
    }
}

fn marked(error: io::Error) -> io::Error {
    if error.kind() == io::ErrorKind::BrokenPipe { io::Error::new(error.kind(), ReaderGone) } else { error }
}

/// Standard output, buffered.
pub fn stdout() -> Box<dyn Write> {
    Box::new(BufWriter::new(Stdout(io::stdout())))
}

/// Where results go.
pub struct Output {
    json: bool,
    sink: Box<dyn Write>,
}

impl Output {
    /// On standard output.
    pub fn stdout(json: bool) -> Self {
        Self::new(json, stdout())
    }

    /// On any sink.
    pub fn new(json: bool, sink: Box<dyn Write>) -> Self {
        Self { json, sink }
    }

    /// Whether JSON was asked for.
    pub fn json(&self) -> bool {
        self.json
    }

    /// An object; printed with `--json` only.
    ///
    /// # Errors
    /// If the sink fails.
    pub fn object(&mut self, object: &impl Serialize) -> io::Result<()> {
        if self.json {
            serde_json::to_writer(&mut self.sink, object)?;
            self.sink.write_all(b"\n")?;
        }
        Ok(())
    }

    /// A line for people; nothing with `--json`.
    ///
    /// # Errors
    /// If the sink fails.
    pub fn line(&mut self, line: impl AsRef<str>) -> io::Result<()> {
        if !self.json {
            writeln!(self.sink, "{}", line.as_ref())?;
        }
        Ok(())
    }

    /// Empties the buffer.
    ///
    /// # Errors
    /// If the sink fails.
    pub fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}

/// A file that will be written once there is something to write. That it can be is known at once; what it holds stays
/// until then, and beside it as `FILE~` after that: it may be a recorded experiment.
pub struct OutFile {
    path: PathBuf,
    made_here: bool,
}

impl OutFile {
    /// Looks whether this place can be written to.
    ///
    /// # Errors
    /// Naming the file.
    pub fn new(path: &Path) -> Result<Self, Failure> {
        let made_here = !path.exists();
        let open = OpenOptions::new().append(true).create(true).open(path);
        open.map_err(|e| Failure::failed(format!("cannot write {}: {e}", path.display())))?;
        Ok(Self { path: path.to_owned(), made_here })
    }

    /// Begins to write; says where it keeps what was there.
    ///
    /// # Errors
    /// Naming the file.
    pub fn begin(mut self) -> Result<Box<dyn Write>, Failure> {
        self.made_here = false;
        let path = &self.path;
        let held = std::fs::symlink_metadata(path).is_ok_and(|m| m.is_file() && m.len() > 0);
        let begun = (|| {
            if held {
                let mut kept = path.clone().into_os_string();
                kept.push("~");
                std::fs::rename(path, &kept)?;
                eprintln!("what {} held is now {}", path.display(), Path::new(&kept).display());
            }
            File::create(path)
        })();
        let file = begun.map_err(|e| Failure::failed(format!("cannot write {}: {e}", path.display())))?;
        Ok(Box::new(BufWriter::new(file)))
    }

    /// Writes all of it.
    ///
    /// # Errors
    /// Naming the file.
    pub fn write(self, content: &str) -> Result<(), Failure> {
        let path = self.path.clone();
        let mut file = self.begin()?;
        let written = file.write_all(content.as_bytes()).and_then(|()| file.flush());
        written.map_err(|e| Failure::failed(format!("cannot write {}: {e}", path.display())))
    }
}

impl Drop for OutFile {
    fn drop(&mut self) {
        // Nothing came to be written.
        if self.made_here {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Makes a folder if need be, before what is to go there takes its time.
///
/// # Errors
/// Naming the folder.
pub fn folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|e| Failure::failed(format!("cannot write into {}: {e}", folder.display())))
}

/// Writes a file into a folder, which is made if need be.
///
/// # Errors
/// Naming the file.
pub fn write_file(folder: &Path, name: &str, content: &str) -> Result<(), Failure> {
    let path = folder.join(name);
    self::folder(folder)?;
    std::fs::write(&path, content).map_err(|e| Failure::failed(format!("cannot write {}: {e}", path.display())))
}

/// Lines of comma-separated cells under a header, quoted where need be.
///
/// # Errors
/// If a line has another number of cells than the header.
pub fn csv_text(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> Result<String, Failure> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(header)?;
    for row in rows {
        writer.write_record(row)?;
    }
    Ok(String::from_utf8(writer.into_inner().map_err(|e| e.into_error())?)?)
}

/// A progress line on standard error; silent without a terminal.
pub fn progress(length: u64, text: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    // The template is a constant; were it wrong, the default style would do.
    if let Ok(style) = ProgressStyle::with_template("{prefix} [{bar:32}] {msg}") {
        bar.set_style(style);
    }
    bar.set_prefix(text);
    bar
}
