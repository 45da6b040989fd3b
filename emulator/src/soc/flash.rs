//! Flash interface (RM0390 chapter 3): wait states, programming and erasing.
//!
//! The firmware runs from the flash that it programs, so the core stalls during an operation; peripherals go on.

use super::memory::{FLASH_BASE, Memory};

/// Programming a word (DS10693 table 48, x32 parallelism).
const PROGRAM_S: f64 = 16e-6;
/// Size of every sector in KiB.
const SECTORS: [usize; 8] = [16, 16, 16, 16, 64, 128, 128, 128];

/// Typical and longest erase time of a sector of the given number of KiB, 8, 16 and 32 bits at a time (PSIZE 0, 1, 2). The typical
/// times at 32 bits are those of DS10693 table 48; the others have not been checked against that table.
fn erase_s(kib: usize, psize: usize) -> Option<[f64; 2]> {
    let times = match kib {
        16 => [[0.4, 0.8], [0.3, 0.6], [0.25, 0.5]],
        64 => [[1.2, 2.4], [0.7, 1.4], [0.55, 1.1]],
        _ => [[2.0, 4.0], [1.3, 2.6], [1.0, 2.0]],
    };
    times.get(psize).copied()
}

/// Bytes in a line, which one access to flash reads (RM0390 section 3.4.2).
const LINE: u32 = 16;

const PRFTEN: u32 = 1 << 8;
const ICEN: u32 = 1 << 9;
const DCEN: u32 = 1 << 10;

const PG: u32 = 1 << 0;
const SER: u32 = 1 << 1;
const MER: u32 = 1 << 2;
const STRT: u32 = 1 << 16;
const EOPIE: u32 = 1 << 24;
const ERRIE: u32 = 1 << 25;
const LOCK: u32 = 1 << 31;

const EOP: u32 = 1 << 0;
const OPERR: u32 = 1 << 1;
const PGAERR: u32 = 1 << 5;
const PGPERR: u32 = 1 << 6;
const PGSERR: u32 = 1 << 7;

/// Flash interface registers.
#[derive(Debug)]
pub struct Flash {
    acr: u32,
    sr: u32,
    cr: u32,
    /// The first key has been written.
    half_open: bool,
    /// A wrong key locks until the next reset.
    jammed: bool,
    /// Option byte: level of the brown-out reset, 0 is off.
    brown_out_level: u8,
    /// This chip takes the longest time to erase, not the typical one.
    slow: bool,
}

impl Flash {
    /// The interface after a reset of a chip with this option byte, which takes the longest time to erase or the typical
    /// one.
    pub fn new(brown_out_level: u8, slow: bool) -> Self {
        Self { acr: 0, sr: 0, cr: LOCK, half_open: false, jammed: false, brown_out_level, slow }
    }

    /// System reset: the option bytes stay.
    pub fn reset(&mut self) {
        *self = Self::new(self.brown_out_level, self.slow);
    }

    /// Level of the brown-out reset, 0 (off, as delivered) to 3.
    pub fn brown_out_level(&self) -> u8 {
        self.brown_out_level
    }

    /// Program that option byte, as a programmer would.
    pub fn set_brown_out_level(&mut self, level: u8) {
        self.brown_out_level = level.min(3);
    }

    /// Wait states in force.
    pub fn wait_states(&self) -> u32 {
        self.acr & 0xF
    }

    /// Cycles that the core waits for the code of a block of `bytes` at `address`: the wait states once for each line
    /// that it touches, with the prefetch buffer on for the first line alone, and with the instruction cache on not at
    /// all. This assumes that the cache always hits, that prefetch always keeps up, and that no line is left from the
    /// block before; loads of constants through the data bus cost nothing here, with or without the data cache.
    pub fn fetch_cycles(&self, address: u32, bytes: u32) -> u64 {
        let lines = (address % LINE + bytes).div_ceil(LINE);
        let waited = match self.acr & (ICEN | PRFTEN) {
            0 => lines,
            PRFTEN => 1,
            _ => 0,
        };
        u64::from(waited * self.wait_states())
    }

    /// The data cache is on: after an operation it may still hold what was there before.
    pub fn data_cached(&self) -> bool {
        self.acr & DCEN != 0
    }

    /// Read a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.acr,
            0x04 | 0x08 => 0,
            0x0C => self.sr,
            0x10 => self.cr,
            // BOR_LEV counts down: 3 is off, 0 is level 3.
            0x14 => 0x0FFF_AAE1 | u32::from(3 - self.brown_out_level) << 2,
            _ => return None,
        })
    }

    /// Write a register; gives the seconds for which the core stalls.
    pub fn write(&mut self, offset: u32, value: u32, memory: &mut Memory) -> Option<f64> {
        match offset {
            0x00 => self.acr = value,
            0x04 => self.key(value),
            0x0C => self.sr &= !value,
            0x10 if self.cr & LOCK == 0 => {
                self.cr = value & !STRT;
                if value & STRT != 0 {
                    return Some(self.start(memory));
                }
            }
            0x10 => self.cr |= value & LOCK,
            _ => return None,
        }
        Some(0.0)
    }

    fn key(&mut self, value: u32) {
        match (self.half_open, value) {
            (false, 0x4567_0123) => self.half_open = true,
            (true, 0xCDEF_89AB) if !self.jammed => {
                self.half_open = false;
                self.cr &= !LOCK;
            }
            _ => {
                self.half_open = false;
                self.jammed = true;
            }
        }
    }

    fn start(&mut self, memory: &mut Memory) -> f64 {
        let sector = (self.cr >> 3 & 0xF) as usize;
        // Mass erase would erase the running program.
        if self.cr & SER == 0 || self.cr & (PG | MER) != 0 || sector >= SECTORS.len() {
            self.sr |= PGSERR;
            return 0.0;
        }
        let first: usize = SECTORS[..sector].iter().map(|kib| kib << 10).sum();
        let kib = SECTORS[sector];
        // 64 bits at a time need an external voltage, which this board does not have.
        let Some([typical_s, longest_s]) = erase_s(kib, (self.cr >> 8 & 3) as usize) else {
            return self.refuse(PGPERR);
        };
        memory
            .flash
            .write(FLASH_BASE + first as u32, &vec![0xFF; kib << 10])
            .expect("the sector table covers the flash exactly");
        self.done();
        if self.slow { longest_s } else { typical_s }
    }

    fn done(&mut self) {
        // EOP is set only with its interrupt enabled (RM0390 section 3.8.4).
        if self.cr & EOPIE != 0 {
            self.sr |= EOP;
        }
    }

    /// An operation that cannot be run.
    fn refuse(&mut self, error: u32) -> f64 {
        // OPERR is set only with the error interrupt enabled (RM0390 section 3.8.4).
        self.sr |= error | if self.cr & ERRIE != 0 { OPERR } else { 0 };
        0.0
    }

    /// The core writes into flash; gives the seconds for which it stalls.
    pub fn program(&mut self, address: u32, size: usize, value: u64, memory: &mut Memory) -> f64 {
        if self.cr & LOCK != 0 || self.cr & PG == 0 || self.cr & (SER | MER) != 0 {
            self.sr |= PGSERR;
            return 0.0;
        }
        if 1 << (self.cr >> 8 & 3) != size {
            return self.refuse(PGPERR);
        }
        if !(address as usize).is_multiple_of(size) {
            return self.refuse(PGAERR);
        }
        let mut old = [0; 8];
        let old = &mut old[..size];
        if memory.flash.read(address, old).is_none() {
            return self.refuse(PGAERR);
        }
        // Programming only clears bits.
        old.iter_mut().zip(value.to_le_bytes()).for_each(|(old, new)| *old &= new);
        memory.flash.write(address, old).expect("it was read from there");
        self.done();
        PROGRAM_S
    }
}
