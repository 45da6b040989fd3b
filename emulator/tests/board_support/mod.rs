//! A bare board, and ELFs around a few hand-assembled instructions.

pub mod programs;

use rig_plant::board::{Board, CanFrame, CanOutcome, Stimulus};

/// A board that answers nothing and drives nothing.
pub struct Bare;

impl Board for Bare {
    fn adc(&mut self, _: f64, _: u8) -> u16 {
        0
    }
    fn uart_tx(&mut self, _: f64, _: u8, _: u8) {}
    fn can_tx(&mut self, _: f64, _: &CanFrame) -> CanOutcome {
        CanOutcome::Acknowledged
    }
    fn gpio_out(&mut self, _: f64, _: char, _: u16) {}
    fn quadrature(&mut self, _: f64, _: u8) -> i64 {
        0
    }
    fn next_event_s(&self) -> f64 {
        f64::INFINITY
    }
    fn poll(&mut self, _: f64) -> Vec<Stimulus> {
        Vec::new()
    }
}

/// Code behind a vector table whose entries all go to `handler`.
pub struct Program {
    pub code: &'static [u16],
    pub handler: u32,
}

const CODE: u32 = 18 * 4;
const FLASH: u32 = 0x0800_0000;

impl Program {
    fn image(&self) -> Vec<u8> {
        let mut words = vec![0x2002_0000, FLASH + CODE + 1];
        words.extend([FLASH + self.handler + 1; 16]);
        let mut bytes: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
        bytes.extend(self.code.iter().flat_map(|half| half.to_le_bytes()));
        bytes
    }

    /// An ELF of one segment, with the symbols `start` and `handler`.
    pub fn elf(&self) -> Vec<u8> {
        let image = self.image();
        let names = b"\0start\0handler\0.text\0.symtab\0.strtab\0";
        let end = CODE + 2 * self.code.len() as u32;
        let mut symbols = vec![0u32; 4];
        // Name, value, size, and: function, global, section 1.
        symbols.extend([1, FLASH + CODE + 1, self.handler.max(CODE + 2) - CODE, 0x0001_0012]);
        symbols.extend([7, FLASH + self.handler + 1, end - self.handler, 0x0001_0012]);
        let text = 52 + 32;
        let symtab = (text + image.len() as u32).next_multiple_of(4);
        let strtab = symtab + 4 * symbols.len() as u32;
        let sections = (strtab + names.len() as u32).next_multiple_of(4);
        let halves = |low: u32, high: u32| low | high << 16;
        let header = [
            0x464C_457F,
            0x0001_0101,
            0,
            0,
            halves(2, 40),
            1,
            FLASH + CODE + 1,
            52,
            sections,
            0x0500_0400,
            halves(52, 32),
            halves(1, 40),
            halves(4, 3),
        ];
        let size = image.len() as u32;
        let segment = [1, text, FLASH, FLASH, size, size, 5, 4];
        let mut elf: Vec<u8> = header.into_iter().chain(segment).flat_map(u32::to_le_bytes).collect();
        elf.extend(&image);
        elf.resize(symtab as usize, 0);
        elf.extend(symbols.iter().flat_map(|word| word.to_le_bytes()));
        elf.extend(names);
        elf.resize(sections as usize, 0);
        let table = [
            [0; 10],
            [15, 1, 6, FLASH, text, size, 0, 0, 4, 0],
            [21, 2, 0, 0, symtab, 48, 3, 1, 4, 16],
            [29, 3, 0, 0, strtab, names.len() as u32, 0, 0, 1, 0],
        ];
        elf.extend(table.as_flattened().iter().flat_map(|word| word.to_le_bytes()));
        elf
    }
}
