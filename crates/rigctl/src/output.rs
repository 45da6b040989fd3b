//! Standard output: either lines for people or JSON objects, one a line.

use crate::failure::Failure;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Where results go.
pub struct Output {
    json: bool,
    sink: Box<dyn Write>,
}

impl Output {
    /// On standard output.
    pub fn stdout(json: bool) -> Self {
        Self::new(json, Box::new(BufWriter::new(io::stdout())))
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

/// Writes a file into a folder, which is made if need be.
///
/// # Errors
/// Naming the file.
pub fn write_file(folder: &Path, name: &str, content: &str) -> Result<(), Failure> {
    let path = folder.join(name);
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&path, content))
        .map_err(|e| Failure::failed(format!("cannot write {}: {e}", path.display())))
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
