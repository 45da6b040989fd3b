//! bxCAN CAN1 (RM0390 chapter 30) and the bus it is on.
//!
//! - [`wire`]: lengths of frames in bits, arbitration.
//! - `transmit`: mailboxes. - `receive`: FIFOs. - `filter`: acceptance filters.
//! - `errors`: error counters and bus-off.
//!
//! Other nodes' frames and the controller's own share the bus: one frame at a time, the lower identifier first. The
//! board decides what becomes of a frame. Time-triggered transmission and receive errors are not modelled.

mod errors;
mod filter;
mod receive;
mod transmit;
pub mod wire;

use self::errors::{Errors, Lec};
use self::filter::Filters;
use self::receive::Fifo;
use self::transmit::{End, Mailboxes};
use self::wire::{PAUSE, arbitration, frame_bits};
use super::clock::{Clock, NEVER};
use super::fault::{Faults, Lint};
use super::gpio::{Function, Pin};
use super::peripheral::Wires;
use super::rcc::{Gate, apb1};
use rig_plant::board::{CanFrame, CanOutcome};
use std::collections::VecDeque;

/// RCC gate of CAN1.
pub const GATE: Gate = apb1(25);
/// Base address of CAN1.
pub const BASE: u32 = 0x4000_6400;

const RX_PINS: [Pin; 3] = [('A', 11), ('B', 8), ('D', 0)];
const TX_PINS: [Pin; 3] = [('A', 12), ('B', 9), ('D', 1)];
const AF: Function = Function::Alternate(9);

const INRQ: u32 = 1;
const SLEEP: u32 = 1 << 1;
const TXFP: u32 = 1 << 2;
const TTCM: u32 = 1 << 7;
const RFLM: u32 = 1 << 3;
const NART: u32 = 1 << 4;
const AWUM: u32 = 1 << 5;
/// MSR: a start of frame came while the controller was asleep.
const WKUI: u32 = 1 << 3;
const ABOM: u32 = 1 << 6;
const LBKM: u32 = 1 << 30;
const SILM: u32 = 1 << 31;

/// In place of a cycle: the controller listens for a quiet bus, and the quiet has not begun.
const LISTENING: u64 = NEVER - 1;

/// Recessive bits that a node has to see before it takes part.
const JOIN_BITS: u64 = 11;
/// Recessive bits that lead out of bus-off.
const RECOVERY_BITS: u64 = 128 * 11;
/// Error flag, delimiter and pause.
const ERROR_BITS: u64 = 6 + 8 + PAUSE;
/// What an error-passive transmitter waits on top.
const SUSPEND_BITS: u64 = 8;
/// Bits after the ACK slot, which an acknowledge error cuts off: delimiter and end of frame.
const AFTER_ACK: u64 = 8;
/// Where in a frame a disturbed bus is noticed: somewhere in the arbitration field.
const DISTURBED_BITS: u64 = 12;

/// Which node has the bus.
#[derive(Clone, Copy, Debug)]
enum Bus {
    /// None, from this cycle on.
    Free(u64),
    /// The controller, until this cycle.
    Own(u64, usize, CanFrame),
    /// Another node.
    Other(u64, CanFrame),
}

/// CAN1.
#[derive(Debug)]
pub struct Can {
    mcr: u32,
    ier: u32,
    btr: u32,
    /// SLAKI and WKUI.
    msr_flags: u32,
    errors: Errors,
    mailboxes: Mailboxes,
    fifos: [Fifo; 2],
    filters: Filters,
    /// Broken inside: no frame that it receives gets to the FIFOs.
    numb: bool,
    /// The controller takes part in the bus from this cycle on; `NEVER` in initialisation and sleep, or [`LISTENING`].
    joined_at: u64,
    /// The bit timing in force cannot follow the other nodes.
    mistuned: bool,
    /// It began to listen in initialisation, not asleep.
    waits_from_init: bool,
    /// End of the recovery from bus-off, once it has begun.
    recovered_at: u64,
    bus: Bus,
    incoming: VecDeque<CanFrame>,
    /// The bus is known to be disturbed: no recovery until the board says that it is quiet.
    disturbed: bool,
    /// Faults of the wire to RX.
    line: Line,
}

/// What is wrong with the wire from the transceiver to RX.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Line {
    /// Held dominant: a shorted bus, or a transceiver without its supply.
    pub dominant: bool,
    /// Nothing is connected: the pin's own pull decides. Without one it counts as dominant, the worse case.
    pub open: bool,
}

impl Default for Can {
    fn default() -> Self {
        Self {
            mcr: 0x0001_0002,
            ier: 0,
            btr: 0x0123_0000,
            msr_flags: 0,
            errors: Errors::default(),
            mailboxes: Mailboxes::default(),
            fifos: Default::default(),
            filters: Filters::default(),
            numb: false,
            joined_at: NEVER,
            mistuned: false,
            waits_from_init: false,
            recovered_at: NEVER,
            bus: Bus::Free(0),
            incoming: VecDeque::new(),
            disturbed: false,
            line: Line::default(),
        }
    }
}

impl Can {
    /// Reset through the RCC or MCR: an own frame on the bus is cut off, other nodes go on.
    pub fn reset(&mut self, wires: &mut Wires<'_>) {
        let old = std::mem::take(self);
        self.numb = old.numb;
        self.incoming = old.incoming;
        self.disturbed = old.disturbed;
        self.line = old.line;
        self.bus = if let Bus::Own(..) = old.bus { Bus::Free(wires.clock.now()) } else { old.bus };
        self.lines(wires);
    }

    /// HCLK cycles in a bit.
    fn bit(&self, clock: &Clock) -> u64 {
        if self.joined_at == NEVER {
            // Not configured yet: other nodes send at the rate of the rig's bus.
            return clock.span(1e-6).max(1);
        }
        let quanta = 3 + u64::from(self.btr >> 16 & 0xF) + u64::from(self.btr >> 20 & 7);
        quanta * (u64::from(self.btr & 0x3FF) + 1) * clock.apb_divider(false)
    }

    /// What is wrong with the wire to RX.
    pub fn line(&self) -> Line {
        self.line
    }

    /// The wire to RX breaks or is mended.
    pub fn set_line(&mut self, line: Line, at: u64, wires: &mut Wires<'_>) {
        self.line = line;
        if !self.deaf() {
            self.disturbed = false;
            self.join(at, wires);
            self.recover(at, wires.clock);
            self.arbitrate(at, wires);
        }
    }

    /// No frame can pass, in either direction. In loop-back the RX pin is disregarded (RM0390 section 30.5).
    fn deaf(&self) -> bool {
        self.btr & LBKM == 0 && (self.line.dominant || self.line.open || self.mistuned)
    }

    /// RX is at the dominant level indefinitely.
    fn dominant(&self, wires: &Wires<'_>) -> bool {
        let pulled_up = || RX_PINS.iter().any(|&pin| wires.gpio.function(pin) == AF && wires.gpio.pulls_up(pin));
        self.btr & LBKM == 0 && (self.line.dominant || (self.line.open && !pulled_up()))
    }

    /// Begin to wait for the bits that let the controller take part, unless they can never come or it waits already.
    fn join(&mut self, at: u64, wires: &Wires<'_>) {
        if self.joined_at == LISTENING && !self.dominant(wires) {
            let wait = if self.errors.bus_off() && self.waits_from_init { RECOVERY_BITS } else { JOIN_BITS };
            self.joined_at = at + wait * self.bit(wires.clock);
            if let Bus::Other(end, _) = self.bus {
                // The end of a frame that others are sending and the pause after it are eleven recessive bits.
                self.joined_at = self.joined_at.max(end + PAUSE * self.bit(wires.clock));
            }
            if self.errors.bus_off() {
                self.recovered_at = self.joined_at;
            }
        }
    }

    fn joined(&self, at: u64) -> bool {
        self.joined_at <= at
    }

    /// Another node wants to send a frame.
    pub fn send(&mut self, frame: CanFrame, at: u64, wires: &mut Wires<'_>) {
        self.incoming.push_back(frame);
        self.arbitrate(at, wires);
    }

    /// The bus is free of disturbance.
    pub fn quiet(&mut self, at: u64, wires: &mut Wires<'_>) {
        self.disturbed = self.deaf();
        self.recover(at, wires.clock);
        self.arbitrate(at, wires);
    }

    fn recover(&mut self, at: u64, clock: &Clock) {
        let listens = self.joined_at != NEVER && !self.disturbed;
        if self.errors.bus_off() && self.mcr & ABOM != 0 && listens && self.recovered_at == NEVER {
            self.recovered_at = at + RECOVERY_BITS * self.bit(clock);
        }
    }

    /// Start whatever may start at `at`.
    fn arbitrate(&mut self, at: u64, wires: &mut Wires<'_>) {
        let Bus::Free(from) = self.bus else { return };
        if from > at {
            return;
        }
        let may_send = self.joined(at) && !self.errors.bus_off() && !self.only_listens();
        let own = may_send.then(|| self.mailboxes.next(self.mcr & TXFP != 0)).flatten();
        let other = self.incoming.front().copied();
        let lost = matches!((&own, &other), (Some((_, own)), Some(other)) if arbitration(other) < arbitration(own));
        let bit = self.bit(wires.clock);
        match (own, other) {
            (Some((index, frame)), _) if !lost => {
                self.check_set_up(wires);
                self.bus = Bus::Own(at + frame_bits(&frame) * bit, index, frame);
            }
            (own, Some(frame)) => {
                self.incoming.pop_front();
                self.bus = Bus::Other(at + frame_bits(&frame) * bit, frame);
                self.wake(wires);
                if self.recovered_at != NEVER {
                    // Of its bits only those from the ACK delimiter to the end of the pause count, once.
                    self.recovered_at += (frame_bits(&frame) + PAUSE - JOIN_BITS) * bit;
                }
                if let (Some((index, _)), true) = (own, self.mcr & NART != 0) {
                    self.mailboxes.finish(index, End::Lost);
                }
            }
            _ => {}
        }
    }

    /// A frame of another node begins: it wakes a controller that is asleep and sees it, and is itself not received
    /// (RM0390 section 30.4.3).
    fn wake(&mut self, wires: &mut Wires<'_>) {
        let asleep = self.mcr & (INRQ | SLEEP) == SLEEP && !self.line.open && !self.line.dominant;
        if asleep && RX_PINS.iter().any(|&pin| wires.gpio.function(pin) == AF) {
            self.msr_flags |= WKUI;
            if self.mcr & AWUM != 0 {
                self.control(self.mcr & !SLEEP, wires);
            }
        }
    }

    /// Silent mode without loop-back: the controller receives, but cannot start a transmission (RM0390 section 30.5).
    fn only_listens(&self) -> bool {
        self.btr & (SILM | LBKM) == SILM
    }

    /// Reports what would go wrong on the chip with a frame that is received or sent.
    fn check_set_up(&self, wires: &mut Wires<'_>) {
        if self.mcr & TTCM != 0 {
            wires.faults.lint(Lint::CanTtcm);
        }
        if self.btr & LBKM == 0 {
            wires.gpio.require("CAN1_TX", AF, &TX_PINS, wires.faults);
            wires.gpio.require("CAN1_RX", AF, &RX_PINS, wires.faults);
        }
    }

    /// Complete what is due at `at`.
    pub fn sync(&mut self, at: u64, wires: &mut Wires<'_>) {
        if self.recovered_at <= at {
            self.recovered_at = NEVER;
            self.errors.recovered();
        }
        match self.bus {
            Bus::Own(end, index, frame) if end <= at => self.sent(end, index, &frame, wires),
            Bus::Other(end, frame) if end <= at => {
                self.disturbed = self.deaf();
                self.bus = Bus::Free(end + PAUSE * self.bit(wires.clock));
                // In loop-back the RX pin is disregarded.
                if self.joined(end) && !self.errors.bus_off() && !self.deaf() && self.btr & LBKM == 0 {
                    self.check_set_up(wires);
                    self.errors.received();
                    self.accept(&frame, end, wires.clock);
                }
            }
            _ => {}
        }
        self.arbitrate(at, wires);
        self.lines(wires);
    }

    fn sent(&mut self, end: u64, index: usize, frame: &CanFrame, wires: &mut Wires<'_>) {
        let bit = self.bit(wires.clock);
        // In silent mode TX stays recessive: the bus sees nothing. A bit that RX does not read back is a bit error, and
        // no other node sees the whole frame.
        let mut outcome = if self.btr & SILM != 0 {
            CanOutcome::Acknowledged
        } else if self.deaf() {
            CanOutcome::BitError
        } else {
            wires.board.can_tx(wires.clock.seconds_at(end), frame)
        };
        if self.btr & LBKM != 0 {
            // In loop-back the controller ignores the ACK slot and receives its own frames.
            outcome = CanOutcome::Acknowledged;
            self.accept(frame, end, wires.clock);
        }
        // The frame was cut off early when it failed, and the bus is free that much sooner.
        let failed_at = |bits: u64| end - (frame_bits(frame) - bits).min(frame_bits(frame)) * bit;
        let free_at = match outcome {
            CanOutcome::Acknowledged => {
                self.disturbed = false;
                self.errors.transmitted();
                self.mailboxes.finish(index, End::Sent);
                end + PAUSE * bit
            }
            CanOutcome::Unacknowledged => {
                self.errors.transmit_error(Lec::Acknowledge);
                failed_at(frame_bits(frame) - AFTER_ACK) + ERROR_BITS * bit
            }
            CanOutcome::BitError => {
                self.disturbed = true;
                self.errors.transmit_error(Lec::BitRecessive);
                failed_at(DISTURBED_BITS) + ERROR_BITS * bit
            }
        };
        if outcome != CanOutcome::Acknowledged {
            if self.mailboxes.abort_requested(index) {
                self.mailboxes.finish(index, End::Aborted);
            } else if self.mcr & NART != 0 {
                self.mailboxes.finish(index, End::Failed);
            }
            self.errors.flag(self.ier);
            self.recover(end, wires.clock);
        }
        let suspend = if self.errors.passive() { SUSPEND_BITS * bit } else { 0 };
        self.bus = Bus::Free((free_at + suspend).max(end));
    }

    /// From now on no frame that it receives gets to the FIFOs: the controller is broken.
    pub fn numb(&mut self) {
        self.numb = true;
    }

    fn accept(&mut self, frame: &CanFrame, at: u64, clock: &Clock) {
        if let Some(found) = self.filters.accept(frame).filter(|_| !self.numb) {
            let time = (at / self.bit(clock)) as u16;
            self.fifos[found.fifo].push(*frame, found.index, time, self.mcr & RFLM != 0);
        }
    }

    fn lines(&self, wires: &mut Wires<'_>) {
        let ier = self.ier;
        wires.nvic.set_line(19, ier & 1 != 0 && self.mailboxes.completed());
        wires.nvic.set_line(20, self.fifos[0].requests(ier >> 1 & 7));
        wires.nvic.set_line(21, self.fifos[1].requests(ier >> 4 & 7));
        let changed = (self.msr_flags >> 4 & 1 & (ier >> 17)) | (self.msr_flags >> 3 & 1 & (ier >> 16));
        wires.nvic.set_line(22, (self.errors.interrupt() && ier >> 15 & 1 == 1) || changed == 1);
    }

    /// When something next happens on the bus.
    pub fn next_event(&self) -> u64 {
        let bus = match self.bus {
            Bus::Own(end, ..) | Bus::Other(end, _) => end,
            Bus::Free(from) => {
                let own = self.joined_at != NEVER
                    && !self.errors.bus_off()
                    && !self.only_listens()
                    && self.mailboxes.next(false).is_some();
                let own_at = if own { from.max(self.joined_at) } else { NEVER };
                own_at.min(if self.incoming.is_empty() { NEVER } else { from })
            }
        };
        bus.min(self.recovered_at)
    }

    /// Read a register.
    pub fn read(&self, offset: u32, clock: &Clock) -> Option<u32> {
        Some(match offset {
            0x000 => self.mcr,
            0x004 => self.msr(clock.now()),
            0x008 => self.mailboxes.status(self.mcr & TXFP != 0),
            0x00C | 0x010 => self.fifos[(offset as usize - 0x00C) / 4].status(),
            0x014 => self.ier,
            0x018 => self.errors.esr(),
            0x01C => self.btr,
            0x180..=0x1AC => self.mailboxes.read((offset as usize - 0x180) / 16, (offset as usize % 16) / 4),
            0x1B0..=0x1CC => self.fifos[(offset as usize - 0x1B0) / 16].mailbox((offset as usize % 16) / 4),
            _ => return self.filters.read(offset),
        })
    }

    /// INAK follows INRQ and SLAK follows SLEEP; both fall when the controller has joined the bus.
    fn msr(&self, now: u64) -> u32 {
        let waiting = !self.joined(now);
        let (initialising, asleep) = match self.mcr & (INRQ | SLEEP) {
            0 => (waiting && self.msr_flags & INRQ != 0, waiting && self.msr_flags & SLEEP != 0),
            mode => (mode & INRQ != 0, mode & INRQ == 0),
        };
        u32::from(initialising)
            | u32::from(asleep) << 1
            | u32::from(self.errors.interrupt()) << 2
            | self.msr_flags & 0x18
            | 0xC00
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32, wires: &mut Wires<'_>) -> Option<()> {
        let now = wires.clock.now();
        match offset {
            0x000 => self.control(value, wires),
            0x004 => {
                self.msr_flags &= !(value & 0x18);
                if value & 4 != 0 {
                    self.errors.clear_interrupt();
                }
            }
            0x008 => {
                let on_wire = if let Bus::Own(_, index, _) = self.bus { Some(index) } else { None };
                self.mailboxes.write_status(value, on_wire);
            }
            0x00C | 0x010 => self.fifos[(offset as usize - 0x00C) / 4].write_status(value),
            0x014 => self.ier = value,
            0x018 => self.errors.set_lec(value >> 4 & 7),
            0x01C => self.set_timing(value, wires.faults),
            0x180..=0x1AC => {
                if !self.mailboxes.write((offset as usize - 0x180) / 16, (offset as usize % 16) / 4, value) {
                    wires.faults.lint(Lint::CanMailbox);
                }
            }
            _ => {
                if !self.filters.write(offset, value)? {
                    wires.faults.lint(Lint::CanFilter);
                }
            }
        }
        self.arbitrate(now, wires);
        self.lines(wires);
        Some(())
    }

    fn set_timing(&mut self, value: u32, faults: &mut Faults) {
        if self.mcr & INRQ == 0 {
            faults.lint(Lint::CanTiming);
            return;
        }
        self.btr = value;
    }

    fn control(&mut self, value: u32, wires: &mut Wires<'_>) {
        if value & 1 << 15 != 0 {
            self.reset(wires);
            return;
        }
        let before = std::mem::replace(&mut self.mcr, value);
        match value & (INRQ | SLEEP) {
            0 => {
                if self.joined_at == NEVER {
                    self.msr_flags = self.msr_flags & !(INRQ | SLEEP) | before & (INRQ | SLEEP);
                    self.joined_at = LISTENING;
                    let bit_s = self.bit(wires.clock) as f64 / wires.clock.tree().hclk_hz as f64;
                    self.mistuned = self.btr & LBKM == 0 && !wire::follows(self.btr, bit_s);
                    self.waits_from_init = before & INRQ != 0;
                }
                self.join(wires.clock.now(), wires);
            }
            mode => {
                if mode == SLEEP && before & SLEEP == 0 && self.ier >> 17 & 1 == 1 {
                    self.msr_flags |= 0x10;
                }
                (self.joined_at, self.recovered_at) = (NEVER, NEVER);
            }
        }
        self.recover(wires.clock.now(), wires.clock);
    }
}
