//! USARTs (RM0390 chapter 25): transmit and receive with interrupts, one data register and one shift register each way.
//!
//! Bytes arrive at the rate that the firmware has set: a wrong BRR shows only in timing. DMA, parity, 9-bit data,
//! break, noise and framing errors, hardware flow control and synchronous modes are not modelled.

use super::Wires;
use super::clock::{Clock, NEVER};
use super::fault::Lint;
use super::gpio::{Function, Pin};
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
    apb2: bool,
    af: u8,
    tx: &'static [Pin],
    /// Pins that can carry RX.
    pub rx: &'static [Pin],
}

/// Every modelled USART (pins: DS10693 table 11).
pub static USARTS: [UsartKind; 4] = [
    UsartKind {
        number: 1,
        base: 0x4001_1000,
        gate: apb2(4),
        irq: 37,
        apb2: true,
        af: 7,
        tx: &[('A', 9), ('B', 6)],
        rx: &[('A', 10), ('B', 7)],
    },
    UsartKind {
        number: 2,
        base: 0x4000_4400,
        gate: apb1(17),
        irq: 38,
        apb2: false,
        af: 7,
        tx: &[('A', 2), ('D', 5)],
        rx: &[('A', 3), ('D', 6)],
    },
    UsartKind {
        number: 3,
        base: 0x4000_4800,
        gate: apb1(18),
        irq: 39,
        apb2: false,
        af: 7,
        tx: &[('B', 10), ('C', 10), ('D', 8)],
        rx: &[('B', 11), ('C', 11), ('C', 5), ('D', 9)],
    },
    UsartKind {
        number: 6,
        base: 0x4001_1400,
        gate: apb2(5),
        irq: 71,
        apb2: true,
        af: 8,
        tx: &[('C', 6)],
        rx: &[('C', 7)],
    },
];

const ORE: u32 = 1 << 3;
const IDLE: u32 = 1 << 4;
const RXNE: u32 = 1 << 5;
const TC: u32 = 1 << 6;
const TXE: u32 = 1 << 7;
/// Flags that software clears by writing 0.
const WRITE_ZERO: u32 = RXNE | TC | 1 << 8 | 1 << 9;
/// CR1: the USART and its receiver are on.
const RECEIVER_ON: u32 = 1 << 13 | 1 << 2;

const UE: u32 = 1 << 13;
const TE: u32 = 1 << 3;
const RE: u32 = 1 << 2;

/// A USART.
#[derive(Debug)]
pub struct Usart {
    kind: &'static UsartKind,
    sr: u32,
    brr: u32,
    cr1: u32,
    cr2: u32,
    cr3: u32,
    gtpr: u32,
    transmit: Option<u8>,
    /// Byte in the transmit shift register, and when its stop bit ends.
    shifting: Option<(u64, u8)>,
    received: u8,
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
            sr: TXE | TC,
            brr: 0,
            cr1: 0,
            cr2: 0,
            cr3: 0,
            gtpr: 0,
            transmit: None,
            shifting: None,
            received: 0,
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
        let bit = if self.cr1 >> 15 & 1 == 1 {
            u64::from((self.brr & 0xFFF0) | (self.brr & 7) << 1) / 2
        } else {
            u64::from(self.brr)
        };
        let bits = 10 + u64::from(self.cr1 >> 12 & 1) + u64::from(self.cr2 >> 13 & 1);
        // A receiver that is not set up yet sees the line at the rate of a console.
        let bit = if bit == 0 { clock.span(1.0 / 115_200.0) } else { bit * clock.apb_divider(self.kind.apb2) };
        (bit * bits).max(1)
    }

    fn receiving(&self) -> bool {
        self.cr1 & UE != 0 && self.cr1 & RE != 0
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
                self.sr |= TC;
            }
        }
        if self.arrival <= at {
            self.arrive(wires);
        }
        if self.idle_at <= at {
            self.idle_at = NEVER;
            if self.receiving() {
                self.sr |= IDLE;
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
            if self.sr & RXNE != 0 {
                self.sr |= ORE;
            } else {
                self.received = byte;
                self.sr |= RXNE;
            }
        }
        let frame = self.frame(wires.clock);
        // The line has to be quiet for a whole character before it counts as idle.
        (self.arrival, self.idle_at) =
            if self.incoming.is_empty() { (NEVER, end + frame) } else { (end + frame, NEVER) };
    }

    /// Move a waiting byte into the shift register at `at`.
    fn load(&mut self, at: u64, wires: &mut Wires<'_>) {
        if self.shifting.is_some() || self.cr1 & UE == 0 || self.cr1 & TE == 0 {
            return;
        }
        if let Some(byte) = self.transmit.take() {
            let function = Function::Alternate(self.kind.af);
            wires.gpio.require("USARTx_TX", function, self.kind.tx, wires.faults);
            if let Some(&pin) = self.kind.tx.iter().find(|&&pin| wires.gpio.function(pin) == function) {
                wires.board.uart_starts(wires.clock.seconds_at(at), pin, byte);
            }
            self.shifting = Some((at + self.frame(wires.clock), byte));
            self.sr |= TXE;
        }
    }

    fn line(&self, wires: &mut Wires<'_>) {
        let enabled = |bit: u32| self.cr1 >> bit & 1 == 1;
        let high = (self.sr & TXE != 0 && enabled(7))
            || (self.sr & TC != 0 && enabled(6))
            || (self.sr & (RXNE | ORE) != 0 && enabled(5))
            // EIE counts only with DMAR, which is not modelled.
            || (self.sr & IDLE != 0 && enabled(4));
        wires.nvic.set_line(self.kind.irq, high);
    }

    /// When something next happens on the lines.
    pub fn next_event(&self) -> u64 {
        self.shifting.map_or(NEVER, |(end, _)| end).min(self.arrival).min(self.idle_at)
    }

    /// Read a register.
    pub fn read(&mut self, offset: u32, wires: &mut Wires<'_>) -> Option<u32> {
        Some(match offset {
            0x00 => {
                self.sr_read = true;
                self.sr
            }
            0x04 => {
                self.sr &= !RXNE;
                if std::mem::take(&mut self.sr_read) {
                    self.sr &= !(ORE | IDLE | 0x7);
                }
                self.line(wires);
                self.received.into()
            }
            0x08 => self.brr,
            0x0C => self.cr1,
            0x10 => self.cr2,
            0x14 => self.cr3,
            0x18 => self.gtpr,
            _ => return None,
        })
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32, wires: &mut Wires<'_>) -> Option<()> {
        // The upper half does not exist; a bridge that repeats a halfword fills it.
        let value = value & 0xFFFF;
        match offset {
            0x00 => {
                if value & RXNE == 0 && self.cr1 & RECEIVER_ON == RECEIVER_ON {
                    // A read-modify-write of SR does this (RM0390 section 25.6.1).
                    wires.faults.lint(Lint::UsartRxne);
                }
                self.sr &= value | !WRITE_ZERO;
            }
            0x04 => {
                self.transmit = Some(value as u8);
                self.sr &= !TXE;
                // A write to DR after a read of SR clears TC.
                if std::mem::take(&mut self.sr_read) {
                    self.sr &= !TC;
                }
                self.load(wires.clock.now(), wires);
                if self.shifting.is_some() {
                    self.sr &= !TC;
                }
            }
            0x08 => self.brr = value & 0xFFFF,
            0x0C => {
                if value & 0x1403 != 0 {
                    wires.faults.lint(Lint::UsartMode);
                }
                self.cr1 = value;
                self.load(wires.clock.now(), wires);
            }
            0x10 => self.cr2 = value,
            0x14 => {
                if value & 0x07FE & !(1 << 11) != 0 {
                    wires.faults.lint(Lint::UsartDma);
                }
                self.cr3 = value;
            }
            0x18 => self.gtpr = value,
            _ => return None,
        }
        self.line(wires);
        Some(())
    }
}
