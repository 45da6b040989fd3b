//! ADC1 (RM0390 chapter 13): software-started regular sequences, single or continuous, polled or through DMA.
//!
//! Conversions are computed in batches: the moment of the computation is not observable, only the instant that a sample
//! is taken at and the time of a flag or an interrupt. The board gives each sample for the end of its sampling window,
//! in order of time with every other call of the board. Injected sequences, external triggers, the analog watchdog and
//! resolutions below 12 bits are not modelled.

use super::Wires;
use super::clock::{Clock, NEVER};
use super::dma::{Dma, Request, Transfer};
use super::fault::Lint;
use super::gpio::{Function, Pin};
use super::memory::Memory;

const EOC: u32 = 1 << 1;
const STRT: u32 = 1 << 4;
const OVR: u32 = 1 << 5;

const SCAN: u32 = 1 << 8;
const ADON: u32 = 1;
const CONT: u32 = 1 << 1;
const DMA_ON: u32 = 1 << 8;
const DDS: u32 = 1 << 9;
const EOCS: u32 = 1 << 10;
const SWSTART: u32 = 1 << 30;
const IRQ: u8 = 18;

/// ADC clock cycles that a 12-bit conversion takes after sampling.
const CONVERSION: u64 = 12;
/// Channel of the internal reference.
const VREFINT: u8 = 17;

/// Pins of channels 0 to 15.
const PINS: [Pin; 16] = [
    ('A', 0),
    ('A', 1),
    ('A', 2),
    ('A', 3),
    ('A', 4),
    ('A', 5),
    ('A', 6),
    ('A', 7),
    ('B', 0),
    ('B', 1),
    ('C', 0),
    ('C', 1),
    ('C', 2),
    ('C', 3),
    ('C', 4),
    ('C', 5),
];

/// ADC1 and the common registers.
#[derive(Debug, Default)]
pub struct Adc {
    sr: u32,
    cr1: u32,
    cr2: u32,
    smpr: [u32; 2],
    sqr: [u32; 3],
    htr_ltr: [u32; 2],
    ccr: u32,
    dr: u32,
    /// The conversion in progress: when it completes, and its place in the sequence.
    running: Option<(u64, usize)>,
    /// The sample of that conversion, once its sampling window has closed.
    held: Option<u16>,
    /// Requests to the DMA are lost.
    stalled: bool,
}

impl Adc {
    /// Reset through the RCC.
    pub fn reset(&mut self, wires: &mut Wires<'_>) {
        *self = Self { stalled: self.stalled, ..Self::default() };
        wires.nvic.set_line(IRQ, false);
    }

    /// Stops all requests to the DMA, or lets them through again.
    pub fn stall(&mut self, stalled: bool) {
        self.stalled = stalled;
    }

    fn length(&self) -> usize {
        if self.cr1 & SCAN == 0 { 1 } else { (self.sqr[0] >> 20 & 0xF) as usize + 1 }
    }

    fn channel(&self, place: usize) -> u8 {
        (self.sqr[2 - place / 6] >> (5 * (place % 6)) & 0x1F) as u8
    }

    /// HCLK cycles in an ADC clock cycle.
    fn adc_cycle(&self, clock: &Clock) -> u64 {
        2 * (u64::from(self.ccr >> 16 & 3) + 1) * clock.apb_divider(true)
    }

    fn duration(&self, place: usize, clock: &Clock) -> u64 {
        let channel = u32::from(self.channel(place));
        let code = if channel < 10 { self.smpr[1] >> (3 * channel) } else { self.smpr[0] >> (3 * (channel - 10)) };
        ([3, 15, 28, 56, 84, 112, 144, 480][(code & 7) as usize] + CONVERSION) * self.adc_cycle(clock)
    }

    /// Convert everything that is due at `at`.
    pub fn catch_up(&mut self, at: u64, dma: &mut Dma, memory: &mut Memory, wires: &mut Wires<'_>) {
        while let Some((done, place)) = self.running {
            let hold = done - CONVERSION * self.adc_cycle(wires.clock);
            if self.held.is_none() && hold <= at {
                self.held = Some(self.sample(place, hold, wires));
            }
            if done > at {
                break;
            }
            let next = place + 1;
            let last = next >= self.length();
            self.dr = self.held.take().unwrap_or(0).into();
            self.deliver(last, dma, memory, wires);
            if self.overrun_by_dma() {
                self.running = None;
                break;
            }
            let follows = if !last { Some(next) } else { (self.cr2 & CONT != 0).then_some(0) };
            self.running = follows.map(|place| (done + self.duration(place, wires.clock), place));
        }
        self.line(wires);
    }

    fn sample(&self, place: usize, at: u64, wires: &mut Wires<'_>) -> u16 {
        let channel = self.channel(place);
        if let Some(&pin) = PINS.get(usize::from(channel)) {
            wires.gpio.require("ADC1_INx", Function::Analog, &[pin], wires.faults);
        } else if channel == VREFINT && self.ccr & 1 << 23 == 0 {
            wires.faults.lint(Lint::AdcVrefint);
        } else if channel != VREFINT {
            wires.faults.lint(Lint::AdcChannel);
        }
        let code = wires.board.adc(wires.clock.seconds_at(at), channel).min(0xFFF);
        if self.cr2 & 1 << 11 != 0 { code << 4 } else { code }
    }

    fn deliver(&mut self, last: bool, dma: &mut Dma, memory: &mut Memory, wires: &mut Wires<'_>) {
        if self.cr2 & DMA_ON == 0 {
            if self.sr & EOC != 0 && self.cr2 & EOCS != 0 {
                self.sr |= OVR;
            }
            if last || self.cr2 & EOCS != 0 {
                self.sr |= EOC;
            }
        } else if self.sr & OVR == 0
            && (self.stalled
                || dma.transfer(Request::Adc1, self.dr, memory, wires.nvic, wires.faults) == Transfer::Unserved)
        {
            // An item that is not fetched: requests and conversions stop until software clears OVR (RM0390 section
            // 13.8.1).
            self.sr |= EOC | OVR;
        }
    }

    /// Conversions are aborted and triggers ignored.
    fn overrun_by_dma(&self) -> bool {
        self.cr2 & DMA_ON != 0 && self.sr & OVR != 0
    }

    fn line(&self, wires: &mut Wires<'_>) {
        let high = (self.sr & EOC != 0 && self.cr1 >> 5 & 1 == 1) || (self.sr & OVR != 0 && self.cr1 >> 26 & 1 == 1);
        wires.nvic.set_line(IRQ, high);
    }

    /// When an interrupt of the ADC, or of the DMA stream behind it, may next be due.
    pub fn next_event(&self, dma: &Dma, clock: &Clock) -> u64 {
        let Some((done, place)) = self.running else { return NEVER };
        if self.cr2 & DMA_ON == 0 {
            return if self.cr1 >> 5 & 1 == 1 || self.cr1 >> 26 & 1 == 1 { done } else { NEVER };
        }
        if self.stalled {
            return done;
        }
        match dma.items_until_interrupt(Request::Adc1) {
            Some(u64::MAX) => NEVER,
            Some(items) => done + self.span(place, items - 1, clock),
            // No stream: an overrun is about to be reported.
            None => done,
        }
    }

    /// HCLK cycles that `items` conversions after the one at `place` take.
    fn span(&self, place: usize, items: u64, clock: &Clock) -> u64 {
        let length = self.length();
        let round: u64 = (0..length).map(|p| self.duration(p, clock)).sum();
        let rest = (1..=items as usize % length).map(|i| self.duration((place + i) % length, clock));
        items / length as u64 * round + rest.sum::<u64>()
    }

    /// Read a register; the caller has caught up.
    pub fn read(&mut self, offset: u32, wires: &mut Wires<'_>) -> Option<u32> {
        Some(match offset {
            0x00 => self.sr,
            0x04 => self.cr1,
            0x08 => self.cr2,
            0x0C | 0x10 => self.smpr[(offset as usize - 0x0C) / 4],
            0x24 | 0x28 => self.htr_ltr[(offset as usize - 0x24) / 4],
            0x2C..=0x34 => self.sqr[(offset as usize - 0x2C) / 4],
            0x4C => {
                self.sr &= !EOC;
                self.line(wires);
                self.dr
            }
            0x300 => self.sr & 0x3F,
            0x304 => self.ccr,
            _ => return None,
        })
    }

    /// Write a register; the caller has caught up.
    pub fn write(&mut self, offset: u32, value: u32, wires: &mut Wires<'_>) -> Option<()> {
        match offset {
            0x00 => self.sr &= value,
            0x04 => {
                if value & 0x03C0_FEC0 != 0 {
                    wires.faults.lint(Lint::AdcMode);
                }
                self.cr1 = value;
            }
            0x08 => self.control(value, wires),
            0x0C | 0x10 => self.smpr[(offset as usize - 0x0C) / 4] = value,
            0x24 | 0x28 => self.htr_ltr[(offset as usize - 0x24) / 4] = value,
            0x2C..=0x34 => self.sqr[(offset as usize - 0x2C) / 4] = value,
            0x304 => {
                if value & 0xEF1F != 0 {
                    wires.faults.lint(Lint::AdcMulti);
                }
                self.ccr = value;
            }
            _ => return None,
        }
        self.line(wires);
        Some(())
    }

    fn control(&mut self, value: u32, wires: &mut Wires<'_>) {
        if value & 0x3070_0000 != 0 || (value & DMA_ON != 0 && value & DDS == 0) {
            wires.faults.lint(Lint::AdcTrigger);
        }
        let was = std::mem::replace(&mut self.cr2, value & !SWSTART);
        if value & ADON == 0 {
            self.running = None;
            self.held = None;
        } else if value & SWSTART != 0 && self.running.is_none() && !self.overrun_by_dma() {
            // The first write of ADON only powers it up (RM0390 section 13.3.1).
            if was & ADON == 0 {
                wires.faults.lint(Lint::AdcPower);
            }
            self.sr |= STRT;
            self.running = Some((wires.clock.now() + self.duration(0, wires.clock), 0));
        }
    }
}
