//! Power controller (RM0390 chapter 5) and debug support (chapter 33): storage with the ready flags that drivers wait
//! for.

/// PWR registers.
#[derive(Debug)]
pub struct Pwr {
    cr: u32,
    csr: u32,
}

impl Default for Pwr {
    fn default() -> Self {
        Self { cr: 0xC000, csr: 0 }
    }
}

impl Pwr {
    /// Read a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            0 => Some(self.cr),
            // VOSRDY; ODRDY and ODSWRDY follow ODEN and ODSWEN.
            4 => Some(self.csr | 1 << 14 | self.cr & 3 << 16),
            _ => None,
        }
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0 => self.cr = value,
            4 => self.csr = value & 0x300,
            _ => return None,
        }
        Some(())
    }
}

/// DBGMCU registers.
#[derive(Debug, Default)]
pub struct DebugMcu {
    words: [u32; 4],
}

impl DebugMcu {
    /// Read a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            // STM32F446, revision A.
            0 => Some(0x1000_0421),
            4..=12 => Some(self.words[offset as usize / 4]),
            _ => None,
        }
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        *self.words.get_mut(offset as usize / 4)? = value;
        Some(())
    }
}
