//! DMA controllers (RM0390 chapter 9): single transfers from a peripheral to memory in direct mode.
//!
//! The stream must select the peripheral that its PAR points to (request table, RM0390 tables 28 and 29). The one
//! peripheral that makes requests here is ADC1. FIFO mode, bursts, double buffering, memory to memory and memory to
//! peripheral are not modelled.

use super::fault::{Faults, Lint};
use super::memory::Memory;
use super::nvic::Nvic;
use super::peripheral::{Registers, registers};

/// Data register of ADC1.
const ADC1_DR: u32 = 0x4001_204C;

const EN: u32 = 1;
const CIRC: u32 = 1 << 8;
const MINC: u32 = 1 << 10;
const HTIF: u32 = 1 << 4;
const TCIF: u32 = 1 << 5;

registers! { CR = 0x00, NDTR = 0x04, PAR = 0x08, M0AR = 0x0C, M1AR = 0x10, FCR = 0x14 reset 0x21 }

#[derive(Clone, Copy, Debug)]
struct Stream {
    registers: Registers<6>,
    /// NDTR and M0AR as they were when the stream was enabled.
    length: u32,
    memory: u32,
    /// Flags at their place for stream 0.
    flags: u32,
}

impl Stream {
    fn on(&self) -> bool {
        self.registers[CR] & EN != 0
    }

    fn channel(&self) -> u8 {
        (self.registers[CR] >> 25 & 7) as u8
    }
}

/// One of the two controllers.
#[derive(Debug)]
pub struct Dma {
    controller: u8,
    streams: [Stream; 8],
}

const IRQ: [[u8; 8]; 2] = [[11, 12, 13, 14, 15, 16, 17, 47], [56, 57, 58, 59, 60, 68, 69, 70]];
/// Place of a stream's flags in LISR or HISR.
const SHIFT: [u32; 4] = [0, 6, 16, 22];

impl Dma {
    /// A controller after a reset.
    pub fn new(controller: u8) -> Self {
        let stream = Stream { registers: Registers::new(REGISTERS), length: 0, memory: 0, flags: 0 };
        Self { controller, streams: [stream; 8] }
    }

    /// Reset through the RCC.
    pub fn reset(&mut self, nvic: &mut Nvic) {
        *self = Self::new(self.controller);
        (0..8).for_each(|stream| self.line(stream, nvic));
    }

    fn line(&self, stream: usize, nvic: &mut Nvic) {
        let Stream { registers, flags, .. } = &self.streams[stream];
        // HTIE and TCIE stand a bit below their flags, TEIE too.
        let high = flags & (registers[CR] << 1) & (HTIF | TCIF | 1 << 3) != 0;
        nvic.set_line(IRQ[usize::from(self.controller - 1)][stream], high);
    }

    /// Whether ADC1 requests transfers of this stream with its channel selection, and PAR points to its data.
    fn serves_adc(&self, index: usize) -> bool {
        let stream = &self.streams[index];
        matches!((self.controller, index, stream.channel()), (2, 0 | 4, 0)) && stream.registers[PAR] == ADC1_DR
    }

    fn serving(&self) -> Option<usize> {
        (0..8).find(|&i| self.streams[i].on() && self.serves_adc(i))
    }

    /// How many more items until an enabled half- or full-transfer interrupt of the stream that serves ADC1; a stream
    /// without either gives `u64::MAX`, no stream `None`.
    pub fn items_until_interrupt(&self) -> Option<u64> {
        let Stream { registers, length, .. } = &self.streams[self.serving()?];
        let (left, half) = (registers[NDTR], length / 2);
        let to_half = if left > half { left - half } else { left + length - half };
        let full = (registers[CR] & 16 != 0).then_some(left);
        let half = (registers[CR] & 8 != 0).then_some(to_half);
        Some(full.into_iter().chain(half).min().map_or(u64::MAX, u64::from))
    }

    /// Move one item from ADC1 to memory. `false` if no enabled stream serves it.
    pub fn transfer(&mut self, item: u32, memory: &mut Memory, nvic: &mut Nvic, faults: &mut Faults) -> bool {
        let Some(index) = self.serving() else { return false };
        let Stream { registers, length, memory: first, flags } = &mut self.streams[index];
        let size = 1u32 << (registers[CR] >> 13 & 3);
        let done = *length - registers[NDTR];
        let address = if registers[CR] & MINC != 0 { *first + done * size } else { *first };
        if memory.ram.write(address, &item.to_le_bytes()[..size.min(4) as usize]).is_none() {
            let what = format!("DMA{} stream {index}: bad memory address {address:#010x}", self.controller);
            faults.raise(Lint::DmaMemory, what);
        }
        registers[NDTR] -= 1;
        if registers[NDTR] == *length / 2 {
            *flags |= HTIF;
        }
        if registers[NDTR] == 0 {
            *flags |= TCIF;
            if registers[CR] & CIRC != 0 {
                registers[NDTR] = *length;
            } else {
                registers[CR] &= !EN;
            }
        }
        self.line(index, nvic);
        true
    }

    /// Read a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        let half = |first: usize| (0..4).fold(0, |bits, i| bits | self.streams[first + i].flags << SHIFT[i]);
        match offset {
            0x00 => Some(half(0)),
            0x04 => Some(half(4)),
            0x08 | 0x0C => Some(0),
            _ => self.streams.get((offset as usize - 0x10) / 0x18)?.registers.get((offset - 0x10) % 0x18),
        }
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
        let (index, register) = ((offset as usize - 0x10) / 0x18, (offset - 0x10) % 0x18);
        let stream = self.streams.get_mut(index)?;
        match register {
            _ if stream.on() && register != CR => faults.lint(Lint::DmaEnabled),
            CR => self.control(index, value, faults),
            NDTR => stream.registers[NDTR] = value & 0xFFFF,
            _ => stream.registers.set(register, value)?,
        }
        self.line(index, nvic);
        Some(())
    }

    fn control(&mut self, index: usize, value: u32, faults: &mut Faults) {
        let stream = &mut self.streams[index];
        let was = std::mem::replace(&mut stream.registers[CR], value);
        // Switching a running stream off counts as the end of its transfer (RM0390 section 9.3.14).
        if was & !value & EN != 0 {
            stream.flags |= TCIF;
        }
        if value & !was & EN == 0 {
            return;
        }
        (stream.length, stream.memory) = (stream.registers[NDTR], stream.registers[M0AR]);
        let (channel, par) = (stream.channel(), stream.registers[PAR]);
        // DIR, PINC, PFCTRL, DBM, bursts; the FIFO.
        let mode = value & 0x01E4_02E0 != 0 || stream.registers[FCR] & 4 != 0;
        let bad_start = stream.length == 0 || stream.flags & 0x3D != 0;
        if !self.serves_adc(index) {
            let stream = format!("DMA{} stream {index} channel {channel}", self.controller);
            faults.raise(Lint::DmaRequest, format!("{stream} has no modelled request of the register at {par:#010x}"));
        }
        if mode {
            faults.lint(Lint::DmaMode);
        }
        if bad_start {
            faults.lint(Lint::DmaStart);
            self.streams[index].registers[CR] &= !EN;
        }
    }
}
