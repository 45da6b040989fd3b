//! Settings in flash. The control task takes them up; this one keeps them, and tells the host when they are there.

use crate::scene::RIG;
use crate::shared;
use crate::store::{self, SharedStore, Store, Unreadable};
use core::sync::atomic::Ordering;
use rig_control::settings::{self, Loaded, RECORD, RECORD_MAX};
use rig_link::messages::{Kept, Message, SettingValues};

/// A record as it stands in flash; one that is longer than any of ours counts as none.
async fn copy<'b>(store: &mut Store, key: u8, to: &'b mut [u8]) -> Result<Option<&'b [u8]>, Unreadable> {
    let Some(record) = store.fetch(key).await? else { return Ok(None) };
    let place = to.get_mut(..record.len());
    Ok(place.map(|place| {
        place.copy_from_slice(record);
        &*place
    }))
}

/// Both of a generation: the witness is written second.
fn records(values: &SettingValues, generation: u32) -> ([u8; RECORD], [u8; 4]) {
    (settings::write(values, &RIG, generation), settings::write_witness(generation))
}

/// From flash, to be used from the first tick on; the generation of the record.
pub async fn kept(store: &mut Store) -> u32 {
    let (mut record, mut witness) = ([0; RECORD_MAX], [0; 4]);
    let found = match copy(store, store::SETTINGS, &mut record).await {
        Ok(record) => copy(store, store::SETTINGS_WITNESS, &mut witness).await.map(|witness| (record, witness)),
        Err(unreadable) => Err(unreadable),
    };
    let mut loaded = match found {
        Ok((record, witness)) => settings::read(record, witness, &RIG),
        Err(Unreadable) => Loaded { kept: Kept::Damaged, ..settings::read(None, None, &RIG) },
    };
    // There may have been a calibration before whatever is there now.
    if loaded.kept == Kept::Nothing && store.was_foreign() {
        loaded.kept = Kept::Damaged;
    }
    if loaded.kept == Kept::Damaged {
        defmt::warn!("the settings in flash are damaged, or for another rig: defaults are used");
        shared::SETTINGS_CORRUPT.store(true, Ordering::Relaxed);
    }
    if loaded.witness_behind {
        let (record, witness) = records(&loaded.values, loaded.generation);
        store.write(&[(store::SETTINGS, &record), (store::SETTINGS_WITNESS, &witness)]).await;
    }
    shared::SETTINGS.set((loaded.values, 0));
    shared::FLASHED.set((loaded.kept, 0));
    loaded.generation
}

#[embassy_executor::task]
pub async fn run(store: &'static SharedStore, mut generation: u32) -> ! {
    loop {
        let (values, count) = shared::KEEP.wait().await;
        generation = generation.wrapping_add(1);
        let (record, witness) = records(&values, generation);
        let kept = store.lock().await.keep(&[(store::SETTINGS, &record), (store::SETTINGS_WITNESS, &witness)]).await;
        shared::FLASHED.set((if kept { Kept::These } else { Kept::Nothing }, count));
        shared::OUTBOX.send(Message::Settings(shared::settings_report())).await;
    }
}
