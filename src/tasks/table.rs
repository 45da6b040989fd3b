//! Takes a table that the host sends in parts, checks it, uses it and keeps it in flash. It runs in the thread-mode executor,
//! so every task but that of the settings interrupts it.

use crate::flash_store::{self, SharedStore, Store, Unreadable};
use crate::shared;
use core::sync::atomic::Ordering;
use embassy_time::{Instant, Timer};
use rig_link::messages::{EventKind, Message, TableParts, TableRefusal};
use static_cell::ConstStaticCell;
use tsa_table::record::{RECORD_MAX, RecordError, StoredTable};

/// Loads the table from flash, to be used from the first tick on, if a valid one is there.
pub async fn load(store: &mut Store) {
    let table = match store.fetch(flash_store::TABLE).await {
        Ok(None) => return,
        Ok(Some(record)) => StoredTable::read(record).ok(),
        Err(Unreadable) => None,
    };
    match table {
        Some(table) => shared::NEW_TABLE.signal(table),
        None => {
            defmt::warn!("the table in flash is damaged or not for this firmware: the built-in table is used");
            shared::SETTINGS_CORRUPT.store(true, Ordering::Relaxed);
        }
    }
}

#[embassy_executor::task]
pub async fn run(store: &'static SharedStore) -> ! {
    static PARTS: ConstStaticCell<TableParts<RECORD_MAX>> = ConstStaticCell::new(TableParts::new());
    let parts = PARTS.take();
    loop {
        let part = shared::TABLE_PARTS.receive().await;
        let kind = match parts.add(&part) {
            Ok(None) => continue,
            Ok(Some(record)) => keep(store, record).await,
            Err(refusal) => EventKind::TableRefused(refusal),
        };
        defmt::info!("{}", kind);
        shared::OUTBOX.send(Message::Event { t_us: Instant::now().as_micros(), kind }).await;
    }
}

async fn keep(store: &SharedStore, record: &[u8]) -> EventKind {
    match StoredTable::read(record) {
        Ok(table) => {
            let crc = table.table().crc;
            let kept = store.lock().await.write_at_rest(&[(flash_store::TABLE, record)]).await;
            shared::NEW_TABLE.signal(table);
            // The host is told when the control code has it, so that the board then answers with its hash. It takes a table in the first
            // tick in which nothing moves.
            while shared::NEW_TABLE.signaled() {
                Timer::after_millis(1).await;
            }
            EventKind::TableStored { crc, kept }
        }
        Err(error) => EventKind::TableRefused(match error {
            RecordError::Damaged => TableRefusal::Damaged,
            RecordError::Version => TableRefusal::Version,
            RecordError::Range => TableRefusal::Range,
            RecordError::NotMonotone => TableRefusal::NotMonotone,
        }),
    }
}
