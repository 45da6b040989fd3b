//! One connection: a thread that reads its lines, and one that writes what is queued for it.
//!
//! A client that reads too slowly loses whole lines and is told how many; neither the rig nor the other clients wait for it.

use serde_json::json;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, SyncSender, TryRecvError, TrySendError};
use std::thread::JoinHandle;

/// Lines of a client that wait for the server; then the client waits. No client can keep the server from the others.
const INBOX: usize = 16;
/// Lines of telemetry that wait for a client: two and a half seconds of them. The socket's own buffer holds more.
const TELEMETRY: usize = 256;
/// Lines of any kind. A client that does not even read the answers to its own orders is disconnected.
const ALL: usize = 2 * TELEMETRY;
/// Longest line of a client (bytes, without its end). The longest order that makes sense has about 150.
pub const LONGEST: usize = 4096;

/// What came up to the end of a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Line {
    /// A line without its end.
    Whole(Vec<u8>),
    /// More than [`LONGEST`] bytes, which are gone.
    TooLong,
}

/// Reads up to the next line end. `None` is the end of the input; a last line without a line end was cut and is dropped.
///
/// # Errors
/// If the input fails.
pub fn next(input: &mut impl BufRead) -> io::Result<Option<Line>> {
    let mut line = Vec::new();
    Read::by_ref(input).take(LONGEST as u64 + 1).read_until(b'\n', &mut line)?;
    if line.pop_if(|byte| *byte == b'\n').is_some() {
        return Ok(Some(Line::Whole(line)));
    }
    Ok((line.len() > LONGEST && input.skip_until(b'\n')? > 0).then_some(Line::TooLong))
}

/// Lines that wait for one client.
pub struct Outbox {
    /// None once it is closed; what is queued still goes out.
    lines: Option<SyncSender<Arc<str>>>,
    waiting: Arc<AtomicUsize>,
    /// Lines that were lost since the last one that was queued.
    lost: u64,
}

/// The other end of an [`Outbox`].
struct Queue {
    lines: Receiver<Arc<str>>,
    waiting: Arc<AtomicUsize>,
}

impl Queue {
    /// Waits for a line; `None` once the outbox is closed and empty.
    fn next(&self) -> Option<Arc<str>> {
        let line = self.lines.recv().ok()?;
        self.waiting.fetch_sub(1, Ordering::Relaxed);
        Some(line)
    }
}

impl Outbox {
    fn new() -> (Self, Queue) {
        let ((sender, lines), waiting) = (mpsc::sync_channel(ALL), Arc::new(AtomicUsize::new(0)));
        (Self { lines: Some(sender), waiting: Arc::clone(&waiting), lost: 0 }, Queue { lines, waiting })
    }

    /// Queues a line that may be lost. `{"lost": n}` goes ahead of the first one after `n` lost ones.
    pub fn offer(&mut self, line: &Arc<str>) {
        if self.waiting.load(Ordering::Relaxed) >= TELEMETRY {
            self.lost += 1;
            return;
        }
        let lost = std::mem::take(&mut self.lost);
        if lost > 0 {
            self.send(json!({"lost": lost}).to_string());
        }
        self.send(Arc::clone(line));
    }

    /// Queues a line that must not be lost: an answer or an event. A client that has no room for it is disconnected.
    pub fn send(&mut self, line: impl Into<Arc<str>>) {
        self.waiting.fetch_add(1, Ordering::Relaxed);
        let sent = self.lines.as_ref().map(|lines| lines.try_send(line.into()));
        if matches!(sent, Some(Err(TrySendError::Full(_)))) {
            self.close();
        }
    }

    /// Nothing more is queued; what is queued still goes out.
    pub fn close(&mut self) {
        self.lines = None;
    }
}

/// A connected client.
pub struct Client {
    /// Its number, never used again.
    pub number: u64,
    /// Lines to it.
    pub outbox: Outbox,
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
            while let Ok(Some(line)) = next(&mut input) {
                if to_inbox.send(line).is_err() {
                    return;
                }
            }
        })?;
        let (outbox, queue) = Outbox::new();
        let writing = std::thread::Builder::new().spawn(move || {
            while queue.next().is_some_and(|line| sink.write_all(format!("{line}\n").as_bytes()).is_ok()) {}
            // What a client sent before it stopped reading still counts, and nothing after that.
            let _ = sink.shutdown(Shutdown::Read);
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

    /// Whether it reads nothing, or has closed its end and all that it sent before has been read.
    pub fn is_gone(&self) -> bool {
        self.outbox.lines.is_none() || (self.is_written() && self.is_silent())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_bounded_and_a_long_one_loses_only_itself() {
        let long = "x".repeat(LONGEST + 1);
        let fits = "y".repeat(LONGEST);
        let text = format!("one\n\n{long}\n{fits}\n{}\ntwo\nthree without an end", long.repeat(100));
        // A buffer smaller than a line, so that lines come in pieces.
        let mut input = BufReader::with_capacity(7, text.as_bytes());
        let mut lines = Vec::new();
        while let Some(line) = next(&mut input).expect("text") {
            lines.push(line);
        }
        let whole = |text: &str| Line::Whole(text.into());
        assert_eq!(lines, [whole("one"), whole(""), Line::TooLong, whole(&fits), Line::TooLong, whole("two")]);
    }

    fn offer(outbox: &mut Outbox, numbers: std::ops::Range<usize>) {
        numbers.for_each(|k| outbox.offer(&k.to_string().into()));
    }

    #[test]
    fn a_slow_reader_loses_whole_lines_and_is_told_how_many() {
        let (mut outbox, queue) = Outbox::new();
        offer(&mut outbox, 0..TELEMETRY + 17);
        (0..TELEMETRY).for_each(|k| assert_eq!(queue.next().as_deref(), Some(&*k.to_string()), "the first are kept"));
        offer(&mut outbox, 1000..1002);
        ["{\"lost\":17}", "1000", "1001"].iter().for_each(|line| assert_eq!(queue.next().as_deref(), Some(*line)));
    }

    #[test]
    fn what_a_client_sent_is_read_although_it_is_gone_by_then() {
        let closes: [fn(UnixStream) -> Option<UnixStream>; 2] =
            [|_| None, |far| far.shutdown(Shutdown::Read).is_ok().then_some(far)];
        for close in closes {
            let (near, mut far) = UnixStream::pair().expect("a pair");
            let mut client = Client::start(1, near).expect("a client");
            // More lines than wait for the server, so that some are still unread once nothing can go out.
            far.write_all("line\n".repeat(3 * INBOX).as_bytes()).expect("sent");
            let _half_closed = close(far);
            while !client.is_written() {
                client.outbox.offer(&"telemetry".into());
                std::thread::yield_now();
            }
            let mut read = 0;
            while !client.is_gone() {
                read += client.lines().len();
                client.outbox.offer(&"telemetry".into());
            }
            assert_eq!(read, 3 * INBOX);
        }
    }

    #[test]
    fn answers_go_out_beside_lost_telemetry_until_nobody_reads_at_all() {
        let (mut outbox, queue) = Outbox::new();
        offer(&mut outbox, 0..2 * TELEMETRY);
        (TELEMETRY..ALL).for_each(|_| outbox.send("answer"));
        assert!(outbox.lines.is_some());
        outbox.send("one too many");
        assert!(outbox.lines.is_none());
        // What was queued before the end goes out.
        assert_eq!(std::iter::from_fn(|| queue.next()).count(), ALL);
    }
}
