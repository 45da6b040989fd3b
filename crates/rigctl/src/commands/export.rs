//! `export`: a recorded log in the format of another tool.

use crate::export::{Format, Table};
use crate::failure::Failure;
use crate::log::Log;
use crate::out_file::OutFile;
use crate::output::Output;
use clap::Args;
use serde_json::json;
use std::path::PathBuf;

/// Convert a log to MCAP (Foxglove, PlotJuggler) or to CSV without comment lines
///
/// Every column of the log, in SI units. In MCAP an empty cell is an absent key, the header is the file's metadata, and
/// requests and events are messages of `/log`. docs/how-to/integrate.md shows how to open the files, and how Python
/// writes Parquet. Example: `rigctl export run.csv --to mcap --out run.mcap`
#[derive(Debug, Clone, Args)]
pub struct Export {
    /// Log of `record` or `sweep`
    #[arg(value_name = "LOG.csv")]
    pub log: PathBuf,
    /// Format of the file
    #[arg(long, value_name = "mcap|csv", hide_possible_values = true)]
    pub to: Format,
    /// File to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Also if the log was cut short: its whole rows
    #[arg(long)]
    pub partial: bool,
}

/// Runs the command.
///
/// # Errors
/// If the log is none, was cut short or has no rows, or the file cannot be written; names the file.
pub fn run(options: &Export, output: &mut Output) -> Result<(), Failure> {
    let (log, out) = (&options.log, &options.out);
    if out.canonicalize().is_ok_and(|out| log.canonicalize().is_ok_and(|log| log == out)) {
        return Err(Failure::Usage(format!("--out {} is the log itself", out.display())));
    }
    let file = OutFile::new(out)?;
    let wrong = |what: String| Failure::failed(format!("log {}: {what}", log.display()));
    let text = Log::text(log).map_err(wrong)?;
    let table = Table::read(&text, options.partial).map_err(wrong)?;
    let content = options.to.encode(&table).map_err(wrong)?;
    file.write(&content)?;
    let (rows, marks, bytes) = (table.log.rows.len(), table.marks().count(), content.len());
    output.object(&json!({"file": out.display().to_string(), "rows": rows, "marks": marks, "bytes": bytes}))?;
    Ok(output.line(format!("{rows} rows, {bytes} bytes; written: {}", out.display()))?)
}
