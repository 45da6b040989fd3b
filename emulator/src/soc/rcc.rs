//! Reset and clock control (RM0390 chapter 6).
//!
//! Oscillators are ready as soon as they are on, and never if nothing feeds them. The board feeds 8 MHz from the
//! ST-LINK into OSC_IN, so HSE works in bypass only, and starting it as a crystal is a fault.

use super::clock::ClockTree;
use super::fault::{Faults, Lint};

/// HSI frequency, nominally.
const HSI_HZ: u64 = 16_000_000;
/// What the ST-LINK feeds into OSC_IN.
const HSE_HZ: u64 = 8_000_000;

/// CSR flags (RM0390 section 6.3.21).
pub mod reset_flag {
    /// Brown-out.
    pub const BOR: u32 = 1 << 25;
    /// NRST pin, which every internal reset pulls low as well.
    pub const PIN: u32 = 1 << 26;
    /// Power-on.
    pub const POR: u32 = 1 << 27;
    /// SYSRESETREQ.
    pub const SOFTWARE: u32 = 1 << 28;
    /// Independent watchdog.
    pub const IWDG: u32 = 1 << 29;
    /// All of them.
    pub const ALL: u32 = 0xFE00_0000;
}

/// Which bit of which register enables or resets a peripheral: word index from AHB1, and bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gate {
    /// Offset from RCC_AHB1ENR and RCC_AHB1RSTR.
    pub offset: u32,
    /// Bit number.
    pub bit: u8,
}

impl Gate {
    /// Its peripheral is on APB2, and runs on that bus's clock.
    pub fn on_apb2(self) -> bool {
        self.offset == apb2(0).offset
    }
}

/// A gate in AHB1ENR.
pub const fn ahb1(bit: u8) -> Gate {
    Gate { offset: 0x00, bit }
}
/// A gate in APB1ENR.
pub const fn apb1(bit: u8) -> Gate {
    Gate { offset: 0x10, bit }
}
/// A gate in APB2ENR.
pub const fn apb2(bit: u8) -> Gate {
    Gate { offset: 0x14, bit }
}

const RSTR: u32 = 0x10;
const ENR: u32 = 0x30;

/// RCC registers.
#[derive(Debug)]
pub struct Rcc {
    words: [u32; 0x98 / 4],
    flags: u32,
    /// Something feeds OSC_IN.
    hse_fed: bool,
    /// What feeds it has come up since power-on.
    hse_up: bool,
    /// This chip's HSI.
    hsi_hz: u64,
}

impl Default for Rcc {
    fn default() -> Self {
        let mut rcc = Self {
            words: [0; 0x98 / 4],
            flags: reset_flag::POR | reset_flag::PIN | reset_flag::BOR,
            hse_fed: true,
            hse_up: true,
            hsi_hz: HSI_HZ,
        };
        rcc.reset();
        rcc
    }
}

impl Rcc {
    /// System reset: everything but the flags goes back to its reset value.
    pub fn reset(&mut self) {
        self.words = [0; 0x98 / 4];
        self.words[0] = 0x83;
        self.words[1] = 0x2400_3010;
        self.words[0x30 / 4] = 0x0010_0000;
        self.words[0x84 / 4] = 0x2400_3000;
        self.words[0x88 / 4] = 0x2400_3000;
    }

    /// Set flags in CSR.
    pub fn flag(&mut self, flags: u32) {
        self.flags |= flags;
    }

    /// Power is back: only its own flags are set.
    pub fn power_on(&mut self) {
        self.flags = reset_flag::POR | reset_flag::PIN | reset_flag::BOR;
    }

    /// The clock of a peripheral is on.
    pub fn enabled(&self, gate: Gate) -> bool {
        self.words[(ENR + gate.offset) as usize / 4] >> gate.bit & 1 == 1
    }

    /// The LSI is switched on (the watchdog, once started, has it in any case).
    pub fn lsi_on(&self) -> bool {
        self.words[0x74 / 4] & 1 == 1
    }

    /// Switch the clock at OSC_IN. `false` if the system clock was made from the clock that has just gone.
    pub fn feed_hse(&mut self, fed: bool) -> bool {
        self.hse_fed = fed;
        let needed = match self.words[2] & 3 {
            0 => false,
            1 => true,
            _ => self.words[1] >> 22 & 1 == 1,
        };
        fed || !needed
    }

    /// Whether what feeds OSC_IN has come up since power-on.
    pub fn set_hse_up(&mut self, up: bool) {
        self.hse_up = up;
    }

    /// This chip's HSI frequency, before the clocks are set up.
    pub fn set_hsi(&mut self, hsi_hz: u64) {
        self.hsi_hz = hsi_hz;
    }

    /// Ready flags of CR: each follows its switch, but HSE is ready only while it is fed, and a PLL only while its
    /// source is.
    fn ready(&self) -> u32 {
        let cr = self.words[0];
        let mut on = cr & 0x1501_0001;
        if !(self.hse_fed && self.hse_up) {
            on &= !(1 << 16);
        }
        let source = if self.words[1] >> 22 & 1 == 1 { 1 << 16 } else { 1 };
        if on & source == 0 {
            on &= 0x0001_0001;
        }
        on << 1
    }

    /// Frequencies that the registers select.
    pub fn tree(&self) -> ClockTree {
        let (cfgr, pll) = (self.words[2], u64::from(self.words[1]));
        let source = if pll >> 22 & 1 == 1 { HSE_HZ } else { self.hsi_hz };
        let sysclk = match cfgr & 3 {
            0 => self.hsi_hz,
            1 => HSE_HZ,
            _ => source * (pll >> 6 & 0x1FF) / (pll & 0x3F).max(1) / (2 * ((pll >> 16 & 3) + 1)),
        };
        // HPRE skips 32.
        let ahb = cfgr >> 4 & 0xF;
        let hclk_hz = if ahb < 8 { sysclk } else { sysclk >> [1, 2, 3, 4, 6, 7, 8, 9][ahb as usize - 8] };
        let apb = |field: u32| if field & 7 < 4 { 1 } else { 2 << ((field & 7) - 4) };
        ClockTree { hclk_hz: hclk_hz.max(1), apb1_divider: apb(cfgr >> 10), apb2_divider: apb(cfgr >> 13) }
    }

    /// Read a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        let word = *self.words.get(offset as usize / 4)?;
        Some(match offset {
            0x00 => (word & !0x2A02_0002) | self.ready(),
            // SWS follows SW.
            0x08 => (word & !0xC) | (word & 3) << 2,
            0x70 => (word & !2) | (word & 1) << 1,
            0x74 => (word & 1) | (word & 1) << 1 | self.flags,
            0x04 | 0x0C..=0x18 | 0x20 | 0x24 | 0x30..=0x38 | 0x40 | 0x44 | 0x50..=0x64 | 0x80..=0x94 => word,
            _ => return None,
        })
    }

    /// Write; gives the reset bits that went from 0 to 1, as (offset from AHB1RSTR, bits).
    pub fn write(&mut self, offset: u32, value: u32, wait_states: u32, faults: &mut Faults) -> Option<(u32, u32)> {
        self.read(offset)?;
        let before = self.words[offset as usize / 4];
        self.words[offset as usize / 4] = value;
        match offset {
            0x00 if value & 1 << 16 != 0 && value & 1 << 18 == 0 => {
                faults.lint(Lint::HseCrystal);
            }
            0x04 if before != value && self.words[0] & 1 << 24 != 0 => {
                faults.lint(Lint::PllRuns);
            }
            0x08 => {
                let ready = match value & 3 {
                    0 => 1 << 1,
                    1 => 1 << 17,
                    _ => 1 << 25,
                };
                if self.ready() & ready == 0 {
                    faults.lint(Lint::ClockSource);
                }
                // DS10693 table 16 at 2.7 V and above: a wait state for every 30 MHz.
                if (self.tree().hclk_hz - 1) / 30_000_000 > u64::from(wait_states) {
                    faults.lint(Lint::WaitStates);
                }
            }
            0x74 if value & 1 << 24 != 0 => self.flags &= !reset_flag::ALL,
            _ => {}
        }
        if (RSTR..RSTR + 0x18).contains(&offset) {
            return Some((offset - RSTR, value & !before));
        }
        Some((0, 0))
    }
}
