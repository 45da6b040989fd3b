//! How much of the board's memory an image takes.

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};
use std::path::Path;

/// Most that the image may take of the 448 KiB that the settings leave (bytes): the solver twice, in f32 and f64, is half of it.
pub const FLASH_LIMIT: u64 = 256 * 1024;

/// Most static data, of 128 KiB of RAM; the stack has the rest (bytes).
pub const RAM_LIMIT: u64 = 64 * 1024;

/// Where the STM32F446 has its RAM.
const RAM: std::ops::Range<u64> = 0x2000_0000..0x2002_0000;

/// What an image takes.
#[derive(Debug, PartialEq)]
pub struct Size {
    /// Code, constants and the initial values of variables (bytes).
    pub flash: u64,
    /// Variables, without the stack (bytes).
    pub ram: u64,
}

/// Sums the sections that the board sees.
pub fn size(path: &Path) -> Result<Size> {
    let data = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let file = object::File::parse(&*data).with_context(|| format!("{} is no ELF file", path.display()))?;
    let mut size = Size { flash: 0, ram: 0 };
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags, .. } = section.flags() else { bail!("{} is no ELF file", path.display()) };
        if sh_flags.0 & elf::SHF_ALLOC.0 == 0 {
            continue; // debug information and defmt's strings stay on the host
        }
        // Initialised variables stand in both.
        if RAM.contains(&section.address()) {
            size.ram += section.size();
        }
        if !matches!(section.kind(), SectionKind::UninitializedData) {
            size.flash += section.size();
        }
    }
    Ok(size)
}

/// Prints the size and fails above the limits.
pub fn report(path: &Path) -> Result<()> {
    let Size { flash, ram } = size(path)?;
    let share =
        |bytes: u64, limit: u64| format!("{bytes} bytes ({:.1} of {} KiB)", bytes as f64 / 1024.0, limit / 1024);
    println!("firmware: flash {}, static RAM {}", share(flash, FLASH_LIMIT), share(ram, RAM_LIMIT));
    if flash > FLASH_LIMIT || ram > RAM_LIMIT {
        bail!("the firmware is too large: limits are {FLASH_LIMIT} bytes of flash and {RAM_LIMIT} bytes of RAM");
    }
    Ok(())
}
