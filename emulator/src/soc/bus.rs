//! Accesses by the core: address decoding, the strict checks, and the effects of a store outside its own peripheral.

use super::fault::Lint;
use super::map::{self, Unit, gate, unit_at};
use super::memory::{FLASH_BASE, FLASH_SIZE};
use super::peripheral::Wires;
use super::{ResetCause, Soc};
use rig_plant::board::Board;

/// Cycles that a peripheral access takes on top of its instruction: AHB-to-APB bridges make the core wait.
const ACCESS_CYCLES: u64 = 2;

fn verb(write: bool) -> &'static str {
    if write { "write" } else { "read" }
}

impl<B: Board> Soc<B> {
    fn clocked(&mut self, unit: Unit, address: u32, write: bool) -> bool {
        let on = gate(unit).is_none_or(|gate| self.rcc.enabled(gate));
        if !on {
            let what = format!("{} at {address:#010x}: the clock of {unit} is not enabled in the RCC", verb(write));
            self.faults.raise(Lint::Unclocked, what);
        }
        on
    }

    fn unmodelled(&mut self, address: u32, write: bool) {
        let what = format!("{} of an unmodelled register of {} at {address:#010x}", verb(write), map::name(address));
        self.faults.raise(Lint::Unmodelled, what);
    }

    /// The core's access, or the stacking of an exception, fails.
    pub fn bus_fault(&mut self, address: u32, stacking: bool) {
        self.scb.bus_fault(address, stacking);
    }

    /// A load by the core.
    pub fn read(&mut self, address: u32, size: usize) -> u32 {
        self.clock.advance(ACCESS_CYCLES);
        self.sync();
        if let Some((word, bit)) = map::bit_band(address) {
            return self.read_whole(word).map_or(0, |value| value >> bit & 1);
        }
        let shifted = self.read_register(address).unwrap_or(0) >> (8 * (address & 3));
        match size {
            1 => shifted & 0xFF,
            2 => shifted & 0xFFFF,
            _ => shifted,
        }
    }

    /// A word of RAM or of a peripheral, for the bit-band alias.
    fn read_whole(&mut self, address: u32) -> Option<u32> {
        self.memory.ram.word(address).or_else(|| self.read_register(address))
    }

    /// The register around an address, if it is there and clocked.
    fn read_register(&mut self, address: u32) -> Option<u32> {
        let unit = unit_at(address);
        if !self.clocked(unit, address, false) {
            return None;
        }
        let word = self.read_word(unit, address & !3);
        if word.is_none() {
            self.unmodelled(address, false);
        }
        word
    }

    /// What the access would find or change must be as it is now.
    fn catch_up(&mut self, unit: Unit) {
        match unit {
            Unit::Rcc => self.look_at_hse(),
            Unit::Timer(_) | Unit::Adc | Unit::Dma(_) => self.catch_up_adc(self.clock.now()),
            _ => {}
        }
    }

    fn read_word(&mut self, unit: Unit, address: u32) -> Option<u32> {
        let offset = address & 0x3FF;
        self.catch_up(unit);
        match unit {
            Unit::Rcc => self.rcc.read(offset),
            Unit::Pwr => self.pwr.read(offset),
            Unit::Flash => self.flash.read(offset),
            Unit::Gpio(port) => self.gpio.read(port, offset),
            Unit::Exti => self.exti.read(offset),
            Unit::Syscfg => self.exti.read_syscfg(offset),
            Unit::Iwdg => self.iwdg.read(offset, &self.clock, self.rcc.lsi_on()),
            Unit::Timer(i) => self.timers[i].read(offset, wires!(self)),
            Unit::Usart(i) => self.usarts[i].read(offset, wires!(self)),
            Unit::Can => self.can.read(offset, &self.clock),
            Unit::Adc => self.adc.read(offset, wires!(self)),
            Unit::Dma(i) => self.dma[i].read(offset),
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
        if let Some((word, bit)) = map::bit_band(address) {
            // The bus matrix reads the word, changes the bit and writes the word back (PM0214 section 2.2.5).
            let Some(old) = self.read_whole(word) else { return };
            let new = old & !(1 << bit) | (value & 1) << bit;
            if self.memory.ram.set_word(word, new).is_none() {
                self.write_at(word, 4, new);
            }
            return;
        }
        self.write_at(address, size, value);
    }

    fn write_at(&mut self, address: u32, size: usize, value: u32) {
        let unit = unit_at(address);
        if !self.clocked(unit, address, true) {
            return;
        }
        if size < 4 && !map::takes_narrow_writes(unit, address, size) {
            let what = format!("{size}-byte write at {address:#010x}: this register takes whole words");
            self.faults.raise(Lint::Width, what);
        }
        let (address, value) = self.widen(unit, address, size, value);
        if self.write_word(unit, address, size, value).is_none() {
            self.unmodelled(address, true);
        }
    }

    /// The word that a narrow write amounts to, and its address. RCC, flash interface and GPIO take the bytes that are
    /// written and keep the others; for the peripherals behind an APB bridge the bridge repeats the bytes over the word
    /// (RM0390 section 2.1.10), and for the rest the same is assumed. The core's own registers do their own.
    fn widen(&mut self, unit: Unit, address: u32, size: usize, value: u32) -> (u32, u32) {
        if size >= 4 || matches!(unit, Unit::Nvic | Unit::Core) {
            return (address, value);
        }
        let mask = if size == 1 { 0xFF } else { 0xFFFF };
        let value = value & mask;
        let word = address & !3;
        if !map::has_byte_lanes(unit) {
            return (word, value * if size == 1 { 0x0101_0101 } else { 0x0001_0001 });
        }
        let shift = 8 * (address & 3);
        // Zeros change nothing in a register whose bits act when they are written.
        let old = if map::acts_on_ones(unit, word) { 0 } else { self.read_word(unit, word).unwrap_or(0) };
        (word, old & !(mask << shift) | value << shift)
    }

    fn write_word(&mut self, unit: Unit, address: u32, size: usize, value: u32) -> Option<()> {
        let offset = address & 0x3FF;
        self.catch_up(unit);
        match unit {
            Unit::Rcc => self.write_rcc(offset, value),
            Unit::Pwr => self.pwr.write(offset, value),
            Unit::Flash => {
                let stall_s = self.flash.write(offset, value, &mut self.memory)?;
                self.stall(stall_s);
                Some(())
            }
            Unit::Gpio(port) => {
                self.gpio.write(port, offset, value)?;
                self.tell_outputs(port);
                Some(())
            }
            Unit::Exti => self.exti.write(offset, value, &mut self.nvic),
            Unit::Syscfg => self.exti.write_syscfg(offset, value),
            Unit::Iwdg => self.iwdg.write(offset, value, &self.clock, &mut self.faults),
            Unit::Timer(i) => self.timers[i].write(offset, value, wires!(self)),
            Unit::Usart(i) => self.usarts[i].write(offset, value, wires!(self)),
            Unit::Can => self.can.write(offset, value, wires!(self)),
            Unit::Adc => self.adc.write(offset, value, wires!(self)),
            Unit::Dma(i) => self.dma[i].write(offset, value, &mut self.nvic, &mut self.faults),
            Unit::Debug => self.debug.write(offset, value),
            Unit::Nvic => self.nvic.write(address - map::NVIC, size, value),
            Unit::Core => {
                if self.scb.write(address, size, value, &self.clock, &mut self.nvic)? {
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
        for unit in map::resettable() {
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
                self.faults.lint(Lint::FlashDataCache);
            }
            self.flash_changed = true;
            self.clock.advance(self.clock.span(seconds));
        }
    }
}
