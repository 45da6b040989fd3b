//! External interrupts (RM0390 chapter 10) and the port selection in SYSCFG (chapter 8).

use super::nvic::Nvic;
use super::peripheral::{Registers, registers};

registers! { IMR = 0x00, EMR = 0x04, RTSR = 0x08, FTSR = 0x0C, SWIER = 0x10, PR = 0x14 }

/// EXTICR1, in SYSCFG.
const EXTICR1: u32 = 0x08;

/// EXTI and SYSCFG registers.
#[derive(Debug)]
pub struct Exti {
    registers: Registers<6>,
    syscfg: Registers<9>,
}

impl Default for Exti {
    fn default() -> Self {
        Self {
            registers: Registers::new(REGISTERS),
            syscfg: Registers::new(&[0x00, 0x04, 0x08, 0x0C, 0x10, 0x14, 0x20].map(|offset| (offset, 0))),
        }
    }
}

impl Exti {
    /// Pins of `port` went from `before` to `after`.
    pub fn edges(&mut self, port: usize, before: u16, after: u16, nvic: &mut Nvic) {
        for line in (0..16).filter(|line| (before ^ after) >> line & 1 == 1) {
            let selected = self.syscfg[EXTICR1 + line / 4 * 4] >> (4 * (line % 4)) & 0xF;
            let trigger = self.registers[if after >> line & 1 == 1 { RTSR } else { FTSR }];
            if selected as usize == port && trigger >> line & 1 == 1 {
                self.registers[PR] |= 1 << line;
            }
        }
        self.lines(nvic);
    }

    fn lines(&self, nvic: &mut Nvic) {
        let requests = self.registers[PR] & self.registers[IMR];
        for line in 0..5 {
            nvic.set_line(6 + line, requests >> line & 1 == 1);
        }
        nvic.set_line(23, requests & 0x03E0 != 0);
        nvic.set_line(40, requests & 0xFC00 != 0);
    }

    /// Reset of SYSCFG.
    pub fn reset_syscfg(&mut self) {
        self.syscfg = Self::default().syscfg;
    }

    /// Read an EXTI register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        self.registers.get(offset)
    }

    /// Write an EXTI register.
    pub fn write(&mut self, offset: u32, value: u32, nvic: &mut Nvic) -> Option<()> {
        match offset {
            SWIER => {
                self.registers[PR] |= value & !self.registers[SWIER];
                self.registers[SWIER] = value;
            }
            PR => {
                self.registers[PR] &= !value;
                self.registers[SWIER] &= !value;
            }
            _ => self.registers.set(offset, value)?,
        }
        self.lines(nvic);
        Some(())
    }

    /// Read a SYSCFG register.
    pub fn read_syscfg(&self, offset: u32) -> Option<u32> {
        self.syscfg.get(offset)
    }

    /// Write a SYSCFG register.
    pub fn write_syscfg(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            // CMPCR is read-only here.
            0x20 => None,
            EXTICR1..=0x14 => self.syscfg.set(offset, value & 0xFFFF),
            _ => self.syscfg.set(offset, value),
        }
    }
}
