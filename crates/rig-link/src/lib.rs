//! What the host tool and the firmware say to each other.
//!
//! - [`messages`]: the one table of all messages, and [`codes`] of the names that they carry.
//! - [`faults`]: sets of faults.
//! - [`settings`]: unit, default and range of every setting.
//! - [`frame`]: how a message becomes bytes on a UART and comes back: sequence number, postcard, CRC-32, COBS.
//! - [`sequence`]: which requests are new, and which come once more.
//! - [`names`]: the macro behind the named codes (states, faults, limits …).
//!
//! Neither side trusts the other's bytes: a damaged frame is counted and dropped, and the next good one is found.
//! Both sides compare [`PROTOCOL_HASH`] first, so that a tool never misreads a firmware of another build.

#![no_std]
#![forbid(unsafe_code)]

pub mod codes;
pub mod faults;
pub mod frame;
pub mod messages;
pub mod names;
pub mod sequence;
pub mod settings;

pub use frame::{DecodeError, Decoder, EncodeError, Frame, MAX_FRAME, encode};
pub use messages::*;

/// Bits per second on the UART (8 data bits, no parity, 1 stop bit).
pub const BAUD: u32 = 115_200;

/// The board sends one telemetry message every this many milliseconds.
/// At most 96 bytes each with every counter at its end, so 9.6 kB/s of the 11.5 kB/s that [`BAUD`] carries; 70 as a rule.
pub const TELEMETRY_PERIOD_MS: u32 = 10;

/// The host sends a heartbeat this often (ms); the board calls it silent after several have failed to come.
pub const HEARTBEAT_PERIOD_MS: u32 = 100;

/// Raised when the framing changes; the messages themselves are covered by their source text.
const FRAMING_VERSION: u8 = 1;

/// Hash of the source text of the message table and of the framing version: whatever changes there changes this.
pub const PROTOCOL_HASH: u32 = source_hash(
    include_bytes!("codes.rs"),
    source_hash(include_bytes!("messages.rs"), source_hash(&[FRAMING_VERSION], 0x811c_9dc5)),
);

/// FNV-1a, 32 bits, going on from a hash. Carriage returns are left out: a checkout may have added them.
const fn source_hash(source: &[u8], mut hash: u32) -> u32 {
    const PRIME: u32 = 0x0100_0193;
    let mut i = 0;
    while i < source.len() {
        if source[i] != b'\r' {
            hash = (hash ^ source[i] as u32).wrapping_mul(PRIME);
        }
        i += 1;
    }
    hash
}

#[cfg(test)]
mod tests {
    use super::source_hash;

    #[test]
    fn hash_follows_text_and_version_but_not_line_ends() {
        assert_eq!(source_hash(b"a\nb", 1), source_hash(b"a\r\nb", 1));
        assert_ne!(source_hash(b"a\nb", 1), source_hash(b"a\nc", 1));
        assert_ne!(source_hash(b"a\nb", 1), source_hash(b"a\nb", 2));
    }
}
