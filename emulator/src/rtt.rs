//! Lines from the firmware's RTT buffer, which is read directly from emulated RAM: defmt's, or plain text where the ELF
//! has no defmt table.
//!
//! The RTT control block is found by its symbol; frames are decoded with the table in the ELF.

use crate::soc::memory::Memory;
use defmt_decoder::{DecodeError, Encoding, Locations, Table};
pub use defmt_parser::Level;
use std::fmt;

/// A decoded line.
#[derive(Clone, Debug, PartialEq)]
pub struct DefmtLine {
    /// When the emulator found it, at most a millisecond after it was written.
    pub t_s: f64,
    /// The firmware's own time stamp.
    pub timestamp: Option<String>,
    /// Severity; `println!` has none.
    pub level: Option<Level>,
    /// The text.
    pub message: String,
    /// `file:line`, if the ELF has debug information.
    pub location: Option<String>,
}

impl fmt::Display for DefmtLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.6} ", self.t_s)?;
        if let Some(level) = self.level {
            write!(f, "{level:?} ")?;
        }
        f.write_str(&self.message)?;
        self.location.as_ref().map_or(Ok(()), |location| write!(f, " [{location}]"))
    }
}

/// Offsets in the control block: up-channel 0 behind the 16-byte id and two counts.
mod offset {
    pub const BUFFER: u32 = 28;
    pub const SIZE: u32 = 32;
    pub const WRITE: u32 = 36;
    pub const READ: u32 = 40;
    pub const FLAGS: u32 = 44;
}

/// Mode of a channel: the firmware waits while its buffer is full.
const BLOCK_IF_FULL: u32 = 2;

/// Reader of one firmware's output.
pub struct Rtt {
    control_block: u32,
    table: Option<Table>,
    locations: Option<Locations>,
    /// Bytes behind the last complete frame.
    rest: Vec<u8>,
    lines: Vec<DefmtLine>,
    stalled: bool,
}

impl Rtt {
    /// The reader for an ELF whose `_SEGGER_RTT` is at `control_block`; `None` where its defmt table cannot be read.
    pub fn new(elf: &[u8], control_block: u32) -> Option<Self> {
        let table = Table::parse(elf).ok()?;
        let locations = table.as_ref().and_then(|table| {
            let locations = table.get_locations(elf).ok()?;
            table.indices().all(|i| locations.contains_key(&(i as u64))).then_some(locations)
        });
        Some(Self { control_block, table, locations, rest: Vec::new(), lines: Vec::new(), stalled: false })
    }

    /// The reader asks the firmware to wait while the buffer is full, as `probe-rs run` does, and reads nothing any
    /// more: the fault `rtt-stalled`, a laptop that sleeps.
    pub fn stall(&mut self, stalled: bool) {
        self.stalled = stalled;
    }

    /// Fetch what the firmware has written by `t_s`.
    pub fn poll(&mut self, memory: &mut Memory, t_s: f64) {
        let mut id = [0; 10];
        if memory.ram.read(self.control_block, &mut id).is_none() || &id != b"SEGGER RTT" {
            return;
        }
        if self.stalled {
            memory.ram.set_word(self.control_block + offset::FLAGS, BLOCK_IF_FULL);
            return;
        }
        let word = |offset| memory.ram.word(self.control_block + offset);
        let Some([buffer, size, write, read]) =
            (|| Some([word(offset::BUFFER)?, word(offset::SIZE)?, word(offset::WRITE)?, word(offset::READ)?]))()
        else {
            return;
        };
        if read == write || size == 0 || read >= size || write >= size {
            return;
        }
        let mut ring = vec![0; size as usize];
        if memory.ram.read(buffer, &mut ring).is_none() {
            return;
        }
        ring.rotate_left(read as usize);
        ring.truncate(((write + size - read) % size) as usize);
        memory.ram.set_word(self.control_block + offset::READ, write);
        self.rest.extend(ring);
        self.decode(t_s);
    }

    fn decode(&mut self, t_s: f64) {
        let Some(table) = &self.table else {
            while let Some(end) = self.rest.iter().position(|&byte| byte == b'\n') {
                let bytes: Vec<u8> = self.rest.drain(..=end).collect();
                let message = String::from_utf8_lossy(&bytes).trim_end().to_owned();
                self.lines.push(DefmtLine { t_s, timestamp: None, level: None, message, location: None });
            }
            return;
        };
        // A stream decoder borrows the table, so it cannot be kept: feed a fresh one whole frames.
        let end = match table.encoding() {
            Encoding::Rzcobs => self.rest.iter().rposition(|&byte| byte == 0).map_or(0, |last| last + 1),
            _ => self.rest.len(),
        };
        let frames: Vec<u8> = self.rest.drain(..end).collect();
        let mut decoder = table.new_stream_decoder();
        decoder.received(&frames);
        loop {
            match decoder.decode() {
                Ok(frame) => {
                    let location = self.locations.as_ref().and_then(|locations| locations.get(&frame.index()));
                    self.lines.push(DefmtLine {
                        t_s,
                        timestamp: frame.display_timestamp().map(|stamp| stamp.to_string()),
                        level: frame.level(),
                        message: frame.display_message().to_string(),
                        location: location.map(|l| format!("{}:{}", l.file.display(), l.line)),
                    });
                }
                Err(DecodeError::UnexpectedEof) => break,
                // A frame cut by a reset, or overwritten: the next zero byte starts afresh.
                Err(DecodeError::Malformed) if table.encoding().can_recover() => {}
                Err(DecodeError::Malformed) => break,
            }
        }
    }

    /// The microcontroller has been reset: a frame that was begun will not be finished.
    pub fn reset(&mut self) {
        self.rest.clear();
    }

    /// Lines since the last call.
    pub fn take(&mut self) -> Vec<DefmtLine> {
        std::mem::take(&mut self.lines)
    }
}
