//! Frames on the wire.
//!
//! ```text
//! 0x00 | COBS( sequence number u16 LE | postcard body | CRC-32 LE of both ) | 0x00
//! ```
//! COBS removes 0x00 from the frame, so a delimiter is always the edge of a frame. The leading one ends any noise before
//! the frame, so a good frame survives noise in front of it. This framing never changes ([`crate::versions`]).

use core::marker::PhantomData;
use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use serde::{Serialize, de::DeserializeOwned};

/// Longest frame on the wire, both delimiters included (bytes). The longest message (`Identity` with all texts at their
/// maximum length) needs 242.
pub const MAX_FRAME: usize = 256;

/// One frame stays under the 254 bytes after which COBS would insert a second overhead byte.
const MAX_CONTENT: usize = MAX_FRAME - 3;

const SEQUENCE_BYTES: usize = 2;
const CRC_BYTES: usize = 4;

/// The frames are short and slow: a table of 1 KiB would gain nothing on the board.
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Why a message did not become a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncodeError {
    /// The message is longer than a frame.
    #[error("message is longer than a frame of {MAX_FRAME} bytes")]
    TooLong,
    /// The caller's buffer is shorter than the frame.
    #[error("buffer is shorter than the frame")]
    BufferTooShort,
}

/// Why bytes did not become a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DecodeError {
    /// More bytes than a frame has came without a delimiter.
    #[error("more than {MAX_FRAME} bytes without a delimiter")]
    TooLong,
    /// The bytes between two delimiters are no COBS code, or too few.
    #[error("not a frame")]
    NotAFrame,
    /// The checksum is wrong.
    #[error("wrong checksum")]
    Crc,
    /// Whole, but no message of this table.
    #[error("not a message of this protocol")]
    NotAMessage,
}

/// A message with its sequence number.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Frame<T> {
    /// Counts the sender's frames, so that the receiver can count what it lost.
    pub sequence: u16,
    /// The message.
    pub body: T,
}

/// Writes one frame into `buffer` and returns the part that holds it. [`MAX_FRAME`] bytes always suffice.
///
/// # Errors
/// If the message is longer than a frame or the buffer too short.
pub fn encode<'a, T: Serialize>(sequence: u16, body: &T, buffer: &'a mut [u8]) -> Result<&'a [u8], EncodeError> {
    let mut content = [0; MAX_CONTENT];
    content[..SEQUENCE_BYTES].copy_from_slice(&sequence.to_le_bytes());
    let space = &mut content[SEQUENCE_BYTES..MAX_CONTENT - CRC_BYTES];
    let body_bytes = postcard::to_slice(body, space).map_err(|_| EncodeError::TooLong)?.len();
    let checked = SEQUENCE_BYTES + body_bytes;
    let crc = CRC.checksum(&content[..checked]);
    content[checked..checked + CRC_BYTES].copy_from_slice(&crc.to_le_bytes());

    let content = &content[..checked + CRC_BYTES];
    let (first, rest) = buffer.split_first_mut().ok_or(EncodeError::BufferTooShort)?;
    *first = 0;
    let coded = cobs::try_encode(content, rest).map_err(|_| EncodeError::BufferTooShort)?;
    *rest.get_mut(coded).ok_or(EncodeError::BufferTooShort)? = 0;
    Ok(&buffer[..coded + 2])
}

/// Finds frames in a stream of bytes, one byte at a time.
#[derive(Debug, Clone)]
pub struct Decoder<T> {
    buffer: [u8; MAX_FRAME],
    length: usize,
    /// Set while skipping to the next delimiter after too many bytes.
    skipping: bool,
    errors: u32,
    message: PhantomData<fn() -> T>,
}

impl<T> Default for Decoder<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T> Decoder<T> {
    /// An empty decoder.
    pub const fn new() -> Self {
        Self { buffer: [0; MAX_FRAME], length: 0, skipping: false, errors: 0, message: PhantomData }
    }

    /// How many damaged frames have gone by (stops at the maximum number instead of wrapping).
    pub const fn errors(&self) -> u32 {
        self.errors
    }

    /// Counts an error that the decoder cannot see, such as an overrun of the UART, and drops the frame it hit.
    pub fn line_error(&mut self) {
        self.errors = self.errors.saturating_add(1);
        self.length = 0;
        self.skipping = true;
    }
}

impl<T: DeserializeOwned> Decoder<T> {
    /// Takes one byte. `Some` at the end of a frame, and once for each run of bytes that is none.
    pub fn push(&mut self, byte: u8) -> Option<Result<Frame<T>, DecodeError>> {
        if byte != 0 {
            if self.skipping {
                return None;
            }
            let Some(place) = self.buffer.get_mut(self.length) else {
                self.skipping = true;
                self.length = 0;
                return Some(Err(self.count(DecodeError::TooLong)));
            };
            *place = byte;
            self.length += 1;
            return None;
        }
        let length = core::mem::take(&mut self.length);
        if core::mem::take(&mut self.skipping) || length == 0 {
            return None; // already counted, or two delimiters in a row
        }
        Some(self.frame(length).map_err(|e| self.count(e)))
    }

    fn count(&mut self, error: DecodeError) -> DecodeError {
        self.errors = self.errors.saturating_add(1);
        error
    }

    fn frame(&mut self, length: usize) -> Result<Frame<T>, DecodeError> {
        let coded = &mut self.buffer[..length];
        let decoded = cobs::decode_in_place(coded).map_err(|_| DecodeError::NotAFrame)?;
        let content = coded.get(..decoded).ok_or(DecodeError::NotAFrame)?;
        let (checked, crc) = content.split_last_chunk::<CRC_BYTES>().ok_or(DecodeError::NotAFrame)?;
        let (sequence, body) = checked.split_first_chunk::<SEQUENCE_BYTES>().ok_or(DecodeError::NotAFrame)?;
        if CRC.checksum(checked) != u32::from_le_bytes(*crc) {
            return Err(DecodeError::Crc);
        }
        match postcard::take_from_bytes(body) {
            Ok((body, [])) => Ok(Frame { sequence: u16::from_le_bytes(*sequence), body }),
            _ => Err(DecodeError::NotAMessage),
        }
    }
}
