//! External interrupts (RM0390 chapter 10) and the port selection in SYSCFG (chapter 8).

use super::nvic::Nvic;

/// EXTI and SYSCFG registers.
#[derive(Debug, Default)]
pub struct Exti {
    imr: u32,
    emr: u32,
    rtsr: u32,
    ftsr: u32,
    swier: u32,
    pr: u32,
    exticr: [u32; 4],
    memrmp: u32,
    pmc: u32,
}

impl Exti {
    /// Pins of `port` went from `before` to `after`.
    pub fn edges(&mut self, port: usize, before: u16, after: u16, nvic: &mut Nvic) {
        for line in (0..16).filter(|line| (before ^ after) >> line & 1 == 1) {
            let selected = self.exticr[line / 4] >> (4 * (line % 4)) & 0xF;
            let trigger = if after >> line & 1 == 1 { self.rtsr } else { self.ftsr };
            if selected as usize == port && trigger >> line & 1 == 1 {
                self.pr |= 1 << line;
            }
        }
        self.lines(nvic);
    }

    fn lines(&self, nvic: &mut Nvic) {
        let requests = self.pr & self.imr;
        for line in 0..5 {
            nvic.set_line(6 + line, requests >> line & 1 == 1);
        }
        nvic.set_line(23, requests & 0x03E0 != 0);
        nvic.set_line(40, requests & 0xFC00 != 0);
    }

    /// Reset of SYSCFG.
    pub fn reset_syscfg(&mut self) {
        self.exticr = [0; 4];
        self.memrmp = 0;
        self.pmc = 0;
    }

    /// Read an EXTI register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.imr,
            0x04 => self.emr,
            0x08 => self.rtsr,
            0x0C => self.ftsr,
            0x10 => self.swier,
            0x14 => self.pr,
            _ => return None,
        })
    }

    /// Write an EXTI register.
    pub fn write(&mut self, offset: u32, value: u32, nvic: &mut Nvic) -> Option<()> {
        match offset {
            0x00 => self.imr = value,
            0x04 => self.emr = value,
            0x08 => self.rtsr = value,
            0x0C => self.ftsr = value,
            0x10 => {
                self.pr |= value & !self.swier;
                self.swier = value;
            }
            0x14 => {
                self.pr &= !value;
                self.swier &= !value;
            }
            _ => return None,
        }
        self.lines(nvic);
        Some(())
    }

    /// Read a SYSCFG register.
    pub fn read_syscfg(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.memrmp,
            0x04 => self.pmc,
            0x08..=0x14 => self.exticr[offset as usize / 4 - 2],
            0x20 => 0,
            _ => return None,
        })
    }

    /// Write a SYSCFG register.
    pub fn write_syscfg(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0x00 => self.memrmp = value,
            0x04 => self.pmc = value,
            0x08..=0x14 => self.exticr[offset as usize / 4 - 2] = value & 0xFFFF,
            _ => return None,
        }
        Some(())
    }
}
