//! Timers TIM2 to TIM7, TIM9 and TIM12 (RM0390 chapters 17 to 19): up-counting with compare flags, and encoder mode 3.
//! Channels neither drive a pin nor capture; a strict machine stops where one would.
//!
//! A counter is never stepped: its value follows from the time since it was last touched. In encoder mode it follows
//! from the board's quadrature count, which is read when the firmware reads the counter. TIM1, TIM8, TIM10, TIM11,
//! TIM13 and TIM14, which fraction interrupt lines, are not modelled.

use super::clock::{Clock, NEVER};
use super::fault::Lint;
use super::gpio::{Function, Pin};
use super::peripheral::{Registers, Wires, registers};
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
    channels: u32,
}

impl TimerKind {
    /// The maximum count.
    fn limit(&self) -> u32 {
        if self.wide { u32::MAX } else { 0xFFFF }
    }
}

/// Every modelled timer.
pub static TIMERS: [TimerKind; 8] = [
    TimerKind { number: 2, base: 0x4000_0000, gate: apb1(0), irq: 28, wide: true, channels: 4 },
    TimerKind { number: 3, base: 0x4000_0400, gate: apb1(1), irq: 29, wide: false, channels: 4 },
    TimerKind { number: 4, base: 0x4000_0800, gate: apb1(2), irq: 30, wide: false, channels: 4 },
    TimerKind { number: 5, base: 0x4000_0C00, gate: apb1(3), irq: 50, wide: true, channels: 4 },
    TimerKind { number: 6, base: 0x4000_1000, gate: apb1(4), irq: 54, wide: false, channels: 0 },
    TimerKind { number: 7, base: 0x4000_1400, gate: apb1(5), irq: 55, wide: false, channels: 0 },
    TimerKind { number: 9, base: 0x4001_4000, gate: apb2(16), irq: 24, wide: false, channels: 2 },
    TimerKind { number: 12, base: 0x4000_1800, gate: apb1(6), irq: 43, wide: false, channels: 2 },
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

registers! {
    CR1 = 0x00, CR2 = 0x04, SMCR = 0x08, DIER = 0x0C, SR = 0x10, EGR = 0x14,
    CCMR1 = 0x18, CCMR2 = 0x1C, CCER = 0x20, CNT = 0x24, PSC = 0x28,
}
/// Those that depend on the timer.
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;

const CEN: u32 = 1;
const URS: u32 = 1 << 2;
const DIR: u32 = 1 << 4;
const FLAGS: u32 = 0x1F;

/// A timer.
#[derive(Debug)]
pub struct Timer {
    kind: &'static TimerKind,
    registers: Registers<17>,
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
        let compares = (0..kind.channels).map(|channel| (CCR1 + 4 * channel, 0));
        let own = [(ARR, kind.limit())].into_iter().chain(compares);
        let registers = Registers::new(&REGISTERS.iter().copied().chain(own).collect::<Vec<_>>());
        Self { kind, registers, active_psc: 0, base: 0, start: 0, seen: 0, quadrature: 0 }
    }

    /// Reset through the RCC.
    pub fn reset(&mut self, wires: &mut Wires<'_>) {
        *self = Self::new(self.kind);
        wires.nvic.set_line(self.kind.irq, false);
    }

    fn encoder(&self) -> bool {
        self.registers[SMCR] & 7 == 3
    }

    fn counting(&self) -> bool {
        self.registers[CR1] & CEN != 0 && !self.encoder()
    }

    /// CCxS of a channel: 0 is an output, all others are inputs.
    fn selection(&self, channel: u32) -> u32 {
        self.registers[CCMR1 + channel / 2 * 4] >> (channel % 2 * 8) & 3
    }

    /// The channels that are outputs, with their CCRx: the flag is set where the count reaches it (RM0390 section 18.4.5).
    fn compares(&self) -> impl Iterator<Item = (u32, u64)> {
        let outputs = (0..self.kind.channels).filter(|&channel| self.selection(channel) == 0);
        outputs.map(|channel| (channel, self.registers[CCR1 + 4 * channel].into()))
    }

    /// Reports channels whose pins would do something. The encoder's two inputs count and need not capture.
    fn check_channels(&self, wires: &mut Wires<'_>) {
        let first = if self.encoder() { 2 } else { 0 };
        let enabled = self.registers[CR1] & CEN != 0;
        let on = |channel: &u32| enabled && self.registers[CCER] >> (4 * channel) & 1 == 1;
        for channel in (first..self.kind.channels).filter(on) {
            wires.faults.lint(if self.selection(channel) == 0 { Lint::TimOutput } else { Lint::TimCapture });
        }
    }

    fn period(&self) -> u64 {
        u64::from(self.registers[ARR]) + 1
    }

    /// HCLK cycles in a count.
    fn tick(&self, clock: &Clock) -> u64 {
        clock.timer_divider(self.kind.gate.on_apb2()) * (u64::from(self.active_psc) + 1)
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
                self.registers[SR] |= 1;
            }
            let passed = |value: u64, count: u64| (count + period - value) / period;
            let reached = |&(_, value): &(u32, u64)| value < period && passed(value, total) > passed(value, self.seen);
            let flags = self.compares().filter(reached).fold(0, |flags, (channel, _)| flags | 2 << channel);
            self.registers[SR] |= flags;
            self.seen = total;
        }
        self.line(wires);
    }

    fn line(&self, wires: &mut Wires<'_>) {
        wires.nvic.set_line(self.kind.irq, self.registers[SR] & self.registers[DIER] & FLAGS != 0);
    }

    /// When a flag with its interrupt enabled will next be set.
    pub fn next_event(&self, clock: &Clock) -> u64 {
        let waiting = self.registers[DIER] & !self.registers[SR] & FLAGS;
        if waiting == 0 || !self.counting() {
            return NEVER;
        }
        let (period, seen) = (self.period(), self.seen);
        let overflow = (waiting & 1 != 0).then(|| (seen / period + 1) * period);
        let matches = self.compares().filter_map(|(channel, value)| {
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
        let inverted = (self.registers[CCER] >> 1 ^ self.registers[CCER] >> 5) & 1 == 1;
        let step = if inverted { self.quadrature.wrapping_sub(now) } else { now.wrapping_sub(self.quadrature) };
        self.quadrature = now;
        if self.registers[CR1] & CEN == 0 || step == 0 {
            return;
        }
        if let Some((af, first, second)) = encoder_pins(self.kind.number) {
            wires.gpio.require("encoder A (TIMx_CH1)", Function::Alternate(af), first, wires.faults);
            wires.gpio.require("encoder B (TIMx_CH2)", Function::Alternate(af), second, wires.faults);
        }
        self.base = (self.base as i64 + step).rem_euclid(self.period() as i64) as u64;
        let cr1 = self.registers[CR1] & !DIR;
        self.registers[CR1] = if step < 0 { cr1 | DIR } else { cr1 };
    }

    /// Read a register.
    pub fn read(&mut self, offset: u32, wires: &mut Wires<'_>) -> Option<u32> {
        if self.encoder() && matches!(offset, CR1 | CNT) {
            self.follow_encoder(wires);
        }
        match offset {
            SR => self.sync(wires.clock.now(), wires),
            CNT => return Some((self.total(wires.clock, wires.clock.now()) % self.period()) as u32),
            _ => {}
        }
        self.registers.get(offset)
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32, wires: &mut Wires<'_>) -> Option<()> {
        let now = wires.clock.now();
        if self.encoder() {
            self.follow_encoder(wires);
        }
        self.sync(now, wires);
        // The upper half of a 16-bit register does not exist; a bridge that repeats a halfword fills it.
        let value = value & if matches!(offset, CNT | ARR) || offset >= CCR1 { self.kind.limit() } else { 0xFFFF };
        let encoder = if offset == SMCR { value & 7 == 3 } else { self.encoder() };
        let lint = match offset {
            CR1 if value & 0x6A != 0 || (value & DIR != 0 && !encoder) => Some(Lint::TimCounting),
            CR2 if value & 0xF8 != 0 => Some(Lint::TimTrigger),
            SMCR if !matches!(value & 7, 0 | 3) || value & 0xFF88 != 0 => Some(Lint::TimSlave),
            DIER if value & 0xFF00 != 0 || (encoder && value & FLAGS != 0) => Some(Lint::TimDma),
            EGR if value & 1 == 0 => Some(Lint::TimEvent),
            _ => None,
        };
        if let Some(lint) = lint {
            wires.faults.lint(lint);
        }
        if matches!(offset, CR1 | SMCR | CNT | ARR) {
            self.rebase(wires.clock, now);
        }
        match offset {
            SR => self.registers[SR] &= value,
            EGR if value & 1 == 1 => self.update(now),
            EGR => {}
            CNT => self.base = u64::from(value) % self.period(),
            _ => self.registers.set(offset, value)?,
        }
        if matches!(offset, CNT | ARR) {
            self.base %= self.period();
            self.seen = self.base;
        }
        if offset == SMCR && encoder {
            self.quadrature = wires.board.quadrature(wires.clock.seconds(), self.kind.number);
        }
        if matches!(offset, CR1 | SMCR | CCMR1 | CCMR2 | CCER) {
            self.check_channels(wires);
        }
        self.line(wires);
        Some(())
    }

    /// Update event by software: restart the count, take the prescaler over.
    fn update(&mut self, now: u64) {
        self.active_psc = self.registers[PSC];
        (self.base, self.seen, self.start) = (0, 0, now);
        if self.registers[CR1] & URS == 0 {
            self.registers[SR] |= 1;
        }
    }
}
