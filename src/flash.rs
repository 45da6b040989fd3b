//! The four small sectors of flash, through the traits that `sequential-storage` uses.

use embassy_stm32::flash::{Bank1Region1, Blocking, Error, READ_SIZE, WRITE_SIZE};
use embassy_stm32::pac;
use embassy_stm32::pac::flash::vals::Psize;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// Size of a sector (bytes).
pub const SECTOR: u32 = 0x4000;

/// Sectors 0 to 3. The core stalls while one is written or erased.
pub struct Sectors(pub Bank1Region1<'static, Blocking>);

impl ErrorType for Sectors {
    type Error = Error;
}

impl ReadNorFlash for Sectors {
    const READ_SIZE: usize = READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.0.blocking_read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        4 * SECTOR as usize
    }
}

impl NorFlash for Sectors {
    const WRITE_SIZE: usize = WRITE_SIZE;
    const ERASE_SIZE: usize = SECTOR as usize;

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.0.blocking_write(offset, bytes)
    }

    /// Erases by 32 bits at a time. embassy-stm32 0.6.0 leaves the width at its reset value of 8 bits, which takes 1.6
    /// times as long.
    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        let flash = pac::FLASH;
        if flash.cr().read().lock() {
            flash.keyr().write_value(0x4567_0123);
            flash.keyr().write_value(0xCDEF_89AB);
        }
        flash.cr().modify(|w| w.set_psize(Psize::PSIZE32));
        // This locks the register again and keeps the width.
        self.0.blocking_erase(from, to)
    }
}
