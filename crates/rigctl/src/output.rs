//! Standard output: either lines for people or JSON objects, one a line.

use crate::failure::Failure;
use indicatif::{ProgressBar, ProgressStyle};
use rig_scene::files::{self, Replacement};
use serde::Serialize;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};

/// The reader of standard output has gone: who says `rigctl … | head` has seen enough.
#[derive(Debug, thiserror::Error)]
#[error("nobody reads the output any more")]
pub struct ReaderGone;

/// Pieces of output (8 KiB each, the buffer's size) that wait for a slow reader before the tool waits for it as well: a
/// quarter of an hour of a real board's telemetry.
const PIECES: usize = 4096;

/// Standard output, written by a thread of its own: a reader that is slow, or stops to look, must not keep the tool from
/// its heartbeats to a real board. A broken pipe is told from that of a serial line.
struct Stdout {
    pieces: SyncSender<Piece>,
    failed: Receiver<io::Error>,
}

enum Piece {
    Bytes(Vec<u8>),
    /// Everything before it has to be out; then this is dropped.
    Flush(Sender<()>),
}

impl Stdout {
    /// Writes to any sink.
    fn new(mut sink: impl Write + Send + 'static) -> Self {
        let (pieces, queue) = mpsc::sync_channel(PIECES);
        let (tell, failed) = mpsc::channel();
        std::thread::spawn(move || {
            for piece in queue {
                // Who waits for a flush goes on when this is dropped, and then has to find the error.
                let (written, _done) = match piece {
                    Piece::Bytes(bytes) => (sink.write_all(&bytes), None),
                    Piece::Flush(done) => (sink.flush(), Some(done)),
                };
                if let Err(error) = written {
                    // Whoever writes next sees that the queue has ended, and asks why.
                    let _ = tell.send(marked(error));
                    return;
                }
            }
        });
        Self { pieces, failed }
    }

    fn why(&self) -> io::Error {
        self.failed.recv().unwrap_or_else(|_| io::ErrorKind::BrokenPipe.into())
    }
}

impl Write for Stdout {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.pieces.send(Piece::Bytes(bytes.to_vec())).map_err(|_| self.why())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let (done, waits) = mpsc::channel();
        self.pieces.send(Piece::Flush(done)).map_err(|_| self.why())?;
        // Nothing is ever sent: the other end is dropped when all is out, or when the thread has failed.
        let _ = waits.recv();
        match self.failed.try_recv() {
            Ok(error) => Err(error),
            Err(_) => Ok(()),
        }
    }
}

fn marked(error: io::Error) -> io::Error {
    if error.kind() == io::ErrorKind::BrokenPipe { io::Error::new(error.kind(), ReaderGone) } else { error }
}

/// Standard output, buffered.
pub fn stdout() -> Box<dyn Write> {
    Box::new(BufWriter::new(Stdout::new(io::stdout())))
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
pub struct OutFile(PathBuf);

impl OutFile {
    /// Looks whether this place can be written to. Nothing is left there by it.
    ///
    /// # Errors
    /// Naming the file.
    pub fn new(path: &Path) -> Result<Self, Failure> {
        Replacement::new(path).map_err(|e| unwritable(path, &e))?;
        Ok(Self(path.to_owned()))
    }

    /// Begins to write. The file takes its place when its first bytes are on the disk, so that it can be followed while it
    /// grows; where what was there is kept is then said.
    ///
    /// # Errors
    /// Naming the file.
    pub fn begin(self) -> Result<Box<dyn Write>, Failure> {
        let new = Replacement::new(&self.0).map_err(|e| unwritable(&self.0, &e))?;
        Ok(Box::new(BufWriter::new(Growing { path: self.0, new })))
    }

    /// Writes all of it, or changes nothing.
    ///
    /// # Errors
    /// Naming the file.
    pub fn write(self, content: &str) -> Result<(), Failure> {
        let kept = files::replace(&self.0, content.as_bytes(), true).map_err(|e| unwritable(&self.0, &e))?;
        say_kept(&self.0, kept);
        Ok(())
    }
}

fn unwritable(path: &Path, error: &io::Error) -> Failure {
    Failure::failed(format!("cannot write {}: {error}", path.display()))
}

fn say_kept(path: &Path, kept: Option<PathBuf>) {
    if let Some(kept) = kept {
        eprintln!("what {} held is now {}", path.display(), kept.display());
    }
}

/// A file that grows in its place from its first bytes on.
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
            say_kept(&self.path, kept);
        }
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.new.flush()
    }
}

/// Makes a folder if need be, before what is to go there takes its time.
///
/// # Errors
/// Naming the folder.
pub fn folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|e| Failure::failed(format!("cannot write into {}: {e}", folder.display())))
}

/// Writes a file into a folder, which is made if need be. What the file held is kept as `FILE~`.
///
/// # Errors
/// Naming the file.
pub fn write_file(folder: &Path, name: &str, content: &str) -> Result<(), Failure> {
    let path = folder.join(name);
    self::folder(folder)?;
    OutFile(path).write(content)
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
