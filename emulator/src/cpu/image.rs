//! The firmware's ELF: bytes for flash, and symbols to name what went wrong.

use crate::soc::memory::{FLASH_BASE, FLASH_SIZE};
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol, SymbolKind};

/// What can be wrong with an ELF.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// Not an ELF, or a broken one.
    #[error("not a 32-bit ELF: {0}")]
    Elf(String),
    /// No segment of it belongs in flash.
    #[error("no segment for flash at {FLASH_BASE:#010x}")]
    NoFlash,
    /// A segment that does not fit.
    #[error("a segment of {size} bytes at {address:#010x} does not fit into flash")]
    TooLarge {
        /// Load address.
        address: u64,
        /// Size.
        size: usize,
    },
}

#[derive(Clone, Debug)]
struct Symbol {
    name: String,
    address: u32,
    /// Bytes of a function; 0 of anything else.
    size: u32,
}

/// What the machine needs of an ELF.
#[derive(Clone, Debug)]
pub struct Image {
    /// Address and bytes of each segment in flash.
    pub segments: Vec<(u32, Vec<u8>)>,
    symbols: Vec<Symbol>,
    /// Functions by their start.
    functions: Vec<Symbol>,
}

impl Image {
    /// Reads an ELF.
    ///
    /// # Errors
    /// [`ImageError`] if it is no ELF for this flash.
    pub fn parse(elf: &[u8]) -> Result<Self, ImageError> {
        let broken = |error: object::Error| ImageError::Elf(error.to_string());
        let file = ElfFile32::<Endianness>::parse(elf).map_err(broken)?;
        let endian = file.endian();
        let mut segments = Vec::new();
        for header in file.elf_program_headers() {
            let (address, size) = (u64::from(header.p_paddr(endian)), header.p_filesz(endian) as usize);
            let flash = u64::from(FLASH_BASE)..u64::from(FLASH_BASE) + FLASH_SIZE as u64;
            if header.p_type(endian) != object::elf::PT_LOAD || size == 0 || !flash.contains(&address) {
                continue;
            }
            if address + size as u64 > flash.end {
                return Err(ImageError::TooLarge { address, size });
            }
            let data = ProgramHeader::data(header, endian, elf)
                .map_err(|()| ImageError::Elf("segment outside the file".into()))?;
            segments.push((address as u32, data.to_vec()));
        }
        if segments.is_empty() {
            return Err(ImageError::NoFlash);
        }
        let symbols = file.symbols().filter_map(|symbol| {
            let size = if symbol.kind() == SymbolKind::Text { symbol.size() as u32 } else { 0 };
            Some(Symbol { name: symbol.name().ok()?.to_owned(), address: symbol.address() as u32, size })
        });
        let symbols: Vec<Symbol> = symbols.collect();
        let functions = symbols.iter().filter(|symbol| symbol.size > 0).cloned();
        let mut functions: Vec<_> = functions.map(|f| Symbol { address: f.address & !1, ..f }).collect();
        functions.sort_by_key(|function| function.address);
        Ok(Self { segments, symbols, functions })
    }

    /// Address of a symbol.
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.iter().find(|symbol| symbol.name == name).map(|symbol| symbol.address)
    }

    /// Start of a function, by its whole name or by its last path segment in a mangled one.
    pub fn function(&self, name: &str) -> Option<u32> {
        let segment = format!("{}{name}", name.len());
        let exact = self.functions.iter().find(|function| function.name == name);
        let mangled = || self.functions.iter().find(|function| function.name.contains(&segment));
        exact.or_else(mangled).map(|function| function.address)
    }

    /// Name of the function at an address.
    pub fn function_at(&self, address: u32) -> Option<&str> {
        self.around(address).map(|function| function.name.as_str())
    }

    /// Start of the function at an address.
    pub fn start_of_function_at(&self, address: u32) -> Option<u32> {
        self.around(address).map(|function| function.address)
    }

    fn around(&self, address: u32) -> Option<&Symbol> {
        let after = self.functions.partition_point(|function| function.address <= address);
        self.functions[..after].last().filter(|function| address < function.address + function.size)
    }

    /// Lowest address of the main stack that starts at `top`, if the firmware is laid out like cortex-m-rt's: where the
    /// linker says so, or the end of the statics below it.
    pub fn stack_bottom(&self, top: u32) -> Option<u32> {
        let below = |address: &u32| *address < top;
        let statics = ["__sheap", "__euninit", "__ebss", "__edata"].iter().filter_map(|name| self.symbol(name)).max();
        self.symbol("_stack_end").filter(below).or(statics.filter(below))
    }
}
