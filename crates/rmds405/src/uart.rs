//! The same frames over a serial line. **Experimental**: hardware.md 5 has one source for the RS485 header
//! and none for the RS232 header, which is assumed by analogy. CAN is the transport to use.
//!
//! Ten bytes, no checksum: header, `number << 4 | function`, the eight bytes of the CAN frame.

use crate::address::Address;
use crate::command::Command;
use crate::frame::Frame;
use crate::report::Report;

/// Length of a frame on the line.
pub const LENGTH: usize = 10;

/// Which of the two serial variants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Variant {
    /// Header 0x32; assumed, no source.
    Rs232,
    /// Header 0x48; one public driver (hardware.md 5, R485).
    Rs485,
}

impl Variant {
    const fn header(self) -> u8 {
        match self {
            Self::Rs232 => 0x32,
            Self::Rs485 => 0x48,
        }
    }
}

/// A frame as bytes. The group has no meaning on a serial line (V-CAN p1) and is dropped.
pub fn encode(variant: Variant, frame: &Frame) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    bytes[0] = variant.header();
    bytes[1] = (frame.id & 0xFF) as u8;
    bytes[2..].copy_from_slice(&frame.data);
    bytes
}

/// Finds frames in a stream of bytes. With no checksum it can only ask whether ten bytes make sense for its drive;
/// if not it looks for the next header among them. Call [`Decoder::idle`] whenever the line was quiet.
#[derive(Clone, Debug)]
pub struct Decoder {
    variant: Variant,
    own: Address,
    bytes: [u8; LENGTH],
    length: usize,
    dropped: u32,
}

impl Decoder {
    /// For the drive at `own`.
    pub const fn new(variant: Variant, own: Address) -> Self {
        Self { variant, own, bytes: [0; LENGTH], length: 0, dropped: 0 }
    }

    /// Takes one byte; a frame when it was the last of one. Its id has the decoder's group.
    pub fn push(&mut self, byte: u8) -> Option<Frame> {
        self.bytes[self.length] = byte;
        self.length += 1;
        self.synchronise();
        if self.length < LENGTH {
            return None;
        }
        let frame = self.frame();
        if frame.is_some() {
            self.length = 0;
        } else {
            self.drop_first();
            self.synchronise();
        }
        frame
    }

    /// The line was quiet for at least two byte times: what is half there will not be completed.
    pub fn idle(&mut self) {
        self.dropped = self.dropped.saturating_add(self.length as u32);
        self.length = 0;
    }

    /// Bytes that were no part of a frame.
    pub const fn dropped(&self) -> u32 {
        self.dropped
    }

    fn frame(&self) -> Option<Frame> {
        let mut data = [0; 8];
        data.copy_from_slice(&self.bytes[2..]);
        let id = u16::from(self.own.group().get()) << 8 | u16::from(self.bytes[1]);
        let frame = Frame { id, data };
        let known =
            Report::decode(self.own, &frame.received()).is_ok() || Command::decode(self.own, &frame.received()).is_ok();
        known.then_some(frame)
    }

    /// Drops bytes until the first is a header.
    fn synchronise(&mut self) {
        while self.length > 0 && self.bytes[0] != self.variant.header() {
            self.drop_first();
        }
    }

    fn drop_first(&mut self) {
        self.bytes.copy_within(1.., 0);
        self.length -= 1;
        self.dropped = self.dropped.saturating_add(1);
    }
}
