//! The records that the board keeps in flash: a key-value map in the three 16 KiB sectors after the vector table.
//! `sequential-storage` makes it safe against power failure and checks every record.

use crate::flash::{SECTOR, Sectors};
use crate::iwdg;
use crate::shared;
use core::ops::Range;
use core::sync::atomic::Ordering;
use embassy_stm32::Peri;
use embassy_stm32::flash::Flash;
use embassy_stm32::pac::iwdg::vals::Pr;
use embassy_stm32::peripherals::FLASH;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_time::{Duration, Timer};
use sequential_storage::Error;
use sequential_storage::cache::Cache;
use sequential_storage::cache::key_pointers::ArrayKeyPointers;
use sequential_storage::cache::page_pointers::ArrayPagePointers;
use sequential_storage::cache::page_states::ArrayPageStates;
use sequential_storage::map::{MapConfig, MapStorage};

type WriteError = Error<embassy_stm32::flash::Error>;

/// Where each record stands. Without this cache `sequential-storage` would read all other records to find the age of
/// each record in a full sector, which takes seconds.
type RecordCache = Cache<ArrayPageStates<SECTORS>, ArrayPagePointers<SECTORS>, ArrayKeyPointers<u8, KEYS>, u8>;

type Map = MapStorage<u8, Sectors, RecordCache>;

/// Sectors 1 to 3 (bytes from the start of flash); memory.x leaves them free.
const RANGE: Range<u32> = 0x4000..0x1_0000;
const SECTORS: usize = 3;
/// Number of keys: those below, and the self-test's (src/bin/selftest/record.rs).
const KEYS: usize = 4;

/// The store, shared by the tasks of the thread-mode executor.
pub type SharedStore = Mutex<NoopRawMutex, Store>;

/// Longest record with its key (bytes).
pub const RECORD_MAX: usize = tsa_table::record::RECORD_MAX + 16;

/// Key of the table that the host sent.
pub const TABLE: u8 = 1;
/// Key of the settings.
pub const SETTINGS: u8 = 2;
/// Key of the settings' witness, which shows whether the settings' record is the newest.
pub const SETTINGS_WITNESS: u8 = 3;

/// The records in flash.
pub struct Store {
    /// `None` only while [`Store::erase`] replaces it.
    map: Option<Map>,
    buffer: [u8; RECORD_MAX],
    foreign: bool,
}

/// Flash is damaged beyond the map's own repair.
pub struct Unreadable;

fn map(sectors: Sectors) -> Map {
    let cache = Cache::new(ArrayPageStates::new(), ArrayPagePointers::new(), ArrayKeyPointers::new());
    MapStorage::new(sectors, const { MapConfig::new(RANGE) }, cache)
}

/// Whether a sector holds data that this store never wrote: another program's data, or a sector that was half erased
/// when power failed. The map would take such a sector for an empty one.
fn is_foreign(Sectors(region): &mut Sectors) -> bool {
    let mut part = [0; 256];
    RANGE.step_by(SECTOR as usize).any(|sector| {
        for place in (sector..sector + SECTOR).step_by(part.len()) {
            // Data that cannot be read is not this store's either.
            if region.blocking_read(place, &mut part).is_err() {
                return true;
            }
            let words = part.as_chunks().0;
            // The map's marker is 0; up to two of its bits may have been lost.
            if place == sector && u32::from_ne_bytes(words[0]).count_ones() <= 2 {
                return false;
            }
            // Compared by words, because this delays the first tick.
            if words.iter().fold(u32::MAX, |all, word| all & u32::from_ne_bytes(*word)) != u32::MAX {
                return true;
            }
        }
        false
    })
}

impl Store {
    /// The store in the board's flash.
    pub fn new(flash: Peri<'static, FLASH>) -> Self {
        let mut sectors = Sectors(Flash::new_blocking(flash).into_blocking_regions().bank1_region1);
        let foreign = is_foreign(&mut sectors);
        Self { map: Some(map(sectors)), buffer: [0; RECORD_MAX], foreign }
    }

    /// Whether the sectors held something else than this store when the board started.
    pub fn was_foreign(&self) -> bool {
        self.foreign
    }

    /// The newest complete record of this key, if there is one.
    ///
    /// # Errors
    /// [`Unreadable`] if flash is damaged beyond repair.
    pub async fn fetch(&mut self, key: u8) -> Result<Option<&[u8]>, Unreadable> {
        let map = self.map.as_mut().ok_or(Unreadable)?;
        map.fetch_item::<&[u8]>(&mut self.buffer, &key).await.map_err(|e| {
            defmt::error!("flash cannot be read: {}", e);
            Unreadable
        })
    }

    /// Writes records, each complete or not at all, and returns whether all of them can be read back. It first waits
    /// until the rig stands and the control task has agreed to pause: erasing a full sector stalls the core for 0.25 s
    /// (0.5 s at most).
    pub async fn write_at_rest(&mut self, records: &[(u8, &[u8])]) -> bool {
        shared::PAUSE_WANTED.store(true, Ordering::Release);
        while !shared::PAUSED.load(Ordering::Acquire) {
            Timer::after(Duration::from_millis(10)).await;
        }
        let written = self.write(records).await;
        // Until sensors and drive have reported again.
        Timer::after(Duration::from_millis(40)).await;
        shared::PAUSE_WANTED.store(false, Ordering::Release);
        written
    }

    /// As [`Store::write_at_rest`], but at once: for use before the tasks run.
    pub async fn write(&mut self, records: &[(u8, &[u8])]) -> bool {
        // One sector may have to be erased, and then all three because they are damaged: 2 s if each takes its longest.
        // This gives 2.8 s with the fastest LSI.
        iwdg::set_times(Pr::DIVIDE_BY32, 0xFFF);
        let mut written = self.write_and_verify(records).await;
        // Flash is damaged beyond repair, or the records read back differ: power once failed while a sector was erased,
        // which then looks empty but is not. The other records (a table, when these are settings) are lost.
        if matches!(written, Ok(false) | Err(Error::Corrupted { .. })) {
            defmt::warn!("flash is damaged: all stored records are erased");
            written = match self.erase().await {
                Ok(()) => self.write_and_verify(records).await,
                Err(e) => Err(e),
            };
        }
        iwdg::set_times(Pr::DIVIDE_BY4, iwdg::RELOAD);
        match written {
            Ok(verified) => verified,
            Err(e) => {
                defmt::error!("flash cannot be written: {}", e);
                false
            }
        }
    }

    /// Writes records and returns whether all of them can be read back. Damaged flash is not erased, and the watchdog
    /// keeps its time.
    ///
    /// # Errors
    /// The error of flash or of the map.
    pub async fn write_and_verify(&mut self, records: &[(u8, &[u8])]) -> Result<bool, WriteError> {
        let Some(map) = self.map.as_mut() else { return Ok(false) };
        for (key, record) in records {
            map.store_item(&mut self.buffer, key, record).await?;
            if map.fetch_item::<&[u8]>(&mut self.buffer, key).await? != Some(*record) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Erases all sectors. The map must be replaced, because it would not forget where its records stood.
    async fn erase(&mut self) -> Result<(), WriteError> {
        let Some(mut old) = self.map.take() else { return Ok(()) };
        let erased = old.erase_all().await;
        self.map = Some(map(old.destroy().0));
        erased
    }
}
