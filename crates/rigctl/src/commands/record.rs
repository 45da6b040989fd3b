//! `record`: what a board sends, kept with what it takes to run it again.

use super::operate::connect;
use super::simulate::{play_events, read};
use crate::cli::{Global, Record};
use crate::failure::Failure;
use crate::log::{Entry, Header, Recorder};
use crate::output::{OutFile, Output, stdout};
use crate::script::Script;
use crate::session::Session;
use serde_json::{Map, Value, json};
use std::io::{self, Write};
use std::ops::ControlFlow;

/// The head for a session that has greeted its board.
///
/// # Errors
/// If the board has not said who it is and how it is set, or the scene cannot be read.
pub fn header(global: &Global, session: &Session, command: &str) -> Result<Header, Failure> {
    let board = session.identity().ok_or_else(|| Failure::failed("the board did not say who it is"))?;
    let settings = session.known_settings().ok_or_else(|| Failure::failed("the board did not tell its settings"))?;
    Ok(Header::new(global, super::scene(global)?.hash(), board, settings, command))
}

/// Runs the command.
///
/// # Errors
/// If the script or the file is wrong, nobody answers, or the port fails.
pub fn run(global: &Global, options: &Record, output: &mut Output) -> Result<(), Failure> {
    let seconds = options.seconds;
    if !(seconds > 0.0 && seconds.is_finite()) {
        return Err(Failure::Usage(format!("--seconds {seconds}: must be above 0")));
    }
    let (script, text) = options.script.as_deref().map(read).transpose()?.unzip();
    let out = options.out.as_deref().map(OutFile::new).transpose()?;
    let mut session = connect(global)?;
    let mut head = header(global, &session, "record")?;
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
    let mut recorder = Recorder::new(sink, &head)?;
    session.keep_journal();
    let script = script.unwrap_or_else(|| Script::idle(session.now_s() + seconds));
    let rows_out = output.json() && options.out.is_none();
    let result = play_events(&mut session, &script, global.seed, |session, said| {
        said.iter().for_each(|line| eprintln!("{line}"));
        for entry in recorder.take(session)? {
            if let (Entry::Row(row), true) = (entry, rows_out) {
                output.object(&row)?;
            }
        }
        // The journal has them all; here they would only pile up.
        session.take_rows();
        session.take_events();
        session.take_log();
        Ok(ControlFlow::Continue(()))
    });
    let rows = recorder.end(&mut session, result.map(drop))?;
    let summary = json!({"rows": rows, "lost_frames": session.lost_frames(), "seconds": session.now_s(),
        "file": options.out.as_ref().map(|p| p.display().to_string())});
    output.object(&json!({"summary": summary}))?;
    if let Some(path) = &options.out {
        output.line(format!(
            "{rows} rows, {} frames lost on the way; written: {}",
            session.lost_frames(),
            path.display()
        ))?;
    }
    Ok(())
}
