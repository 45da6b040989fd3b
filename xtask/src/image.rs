//! The memory that an image takes on the board.

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};
use std::path::Path;

/// Limit of the firmware's flash (bytes), of the 448 KiB that the flash store leaves. The solver, which is there in f32
/// and in f64, takes half of it.
pub const FLASH_LIMIT: u64 = 256 * 1024;

/// Limit of static data (bytes), of 128 KiB of RAM; the rest is for the stack.
pub const RAM_LIMIT: u64 = 64 * 1024;

/// Addresses of the RAM of the STM32F446.
const RAM: std::ops::Range<u64> = 0x2000_0000..0x2002_0000;

/// Memory that an image takes.
#[derive(Debug, PartialEq)]
pub struct Size {
    /// Code, constants and the initial values of variables (bytes).
    pub flash: u64,
    /// Variables, without the stack (bytes).
    pub ram: u64,
}

/// Sums the sections that are loaded onto the board.
pub fn size(path: &Path) -> Result<Size> {
    let data = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let file = object::File::parse(&*data).with_context(|| format!("{} is not an ELF file", path.display()))?;
    let mut size = Size { flash: 0, ram: 0 };
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags, .. } = section.flags() else {
            bail!("{} is not an ELF file", path.display())
        };
        if sh_flags.0 & elf::SHF_ALLOC.0 == 0 {
            continue; // debug information and defmt's strings are not loaded
        }
        // Initialised variables take both RAM and flash.
        if RAM.contains(&section.address()) {
            size.ram += section.size();
        }
        if !matches!(section.kind(), SectionKind::UninitializedData) {
            size.flash += section.size();
        }
    }
    Ok(size)
}

/// Prints the size of the firmware; fails if it exceeds the limits.
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
