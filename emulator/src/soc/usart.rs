//! USARTs (RM0390 chapter 25): transmit and receive with interrupts, one data register and one shift register each way.
//!
//! Bytes arrive at the rate that the firmware has set: a wrong BRR shows only in timing. DMA, parity, 9-bit data,
//! break, noise and framing errors, hardware flow control and synchronous modes are not modelled.

use super::clock::{Clock, NEVER};
use super::fault::Lint;
use super::gpio::{Function, Pin};
use super::peripheral::{Registers, Wires, registers};
use super::rcc::{Gate, apb1, apb2};
use std::collections::VecDeque;

/// Fixed properties of a USART.
#[derive(Debug)]
pub struct UsartKind {
    /// USART number.
    pub number: u8,
    /// Base address.
    pub base: u32,
    /// RCC gate.
    pub gate: Gate,
    irq: u8,
    af: u8,
    tx: &'static [Pin],
    /// Pins that can carry RX.
    pub rx: &'static [Pin],
}

/// Every modelled USART (pins: DS10693 table 11).
pub static USARTS: [UsartKind; 4] = [
    kind(1, 0x4001_1000, apb2(4), 37, 7, &[('A', 9), ('B', 6)], &[('A', 10), ('B', 7)]),
    kind(2, 0x4000_4400, apb1(17), 38, 7, &[('A', 2), ('D', 5)], &[('A', 3), ('D', 6)]),
    kind(
        3,
        0x4000_4800,
        apb1(18),
        39,
        7,
        &[('B', 10), ('C', 10), ('D', 8)],
        &[('B', 11), ('C', 11), ('C', 5), ('D', 9)],
    ),
    kind(6, 0x4001_1400, apb2(5), 71, 8, &[('C', 6)], &[('C', 7)]),
];

const fn kind(number: u8, base: u32, gate: Gate, irq: u8, af: u8, tx: &'static [Pin], rx: &'static [Pin]) -> UsartKind {
    UsartKind { number, base, gate, irq, af, tx, rx }
}

registers! {
    SR = 0x00 reset TXE | TC, DR = 0x04, BRR = 0x08, CR1 = 0x0C, CR2 = 0x10, CR3 = 0x14, GTPR = 0x18,
}

const ORE: u32 = 1 << 3;
const IDLE: u32 = 1 << 4;
const RXNE: u32 = 1 << 5;
const TC: u32 = 1 << 6;
const TXE: u32 = 1 << 7;
/// Flags that software clears by writing 0.
const WRITE_ZERO: u32 = RXNE | TC | 1 << 8 | 1 << 9;

const UE: u32 = 1 << 13;
const TE: u32 = 1 << 3;
const RE: u32 = 1 << 2;

/// A USART.
#[derive(Debug)]
pub struct Usart {
    kind: &'static UsartKind,
    registers: Registers<7>,
    transmit: Option<u8>,
    /// Byte in the transmit shift register, and when its stop bit ends.
    shifting: Option<(u64, u8)>,
    /// SR has been read: a read of DR now clears the error and idle flags.
    sr_read: bool,
    /// Bytes on the receive line: the first one's stop bit ends at `arrival`.
    incoming: VecDeque<u8>,
    arrival: u64,
    idle_at: u64,
}

impl Usart {
    /// The USART after a reset.
    pub fn new(kind: &'static UsartKind) -> Self {
        Self {
            kind,
            registers: Registers::new(REGISTERS),
            transmit: None,
            shifting: None,
            sr_read: false,
            incoming: VecDeque::new(),
            arrival: NEVER,
            idle_at: NEVER,
        }
    }

    /// Reset through the RCC. What is on the wire stays there.
    pub fn reset(&mut self, wires: &mut Wires<'_>) {
        let (incoming, arrival) = (std::mem::take(&mut self.incoming), self.arrival);
        *self = Self { incoming, arrival, ..Self::new(self.kind) };
        self.line(wires);
    }

    /// HCLK cycles in a character: start bit, data, stop bits.
    fn frame(&self, clock: &Clock) -> u64 {
        let (brr, cr1) = (self.registers[BRR], self.registers[CR1]);
        let bit = u64::from(if cr1 >> 15 & 1 == 1 { ((brr & 0xFFF0) | (brr & 7) << 1) / 2 } else { brr });
        let bits = 10 + u64::from(cr1 >> 12 & 1) + u64::from(self.registers[CR2] >> 13 & 1);
        // A receiver that is not set up yet sees the line at the rate of a console.
        let bit =
            if bit == 0 { clock.span(1.0 / 115_200.0) } else { bit * clock.apb_divider(self.kind.gate.on_apb2()) };
        (bit * bits).max(1)
    }

    fn receiving(&self) -> bool {
        self.registers[CR1] & (UE | RE) == UE | RE
    }

    /// The board sends bytes, starting at `at` or when the line is free.
    pub fn send(&mut self, at: u64, bytes: &[u8], wires: &mut Wires<'_>) {
        if self.incoming.is_empty() && !bytes.is_empty() {
            self.arrival = at + self.frame(wires.clock);
            self.idle_at = NEVER;
        }
        self.incoming.extend(bytes);
    }

    /// Complete everything that is due at `at`.
    pub fn sync(&mut self, at: u64, wires: &mut Wires<'_>) {
        if let Some((end, byte)) = self.shifting
            && end <= at
        {
            self.shifting = None;
            wires.board.uart_tx(wires.clock.seconds_at(end), self.kind.number, byte);
            self.load(end, wires);
            if self.shifting.is_none() {
                self.registers[SR] |= TC;
            }
        }
        if self.arrival <= at {
            self.arrive(wires);
        }
        if self.idle_at <= at {
            self.idle_at = NEVER;
            if self.receiving() {
                self.registers[SR] |= IDLE;
            }
        }
        self.line(wires);
    }

    fn arrive(&mut self, wires: &mut Wires<'_>) {
        let end = self.arrival;
        let Some(byte) = self.incoming.pop_front() else {
            self.arrival = NEVER;
            return;
        };
        if self.receiving() {
            wires.gpio.require("USARTx_RX", Function::Alternate(self.kind.af), self.kind.rx, wires.faults);
            if self.registers[SR] & RXNE != 0 {
                self.registers[SR] |= ORE;
            } else {
                self.registers[DR] = byte.into();
                self.registers[SR] |= RXNE;
            }
        }
        let frame = self.frame(wires.clock);
        // The line has to be quiet for a whole character before it counts as idle.
        (self.arrival, self.idle_at) =
            if self.incoming.is_empty() { (NEVER, end + frame) } else { (end + frame, NEVER) };
    }

    /// Move a waiting byte into the shift register at `at`.
    fn load(&mut self, at: u64, wires: &mut Wires<'_>) {
        if self.shifting.is_some() || self.registers[CR1] & (UE | TE) != UE | TE {
            return;
        }
        if let Some(byte) = self.transmit.take() {
            let function = Function::Alternate(self.kind.af);
            wires.gpio.require("USARTx_TX", function, self.kind.tx, wires.faults);
            if let Some(&pin) = self.kind.tx.iter().find(|&&pin| wires.gpio.function(pin) == function) {
                wires.board.uart_starts(wires.clock.seconds_at(at), pin, byte);
            }
            self.shifting = Some((at + self.frame(wires.clock), byte));
            self.registers[SR] |= TXE;
        }
    }

    fn line(&self, wires: &mut Wires<'_>) {
        let (sr, enabled) = (self.registers[SR], |bit: u32| self.registers[CR1] >> bit & 1 == 1);
        let high = (sr & TXE != 0 && enabled(7))
            || (sr & TC != 0 && enabled(6))
            || (sr & (RXNE | ORE) != 0 && enabled(5))
            // EIE counts only with DMAR, which is not modelled.
            || (sr & IDLE != 0 && enabled(4));
        wires.nvic.set_line(self.kind.irq, high);
    }

    /// When something next happens on the lines.
    pub fn next_event(&self) -> u64 {
        self.shifting.map_or(NEVER, |(end, _)| end).min(self.arrival).min(self.idle_at)
    }

    /// Read a register.
    pub fn read(&mut self, offset: u32, wires: &mut Wires<'_>) -> Option<u32> {
        match offset {
            SR => self.sr_read = true,
            DR => {
                self.registers[SR] &= !RXNE;
                if std::mem::take(&mut self.sr_read) {
                    self.registers[SR] &= !(ORE | IDLE | 0x7);
                }
                self.line(wires);
            }
            _ => {}
        }
        self.registers.get(offset)
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32, wires: &mut Wires<'_>) -> Option<()> {
        // The upper half does not exist; a bridge that repeats a halfword fills it.
        let value = value & 0xFFFF;
        match offset {
            // A read-modify-write of SR does this (RM0390 section 25.6.1).
            SR if value & RXNE == 0 && self.receiving() => wires.faults.lint(Lint::UsartRxne),
            CR1 if value & 0x1403 != 0 => wires.faults.lint(Lint::UsartMode),
            CR3 if value & 0x07FE & !(1 << 11) != 0 => wires.faults.lint(Lint::UsartDma),
            _ => {}
        }
        match offset {
            SR => self.registers[SR] &= value | !WRITE_ZERO,
            DR => {
                self.transmit = Some(value as u8);
                self.registers[SR] &= !TXE;
                self.load(wires.clock.now(), wires);
                // A write to DR after a read of SR clears TC.
                if std::mem::take(&mut self.sr_read) || self.shifting.is_some() {
                    self.registers[SR] &= !TC;
                }
            }
            _ => self.registers.set(offset, value)?,
        }
        if offset == CR1 {
            self.load(wires.clock.now(), wires);
        }
        self.line(wires);
        Some(())
    }
}
