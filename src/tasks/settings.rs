//! The settings in flash. The control task applies new settings; this task saves them and reports to the host when
//! flash holds them.

use crate::flash_store::{self, SharedStore, Store, Unreadable};
use crate::scene::RIG;
use crate::shared;
use core::sync::atomic::Ordering;
use rig_control::settings::{self, Loaded, RECORD_MAX};
use rig_link::messages::{Dropped, Kept, Message};

/// Copies a record from flash. A record that is longer than `to` is none of the settings' and counts as missing.
async fn copy<'b>(store: &mut Store, key: u8, to: &'b mut [u8]) -> Result<Option<&'b [u8]>, Unreadable> {
    let Some(record) = store.fetch(key).await? else { return Ok(None) };
    Ok(to.get_mut(..record.len()).map(|to| {
        to.copy_from_slice(record);
        &*to
    }))
}

/// Loads the settings from flash, to be used from the first tick on, and returns the generation of their record.
pub async fn load(store: &mut Store) -> u32 {
    let (mut record, mut witness) = ([0; RECORD_MAX], [0; 4]);
    let found = match copy(store, flash_store::SETTINGS, &mut record).await {
        Ok(record) => copy(store, flash_store::SETTINGS_WITNESS, &mut witness).await.map(|witness| (record, witness)),
        Err(unreadable) => Err(unreadable),
    };
    let mut loaded = match &found {
        Ok((record, witness)) => settings::read(*record, *witness, &RIG),
        Err(Unreadable) => Loaded { kept: Kept::Damaged, ..settings::read(None, None, &RIG) },
    };
    // A calibration may have been there before another program's data replaced it.
    if loaded.kept == Kept::Nothing && store.was_foreign() {
        loaded.kept = Kept::Damaged;
    }
    if loaded.kept == Kept::Damaged {
        defmt::warn!("the settings in flash are damaged or for another rig: the defaults are used");
    }
    for name in loaded.dropped.names() {
        defmt::warn!("setting {=str} in flash is for other constants of the rig: its default is used", name);
    }
    if matches!(loaded.kept, Kept::Damaged | Kept::Partly) {
        shared::SETTINGS_CORRUPT.store(true, Ordering::Relaxed);
    }
    // The record as it was found: settings that are not used must be reported again at the next start.
    if let (true, Ok((Some(record), _))) = (loaded.witness_behind, found) {
        let witness = settings::write_witness(loaded.generation);
        store.write(&[(flash_store::SETTINGS, record), (flash_store::SETTINGS_WITNESS, &witness)]).await;
    }
    shared::SETTINGS.set((loaded.values, 0));
    shared::SAVED_SETTINGS.set((loaded.kept, loaded.dropped, 0));
    loaded.generation
}

#[embassy_executor::task]
pub async fn run(store: &'static SharedStore, mut generation: u32) -> ! {
    loop {
        let (values, count) = shared::SETTINGS_TO_SAVE.wait().await;
        generation = generation.wrapping_add(1);
        let (record, witness) = (settings::write(&values, &RIG, generation), settings::write_witness(generation));
        // The witness is written second.
        let saved = store
            .lock()
            .await
            .write_at_rest(&[(flash_store::SETTINGS, &record), (flash_store::SETTINGS_WITNESS, &witness)])
            .await;
        shared::SAVED_SETTINGS.set((if saved { Kept::These } else { Kept::Nothing }, Dropped::NONE, count));
        shared::OUTBOX.send(Message::Settings(shared::settings_report())).await;
    }
}
