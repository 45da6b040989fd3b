//! Independent watchdog (RM0390 chapter 20): a down-counter on the LSI that nothing but a reset stops.
//!
//! It keeps its own time in seconds, because the LSI does not care what HCLK is.

use super::clock::{Clock, NEVER};

/// Watchdog state.
#[derive(Debug)]
pub struct Iwdg {
    lsi_hz: f64,
    prescaler: u32,
    reload: u32,
    unlocked: bool,
    /// When it bites, in seconds.
    due_s: Option<f64>,
}

impl Iwdg {
    /// A stopped watchdog on an LSI of `lsi_hz`.
    pub fn new(lsi_hz: f64) -> Self {
        Self { lsi_hz, prescaler: 0, reload: 0xFFF, unlocked: false, due_s: None }
    }

    /// System reset.
    pub fn reset(&mut self) {
        *self = Self::new(self.lsi_hz);
    }

    fn timeout_s(&self, counts: u32) -> f64 {
        // /4 to /256; codes 6 and 7 both mean /256.
        f64::from(counts + 1) * f64::from(4u32 << self.prescaler.min(6)) / self.lsi_hz
    }

    /// When it bites.
    pub fn next_event(&self, clock: &Clock) -> u64 {
        self.due_s.map_or(NEVER, |due| clock.cycle_at(due))
    }

    /// Read a register. Updates are instantaneous, so SR is 0.
    pub fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            0x00 | 0x0C => Some(0),
            0x04 => Some(self.prescaler),
            0x08 => Some(self.reload),
            _ => None,
        }
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32, clock: &Clock) -> Option<()> {
        match offset {
            0x00 => {
                self.unlocked = value & 0xFFFF == 0x5555;
                match value & 0xFFFF {
                    0xAAAA if self.due_s.is_some() => self.due_s = Some(clock.seconds() + self.timeout_s(self.reload)),
                    // It starts from the counter's reset value, not from RLR (RM0390 section 20.3).
                    0xCCCC if self.due_s.is_none() => self.due_s = Some(clock.seconds() + self.timeout_s(0xFFF)),
                    _ => {}
                }
            }
            0x04 if self.unlocked => self.prescaler = value & 7,
            0x08 if self.unlocked => self.reload = value & 0xFFF,
            // Without the key the write has no effect.
            0x04 | 0x08 => {}
            _ => return None,
        }
        Some(())
    }
}
