//! What the board keeps while it is without power: a map of small records in the three 16 KiB sectors after the vector
//! table. `sequential-storage` makes it power-fail safe and checks every record.

use crate::flash::{SECTOR, Sectors};
use crate::shared;
use core::ops::Range;
use core::sync::atomic::Ordering;
use embassy_stm32::Peri;
use embassy_stm32::flash::Flash;
use embassy_stm32::pac;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};
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

type Failed = Error<embassy_stm32::flash::Error>;

/// Where each record stands. Without it the age of each old record in a full sector would be found by reading all of the
/// others: seconds.
type Places = Cache<ArrayPageStates<SECTORS>, ArrayPagePointers<SECTORS>, ArrayKeyPointers<u8, KEYS>, u8>;

type Map = MapStorage<u8, Sectors, Places>;

/// Sectors 1 to 3, from the start of flash; memory.x leaves them free.
const PLACE: Range<u32> = 0x4000..0x1_0000;
const SECTORS: usize = 3;
/// Keys that there are.
const KEYS: usize = 3;

/// The store as the tasks of the thread-mode executor share it.
pub type SharedStore = Mutex<NoopRawMutex, Store>;

/// Longest record with its key.
pub const RECORD: usize = 1536;

/// Record of the table made on the board.
pub const TABLE: u8 = 1;
/// Record of the settings, and of what tells whether it is the newest.
pub const SETTINGS: u8 = 2;
pub const SETTINGS_WITNESS: u8 = 3;

/// The kept records.
pub struct Store {
    /// Nothing only while it is made anew.
    map: Option<Map>,
    buffer: [u8; RECORD],
    foreign: bool,
}

/// Flash is damaged past the map's own repair.
pub struct Unreadable;

fn map(sectors: Sectors) -> Map {
    let places = Cache::new(ArrayPageStates::new(), ArrayPagePointers::new(), ArrayKeyPointers::new());
    MapStorage::new(sectors, const { MapConfig::new(PLACE) }, places)
}

/// Whether a sector holds what this store never wrote: another program's, or half of what was erased when power failed.
/// The map takes such a sector for an empty one.
fn is_foreign(Sectors(region): &mut Sectors) -> bool {
    let mut part = [0; 256];
    PLACE.step_by(SECTOR as usize).any(|sector| {
        for place in (sector..sector + SECTOR).step_by(part.len()) {
            // What cannot be read is nothing of ours either.
            if region.blocking_read(place, &mut part).is_err() {
                return true;
            }
            let words = part.as_chunks().0;
            // The map's mark, a bit or two of which may have been lost.
            if place == sector && u32::from_ne_bytes(words[0]).count_ones() <= 2 {
                return false;
            }
            // By words: this is on the way to the first tick.
            if words.iter().fold(u32::MAX, |all, word| all & u32::from_ne_bytes(*word)) != u32::MAX {
                return true;
            }
        }
        false
    })
}

impl Store {
    /// On the board's flash.
    pub fn new(flash: Peri<'static, FLASH>) -> Self {
        let mut sectors = Sectors(Flash::new_blocking(flash).into_blocking_regions().bank1_region1);
        let foreign = is_foreign(&mut sectors);
        Self { map: Some(map(sectors)), buffer: [0; RECORD], foreign }
    }

    /// Whether there was something else than this store where it is, when the board started.
    pub fn was_foreign(&self) -> bool {
        self.foreign
    }

    /// The newest whole record, if there is one.
    pub async fn fetch(&mut self, key: u8) -> Result<Option<&[u8]>, Unreadable> {
        let map = self.map.as_mut().ok_or(Unreadable)?;
        map.fetch_item::<&[u8]>(&mut self.buffer, &key).await.map_err(|e| {
            defmt::error!("flash cannot be read: {}", e);
            Unreadable
        })
    }

    /// Keeps records, each whole or not at all; whether all are there now. Waits until the rig stands and the control task
    /// has agreed to pause: erasing a full sector stalls the core for 0.25 s (0.5 s at most).
    pub async fn keep(&mut self, records: &[(u8, &[u8])]) -> bool {
        shared::PAUSE_WANTED.store(true, Ordering::Release);
        while !shared::PAUSED.load(Ordering::Acquire) {
            Timer::after(Duration::from_millis(10)).await;
        }
        let kept = self.write(records).await;
        // Until sensors and drive have been heard again.
        Timer::after(Duration::from_millis(40)).await;
        shared::PAUSE_WANTED.store(false, Ordering::Release);
        kept
    }

    /// As [`Store::keep`], before the tasks run.
    pub async fn write(&mut self, records: &[(u8, &[u8])]) -> bool {
        // One sector may have to be erased and then, damaged, all three: 2 s if each takes its longest. 2.8 s with the
        // fastest LSI.
        watchdog(Pr::DIVIDE_BY32, 0xFFF);
        let mut written = self.write_and_read(records).await;
        // Past repair, or not what was written: power failed once while a sector was erased, which then looks empty and is
        // not. What else is in there (a table, when these are settings) must be made again.
        if matches!(written, Ok(false) | Err(Error::Corrupted { .. })) {
            defmt::warn!("flash is damaged: erased");
            written = match self.erase().await {
                Ok(()) => self.write_and_read(records).await,
                Err(e) => Err(e),
            };
        }
        watchdog(Pr::DIVIDE_BY4, crate::board::WATCHDOG_RELOAD);
        match written {
            Ok(whole) => whole,
            Err(e) => {
                defmt::error!("flash cannot be written: {}", e);
                false
            }
        }
    }

    async fn write_and_read(&mut self, records: &[(u8, &[u8])]) -> Result<bool, Failed> {
        let Some(map) = self.map.as_mut() else { return Ok(false) };
        for (key, record) in records {
            map.store_item(&mut self.buffer, key, record).await?;
            if map.fetch_item::<&[u8]>(&mut self.buffer, key).await? != Some(*record) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Erases all of it. The map forgets where its records stood only if it is made anew.
    async fn erase(&mut self) -> Result<(), Failed> {
        let Some(mut old) = self.map.take() else { return Ok(()) };
        let erased = old.erase_all().await;
        self.map = Some(map(old.destroy().0));
        erased
    }
}

/// Prescaler and counts of the watchdog from now on; this feeds it.
fn watchdog(prescaler: Pr, counts: u16) {
    let iwdg = pac::IWDG;
    let wait = || while iwdg.sr().read().pvu() || iwdg.sr().read().rvu() {};
    wait();
    // In one piece: the watchdog task, which feeds it from interrupt level, would lock the registers again.
    cortex_m::interrupt::free(|_| {
        iwdg.kr().write(|w| w.set_key(Key::ENABLE));
        iwdg.pr().write(|w| w.set_pr(prescaler));
        iwdg.rlr().write(|w| w.set_rl(counts));
    });
    wait();
    iwdg.kr().write(|w| w.set_key(Key::RESET));
}
