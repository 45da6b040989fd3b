//! Lines on their way to one client. A client that reads too slowly loses whole lines and is told how many; neither the rig
//! nor the other clients wait for it.

use serde_json::json;
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Lines of telemetry that wait for a client: two and a half seconds of them. The socket's own buffer holds more.
pub const TELEMETRY: usize = 256;
/// Lines of any kind. A client that does not even read the answers to its own orders is disconnected.
pub const ALL: usize = 2 * TELEMETRY;

#[derive(Default)]
struct Queue {
    lines: VecDeque<Arc<str>>,
    /// Lines that were lost since the last one that was queued.
    lost: u64,
    closed: bool,
}

/// Lines that wait for one client.
#[derive(Default)]
pub struct Outbox {
    queue: Mutex<Queue>,
    changed: Condvar,
}

impl Outbox {
    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Queues a line that may be lost. `{"lost": n}` goes ahead of the first one after `n` lost ones.
    pub fn offer(&self, line: &Arc<str>) {
        let mut queue = self.queue();
        if queue.lines.len() >= TELEMETRY {
            queue.lost += 1;
            return;
        }
        let lost = std::mem::take(&mut queue.lost);
        if lost > 0 {
            queue.lines.push_back(json!({"lost": lost}).to_string().into());
        }
        queue.lines.push_back(Arc::clone(line));
        self.changed.notify_one();
    }

    /// Queues a line that must not be lost: an answer or an event. A client that has no room for it is disconnected.
    pub fn send(&self, line: impl Into<Arc<str>>) {
        let mut queue = self.queue();
        if queue.lines.len() >= ALL {
            queue.lines.clear();
            queue.closed = true;
        } else {
            queue.lines.push_back(line.into());
        }
        self.changed.notify_one();
    }

    /// Nothing more is queued; what is queued still goes out.
    pub fn close(&self) {
        self.queue().closed = true;
        self.changed.notify_one();
    }

    /// Whether it was closed.
    pub fn is_closed(&self) -> bool {
        self.queue().closed
    }

    /// Waits for lines and takes all of them; `None` once it is closed and empty.
    pub fn take(&self) -> Option<VecDeque<Arc<str>>> {
        let mut queue = self.queue();
        while queue.lines.is_empty() {
            if queue.closed {
                return None;
            }
            queue = self.changed.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
        Some(std::mem::take(&mut queue.lines))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offer(outbox: &Outbox, numbers: std::ops::Range<usize>) {
        numbers.for_each(|k| outbox.offer(&k.to_string().into()));
    }

    #[test]
    fn a_slow_reader_loses_whole_lines_and_is_told_how_many() {
        let outbox = Outbox::default();
        offer(&outbox, 0..TELEMETRY + 17);
        let first = outbox.take().expect("lines");
        assert_eq!(
            (first.len(), first.back().map(|line| &**line)),
            (TELEMETRY, Some("255")),
            "the first ones are kept"
        );
        offer(&outbox, 1000..1002);
        let next: Vec<String> = outbox.take().expect("lines").iter().map(|line| line.to_string()).collect();
        assert_eq!(next, ["{\"lost\":17}", "1000", "1001"]);
    }

    #[test]
    fn answers_go_out_beside_lost_telemetry_until_nobody_reads_at_all() {
        let outbox = Outbox::default();
        offer(&outbox, 0..2 * TELEMETRY);
        (TELEMETRY..ALL).for_each(|_| outbox.send("answer"));
        assert!(!outbox.is_closed());
        outbox.send("one too many");
        assert!(outbox.is_closed() && outbox.take().is_none());
    }

    #[test]
    fn what_was_queued_before_the_end_goes_out() {
        let outbox = Outbox::default();
        outbox.send("last");
        outbox.close();
        assert_eq!(outbox.take().map(|lines| lines.len()), Some(1));
        assert!(outbox.take().is_none());
    }
}
