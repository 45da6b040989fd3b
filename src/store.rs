//! What the board keeps while it is without power: a map of small records in the three 16 KiB sectors after the vector
//! table. `sequential-storage` makes it power-fail safe and checks every record.

use embassy_embedded_hal::adapter::BlockingAsync;
use embassy_stm32::Peri;
use embassy_stm32::flash::{Bank1Region1, Blocking, Flash};
use embassy_stm32::pac;
use embassy_stm32::peripherals::FLASH;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

type Sectors = BlockingAsync<Bank1Region1<'static, Blocking>>;

/// Longest record with its key.
pub const RECORD: usize = 1536;

/// Record of the table made on the board.
pub const TABLE: u8 = 1;

/// The kept records.
pub struct Store {
    map: MapStorage<u8, Sectors, Cache<Uncached, Uncached, Uncached, u8>>,
    buffer: [u8; RECORD],
}

impl Store {
    /// On the board's flash.
    pub fn new(flash: Peri<'static, FLASH>) -> Self {
        let region = Flash::new_blocking(flash).into_blocking_regions().bank1_region1;
        // Sectors 1 to 3; memory.x leaves them free.
        let config = const { MapConfig::new(0x4000..0x1_0000) };
        Self { map: MapStorage::new(BlockingAsync::new(region), config, Cache::new_uncached()), buffer: [0; RECORD] }
    }

    /// The record, if there is a whole one. Damage counts as none.
    pub async fn fetch(&mut self, key: u8) -> Option<&[u8]> {
        match self.map.fetch_item::<&[u8]>(&mut self.buffer, &key).await {
            Ok(found) => found,
            Err(e) => {
                defmt::error!("settings in flash cannot be read: {}", e);
                crate::shared::SETTINGS_CORRUPT.store(true, core::sync::atomic::Ordering::Relaxed);
                None
            }
        }
    }

    /// Keeps a record; whether it is there now. Erasing a full sector stalls the core for 0.25 s (0.5 s at most): only while
    /// nothing moves. The watchdog is given longer meanwhile.
    pub async fn store(&mut self, key: u8, record: &[u8]) -> bool {
        watchdog_reload(0xFFF);
        let result = self.map.store_item(&mut self.buffer, &key, &record).await;
        watchdog_reload(crate::board::WATCHDOG_RELOAD);
        if let Err(e) = &result {
            defmt::error!("cannot keep record {}: {}", key, e);
        }
        result.is_ok()
    }
}

/// Counts of the watchdog from the next feeding on; this feeds it.
fn watchdog_reload(counts: u16) {
    let iwdg = pac::IWDG;
    iwdg.kr().write(|w| w.set_key(pac::iwdg::vals::Key::ENABLE));
    while iwdg.sr().read().rvu() {}
    iwdg.rlr().write(|w| w.set_rl(counts));
    while iwdg.sr().read().rvu() {}
    iwdg.kr().write(|w| w.set_key(pac::iwdg::vals::Key::RESET));
}
