//! The firmware's own store: a record written, a reset, and the record read. It is a record of the self-test's own beside the
//! firmware's, whose checksum must stay; nothing is erased but what the store itself makes room of. Where the sectors hold
//! something else than a store, nothing is written.

use crate::kept::{self, Word};
use crate::store::{SETTINGS, SETTINGS_WITNESS, Store, TABLE, Unreadable};
use crate::table::{Table, Verdict};

/// The self-test's record; the firmware's are in src/store.rs.
const KEY: u8 = 4;

/// How it went.
#[derive(Clone, Copy, PartialEq)]
#[repr(u32)]
enum Outcome {
    /// Written, not read after the reset yet.
    Written = 1,
    /// There is something else than a store.
    Foreign,
    Unreadable,
    NotWritten,
    /// After the reset: as written.
    Kept,
    /// After the reset: another value, or none.
    Lost,
    /// After the reset: the firmware's records have changed.
    OthersChanged,
}

/// Checksum of the firmware's records (FNV-1a).
async fn others(store: &mut Store) -> Result<u32, Unreadable> {
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

/// Before the reset.
pub async fn write(store: &mut Store) -> u32 {
    let outcome =
        if store.was_foreign() { Outcome::Foreign } else { begin(store).await.unwrap_or(Outcome::Unreadable) };
    outcome as u32
}

async fn begin(store: &mut Store) -> Result<Outcome, Unreadable> {
    kept::set(Word::Others, others(store).await?);
    // Another one than is there.
    let new = value(store).await?.unwrap_or(0).wrapping_add(1);
    kept::set(Word::Value, new);
    let written = store.write_and_read(&[(KEY, &new.to_le_bytes())]).await;
    Ok(if matches!(written, Ok(true)) { Outcome::Written } else { Outcome::NotWritten })
}

/// After the reset.
pub async fn read(store: &mut Store) -> u32 {
    let before = kept::get(Word::Flash);
    if before != Outcome::Written as u32 {
        return before;
    }
    let outcome = match (value(store).await, others(store).await) {
        (Ok(Some(value)), Ok(others)) if value == kept::get(Word::Value) => {
            if others == kept::get(Word::Others) {
                Outcome::Kept
            } else {
                Outcome::OthersChanged
            }
        }
        (Ok(_), Ok(_)) => Outcome::Lost,
        _ => Outcome::Unreadable,
    };
    outcome as u32
}

pub fn row(table: &mut Table) {
    const SEEN: [(Outcome, &str); 7] = [
        (Outcome::Kept, "read back after the reset, the firmware's as they were"),
        (Outcome::Written, "not read"),
        (Outcome::Foreign, "sectors 1 to 3 hold something else: left alone (probe-rs erase)"),
        (Outcome::Unreadable, "cannot be read"),
        (Outcome::NotWritten, "cannot be written"),
        (Outcome::Lost, "gone after the reset"),
        (Outcome::OthersChanged, "the firmware's records have changed"),
    ];
    let outcome = kept::get(Word::Flash);
    let seen = SEEN.iter().find(|(of, _)| *of as u32 == outcome).map_or("no result", |(_, text)| text);
    let good = outcome == Outcome::Kept as u32;
    table.row("flash store", format_args!("a record outlives a reset"), format_args!("{seen}"), Verdict::of(good));
}
