//! Programs for the core, assembled by hand and wrapped into an ELF with symbols.

/// Where programs start: behind the vector table.
pub const START: u32 = 0x0800_0200;
/// Initial stack pointer.
pub const STACK: u32 = 0x2002_0000;

pub const NOP: u16 = 0xBF00;
pub const WFI: u16 = 0xBF30;
pub const WFE: u16 = 0xBF20;
pub const SEV: u16 = 0xBF40;
pub const BX_LR: u16 = 0x4770;
/// A branch to itself.
pub const PARK: u16 = 0xE7FE;
/// The instruction that `panic-probe` ends with.
pub const UDF: u16 = 0xDE00;
/// `vmov s0, r0` and back, and `vadd.f32 s0, s0, s0`.
pub const S0_FROM_R0: [u16; 2] = [0xEE00, 0x0A10];
pub const R0_FROM_S0: [u16; 2] = [0xEE10, 0x0A10];
pub const DOUBLE_S0: [u16; 2] = [0xEE30, 0x0A00];

/// `movw` and `movt`: any word into a low register.
pub fn load(register: u16, value: u32) -> Vec<u16> {
    let half = |op: u16, value: u32| {
        let value = value as u16;
        [op | (value >> 11 & 1) << 10 | value >> 12, (value >> 8 & 7) << 12 | register << 8 | value & 0xFF]
    };
    [half(0xF240, value), half(0xF2C0, value >> 16)].concat()
}

/// `str to, [at]`.
pub fn store(value: u16, at: u16) -> u16 {
    0x6000 | at << 3 | value
}

/// `ldr into, [at]`.
pub fn fetch(into: u16, at: u16) -> u16 {
    0x6800 | at << 3 | into
}

/// `adds register, #n`.
pub fn add(register: u16, n: u16) -> u16 {
    0x3000 | register << 8 | n
}

/// `subs register, #n`.
pub fn subtract(register: u16, n: u16) -> u16 {
    0x3800 | register << 8 | n
}

/// A branch over `halfwords`, counted from the branch itself: always (0xE000), if not equal (0xD100), if negative (0xD400).
pub fn branch(op: u16, halfwords: i16) -> u16 {
    let offset = (halfwords - 2) as u16;
    op | offset & if op == 0xE000 { 0x7FF } else { 0xFF }
}

/// `ram[address] += n`, with r2 and r3.
pub fn bump(address: u32, n: u16) -> Vec<u16> {
    [load(2, address), vec![fetch(3, 2), add(3, n), store(3, 2)]].concat()
}

/// `*address = value`, with r2 and r3.
pub fn poke(address: u32, value: u32) -> Vec<u16> {
    [load(2, address), load(3, value), vec![store(3, 2)]].concat()
}

/// A program: functions one after the other, the first is the entry.
#[derive(Default)]
pub struct Program {
    code: Vec<u16>,
    functions: Vec<(&'static str, u32, u32)>,
    vectors: Vec<(usize, u32)>,
}

impl Program {
    /// Append a function. Gives its address.
    pub fn function(&mut self, name: &'static str, code: &[Vec<u16>]) -> u32 {
        let code = code.concat();
        let address = START + 2 * self.code.len() as u32;
        self.functions.push((name, address, 2 * code.len() as u32));
        self.code.extend(code);
        address
    }

    /// Append the handler of an exception.
    pub fn handler(&mut self, exception: usize, name: &'static str, code: &[Vec<u16>]) {
        let address = self.function(name, &[code.concat(), vec![BX_LR]]);
        self.vector(exception, address);
    }

    /// An exception's handler is at this address.
    pub fn vector(&mut self, exception: usize, address: u32) {
        self.vectors.push((exception, address | 1));
    }

    /// The ELF.
    pub fn elf(&self) -> Vec<u8> {
        let mut vectors = vec![START | 1; 0x80];
        vectors[0] = STACK;
        for (exception, address) in &self.vectors {
            vectors[*exception] = *address;
        }
        let mut image: Vec<u8> = vectors.iter().flat_map(|word| word.to_le_bytes()).collect();
        image.extend(self.code.iter().flat_map(|half| half.to_le_bytes()));

        let mut names = vec![0u8];
        let mut symbols = vec![0u8; 16];
        for (name, address, size) in &self.functions {
            symbols.extend([names.len() as u32, address | 1, *size].iter().flat_map(|word| word.to_le_bytes()));
            // Global function in section 1.
            symbols.extend([0x12, 0, 1, 0]);
            names.extend(name.bytes().chain([0]));
        }
        let section_names = b"\0.text\0.symtab\0.strtab\0.shstrtab\0";

        let (head, program_head) = (52usize, 32usize);
        let text_at = head + program_head;
        let symbols_at = text_at + image.len();
        let names_at = symbols_at + symbols.len();
        let section_names_at = names_at + names.len();
        let sections_at = section_names_at + section_names.len();

        let mut elf = vec![0x7F, b'E', b'L', b'F', 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        halves(&mut elf, &[2, 40]);
        words(&mut elf, &[1, START | 1, head as u32, sections_at as u32, 0x0500_0400]);
        halves(&mut elf, &[head as u16, program_head as u16, 1, 40, 5, 4]);
        let size = image.len() as u32;
        words(&mut elf, &[1, text_at as u32, 0x0800_0000, 0x0800_0000, size, size, 5, 4]);
        elf.extend(&image);
        elf.extend(&symbols);
        elf.extend(&names);
        elf.extend(section_names);
        let section = |fields: [u32; 10]| fields;
        for fields in [
            section([0; 10]),
            section([1, 1, 6, 0x0800_0000, text_at as u32, size, 0, 0, 4, 0]),
            section([7, 2, 0, 0, symbols_at as u32, symbols.len() as u32, 3, 1, 4, 16]),
            section([15, 3, 0, 0, names_at as u32, names.len() as u32, 0, 0, 1, 0]),
            section([23, 3, 0, 0, section_names_at as u32, section_names.len() as u32, 0, 0, 1, 0]),
        ] {
            words(&mut elf, &fields);
        }
        elf
    }
}

fn words(into: &mut Vec<u8>, words: &[u32]) {
    into.extend(words.iter().flat_map(|word| word.to_le_bytes()));
}

fn halves(into: &mut Vec<u8>, halves: &[u16]) {
    into.extend(halves.iter().flat_map(|half| half.to_le_bytes()));
}
