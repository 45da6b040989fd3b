//! Writing a log.

use super::Header;
use crate::failure::Failure;
use crate::request;
use crate::session::Session;
use crate::session::row::{Entry, Row};
use rig_link::EventKind;
use serde::Serialize;
use std::io::Write;
use std::sync::mpsc::Receiver;

/// Writes a header, then everything that passes in a session.
pub struct Recorder<W: Write> {
    sink: W,
    entries: Receiver<Entry>,
    ended: Ended,
}

/// What a log holds, and what was lost while it was written.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Ended {
    /// Rows.
    pub rows: u64,
    /// Rows that the board has made and that never came.
    pub lost_rows: u64,
    /// Frames that never came.
    pub lost_frames: u32,
}

impl Ended {
    /// Nothing, in a session that has lost so much.
    fn of(session: &Session) -> Self {
        Self { rows: 0, lost_rows: session.lost_rows(), lost_frames: session.link.lost_frames() }
    }
}

impl<W: Write> Recorder<W> {
    /// Writes the header. `entries` is what [`Session::watch`] returns; the log contains everything from that call on.
    ///
    /// # Errors
    /// If the sink fails.
    pub fn new(mut sink: W, header: &Header, entries: Receiver<Entry>, session: &Session) -> Result<Self, Failure> {
        for (key, value) in &header.0 {
            writeln!(sink, "# {key} = {value}")?;
        }
        Ok(Self { sink, entries, ended: Ended::of(session) })
    }

    /// Writes everything that has passed since the last call, and returns it.
    ///
    /// # Errors
    /// If the sink fails.
    pub fn take(&mut self) -> Result<Vec<Entry>, Failure> {
        let entries: Vec<Entry> = self.entries.try_iter().collect();
        for entry in &entries {
            match entry {
                Entry::Row(row) => self.row(row)?,
                Entry::Request(t_s, request) => {
                    if let Some(text) = request::text(request) {
                        self.comment(format_args!("at {t_s} request {text}"))?;
                    }
                }
                Entry::Event(t_s, kind) => self.comment(format_args!("at {t_s} event {}", event(kind)))?,
            }
        }
        Ok(entries)
    }

    fn row(&mut self, row: &Row) -> Result<(), Failure> {
        // A writer for each row, so that comments can go between them.
        let mut line = csv::WriterBuilder::new().has_headers(self.ended.rows == 0).from_writer(Vec::new());
        line.serialize(row)?;
        self.sink.write_all(&line.into_inner().map_err(|e| e.into_error())?)?;
        self.ended.rows += 1;
        Ok(())
    }

    /// Writes a line that readers of CSV pass over.
    ///
    /// # Errors
    /// If the sink fails.
    pub fn comment(&mut self, text: impl std::fmt::Display) -> Result<(), Failure> {
        Ok(writeln!(self.sink, "# {text}")?)
    }

    /// Ends the log and returns what it holds. A failure that broke it off is written, too.
    ///
    /// # Errors
    /// If the sink fails, or the failure that broke it off.
    pub fn end<T>(mut self, session: &Session, result: Result<T, Failure>) -> Result<(Ended, T), Failure> {
        self.take()?;
        if let Some(message) = result.as_ref().err().and_then(Failure::message) {
            self.comment(format_args!("broken_off = {}", message.replace(['\r', '\n'], " ")))?;
        }
        let (before, now) = (self.ended, Ended::of(session));
        let ended = Ended {
            lost_rows: now.lost_rows - before.lost_rows,
            lost_frames: now.lost_frames - before.lost_frames,
            ..before
        };
        self.comment(format_args!("lost_frames = {}", ended.lost_frames))?;
        self.comment(format_args!("lost_rows = {}", ended.lost_rows))?;
        self.comment(format_args!("end rows = {}", ended.rows))?;
        self.sink.flush()?;
        result.map(|value| (ended, value))
    }
}

/// How the line of a homing begins; its result follows as JSON.
pub const HOMED: &str = "homed ";

/// An event as a line of the log: its name, then what belongs to it.
pub fn event(kind: &EventKind) -> String {
    match kind {
        EventKind::Homed(found) => format!("{HOMED}{}", serde_json::to_string(found).unwrap_or_default()),
        EventKind::HomingRefused(failure) => format!("homing-refused {failure}"),
        EventKind::MoveDone { error_m } => format!("move-done error_m={error_m}"),
        EventKind::Stopped => "stopped".into(),
        EventKind::DirectionProven => "direction-proven".into(),
        EventKind::StreamEnded(end) => format!("stream-ended {end}"),
        EventKind::FaultRaised(fault) => format!("fault-raised {fault}"),
        EventKind::FaultCleared(fault) => format!("fault-cleared {fault}"),
        EventKind::EStopOpened => "estop-opened".into(),
        EventKind::EStopClosed => "estop-closed".into(),
        other => format!("{other:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_link::{Fault, HomingFailure};

    #[test]
    fn events_have_their_words() {
        for (kind, words) in [
            (EventKind::HomingRefused(HomingFailure::PoorFit), format!("homing-refused {}", HomingFailure::PoorFit)),
            (EventKind::FaultRaised(Fault::DriveStall), "fault-raised drive-stall".into()),
            (EventKind::MoveDone { error_m: 0.5 }, "move-done error_m=0.5".into()),
        ] {
            assert_eq!(event(&kind), words);
        }
    }
}
