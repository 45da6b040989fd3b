//! Instructions and cycles of each translation block, decoded once for each address.

use super::timing;
use crate::soc::memory::{FLASH_BASE, FLASH_SIZE, Region};

/// What a block costs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Block {
    /// Its length; 0 where it has not been decoded yet.
    bytes: u16,
    /// Its instructions.
    pub instructions: u16,
    /// Their cycles, without those of a branch that is taken.
    pub cycles: u16,
    /// A watched function starts with it.
    pub watched: bool,
}

/// Table over flash, an entry for each halfword.
pub struct Blocks {
    entries: Vec<Block>,
}

impl Blocks {
    /// An empty table.
    pub fn new() -> Self {
        Self { entries: vec![Block::default(); FLASH_SIZE / 2] }
    }

    /// Cost of the block of `bytes` at `address`.
    pub fn look_up(&mut self, address: u32, bytes: u32, flash: &Region, watched: impl Fn(u32) -> bool) -> Block {
        let Some(entry) = self.entries.get_mut(address.wrapping_sub(FLASH_BASE) as usize / 2) else {
            // Code in RAM: the firmware has none, and this is accurate enough.
            let instructions = (bytes / 2) as u16;
            return Block { bytes: bytes as u16, instructions, cycles: instructions, watched: false };
        };
        if u32::from(entry.bytes) != bytes {
            let (instructions, cycles) = timing::of_block(address, bytes, flash);
            *entry = Block { bytes: bytes as u16, instructions, cycles, watched: watched(address) };
        }
        *entry
    }

    /// Code or watched functions have changed.
    pub fn clear(&mut self) {
        self.entries.fill(Block::default());
    }
}
