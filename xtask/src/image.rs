//! An image on the board: the memory that it takes, and its bytes in flash.

use anyhow::{Context, Result, bail, ensure};
use fs_err as fs;
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};
use std::path::Path;

/// Limit of the firmware's flash (bytes), of the 448 KiB that the flash store leaves.
pub const FLASH_LIMIT: u64 = 256 * 1024;

/// Limit of static data (bytes), of 128 KiB of RAM; the rest is for the stack (memory.x).
pub const RAM_LIMIT: u64 = 64 * 1024;

/// Addresses of the RAM of the STM32F446.
const RAM: std::ops::Range<u64> = 0x2000_0000..0x2002_0000;

/// Addresses of its flash. A binary image has no address of its own: the ST-LINK's drive writes it to the first one.
const FLASH: std::ops::Range<u64> = 0x0800_0000..0x0808_0000;

/// The bytes of an image from the start of the flash on, with erased flash (0xff) in the gaps.
pub fn binary(path: &Path) -> Result<Vec<u8>> {
    let data = fs::read(path)?;
    let file = ElfFile32::<object::Endianness>::parse(&*data)
        .with_context(|| format!("{} is not a 32-bit ELF file", path.display()))?;
    let endian = file.endian();
    let mut parts = Vec::new();
    for segment in file.elf_program_headers().iter().filter(|s| s.p_type(endian) == elf::PT_LOAD) {
        let bytes = segment.data(endian, &*data).ok().context("a segment reaches beyond the file")?;
        // Initial values of variables are loaded where they lie in flash, which is their physical address.
        parts.push((u64::from(segment.p_paddr(endian)), bytes));
    }
    joined(&parts)
}

/// Joins bytes at their addresses; parts without bytes are variables that start at zero.
fn joined(parts: &[(u64, &[u8])]) -> Result<Vec<u8>> {
    let mut image = Vec::new();
    for (address, bytes) in parts.iter().filter(|(_, bytes)| !bytes.is_empty()) {
        let end = address + bytes.len() as u64;
        ensure!(FLASH.contains(address) && end <= FLASH.end, "{address:#x}..{end:#x} is not in the flash");
        let [start, end] = [address - FLASH.start, end - FLASH.start].map(|offset| offset as usize);
        if image.len() < end {
            image.resize(end, 0xff);
        }
        image[start..end].copy_from_slice(bytes);
    }
    ensure!(parts.iter().any(|(address, bytes)| *address == FLASH.start && !bytes.is_empty()), "no vector table");
    Ok(image)
}

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
    let data = fs::read(path)?;
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
    let fraction =
        |bytes: u64, limit: u64| format!("{bytes} bytes ({:.1} of {} KiB)", bytes as f64 / 1024.0, limit / 1024);
    println!("firmware: flash {}, static RAM {}", fraction(flash, FLASH_LIMIT), fraction(ram, RAM_LIMIT));
    ensure!(
        flash <= FLASH_LIMIT && ram <= RAM_LIMIT,
        "the firmware is too large: limits are {FLASH_LIMIT} bytes of flash and {RAM_LIMIT} bytes of RAM"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_stand_at_their_addresses_and_gaps_are_erased_flash() {
        let image = joined(&[(0x0800_0008, &[5, 6]), (0x0800_0000, &[1, 2, 3]), (0x2000_0000, &[])]).unwrap();
        assert_eq!(image, [1, 2, 3, 0xff, 0xff, 0xff, 0xff, 0xff, 5, 6]);
    }

    #[test]
    fn bytes_elsewhere_and_an_image_without_vectors_are_refused() {
        assert!(joined(&[(0x2000_0000, &[1])]).is_err());
        assert!(joined(&[(0x0800_0000, &[1]), (0x0807_ffff, &[1, 2])]).is_err());
        assert!(joined(&[(0x0800_0004, &[1])]).is_err());
        assert!(joined(&[]).is_err());
    }
}
