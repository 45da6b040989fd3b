//! Instructions in each translation block, decoded once for each address.

use crate::soc::memory::{FLASH_BASE, FLASH_SIZE, Region};

/// Length of the block that starts at an address.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    bytes: u16,
    instructions: u16,
}

/// Bit of `instructions` that marks the start of a watched function.
const WATCHED: u16 = 1 << 15;

/// Table over flash, an entry for each halfword.
pub struct Blocks {
    entries: Vec<Entry>,
}

impl Blocks {
    /// An empty table.
    pub fn new() -> Self {
        Self { entries: vec![Entry::default(); FLASH_SIZE / 2] }
    }

    /// Instructions in the block of `bytes` at `address`, and whether a watched function starts there.
    pub fn look_up(&mut self, address: u32, bytes: u32, flash: &Region, watched: impl Fn(u32) -> bool) -> (u64, bool) {
        let Some(entry) = self.entries.get_mut(address.wrapping_sub(FLASH_BASE) as usize / 2) else {
            // Code in RAM: the firmware has none, and this is accurate enough.
            return (u64::from(bytes / 2), false);
        };
        if u32::from(entry.bytes) != bytes {
            *entry = Entry {
                bytes: bytes as u16,
                instructions: count(address, bytes, flash) | if watched(address) { WATCHED } else { 0 },
            };
        }
        (u64::from(entry.instructions & !WATCHED), entry.instructions & WATCHED != 0)
    }

    /// Code or watched functions have changed.
    pub fn clear(&mut self) {
        self.entries.fill(Entry::default());
    }
}

fn count(address: u32, bytes: u32, flash: &Region) -> u16 {
    let (mut at, mut instructions) = (address, 0);
    while at < address + bytes {
        let half = flash.half(at).unwrap_or(0);
        // The first halfword of a 32-bit instruction starts with 0b11101, 0b11110 or 0b11111.
        at += if half >> 11 >= 0x1D { 4 } else { 2 };
        instructions += 1;
    }
    instructions
}
