//! Checks the firmware's flash store: writes a record, resets, and reads the record. The record has a key of its own,
//! and the checksum of the firmware's records must not change. Only the store itself erases sectors, to make room. If
//! the sectors hold something else than a store, nothing is written.

use crate::flash_store::{SETTINGS, SETTINGS_WITNESS, Store, TABLE, Unreadable};
use crate::retained::{self, Word};
use crate::table::{Table, Verdict};

/// Key of the self-test's record; the firmware's keys are in src/flash_store.rs.
const KEY: u8 = 4;

/// Result of the check.
#[derive(Clone, Copy, PartialEq)]
#[repr(u32)]
enum Outcome {
    /// Written, but not read after the reset yet.
    Written = 1,
    /// The sectors hold something else than a store.
    Foreign,
    Unreadable,
    NotWritten,
    /// The record is the same after the reset.
    Preserved,
    /// The record has another value after the reset, or is missing.
    Lost,
    /// The firmware's records have changed.
    FirmwareRecordsChanged,
}

/// Checksum of the firmware's records (FNV-1a).
async fn firmware_records(store: &mut Store) -> Result<u32, Unreadable> {
    let mut hash = 0x811C_9DC5;
    for key in [TABLE, SETTINGS, SETTINGS_WITNESS] {
        let record = store.fetch(key).await?;
        let length = record.map_or(u32::MAX, |bytes| bytes.len() as u32);
        for byte in length.to_le_bytes().iter().chain(record.unwrap_or_default()) {
            hash = (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193);
        }
    }
    Ok(hash)
}

async fn value(store: &mut Store) -> Result<Option<u32>, Unreadable> {
    let record = store.fetch(KEY).await?;
    Ok(record.and_then(|bytes| bytes.try_into().ok()).map(u32::from_le_bytes))
}

/// Writes the record before the reset; returns an [`Outcome`].
pub async fn write(store: &mut Store) -> u32 {
    let outcome =
        if store.was_foreign() { Outcome::Foreign } else { write_new(store).await.unwrap_or(Outcome::Unreadable) };
    outcome as u32
}

async fn write_new(store: &mut Store) -> Result<Outcome, Unreadable> {
    retained::set(Word::FirmwareRecords, firmware_records(store).await?);
    // It differs from the value that is there.
    let new = value(store).await?.unwrap_or(0).wrapping_add(1);
    retained::set(Word::Value, new);
    let written = store.write_and_verify(&[(KEY, &new.to_le_bytes())]).await;
    Ok(if matches!(written, Ok(true)) { Outcome::Written } else { Outcome::NotWritten })
}

/// Reads the record after the reset; returns an [`Outcome`].
pub async fn read(store: &mut Store) -> u32 {
    let before = retained::get(Word::Flash);
    if before != Outcome::Written as u32 {
        return before;
    }
    let outcome = match (value(store).await, firmware_records(store).await) {
        (Ok(Some(value)), Ok(checksum)) if value == retained::get(Word::Value) => {
            if checksum == retained::get(Word::FirmwareRecords) {
                Outcome::Preserved
            } else {
                Outcome::FirmwareRecordsChanged
            }
        }
        (Ok(_), Ok(_)) => Outcome::Lost,
        _ => Outcome::Unreadable,
    };
    outcome as u32
}

pub fn row(table: &mut Table) {
    const RESULTS: [(Outcome, &str); 7] = [
        (Outcome::Preserved, "read after the reset, the firmware's records unchanged"),
        (Outcome::Written, "not read after the reset"),
        (Outcome::Foreign, "sectors 1 to 3 hold other data: not touched (probe-rs erase)"),
        (Outcome::Unreadable, "cannot be read"),
        (Outcome::NotWritten, "cannot be written"),
        (Outcome::Lost, "lost in the reset"),
        (Outcome::FirmwareRecordsChanged, "the firmware's records have changed"),
    ];
    let outcome = retained::get(Word::Flash);
    let result = RESULTS.iter().find(|(of, _)| *of as u32 == outcome).map_or("no result", |(_, text)| text);
    let good = outcome == Outcome::Preserved as u32;
    table.row("flash store", format_args!("a record survives a reset"), format_args!("{result}"), Verdict::of(good));
}
