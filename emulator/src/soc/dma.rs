//! DMA controllers (RM0390 chapter 9): single transfers from a peripheral to memory in direct mode.
//!
//! The stream must select the peripheral that its PAR points to (request table, RM0390 tables 28 and 29). The one
//! peripheral that makes requests here is ADC1. FIFO mode, bursts, double buffering, memory to memory and memory to
//! peripheral are not modelled.

use super::fault::{Fault, Faults, Lint};
use super::memory::Memory;
use super::nvic::Nvic;

/// Data register of ADC1.
const ADC1_DR: u32 = 0x4001_204C;

/// A peripheral that can request a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// A conversion of ADC1 is complete.
    Adc1,
}

impl Request {
    /// Register that PAR has to point to.
    fn register(self) -> u32 {
        match self {
            Self::Adc1 => ADC1_DR,
        }
    }

    /// The request that a stream serves with a channel selection.
    fn of(controller: u8, stream: u8, channel: u8) -> Option<Self> {
        match (controller, stream, channel) {
            (2, 0 | 4, 0) => Some(Self::Adc1),
            _ => None,
        }
    }
}

const EN: u32 = 1;
const CIRC: u32 = 1 << 8;
const MINC: u32 = 1 << 10;
const HTIF: u32 = 1 << 4;
const TCIF: u32 = 1 << 5;

#[derive(Clone, Copy, Debug, Default)]
struct Stream {
    cr: u32,
    ndtr: u32,
    par: u32,
    m0ar: u32,
    m1ar: u32,
    fcr: u32,
    /// NDTR and M0AR as they were when the stream was enabled.
    length: u32,
    memory: u32,
    /// Flags at their place for stream 0.
    flags: u32,
}

/// One of the two controllers.
#[derive(Debug)]
pub struct Dma {
    controller: u8,
    streams: [Stream; 8],
}

/// How a transfer ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// The item has been stored.
    Done,
    /// No enabled stream serves the request.
    Unserved,
}

const IRQ: [[u8; 8]; 2] = [[11, 12, 13, 14, 15, 16, 17, 47], [56, 57, 58, 59, 60, 68, 69, 70]];
/// Place of a stream's flags in LISR or HISR.
const SHIFT: [u32; 4] = [0, 6, 16, 22];

impl Dma {
    /// A controller after a reset.
    pub fn new(controller: u8) -> Self {
        Self { controller, streams: [Stream { fcr: 0x21, ..Stream::default() }; 8] }
    }

    /// Reset through the RCC.
    pub fn reset(&mut self, nvic: &mut Nvic) {
        *self = Self::new(self.controller);
        (0..8).for_each(|stream| self.line(stream, nvic));
    }

    fn line(&self, stream: usize, nvic: &mut Nvic) {
        let Stream { cr, flags, .. } = self.streams[stream];
        let high = (flags & HTIF != 0 && cr & 8 != 0)
            || (flags & TCIF != 0 && cr & 16 != 0)
            || (flags & 8 != 0 && cr & 4 != 0);
        nvic.set_line(IRQ[usize::from(self.controller - 1)][stream], high);
    }

    fn serving(&self, request: Request) -> Option<usize> {
        (0..8).find(|&i| {
            let stream = &self.streams[i];
            stream.cr & EN != 0
                && stream.par == request.register()
                && Request::of(self.controller, i as u8, channel(stream.cr)) == Some(request)
        })
    }

    /// How many more items until an enabled half- or full-transfer interrupt of the stream that serves `request`; a
    /// stream without either gives `u64::MAX`, no stream `None`.
    pub fn items_until_interrupt(&self, request: Request) -> Option<u64> {
        let stream = &self.streams[self.serving(request)?];
        let half = stream.length / 2;
        let to_half = if stream.ndtr > half { stream.ndtr - half } else { stream.ndtr + stream.length - half };
        let full = (stream.cr & 16 != 0).then_some(stream.ndtr);
        let half = (stream.cr & 8 != 0).then_some(to_half);
        Some(full.into_iter().chain(half).min().map_or(u64::MAX, u64::from))
    }

    /// Move one item from a peripheral to memory.
    pub fn transfer(
        &mut self,
        request: Request,
        item: u32,
        memory: &mut Memory,
        nvic: &mut Nvic,
        faults: &mut Faults,
    ) -> Transfer {
        let Some(index) = self.serving(request) else { return Transfer::Unserved };
        let stream = &mut self.streams[index];
        let size = 1u32 << (stream.cr >> 13 & 3);
        let done = stream.length - stream.ndtr;
        let address = if stream.cr & MINC != 0 { stream.memory + done * size } else { stream.memory };
        if memory.ram.write(address, &item.to_le_bytes()[..size.min(4) as usize]).is_none() {
            faults.raise(Fault::DmaMemory { controller: self.controller, stream: index as u8, address });
        }
        stream.ndtr -= 1;
        if stream.ndtr == stream.length / 2 {
            stream.flags |= HTIF;
        }
        if stream.ndtr == 0 {
            stream.flags |= TCIF;
            if stream.cr & CIRC != 0 {
                stream.ndtr = stream.length;
            } else {
                stream.cr &= !EN;
            }
        }
        self.line(index, nvic);
        Transfer::Done
    }

    /// Read a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        let half = |first: usize| (0..4).fold(0, |bits, i| bits | self.streams[first + i].flags << SHIFT[i]);
        match offset {
            0x00 => return Some(half(0)),
            0x04 => return Some(half(4)),
            0x08 | 0x0C => return Some(0),
            _ => {}
        }
        let stream = self.streams.get((offset as usize - 0x10) / 0x18)?;
        Some(match (offset - 0x10) % 0x18 {
            0x00 => stream.cr,
            0x04 => stream.ndtr,
            0x08 => stream.par,
            0x0C => stream.m0ar,
            0x10 => stream.m1ar,
            _ => stream.fcr,
        })
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32, nvic: &mut Nvic, faults: &mut Faults) -> Option<()> {
        match offset {
            // The status registers are read-only.
            0x00 | 0x04 => return Some(()),
            0x08 | 0x0C => {
                let first = (offset as usize - 8) / 4 * 4;
                for (i, shift) in SHIFT.into_iter().enumerate() {
                    self.streams[first + i].flags &= !(value >> shift);
                    self.line(first + i, nvic);
                }
                return Some(());
            }
            _ => {}
        }
        let index = (offset as usize - 0x10) / 0x18;
        let running = self.streams.get(index)?.cr & EN != 0;
        let register = (offset - 0x10) % 0x18;
        if running && register != 0 {
            faults.lint(Lint::DmaEnabled);
            return Some(());
        }
        let stream = &mut self.streams[index];
        match register {
            0x00 => self.control(index, value, faults),
            0x04 => stream.ndtr = value & 0xFFFF,
            0x08 => stream.par = value,
            0x0C => stream.m0ar = value,
            0x10 => stream.m1ar = value,
            _ => stream.fcr = value,
        }
        self.line(index, nvic);
        Some(())
    }

    fn control(&mut self, index: usize, value: u32, faults: &mut Faults) {
        let controller = self.controller;
        let stream = &mut self.streams[index];
        let was = std::mem::replace(&mut stream.cr, value);
        if value & EN == 0 {
            // Switching a running stream off counts as the end of its transfer (RM0390 section 9.3.14).
            if was & EN != 0 {
                stream.flags |= TCIF;
            }
            return;
        }
        if was & EN != 0 {
            return;
        }
        (stream.length, stream.memory) = (stream.ndtr, stream.m0ar);
        let request = Request::of(controller, index as u8, channel(value));
        if request.map(Request::register) != Some(stream.par) {
            let (stream_number, peripheral) = (index as u8, stream.par);
            faults.raise(Fault::DmaRequest { controller, stream: stream_number, channel: channel(value), peripheral });
        }
        // DIR, PINC, PFCTRL, DBM, bursts; the FIFO.
        if value & 0x01E4_02E0 != 0 || stream.fcr & 4 != 0 {
            faults.lint(Lint::DmaMode);
        }
        if stream.ndtr == 0 || stream.flags & 0x3D != 0 {
            faults.lint(Lint::DmaStart);
            stream.cr &= !EN;
        }
    }
}

fn channel(cr: u32) -> u8 {
    (cr >> 25 & 7) as u8
}
