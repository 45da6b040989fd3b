//! Independent watchdog (RM0390 chapter 20): a down-counter on the LSI that nothing but a reset stops.
//!
//! It keeps its own time in seconds, because the LSI does not depend on HCLK.

use super::clock::{Clock, NEVER};
use super::fault::{Faults, Lint};

/// Periods of the LSI that a new prescaler or reload value takes to reach the watchdog (RM0390 section 20.4.4).
const UPDATE_PERIODS: f64 = 5.0;

/// Watchdog state.
#[derive(Debug)]
pub struct Iwdg {
    lsi_hz: f64,
    prescaler: u32,
    reload: u32,
    unlocked: bool,
    /// Time of its reset, in seconds.
    due_s: Option<f64>,
    /// PVU and RVU: since when the update has been under way, in seconds.
    update_s: [Option<f64>; 2],
}

impl Iwdg {
    /// A stopped watchdog on an LSI of `lsi_hz`.
    pub fn new(lsi_hz: f64) -> Self {
        Self { lsi_hz, prescaler: 0, reload: 0xFFF, unlocked: false, due_s: None, update_s: [None; 2] }
    }

    /// System reset.
    pub fn reset(&mut self) {
        *self = Self::new(self.lsi_hz);
    }

    fn timeout_s(&self, counts: u32) -> f64 {
        // /4 to /256; codes 6 and 7 both mean /256.
        f64::from(counts + 1) * f64::from(4u32 << self.prescaler.min(6)) / self.lsi_hz
    }

    /// Time of its reset (s).
    pub fn next_event(&self, clock: &Clock) -> u64 {
        self.due_s.map_or(NEVER, |due| clock.cycle_at(due))
    }

    /// Which updates are under way. With the LSI off they stay so.
    fn status(&mut self, clock: &Clock, lsi_on: bool) -> u32 {
        let running = lsi_on || self.due_s.is_some();
        for since_s in &mut self.update_s {
            *since_s = since_s.map(|since_s| if running { since_s } else { clock.seconds() });
            *since_s = since_s.filter(|since_s| clock.seconds() < since_s + UPDATE_PERIODS / self.lsi_hz);
        }
        u32::from(self.update_s[0].is_some()) | u32::from(self.update_s[1].is_some()) << 1
    }

    fn update(&mut self, which: usize, clock: &Clock, faults: &mut Faults) {
        // An update that is over was cleared when SR was read.
        let done_s = |since_s: f64| since_s + UPDATE_PERIODS / self.lsi_hz;
        if self.update_s[which].is_some_and(|since_s| clock.seconds() < done_s(since_s)) {
            faults.lint(Lint::IwdgUpdate);
        }
        self.update_s[which] = Some(clock.seconds());
    }

    /// Read a register.
    pub fn read(&mut self, offset: u32, clock: &Clock, lsi_on: bool) -> Option<u32> {
        match offset {
            0x00 => Some(0),
            0x0C => Some(self.status(clock, lsi_on)),
            0x04 => Some(self.prescaler),
            0x08 => Some(self.reload),
            _ => None,
        }
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32, clock: &Clock, faults: &mut Faults) -> Option<()> {
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
            0x04 if self.unlocked => {
                self.update(0, clock, faults);
                self.prescaler = value & 7;
            }
            0x08 if self.unlocked => {
                self.update(1, clock, faults);
                self.reload = value & 0xFFF;
            }
            // Without the key the write has no effect, which no program can intend.
            0x04 | 0x08 => faults.lint(Lint::IwdgKey),
            _ => return None,
        }
        Some(())
    }
}
