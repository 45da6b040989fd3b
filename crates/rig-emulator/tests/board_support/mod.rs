//! What the board's tests share: a board that records, and ELFs around a few hand-assembled instructions.

#![allow(dead_code, reason = "each test binary uses its own part")]

pub mod programs;

use rig_emulator::board::{Board, CanFrame, CanOutcome, Stimulus};
use rig_emulator::soc::Soc;

/// A board that notes what it is told and answers what the test has set.
pub struct Bench {
    pub samples: Vec<(f64, u8)>,
    pub bytes: Vec<(f64, u8, u8)>,
    pub frames: Vec<(f64, CanFrame)>,
    pub levels: Vec<(f64, char, u16)>,
    pub outcome: CanOutcome,
    pub counts: i64,
    pub script: Vec<(f64, Stimulus)>,
}

impl Default for Bench {
    fn default() -> Self {
        Self {
            samples: Vec::new(),
            bytes: Vec::new(),
            frames: Vec::new(),
            levels: Vec::new(),
            outcome: CanOutcome::Acknowledged,
            counts: 0,
            script: Vec::new(),
        }
    }
}

impl Board for Bench {
    fn adc(&mut self, t_s: f64, channel: u8) -> u16 {
        self.samples.push((t_s, channel));
        self.samples.len() as u16
    }
    fn uart_tx(&mut self, t_s: f64, usart: u8, byte: u8) {
        self.bytes.push((t_s, usart, byte));
    }
    fn can_tx(&mut self, t_s: f64, frame: &CanFrame) -> CanOutcome {
        self.frames.push((t_s, *frame));
        self.outcome
    }
    fn gpio_out(&mut self, t_s: f64, port: char, levels: u16) {
        self.levels.push((t_s, port, levels));
    }
    fn quadrature(&mut self, _: f64, _: u8) -> i64 {
        self.counts
    }
    fn next_event_s(&self) -> f64 {
        self.script.first().map_or(f64::INFINITY, |(t_s, _)| *t_s)
    }
    fn poll(&mut self, t_s: f64) -> Vec<Stimulus> {
        let due = self.script.iter().take_while(|(due, _)| *due <= t_s + 1e-9).count();
        self.script.drain(..due).map(|(_, stimulus)| stimulus).collect()
    }
}

/// A strict chip on the bench with every peripheral's clock on.
pub fn clocked() -> Soc<Bench> {
    let mut soc = Soc::new(Bench::default(), true, 32_000.0);
    for (register, bits) in [(0x30, 0x0060_00FF), (0x40, 0x1206_007F), (0x44, 0x0005_4130)] {
        soc.write(RCC + register, 4, bits);
    }
    clean(&mut soc);
    soc
}

pub const RCC: u32 = 0x4002_3800;
pub const NVIC_PENDING: u32 = 0xE000_E200;

/// Nothing has been objected to.
pub fn clean(soc: &mut Soc<Bench>) {
    if let Some(fault) = soc.faults.take() {
        panic!("{fault}");
    }
}

/// An interrupt is pending in the NVIC.
pub fn pending(soc: &mut Soc<Bench>, irq: u32) -> bool {
    soc.read(NVIC_PENDING + irq / 32 * 4, 4) >> (irq % 32) & 1 == 1
}

/// Let `cycles` pass with the core asleep.
pub fn pass(soc: &mut Soc<Bench>, cycles: u64) {
    let until = soc.clock.now() + cycles;
    while soc.clock.now() < until {
        soc.sleep(until);
    }
}

/// Make a pin of a port an alternate function, an output (`Err(1)`) or analog (`Err(3)`).
pub fn pin(soc: &mut Soc<Bench>, port: char, number: u32, function: Result<u32, u32>) {
    let base = 0x4002_0000 + 0x400 * (port as u32 - 'A' as u32);
    let mode = function.map_or_else(|mode| mode, |_| 2);
    let moder = soc.read(base, 4) & !(3 << (2 * number)) | mode << (2 * number);
    soc.write(base, 4, moder);
    if let Ok(af) = function {
        let register = base + 0x20 + number / 8 * 4;
        let shift = 4 * (number % 8);
        let value = soc.read(register, 4) & !(0xF << shift) | af << shift;
        soc.write(register, 4, value);
    }
}

/// Code behind a vector table whose entries all go to `handler`, but that of IRQ 1 to `second`.
pub struct Program {
    pub code: &'static [u16],
    pub handler: u32,
    pub second: u32,
}

const CODE: u32 = 18 * 4;
const FLASH: u32 = 0x0800_0000;

impl Program {
    fn image(&self) -> Vec<u8> {
        let mut words = vec![0x2002_0000, FLASH + CODE + 1];
        words.extend([FLASH + self.handler + 1; 15]);
        words.push(FLASH + self.second + 1);
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
