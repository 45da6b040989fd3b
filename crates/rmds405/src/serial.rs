//! The same frames over RS232. **Experimental: no public text of the vendor's RS232 manual was found.**
//!
//! Known (crates/rmds405/README.md 5): RS232 levels, 115 200 baud 8N1, the command set of CAN, RS232 and CAN exclusive.
//! Assumed, by analogy with the vendor's older RS485 frame (0x48, number and function, the same eight bytes, no
//! checksum):
//!
//! - ten bytes: the header 0x32, the function, the eight data bytes of the CAN frame padded with 0x55;
//! - no address: the line has one drive at its end;
//! - the drive sends the reports that it sends on CAN, each in one piece.
//!
//! Without a checksum only its place and its form distinguish a frame from noise. So a frame begins only where the line
//! was quiet or where another frame ended, and it is accepted only if header, function and padding are all correct.
//! Otherwise everything up to the next quiet line is dropped.

use crate::address::Function;
use crate::command::Command;
use crate::frame::Frame;
use crate::report::Report;

/// Baud of the drive as it is delivered (crates/rmds405/README.md 5), 8N1.
pub const BAUD: u32 = 115_200;

/// Length of a frame on the line.
pub const LENGTH: usize = 10;

/// First byte of a frame. Assumed.
pub const HEADER: u8 = 0x32;

/// Time of one byte on the line (µs, rounded up): start bit, eight bits, stop bit.
pub const BYTE_US: u64 = 10_000_000_u64.div_ceil(BAUD as u64);

/// A line without a byte for this long is quiet (µs): well above the time of a byte, well below the period of the
/// reports.
pub const QUIET_US: u64 = 1000;

/// A frame as bytes. Only the function of its identifier is sent.
pub fn encode(frame: &Frame) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    bytes[0] = HEADER;
    bytes[1] = Function::of_id(frame.id) as u8;
    bytes[2..].copy_from_slice(&frame.data);
    bytes
}

/// Finds the frames of one direction in a stream of bytes.
#[derive(Clone, Debug)]
pub struct Decoder<T> {
    understand: fn(Function, &[u8; 8]) -> Option<T>,
    bytes: [u8; LENGTH],
    length: usize,
    /// The decoder has lost its place in the frame, and waits for a quiet line.
    lost: bool,
    last_us: u64,
    foreign: u32,
}

impl Decoder<Report> {
    /// For reports of a drive. The padding is checked: bytes that the drive would not send are noise.
    pub const fn reports() -> Self {
        Self::new(|function, data| Report::of(function, data).ok().filter(|report| report.data() == *data))
    }
}

impl Decoder<Command> {
    /// For commands of a host, in an emulated drive.
    pub const fn commands() -> Self {
        Self::new(|function, data| Command::of(function, data).ok())
    }
}

impl<T> Decoder<T> {
    const fn new(understand: fn(Function, &[u8; 8]) -> Option<T>) -> Self {
        Self { understand, bytes: [0; LENGTH], length: 0, lost: false, last_us: 0, foreign: 0 }
    }

    /// Takes a byte that came at `now_us`. Gives the frame that it completed, if it was the last byte of one. A time
    /// before the previous one counts as no time passed.
    pub fn push(&mut self, now_us: u64, byte: u8) -> Option<T> {
        if now_us.saturating_sub(self.last_us) >= QUIET_US {
            self.drop_rest();
            self.lost = false;
        }
        self.last_us = self.last_us.max(now_us);
        self.bytes[self.length] = byte;
        self.length += 1;
        let in_place = self.bytes[0] == HEADER && (self.length < 2 || self.bytes[1] <= 0xF);
        if self.lost || !in_place {
            self.lost = true;
            self.drop_rest();
            return None;
        }
        if self.length < LENGTH {
            return None;
        }
        let [_, function, data @ ..] = self.bytes;
        let understood = (self.understand)(Function::of_id(u16::from(function)), &data);
        if understood.is_none() {
            self.lost = true;
            self.drop_rest();
        }
        self.length = 0;
        understood
    }

    /// How many bytes were no part of a frame. Those of a frame that broke off are counted when the next byte comes.
    pub const fn foreign(&self) -> u32 {
        self.foreign
    }

    fn drop_rest(&mut self) {
        self.foreign = self.foreign.saturating_add(self.length as u32);
        self.length = 0;
    }
}
