//! Timers TIM2 to TIM7, TIM9 and TIM12 (RM0390 chapters 17 to 19): up-counting with compare flags, and encoder mode 3.
//! Channels neither drive a pin nor capture; a strict machine stops where one would.
//!
//! A counter is never stepped: its value follows from the time since it was last touched. In encoder mode it follows
//! from the board's quadrature count, which is read when the firmware reads the counter. TIM1, TIM8, TIM10, TIM11,
//! TIM13 and TIM14, which share interrupt lines, are not modelled.

use super::Wires;
use super::clock::{Clock, NEVER};
use super::fault::Lint;
use super::gpio::{Function, Pin};
use super::rcc::{Gate, apb1, apb2};

/// Fixed properties of a timer.
#[derive(Debug)]
pub struct TimerKind {
    /// Timer number.
    pub number: u8,
    /// Base address.
    pub base: u32,
    /// RCC gate.
    pub gate: Gate,
    irq: u8,
    wide: bool,
    apb2: bool,
    channels: usize,
}

/// Every modelled timer.
pub static TIMERS: [TimerKind; 8] = [
    TimerKind { number: 2, base: 0x4000_0000, gate: apb1(0), irq: 28, wide: true, apb2: false, channels: 4 },
    TimerKind { number: 3, base: 0x4000_0400, gate: apb1(1), irq: 29, wide: false, apb2: false, channels: 4 },
    TimerKind { number: 4, base: 0x4000_0800, gate: apb1(2), irq: 30, wide: false, apb2: false, channels: 4 },
    TimerKind { number: 5, base: 0x4000_0C00, gate: apb1(3), irq: 50, wide: true, apb2: false, channels: 4 },
    TimerKind { number: 6, base: 0x4000_1000, gate: apb1(4), irq: 54, wide: false, apb2: false, channels: 0 },
    TimerKind { number: 7, base: 0x4000_1400, gate: apb1(5), irq: 55, wide: false, apb2: false, channels: 0 },
    TimerKind { number: 9, base: 0x4001_4000, gate: apb2(16), irq: 24, wide: false, apb2: true, channels: 2 },
    TimerKind { number: 12, base: 0x4000_1800, gate: apb1(6), irq: 43, wide: false, apb2: false, channels: 2 },
];

/// Pins of channels 1 and 2 with their alternate function (DS10693 table 11).
pub(crate) fn encoder_pins(number: u8) -> Option<(u8, &'static [Pin], &'static [Pin])> {
    match number {
        2 => Some((1, &[('A', 0), ('A', 5), ('A', 15), ('B', 8)], &[('A', 1), ('B', 3), ('B', 9)])),
        3 => Some((2, &[('A', 6), ('B', 4), ('C', 6)], &[('A', 7), ('B', 5), ('C', 7)])),
        4 => Some((2, &[('B', 6), ('D', 12)], &[('B', 7), ('D', 13)])),
        5 => Some((2, &[('A', 0)], &[('A', 1)])),
        _ => None,
    }
}

const CEN: u32 = 1;
const URS: u32 = 1 << 2;
const DIR: u32 = 1 << 4;
const FLAGS: u32 = 0x1F;

/// A timer.
#[derive(Debug)]
pub struct Timer {
    kind: &'static TimerKind,
    cr1: u32,
    cr2: u32,
    smcr: u32,
    dier: u32,
    sr: u32,
    ccmr: [u32; 2],
    ccer: u32,
    psc: u32,
    arr: u32,
    ccr: [u32; 4],
    /// The prescaler in force: PSC is taken over at an update event.
    active_psc: u32,
    /// The count at cycle `start`, without the overflows before it.
    base: u64,
    start: u64,
    /// Count up to which flags have been set.
    seen: u64,
    /// Quadrature count of the board when the encoder was last looked at.
    quadrature: i64,
}

impl Timer {
    /// The timer after a reset.
    pub fn new(kind: &'static TimerKind) -> Self {
        Self {
            kind,
            cr1: 0,
            cr2: 0,
            smcr: 0,
            dier: 0,
            sr: 0,
            ccmr: [0; 2],
            ccer: 0,
            psc: 0,
            arr: if kind.wide { u32::MAX } else { 0xFFFF },
            ccr: [0; 4],
            active_psc: 0,
            base: 0,
            start: 0,
            seen: 0,
            quadrature: 0,
        }
    }

    /// Reset through the RCC.
    pub fn reset(&mut self, wires: &mut Wires<'_>) {
        *self = Self::new(self.kind);
        wires.nvic.set_line(self.kind.irq, false);
    }

    fn encoder(&self) -> bool {
        self.smcr & 7 == 3
    }

    fn counting(&self) -> bool {
        self.cr1 & CEN != 0 && !self.encoder()
    }

    /// CCxS of a channel: 0 is an output, all others are inputs.
    fn selection(&self, channel: usize) -> u32 {
        self.ccmr[channel / 2] >> (channel % 2 * 8) & 3
    }

    /// The channels that are outputs, with their CCRx: the flag is set where the count reaches it (RM0390 section 18.4.5).
    fn compares(&self) -> impl Iterator<Item = (usize, u32)> + use<> {
        let output = |channel: usize| channel < self.kind.channels && self.selection(channel) == 0;
        let compares: [_; 4] = std::array::from_fn(|channel| output(channel).then_some((channel, self.ccr[channel])));
        compares.into_iter().flatten()
    }

    /// Reports channels whose pins would do something. The encoder's two inputs count and need not capture.
    fn check_channels(&self, wires: &mut Wires<'_>) {
        let first = if self.encoder() { 2 } else { 0 };
        let on = |channel: &usize| self.cr1 & CEN != 0 && self.ccer >> (4 * channel) & 1 == 1;
        for channel in (first..self.kind.channels).filter(on) {
            wires.faults.lint(if self.selection(channel) == 0 { Lint::TimOutput } else { Lint::TimCapture });
        }
    }

    fn period(&self) -> u64 {
        u64::from(self.arr) + 1
    }

    /// HCLK cycles in a count.
    fn tick(&self, clock: &Clock) -> u64 {
        clock.timer_divider(self.kind.apb2) * (u64::from(self.active_psc) + 1)
    }

    fn total(&self, clock: &Clock, at: u64) -> u64 {
        if self.counting() { self.base + at.saturating_sub(self.start) / self.tick(clock) } else { self.base }
    }

    /// Make `at` the new origin of counting, keeping the count (and losing less than one count of the prescaler).
    pub fn rebase(&mut self, clock: &Clock, at: u64) {
        self.base = self.total(clock, at) % self.period();
        self.seen = self.base;
        self.start = at;
    }

    /// Set the flags of everything that happened up to `at`.
    pub fn sync(&mut self, at: u64, wires: &mut Wires<'_>) {
        let total = self.total(wires.clock, at);
        if total != self.seen {
            let period = self.period();
            if total / period > self.seen / period {
                self.sr |= 1;
            }
            for (channel, match_at) in self.compares() {
                let (value, passed) =
                    (u64::from(match_at), |count: u64| (count + period - u64::from(match_at)) / period);
                if value < period && passed(total) > passed(self.seen) {
                    self.sr |= 2 << channel;
                }
            }
            self.seen = total;
        }
        self.line(wires);
    }

    fn line(&self, wires: &mut Wires<'_>) {
        wires.nvic.set_line(self.kind.irq, self.sr & self.dier & FLAGS != 0);
    }

    /// When a flag with its interrupt enabled will next be set.
    pub fn next_event(&self, clock: &Clock) -> u64 {
        let waiting = self.dier & !self.sr & FLAGS;
        if waiting == 0 || !self.counting() {
            return NEVER;
        }
        let (period, seen) = (self.period(), self.seen);
        let overflow = (waiting & 1 != 0).then(|| (seen / period + 1) * period);
        let matches = self.compares().filter_map(|(channel, value)| {
            let value = u64::from(value);
            let here = seen / period * period + value;
            (waiting & 2 << channel != 0 && value < period).then(|| if here <= seen { here + period } else { here })
        });
        overflow
            .into_iter()
            .chain(matches)
            .min()
            .map_or(NEVER, |count| self.start + (count - self.base) * self.tick(clock))
    }

    /// Encoder mode: move the counter by the quadrature counts of the board.
    fn follow_encoder(&mut self, wires: &mut Wires<'_>) {
        let now = wires.board.quadrature(wires.clock.seconds(), self.kind.number);
        // CC1P or CC2P alone swaps the direction; both leave it.
        let inverted = (self.ccer >> 1 ^ self.ccer >> 5) & 1 == 1;
        let step = if inverted { self.quadrature.wrapping_sub(now) } else { now.wrapping_sub(self.quadrature) };
        self.quadrature = now;
        if self.cr1 & CEN == 0 || step == 0 {
            return;
        }
        if let Some((af, first, second)) = encoder_pins(self.kind.number) {
            wires.gpio.require("encoder A (TIMx_CH1)", Function::Alternate(af), first, wires.faults);
            wires.gpio.require("encoder B (TIMx_CH2)", Function::Alternate(af), second, wires.faults);
        }
        self.base = (self.base as i64 + step).rem_euclid(self.period() as i64) as u64;
        self.cr1 = if step < 0 { self.cr1 | DIR } else { self.cr1 & !DIR };
    }

    /// Read a register.
    pub fn read(&mut self, offset: u32, wires: &mut Wires<'_>) -> Option<u32> {
        if self.encoder() && matches!(offset, 0x00 | 0x24) {
            self.follow_encoder(wires);
        }
        Some(match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 => self.smcr,
            0x0C => self.dier,
            0x10 => {
                self.sync(wires.clock.now(), wires);
                self.sr
            }
            0x14 => 0,
            0x18 | 0x1C => self.ccmr[(offset as usize - 0x18) / 4],
            0x20 => self.ccer,
            0x24 => (self.total(wires.clock, wires.clock.now()) % self.period()) as u32,
            0x28 => self.psc,
            0x2C => self.arr,
            0x34..=0x40 => *self.ccr[..self.kind.channels].get((offset as usize - 0x34) / 4)?,
            _ => return None,
        })
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32, wires: &mut Wires<'_>) -> Option<()> {
        let now = wires.clock.now();
        if self.encoder() {
            self.follow_encoder(wires);
        }
        self.sync(now, wires);
        // The upper half of a 16-bit register does not exist; a bridge that repeats a halfword fills it.
        let value = if matches!(offset, 0x24 | 0x2C | 0x34..=0x40) { value } else { value & 0xFFFF };
        let limit = if self.kind.wide { u32::MAX } else { 0xFFFF };
        match offset {
            0x00 => {
                if value & 0x6A != 0 || (value & DIR != 0 && !self.encoder()) {
                    wires.faults.lint(Lint::TimCounting);
                }
                self.rebase(wires.clock, now);
                self.cr1 = value;
            }
            0x04 => {
                if value & 0xF8 != 0 {
                    wires.faults.lint(Lint::TimTrigger);
                }
                self.cr2 = value;
            }
            0x08 => {
                if !matches!(value & 7, 0 | 3) || value & 0xFF88 != 0 {
                    wires.faults.lint(Lint::TimSlave);
                }
                self.rebase(wires.clock, now);
                self.smcr = value;
                if self.encoder() {
                    self.quadrature = wires.board.quadrature(wires.clock.seconds(), self.kind.number);
                }
            }
            0x0C => {
                if value & 0xFF00 != 0 || (self.encoder() && value & FLAGS != 0) {
                    wires.faults.lint(Lint::TimDma);
                }
                self.dier = value;
            }
            0x10 => self.sr &= value,
            0x14 if value & 1 == 1 => self.update(now),
            0x14 => wires.faults.lint(Lint::TimEvent),
            0x18 | 0x1C => self.ccmr[(offset as usize - 0x18) / 4] = value,
            0x20 => self.ccer = value,
            0x24 => {
                self.rebase(wires.clock, now);
                self.base = u64::from(value & limit) % self.period();
                self.seen = self.base;
            }
            0x28 => self.psc = value & 0xFFFF,
            0x2C => {
                self.rebase(wires.clock, now);
                self.arr = value & limit;
                self.base %= self.period();
                self.seen = self.base;
            }
            0x34..=0x40 => *self.ccr[..self.kind.channels].get_mut((offset as usize - 0x34) / 4)? = value & limit,
            _ => return None,
        }
        if matches!(offset, 0x00 | 0x08 | 0x18 | 0x1C | 0x20) {
            self.check_channels(wires);
        }
        self.line(wires);
        Some(())
    }

    /// Update event by software: restart the count, take the prescaler over.
    fn update(&mut self, now: u64) {
        self.active_psc = self.psc;
        (self.base, self.seen, self.start) = (0, 0, now);
        if self.cr1 & URS == 0 {
            self.sr |= 1;
        }
    }
}
