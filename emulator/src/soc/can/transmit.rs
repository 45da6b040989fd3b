//! Transmit mailboxes (RM0390 section 30.7.1).

use super::wire::arbitration;
use rig_plant::board::CanFrame;

const TXRQ: u32 = 1;
const RQCP: u32 = 1;
const TXOK: u32 = 2;
const ALST: u32 = 4;
const TERR: u32 = 8;
const ABRQ: u32 = 0x80;

/// How a request ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Sent and acknowledged.
    Sent,
    /// Aborted, on request.
    Aborted,
    /// Arbitration lost with retransmission off.
    Lost,
    /// Error with retransmission off.
    Failed,
}

#[derive(Clone, Copy, Debug, Default)]
struct Mailbox {
    words: [u32; 4],
    /// RQCP, TXOK, ALST, TERR, ABRQ at the place they have for mailbox 0.
    status: u32,
    /// Order of requests.
    order: u64,
}

impl Mailbox {
    fn pending(&self) -> bool {
        self.words[0] & TXRQ != 0
    }

    fn frame(&self) -> CanFrame {
        let [identifier, control, low, high] = self.words;
        let extended = identifier >> 2 & 1 == 1;
        let mut data = [0; 8];
        data[..4].copy_from_slice(&low.to_le_bytes());
        data[4..].copy_from_slice(&high.to_le_bytes());
        let dlc = (control & 0xF).min(8) as u8;
        data[usize::from(dlc)..].fill(0);
        let id = if extended { identifier >> 3 } else { identifier >> 21 };
        CanFrame { id, extended, remote: identifier >> 1 & 1 == 1, dlc, data }
    }
}

/// Three mailboxes.
#[derive(Debug, Default)]
pub struct Mailboxes {
    boxes: [Mailbox; 3],
    requests: u64,
}

impl Mailboxes {
    /// The mailbox that is sent next, and its frame: by identifier, or in order of request (`fifo`).
    pub fn next(&self, fifo: bool) -> Option<(usize, CanFrame)> {
        let waiting = (0..3).filter(|&i| self.boxes[i].pending() && self.boxes[i].status & ABRQ == 0);
        waiting.min_by_key(|&i| self.rank(i, fifo)).map(|i| (i, self.boxes[i].frame()))
    }

    fn rank(&self, index: usize, fifo: bool) -> (u64, usize) {
        let mailbox = &self.boxes[index];
        (if fifo { mailbox.order } else { arbitration(&mailbox.frame()) }, index)
    }

    /// A request has ended.
    pub fn finish(&mut self, index: usize, end: End) {
        let mailbox = &mut self.boxes[index];
        mailbox.words[0] &= !TXRQ;
        mailbox.status = RQCP
            | match end {
                End::Sent => TXOK,
                End::Aborted => 0,
                End::Lost => ALST,
                End::Failed => TERR,
            };
    }

    /// Software wants this one aborted.
    pub fn abort_requested(&self, index: usize) -> bool {
        self.boxes[index].status & ABRQ != 0
    }

    /// Some request has ended since software last looked.
    pub fn completed(&self) -> bool {
        self.boxes.iter().any(|mailbox| mailbox.status & RQCP != 0)
    }

    /// TSR.
    pub fn status(&self, fifo: bool) -> u32 {
        let mut value = 0;
        for (i, mailbox) in self.boxes.iter().enumerate() {
            value |= mailbox.status << (8 * i) | u32::from(!mailbox.pending()) << (26 + i);
        }
        let pending = self.boxes.iter().filter(|mailbox| mailbox.pending()).count();
        let lowest = (0..3).filter(|&i| self.boxes[i].pending()).max_by_key(|&i| self.rank(i, fifo));
        let free = self.boxes.iter().position(|mailbox| !mailbox.pending());
        value |= (free.or(lowest).unwrap_or(0) as u32) << 24;
        if let Some(lowest) = lowest.filter(|_| pending > 1) {
            value |= 1 << (29 + lowest);
        }
        value
    }

    /// A write to TSR. Mailboxes whose abort can be carried out at once, all but `on_wire`, end.
    pub fn write_status(&mut self, value: u32, on_wire: Option<usize>) {
        for i in 0..3 {
            let bits = value >> (8 * i);
            if bits & RQCP != 0 {
                self.boxes[i].status &= ABRQ;
            }
            if bits & ABRQ != 0 && self.boxes[i].pending() {
                self.boxes[i].status |= ABRQ;
                if on_wire != Some(i) {
                    self.finish(i, End::Aborted);
                }
            }
        }
    }

    /// Read a mailbox register.
    pub fn read(&self, index: usize, word: usize) -> u32 {
        self.boxes[index].words[word]
    }

    /// Write a mailbox register; `false` if it is write-protected, because its frame is pending.
    pub fn write(&mut self, index: usize, word: usize, value: u32) -> bool {
        let mailbox = &mut self.boxes[index];
        if mailbox.pending() {
            return false;
        }
        mailbox.words[word] = value;
        if mailbox.pending() {
            mailbox.status = 0;
            mailbox.order = self.requests;
            self.requests += 1;
        }
        true
    }
}
