//! The greeting, which a tool and a board of any two versions understand, so that each can name the other.
//!
//! Its layout never changes. A greeting is a frame as [`crate::frame`] describes it, with this body:
//!
//! | byte | content                                                     |
//! |------|-------------------------------------------------------------|
//! | 0    | 0: the first variant of `Request` and of `Message`          |
//! | 1    | protocol hash, u32, least significant byte first            |
//! | 5    | package version, 24 bytes of UTF-8, filled up with zeros    |
//! | 29   | git id of the source, the same; all zeros if it is not known |
//!
//! So never change [`Versions`], the framing, or the place of `Hello` among the variants. `tests/versions.rs` holds a
//! frame of another version, byte by byte.

use crate::PROTOCOL_HASH;
use core::fmt;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Bytes of a text.
const TEXT: usize = 24;

/// Protocol, package version and git id of a tool or a firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Versions {
    protocol_hash: [u8; 4],
    version: [u8; TEXT],
    git: [u8; TEXT],
}

impl Versions {
    /// Of this build: its [`PROTOCOL_HASH`]. `git` is empty if it is not known. Texts are cut to 24 bytes.
    pub const fn own(version: &str, git: &str) -> Self {
        Self::new(PROTOCOL_HASH, version, git)
    }

    /// Of any build.
    pub const fn new(protocol_hash: u32, version: &str, git: &str) -> Self {
        Self { protocol_hash: protocol_hash.to_le_bytes(), version: field(version), git: field(git) }
    }

    /// Hash of all messages, [`PROTOCOL_HASH`] of that build.
    pub const fn protocol_hash(&self) -> u32 {
        u32::from_le_bytes(self.protocol_hash)
    }

    /// Package version.
    pub fn version(&self) -> &str {
        text(&self.version)
    }

    /// Git id of the source, empty if it is not known.
    pub fn git(&self) -> &str {
        text(&self.git)
    }

    /// Whether a tool of these versions and this board understand each other.
    ///
    /// # Errors
    /// [`VersionMismatch`] with both versions if their protocols differ.
    pub fn check_board(&self, board: &Self) -> Result<(), VersionMismatch> {
        if self.protocol_hash == board.protocol_hash {
            return Ok(());
        }
        Err(VersionMismatch { tool: *self, board: *board })
    }
}

impl fmt::Display for Versions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let git = if self.git().is_empty() { "unknown" } else { self.git() };
        write!(f, "{} (git {git}, protocol {:#010x})", self.version(), self.protocol_hash())
    }
}

/// Tool and board have different protocols.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "tool and board have different protocols: the tool is {tool}, the board {board}. Build both from the same source \
     (`cargo xtask build`), then flash the board (`cargo xtask flash`)"
)]
pub struct VersionMismatch {
    /// The tool's versions.
    pub tool: Versions,
    /// The board's versions.
    pub board: Versions,
}

const fn field(text: &str) -> [u8; TEXT] {
    let (bytes, mut field, mut i) = (text.as_bytes(), [0; TEXT], 0);
    while i < bytes.len() && i < TEXT {
        field[i] = bytes[i];
        i += 1;
    }
    field
}

/// The text up to the first zero, as far as it is UTF-8: it may have been cut, or come from a faulty sender.
fn text(field: &[u8; TEXT]) -> &str {
    let length = field.iter().position(|&byte| byte == 0).unwrap_or(TEXT);
    let bytes = &field[..length];
    match core::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => core::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or(""),
    }
}
