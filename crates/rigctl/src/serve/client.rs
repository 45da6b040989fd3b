//! One connection: a thread that reads its lines, and one that writes what is queued for it.

use super::lines::{self, Line};
use super::outbox::Outbox;
use std::io::{self, BufReader, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::thread::JoinHandle;

/// Lines of a client that wait for the server; then the client waits. No client can keep the server from the others.
const INBOX: usize = 16;

/// A connected client.
pub struct Client {
    /// Its number, never used again.
    pub number: u64,
    /// Lines to it.
    pub outbox: Arc<Outbox>,
    /// Lines from it; none once it sends no more.
    inbox: Option<Receiver<Line>>,
    stream: UnixStream,
    writing: JoinHandle<()>,
}

impl Client {
    /// Starts the threads of a connection.
    ///
    /// # Errors
    /// If the process has no handle or thread left.
    pub fn start(number: u64, stream: UnixStream) -> io::Result<Self> {
        let (reading, mut sink) = (stream.try_clone()?, stream.try_clone()?);
        let (to_inbox, inbox) = mpsc::sync_channel(INBOX);
        std::thread::Builder::new().spawn(move || {
            let mut input = BufReader::new(reading);
            while let Ok(Some(line)) = lines::next(&mut input) {
                if to_inbox.send(line).is_err() {
                    return;
                }
            }
        })?;
        let outbox = Arc::new(Outbox::default());
        let queue = Arc::clone(&outbox);
        let writing = std::thread::Builder::new().spawn(move || {
            while let Some(lines) = queue.take() {
                let mut text = String::new();
                lines.iter().for_each(|line| {
                    text.push_str(line);
                    text.push('\n');
                });
                if sink.write_all(text.as_bytes()).is_err() {
                    queue.close();
                    return;
                }
            }
        })?;
        Ok(Self { number, outbox, inbox: Some(inbox), stream, writing })
    }

    /// Lines that it has sent since the last call.
    pub fn lines(&mut self) -> Vec<Line> {
        let mut lines = Vec::new();
        while let Some(inbox) = &self.inbox {
            match inbox.try_recv() {
                Ok(line) => lines.push(line),
                Err(TryRecvError::Disconnected) => self.inbox = None,
                Err(TryRecvError::Empty) => break,
            }
            if lines.len() == INBOX {
                break;
            }
        }
        lines
    }

    /// Whether it sends no more. It may still read.
    pub fn is_silent(&self) -> bool {
        self.inbox.is_none()
    }

    /// Whether everything that was queued is out, or cannot go out.
    pub fn is_written(&self) -> bool {
        self.writing.is_finished()
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        // Both threads may wait for the other end.
        self.outbox.close();
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}
