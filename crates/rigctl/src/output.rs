//! Standard output: either lines for people or JSON objects, one object a line; and progress on standard error.

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::{self, BufWriter, Write};
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};

/// Writes a line to standard error. What cannot be written, as on a full disk, is left out: `eprintln!` would panic, and the stop
/// that a command was about to send would never be sent.
macro_rules! say {
    ($($text:tt)*) => {{
        let _ = std::io::Write::write_fmt(&mut std::io::stderr(), format_args!("{}\n", format_args!($($text)*)));
    }};
}
pub(crate) use say;

/// The reader of standard output has gone, as in `rigctl … | head`.
#[derive(Debug, thiserror::Error)]
#[error("nobody reads the output any more")]
pub struct ReaderGone;

/// Pieces of output (8 KiB each, the buffer's size) that wait for a slow reader before the tool waits for it as well: a
/// quarter of an hour of a real board's telemetry.
const PIECES: usize = 4096;

/// Standard output, written by a thread of its own: a slow reader must not keep the tool from its heartbeats to a real
/// board. Its broken pipe is marked, to distinguish it from that of a serial line.
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
        let (report, failed) = mpsc::channel();
        std::thread::spawn(move || {
            for piece in queue {
                // The caller of a flush goes on when this is dropped, and must then find the error.
                let (written, _done) = match piece {
                    Piece::Bytes(bytes) => (sink.write_all(&bytes), None),
                    Piece::Flush(done) => (sink.flush(), Some(done)),
                };
                if let Err(error) = written {
                    // The next write finds the queue closed, and fetches the error.
                    let _ = report.send(marked(error));
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

/// The results of a command.
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

    /// Named values for people, a line each; one without text is left out.
    ///
    /// # Errors
    /// If the sink fails.
    pub fn named<const N: usize>(&mut self, values: [(&str, String); N]) -> io::Result<()> {
        let mut values = values.iter().filter(|(_, value)| !value.is_empty());
        values.try_for_each(|(name, value)| self.line(format!("{name:<15} {value}")))
    }

    /// Empties the buffer.
    ///
    /// # Errors
    /// If the sink fails.
    pub fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}

/// The time (s) that a line begins with.
pub fn at(t_s: f64) -> String {
    format!("{t_s:8.2} s")
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
/// An f32 for JSON: its shortest decimal, without the digits that a conversion to f64 would add.
pub fn decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}
