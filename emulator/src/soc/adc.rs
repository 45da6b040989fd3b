//! ADC1 (RM0390 chapter 13): software-started regular sequences, single or continuous, polled or through DMA.
//!
//! Conversions are computed in batches: the moment of the computation is not observable, only the instant that a sample
//! is taken at and the time of a flag or an interrupt. The board gives each sample for the end of its sampling window,
//! in order of time with every other call of the board. Injected sequences, external triggers, the analog watchdog and
//! resolutions below 12 bits are not modelled.

use super::clock::{Clock, NEVER};
use super::dma::Dma;
use super::fault::Lint;
use super::gpio::{Function, Pin};
use super::memory::Memory;
use super::peripheral::{Registers, Wires, registers};

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

/// The pin of a channel from 0 to 15 (DS10693 table 10).
pub fn pin(channel: u8) -> Option<Pin> {
    match channel {
        0..=7 => Some(('A', channel)),
        8..=9 => Some(('B', channel - 8)),
        10..=15 => Some(('C', channel - 10)),
        _ => None,
    }
}

registers! {
    SR = 0x00, CR1 = 0x04, CR2 = 0x08, SMPR1 = 0x0C, SMPR2 = 0x10, HTR = 0x24, LTR = 0x28,
    SQR1 = 0x2C, SQR2 = 0x30, SQR3 = 0x34, DR = 0x4C,
}
/// Common registers, at their offset from ADC1.
const CSR: u32 = 0x300;
const CCR: u32 = 0x304;

/// ADC1 and the common registers.
#[derive(Debug)]
pub struct Adc {
    registers: Registers<20>,
    ccr: u32,
    /// The conversion in progress: when it completes, and its place in the sequence.
    running: Option<(u64, usize)>,
    /// The sample of that conversion, once its sampling window has closed.
    held: Option<u16>,
    /// Requests to the DMA are lost.
    stalled: bool,
}

impl Default for Adc {
    fn default() -> Self {
        Self { registers: Registers::new(REGISTERS), ccr: 0, running: None, held: None, stalled: false }
    }
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
        if self.registers[CR1] & SCAN == 0 { 1 } else { (self.registers[SQR1] >> 20 & 0xF) as usize + 1 }
    }

    fn channel(&self, place: usize) -> u8 {
        (self.registers[SQR3 - 4 * (place as u32 / 6)] >> (5 * (place % 6)) & 0x1F) as u8
    }

    /// HCLK cycles in an ADC clock cycle.
    fn adc_cycle(&self, clock: &Clock) -> u64 {
        2 * (u64::from(self.ccr >> 16 & 3) + 1) * clock.apb_divider(true)
    }

    fn duration(&self, place: usize, clock: &Clock) -> u64 {
        let channel = u32::from(self.channel(place));
        let smpr = self.registers[if channel < 10 { SMPR2 } else { SMPR1 }];
        let code = smpr >> (3 * (channel % 10));
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
            self.registers[DR] = self.held.take().unwrap_or(0).into();
            self.deliver(last, dma, memory, wires);
            if self.overrun_by_dma() {
                self.running = None;
                break;
            }
            let follows = if !last { Some(next) } else { (self.registers[CR2] & CONT != 0).then_some(0) };
            self.running = follows.map(|place| (done + self.duration(place, wires.clock), place));
        }
        self.line(wires);
    }

    fn sample(&self, place: usize, at: u64, wires: &mut Wires<'_>) -> u16 {
        let channel = self.channel(place);
        if let Some(pin) = pin(channel) {
            wires.gpio.require("ADC1_INx", Function::Analog, &[pin], wires.faults);
        } else if channel == VREFINT && self.ccr & 1 << 23 == 0 {
            wires.faults.lint(Lint::AdcVrefint);
        } else if channel != VREFINT {
            wires.faults.lint(Lint::AdcChannel);
        }
        let code = wires.board.adc(wires.clock.seconds_at(at), channel).min(0xFFF);
        if self.registers[CR2] & 1 << 11 != 0 { code << 4 } else { code }
    }

    fn deliver(&mut self, last: bool, dma: &mut Dma, memory: &mut Memory, wires: &mut Wires<'_>) {
        if self.registers[CR2] & DMA_ON == 0 {
            if self.registers[SR] & EOC != 0 && self.registers[CR2] & EOCS != 0 {
                self.registers[SR] |= OVR;
            }
            if last || self.registers[CR2] & EOCS != 0 {
                self.registers[SR] |= EOC;
            }
        } else if self.registers[SR] & OVR == 0
            && (self.stalled || !dma.transfer(self.registers[DR], memory, wires.nvic, wires.faults))
        {
            // An item that is not fetched: requests and conversions stop until software clears OVR (RM0390 section
            // 13.8.1).
            self.registers[SR] |= EOC | OVR;
        }
    }

    /// Conversions are aborted and triggers ignored.
    fn overrun_by_dma(&self) -> bool {
        self.registers[CR2] & DMA_ON != 0 && self.registers[SR] & OVR != 0
    }

    fn line(&self, wires: &mut Wires<'_>) {
        let high = (self.registers[SR] & EOC != 0 && self.registers[CR1] >> 5 & 1 == 1)
            || (self.registers[SR] & OVR != 0 && self.registers[CR1] >> 26 & 1 == 1);
        wires.nvic.set_line(IRQ, high);
    }

    /// When an interrupt of the ADC, or of the DMA stream behind it, may next be due.
    pub fn next_event(&self, dma: &Dma, clock: &Clock) -> u64 {
        let Some((done, place)) = self.running else { return NEVER };
        if self.registers[CR2] & DMA_ON == 0 {
            return if self.registers[CR1] >> 5 & 1 == 1 || self.registers[CR1] >> 26 & 1 == 1 { done } else { NEVER };
        }
        if self.stalled {
            return done;
        }
        match dma.items_until_interrupt() {
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
        match offset {
            DR => {
                self.registers[SR] &= !EOC;
                self.line(wires);
            }
            CSR => return Some(self.registers[SR] & 0x3F),
            CCR => return Some(self.ccr),
            _ => {}
        }
        self.registers.get(offset)
    }

    /// Write a register; the caller has caught up.
    pub fn write(&mut self, offset: u32, value: u32, wires: &mut Wires<'_>) -> Option<()> {
        match offset {
            CR1 if value & 0x03C0_FEC0 != 0 => wires.faults.lint(Lint::AdcMode),
            CCR if value & 0xEF1F != 0 => wires.faults.lint(Lint::AdcMulti),
            _ => {}
        }
        match offset {
            SR => self.registers[SR] &= value,
            CR2 => self.control(value, wires),
            CCR => self.ccr = value,
            // Read-only.
            DR => return None,
            _ => self.registers.set(offset, value)?,
        }
        self.line(wires);
        Some(())
    }

    fn control(&mut self, value: u32, wires: &mut Wires<'_>) {
        if value & 0x3070_0000 != 0 || (value & DMA_ON != 0 && value & DDS == 0) {
            wires.faults.lint(Lint::AdcTrigger);
        }
        let was = std::mem::replace(&mut self.registers[CR2], value & !SWSTART);
        if value & ADON == 0 {
            self.running = None;
            self.held = None;
        } else if value & SWSTART != 0 && self.running.is_none() && !self.overrun_by_dma() {
            // The first write of ADON only powers it up (RM0390 section 13.3.1).
            if was & ADON == 0 {
                wires.faults.lint(Lint::AdcPower);
            }
            self.registers[SR] |= STRT;
            self.running = Some((wires.clock.now() + self.duration(0, wires.clock), 0));
        }
    }
}
