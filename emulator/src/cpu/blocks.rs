//! Instructions and cycles of each translation block, decoded once for each address.

use super::timing;
use crate::soc::memory::{FLASH_BASE, FLASH_SIZE, Region};

/// Length and cost of the block that starts at an address.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    bytes: u16,
    instructions: u16,
    cycles: u16,
}

/// What a block costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cost {
    /// Its instructions.
    pub instructions: u64,
    /// Their cycles, without those of a branch that is taken.
    pub cycles: u64,
    /// A watched function starts with it.
    pub watched: bool,
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

    /// Cost of the block of `bytes` at `address`.
    pub fn look_up(&mut self, address: u32, bytes: u32, flash: &Region, watched: impl Fn(u32) -> bool) -> Cost {
        let Some(entry) = self.entries.get_mut(address.wrapping_sub(FLASH_BASE) as usize / 2) else {
            // Code in RAM: the firmware has none, and this is accurate enough.
            let instructions = u64::from(bytes / 2);
            return Cost { instructions, cycles: instructions, watched: false };
        };
        if u32::from(entry.bytes) != bytes {
            let (instructions, cycles) = timing::of_block(address, bytes, flash);
            let watched = if watched(address) { WATCHED } else { 0 };
            *entry = Entry { bytes: bytes as u16, instructions: instructions | watched, cycles };
        }
        Cost {
            instructions: u64::from(entry.instructions & !WATCHED),
            cycles: entry.cycles.into(),
            watched: entry.instructions & WATCHED != 0,
        }
    }

    /// Code or watched functions have changed.
    pub fn clear(&mut self) {
        self.entries.fill(Entry::default());
    }
}
