//! Flash and RAM as host buffers, which the emulated CPU maps and peripherals read and write.
//!
//! unicorn's translated code writes RAM through the pointer it was given, so the bytes are only ever touched through
//! raw pointers here: no Rust reference to them may exist while the CPU runs.

use std::ptr::NonNull;

/// Start of flash.
pub const FLASH_BASE: u32 = 0x0800_0000;
/// Size of flash on the STM32F446RE.
pub const FLASH_SIZE: usize = 512 << 10;
/// Start of RAM.
pub const RAM_BASE: u32 = 0x2000_0000;
/// Size of SRAM1 and SRAM2 together.
pub const RAM_SIZE: usize = 128 << 10;
/// From here up to RAM nothing answers: where a stack at the bottom of RAM overflows to. System memory ends here.
pub const BELOW_RAM: std::ops::Range<u32> = 0x1FFF_8000..RAM_BASE;
/// What RAM holds at power-up. Real RAM holds noise; a value that is no useful number exposes code that relies on
/// zeros.
pub const RAM_NOISE: u8 = 0xA5;

/// A block of memory at a fixed address.
#[derive(Debug)]
pub struct Region {
    base: u32,
    start: NonNull<u8>,
    size: usize,
}

impl Region {
    /// `size` bytes of `fill` at `base`.
    pub fn new(base: u32, size: usize, fill: u8) -> Self {
        let bytes = Box::leak(vec![fill; size].into_boxed_slice());
        Self { base, start: NonNull::from(&mut bytes[0]), size }
    }

    /// Where the bytes are in the host.
    pub(crate) fn host(&self) -> *mut u8 {
        self.start.as_ptr()
    }

    /// The address behind the last byte.
    pub fn end(&self) -> u32 {
        self.base + self.size as u32
    }

    /// Size in bytes.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Offset of `address`, if `len` bytes from there are inside.
    fn offset(&self, address: u32, len: usize) -> Option<usize> {
        let offset = address.checked_sub(self.base)? as usize;
        (offset.checked_add(len)? <= self.size).then_some(offset)
    }

    /// Copy bytes out; `None` if they are not all inside.
    pub fn read(&self, address: u32, into: &mut [u8]) -> Option<()> {
        let offset = self.offset(address, into.len())?;
        // SAFETY: `offset` has been checked; the bytes live as long as `self`; `into` is a Rust buffer, so it cannot
        // overlap.
        unsafe { std::ptr::copy_nonoverlapping(self.start.as_ptr().add(offset), into.as_mut_ptr(), into.len()) };
        Some(())
    }

    /// Copy bytes in; `None` if they do not all fit.
    pub fn write(&mut self, address: u32, from: &[u8]) -> Option<()> {
        let offset = self.offset(address, from.len())?;
        // SAFETY: as in `read`. The CPU is not running translated code while a peripheral or the host is here.
        unsafe { std::ptr::copy_nonoverlapping(from.as_ptr(), self.start.as_ptr().add(offset), from.len()) };
        Some(())
    }

    /// A little-endian word.
    pub fn word(&self, address: u32) -> Option<u32> {
        let mut bytes = [0; 4];
        self.read(address, &mut bytes)?;
        Some(u32::from_le_bytes(bytes))
    }

    /// A little-endian halfword.
    pub fn half(&self, address: u32) -> Option<u16> {
        let mut bytes = [0; 2];
        self.read(address, &mut bytes)?;
        Some(u16::from_le_bytes(bytes))
    }

    /// Write a little-endian word.
    pub fn set_word(&mut self, address: u32, value: u32) -> Option<()> {
        self.write(address, &value.to_le_bytes())
    }

    /// Everything.
    pub fn to_vec(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.size];
        self.read(self.base, &mut bytes).expect("the whole region is inside itself");
        bytes
    }

    /// Fill everything with one byte.
    pub fn fill(&mut self, value: u8) {
        // SAFETY: the pointer and size are those of the allocation.
        unsafe { std::ptr::write_bytes(self.start.as_ptr(), value, self.size) };
    }
}

impl Drop for Region {
    fn drop(&mut self) {
        // SAFETY: pointer and size are those of the box leaked in `new`, and unicorn, the other user, is closed before
        // its data drops.
        drop(unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(self.start.as_ptr(), self.size)) });
    }
}

/// Flash and RAM.
#[derive(Debug)]
pub struct Memory {
    /// 512 KiB of flash.
    pub flash: Region,
    /// 128 KiB of RAM.
    pub ram: Region,
}

impl Default for Memory {
    fn default() -> Self {
        Self { flash: Region::new(FLASH_BASE, FLASH_SIZE, 0xFF), ram: Region::new(RAM_BASE, RAM_SIZE, RAM_NOISE) }
    }
}

impl Memory {
    /// A word of RAM or flash.
    pub fn word(&self, address: u32) -> Option<u32> {
        self.ram.word(address).or_else(|| self.flash.word(address))
    }

    /// A halfword of RAM or flash.
    pub fn half(&self, address: u32) -> Option<u16> {
        self.flash.half(address).or_else(|| self.ram.half(address))
    }
}
