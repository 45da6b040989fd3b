//! Accesses by the core: address decoding, the strict checks, and the effects of a store outside its own peripheral.

use super::fault::Fault;
use super::map::{self, Unit, gate, unit_at};
use super::memory::{FLASH_BASE, FLASH_SIZE};
use super::scb::Effect;
use super::{ResetCause, Soc, Wires};
use crate::board::Board;

/// Cycles that a peripheral access takes on top of its instruction: AHB-to-APB bridges make the core wait.
const ACCESS_CYCLES: u64 = 2;

impl<B: Board> Soc<B> {
    fn clocked(&mut self, unit: Unit, address: u32, write: bool) -> bool {
        let on = gate(unit).is_none_or(|gate| self.rcc.enabled(gate));
        if !on {
            self.faults.raise(Fault::Unclocked { unit: unit.to_string(), address, write });
        }
        on
    }

    /// A load by the core.
    pub fn read(&mut self, address: u32, size: usize) -> u32 {
        self.clock.advance(ACCESS_CYCLES);
        self.sync();
        let unit = unit_at(address);
        if !self.clocked(unit, address, false) {
            return 0;
        }
        let Some(word) = self.read_word(unit, address & !3) else {
            self.faults.raise(Fault::Unmodelled { address, write: false });
            return 0;
        };
        let shifted = word >> (8 * (address & 3));
        match size {
            1 => shifted & 0xFF,
            2 => shifted & 0xFFFF,
            _ => shifted,
        }
    }

    fn read_word(&mut self, unit: Unit, address: u32) -> Option<u32> {
        let offset = address & 0x3FF;
        match unit {
            Unit::Rcc => self.rcc.read(offset),
            Unit::Pwr => self.pwr.read(offset),
            Unit::Flash => self.flash.read(offset),
            Unit::Gpio(port) => self.gpio.read(port, offset),
            Unit::Exti => self.exti.read(offset),
            Unit::Syscfg => self.exti.read_syscfg(offset),
            Unit::Iwdg => self.iwdg.read(offset, &self.clock, self.rcc.lsi_on()),
            Unit::Timer(i) => {
                self.catch_up_adc(self.clock.now());
                self.timers[i].read(offset, wires!(self))
            }
            Unit::Usart(i) => self.usarts[i].read(offset, wires!(self)),
            Unit::Can => self.can.read(offset, &self.clock),
            Unit::Adc => {
                self.catch_up_adc(self.clock.now());
                self.adc.read(offset, wires!(self))
            }
            Unit::Dma(i) => {
                self.catch_up_adc(self.clock.now());
                self.dma[i].read(offset)
            }
            Unit::Debug => self.debug.read(offset),
            Unit::Nvic => self.nvic.read(address - map::NVIC),
            Unit::Core => self.scb.read(address, &self.clock, &mut self.nvic),
            Unit::None => None,
        }
    }

    /// A store by the core.
    pub fn write(&mut self, address: u32, size: usize, value: u32) {
        self.clock.advance(ACCESS_CYCLES);
        self.sync();
        let unit = unit_at(address);
        if !self.clocked(unit, address, true) {
            return;
        }
        if size < 4 && !map::takes_narrow_writes(unit, address) {
            self.faults.raise(Fault::Width { address, size });
        }
        if self.write_word(unit, address, size, value).is_none() {
            self.faults.raise(Fault::Unmodelled { address, write: true });
        }
    }

    fn write_word(&mut self, unit: Unit, address: u32, size: usize, value: u32) -> Option<()> {
        let offset = address & 0x3FF;
        match unit {
            Unit::Rcc => self.write_rcc(offset, value),
            Unit::Pwr => self.pwr.write(offset, value),
            Unit::Flash => {
                let stall_s = self.flash.write(offset, value, &mut self.memory)?;
                self.stall(stall_s);
                Some(())
            }
            Unit::Gpio(port) => {
                // A halfword to the upper half of BSRR.
                let value = value << (8 * (address & 3));
                self.gpio.write(port, offset & !3, value)?;
                self.tell_outputs(port);
                Some(())
            }
            Unit::Exti => self.exti.write(offset, value, &mut self.nvic),
            Unit::Syscfg => self.exti.write_syscfg(offset, value),
            Unit::Iwdg => self.iwdg.write(offset, value, &self.clock, &mut self.faults),
            Unit::Timer(i) => {
                self.catch_up_adc(self.clock.now());
                self.timers[i].write(offset, value, wires!(self))
            }
            Unit::Usart(i) => self.usarts[i].write(offset, value, wires!(self)),
            Unit::Can => self.can.write(offset, value, wires!(self)),
            Unit::Adc => {
                self.catch_up_adc(self.clock.now());
                self.adc.write(offset, value, wires!(self))
            }
            Unit::Dma(i) => {
                self.catch_up_adc(self.clock.now());
                self.dma[i].write(offset, value, &mut self.nvic, &mut self.faults)
            }
            Unit::Debug => self.debug.write(offset, value),
            Unit::Nvic => self.nvic.write(address - map::NVIC, size, value),
            Unit::Core => {
                if self.scb.write(address, size, value, &self.clock, &mut self.nvic)? == Effect::Reset {
                    self.reset_request = Some(ResetCause::Software);
                }
                Some(())
            }
            Unit::None => None,
        }
    }

    fn write_rcc(&mut self, offset: u32, value: u32) -> Option<()> {
        self.catch_up_adc(self.clock.now());
        let (register, bits) = self.rcc.write(offset, value, self.flash.wait_states(), &mut self.faults)?;
        for unit in map::RESETTABLE {
            if gate(unit).is_some_and(|gate| gate.offset == register && bits >> gate.bit & 1 == 1) {
                self.reset_unit(unit);
            }
        }
        if self.rcc.tree() != self.clock.tree() {
            for timer in &mut self.timers {
                timer.rebase(&self.clock, self.clock.now());
            }
            self.clock.retune(self.rcc.tree());
        }
        Some(())
    }

    /// A store by the core into flash.
    pub fn program_flash(&mut self, address: u32, size: usize, value: u64) {
        let stall_s = self.flash.program(address, size, value, &mut self.memory);
        let mut bytes = [0; 8];
        if let Some(bytes) = bytes.get_mut(..size)
            && self.memory.flash.read(address, bytes).is_some()
        {
            self.programmed.push((address, bytes.to_vec()));
        }
        self.flash_changed = true;
        self.stall(stall_s);
    }

    /// Restores words that unicorn has stored into by itself since.
    pub fn settle_flash(&mut self) {
        for (address, bytes) in self.programmed.drain(..) {
            self.memory.flash.write(address, &bytes).expect("it was read from there");
        }
    }

    /// Cycles that the core waits for a block of code ([`super::flash::Flash::fetch_cycles`]).
    pub fn fetch_cycles(&self, address: u32, bytes: u32) -> u64 {
        let in_flash = (FLASH_BASE..FLASH_BASE + FLASH_SIZE as u32).contains(&address);
        if in_flash { self.flash.fetch_cycles(address, bytes) } else { 0 }
    }

    /// The core waits for flash: time passes, and the events meanwhile are processed at the next opportunity.
    fn stall(&mut self, seconds: f64) {
        if seconds > 0.0 {
            if self.flash.data_cached() {
                self.faults
                    .feature("flash", "programmed or erased with the data cache on, which may then hold old data");
            }
            self.flash_changed = true;
            self.clock.advance(self.clock.span(seconds));
        }
    }
}
