//! `record`: telemetry with everything that is needed to run the experiment again.

use crate::failure::Failure;
use crate::log::{Header, Recorder};
use crate::options::Global;
use crate::options::values::of;
use crate::out_file::OutFile;
use crate::output::{Output, stdout};
use crate::play::{check_refused, play};
use crate::script::Script;
use crate::session::Wanted;
use crate::session::row::Entry;
use crate::units::Quantity;
use clap::Args;
use serde_json::{Map, Value, json};
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;

/// What to record, and the file.
#[derive(Debug, Clone, Args)]
pub struct Record {
    /// File to write [default: standard output]
    #[arg(long, value_name = "FILE.csv")]
    pub out: Option<PathBuf>,
    /// How long to record without a script (s)
    #[arg(long, value_name = "S", default_value = "10s", allow_hyphen_values = true, value_parser = of("seconds", Quantity::Time),
        conflicts_with = "script")]
    pub seconds: f64,
    /// Play this script meanwhile (format as for `play`); exit code 1 if a command of it was refused
    #[arg(long, value_name = "FILE")]
    pub script: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// If the script or the file is wrong, nobody answers, the port fails, or a command of the script was refused.
pub fn run(global: &Global, options: &Record, output: &mut Output) -> Result<(), Failure> {
    let seconds = options.seconds;
    if !(seconds > 0.0 && seconds.is_finite()) {
        return Err(Failure::Usage(format!("--seconds {seconds}: must be above 0")));
    }
    let (script, text) = options.script.as_deref().map(Script::load).transpose()?.unzip();
    let out = options.out.as_deref().map(OutFile::new).transpose()?;
    let target = global.target()?;
    let mut session = target.connect(Wanted::OfScene)?;
    let mut head = Header::new(&target, &session, "record")?;
    if let Some(path) = &options.script {
        head.add("script", path.display());
    }
    for (number, line) in (1..).zip(text.iter().flat_map(|text| text.lines())) {
        head.add(&format!("script.{number}"), line);
    }
    if output.json() && options.out.is_none() {
        let facts: Map<String, Value> = head.0.iter().map(|(k, v)| (k.clone(), Value::from(v.as_str()))).collect();
        output.object(&json!({"header": facts}))?;
    }
    let sink: Box<dyn Write> = match out {
        Some(file) => file.begin()?,
        None if output.json() => Box::new(io::sink()),
        None => stdout(),
    };
    let mut recorder = Recorder::new(sink, &head, &mut session)?;
    let script = script.unwrap_or_else(|| Script::idle(session.now_s() + seconds));
    let rows_out = output.json() && options.out.is_none();
    let result = play(&mut session, &script, global.board.seed, |session, messages| {
        messages.iter().for_each(|line| crate::output::say!("{line}"));
        for entry in recorder.take()? {
            if let (Entry::Row(row), true) = (entry, rows_out) {
                output.object(&row)?;
            }
        }
        // The recorder has them all; here they would only accumulate.
        session.take_rows();
        session.take_events();
        session.take_log();
        Ok(ControlFlow::Continue(()))
    });
    let (rows, refused) = recorder.end(&session, result)?;
    let lost = session.lost_rows();
    let frames = session.link.lost_frames();
    let summary = json!({"rows": rows, "lost_rows": lost, "lost_frames": frames, "seconds": session.now_s(),
        "file": options.out.as_ref().map(|p| p.display().to_string())});
    output.object(&json!({"summary": summary}))?;
    if let Some(path) = &options.out {
        output.line(format!("{rows} rows, {lost} rows lost on the way; written: {}", path.display()))?;
    }
    check_refused(refused)
}
