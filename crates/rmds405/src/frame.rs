//! Frames as values: one to send, one received, and why a received one is ignored.

use crate::address::{Address, Function};
use crate::units::QuadCounts;

/// Fills the bytes that a function does not use (crates/rmds405/README.md 1).
pub const PAD: u8 = 0x55;

/// A frame to send: standard identifier, data frame, always 8 bytes (crates/rmds405/README.md 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// 11-bit identifier.
    pub id: u16,
    /// Payload, big-endian fields, unused bytes [`PAD`].
    pub data: [u8; 8],
}

impl Frame {
    /// The same frame as its receiver sees it.
    pub fn received(&self) -> Received<'_> {
        Received { id: u32::from(self.id), extended: false, remote: false, data: &self.data }
    }
}

/// A frame as it came off the bus, from any node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received<'a> {
    /// 11-bit or 29-bit identifier.
    pub id: u32,
    /// 29-bit identifier.
    pub extended: bool,
    /// Remote frame.
    pub remote: bool,
    /// As many bytes as the DLC says.
    pub data: &'a [u8],
}

/// Why a frame was ignored. The receiver counts these: the protocol has no checksum and no sequence number of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Ignored {
    /// A 29-bit identifier; the drive knows only 11 bits.
    #[error("29-bit identifier")]
    Extended,
    /// A remote frame; the protocol has none.
    #[error("remote frame")]
    Remote,
    /// The identifier of another drive.
    #[error("identifier {0:#05x} is another drive's")]
    OtherDrive(u32),
    /// A function of the opposite direction.
    #[error("function {0:?} belongs to the opposite direction")]
    WrongDirection(Function),
    /// Not 8 bytes.
    #[error("{0} bytes instead of 8")]
    Length(u8),
    /// A field outside its range.
    #[error("byte {0} holds no valid value")]
    Field(u8),
}

/// Function and eight bytes of a frame that is addressed to, or comes from, the drive at `address`.
pub(crate) fn accept(
    address: Address,
    received: &Received<'_>,
    broadcast: bool,
) -> Result<(Function, [u8; 8]), Ignored> {
    if received.extended {
        return Err(Ignored::Extended);
    }
    if received.remote {
        return Err(Ignored::Remote);
    }
    let id = u16::try_from(received.id).map_err(|_| Ignored::OtherDrive(received.id))?;
    let function = Function::of_id(id);
    if id != address.id(function) && !(broadcast && id == address.broadcast_id(function)) {
        return Err(Ignored::OtherDrive(received.id));
    }
    let length = received.data.len();
    let data =
        <[u8; 8]>::try_from(received.data).map_err(|_| Ignored::Length(u8::try_from(length).unwrap_or(u8::MAX)))?;
    Ok((function, data))
}

/// Eight bytes of big-endian fields: an `i16` at byte 0, one at byte 2, an `i32` in the last four.
pub(crate) fn words(first: i16, second: Option<i16>, tail: Option<QuadCounts>) -> [u8; 8] {
    let mut data = [PAD; 8];
    data[..2].copy_from_slice(&first.to_be_bytes());
    if let Some(second) = second {
        data[2..4].copy_from_slice(&second.to_be_bytes());
    }
    if let Some(QuadCounts(tail)) = tail {
        data[4..].copy_from_slice(&tail.to_be_bytes());
    }
    data
}

/// Big-endian `i16` at byte `at` (0 to 6).
pub(crate) fn i16_at(data: &[u8; 8], at: usize) -> i16 {
    i16::from_be_bytes([data[at], data[at + 1]])
}

/// Big-endian position in the last four bytes.
pub(crate) fn position_of(data: &[u8; 8]) -> QuadCounts {
    QuadCounts(i32::from_be_bytes([data[4], data[5], data[6], data[7]]))
}
