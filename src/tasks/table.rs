//! A table for other constants, made in the background: in the thread-mode executor, so everything but the keeping of
//! settings interrupts it.

use crate::scene;
use crate::shared;
use crate::store::{self, SharedStore, Store, Unreadable};
use core::sync::atomic::Ordering;
use embassy_futures::yield_now;
use embassy_time::Instant;
use rig_link::messages::{Constants, EventKind, Message, TableRefusal};
use static_cell::StaticCell;
use tsa_model::{Geometry, Material, Parameters, StringParameters};
use tsa_table::Table;
use tsa_table::rebuild::{Rebuild, RebuildError, Rebuilt};

/// Tables that one run of the firmware can make: the control task keeps looking into the one it was given.
const ROOM: usize = 4;

/// From flash, if a good one is there.
pub async fn kept(store: &mut Store) -> Option<&'static Table<'static>> {
    let rebuilt = match store.fetch(store::TABLE).await {
        Ok(record) => Rebuilt::read(&scene::TABLE, scene::SPARE_SHAPE, record?),
        Err(Unreadable) => None,
    };
    if rebuilt.is_none() {
        defmt::warn!("the table in flash is not for this firmware, or damaged: the built-in one is used");
        shared::SETTINGS_CORRUPT.store(true, Ordering::Relaxed);
    }
    place(rebuilt?)
}

/// A place in memory for good.
fn place(rebuilt: Rebuilt) -> Option<&'static Table<'static>> {
    static NUMBERS: [StaticCell<Rebuilt>; ROOM] = [const { StaticCell::new() }; ROOM];
    static TABLES: [StaticCell<Table<'static>>; ROOM] = [const { StaticCell::new() }; ROOM];
    let mut rebuilt = Some(rebuilt);
    for (numbers, table) in NUMBERS.iter().zip(&TABLES) {
        if let Some(cell) = numbers.try_uninit() {
            let numbers: &'static Rebuilt = cell.write(rebuilt.take()?);
            return table.try_init(numbers.table()).map(|t| &*t);
        }
    }
    None
}

#[embassy_executor::task]
pub async fn run(store: &'static SharedStore) -> ! {
    loop {
        let constants = shared::REBUILD.wait().await;
        let began = Instant::now();
        let kind = match make(&constants).await {
            Err(refused) => refused,
            Ok((rebuilt, states)) => {
                let took_us = began.elapsed().as_micros();
                let kept = keep(store, &rebuilt).await;
                let m = rebuilt.metadata;
                match place(rebuilt) {
                    None => refused(TableRefusal::NoRoom, 0.0, 0.0),
                    Some(table) => {
                        shared::TABLE.set(table);
                        shared::NEW_TABLE.signal(table);
                        EventKind::TableRebuilt {
                            contraction_error_m: m.contraction_error_m,
                            tr_relative_error: m.tr_relative_error,
                            states,
                            took_us,
                            kept,
                        }
                    }
                }
            }
        };
        defmt::info!("{}", kind);
        shared::OUTBOX.send(Message::Event { t_us: Instant::now().as_micros(), kind }).await;
    }
}

const fn refused(reason: TableRefusal, load_n_or_error_m: f32, twist_rad_or_error: f32) -> EventKind {
    EventKind::TableRefused { reason, load_n_or_error_m, twist_rad_or_error }
}

fn parameters(c: &Constants) -> Option<Parameters> {
    let [string_length_m, rod_span_m, clamp_width_m, rod_radius_m] = c.geometry_m;
    Parameters::new(
        &Geometry { string_length_m, rod_span_m, clamp_width_m, rod_radius_m },
        &StringParameters::from_constants(c.string, c.twist_exponent),
        &Material { stress_coefficients_pa: c.stress_coefficients_pa },
    )
    .ok()
}

async fn make(constants: &Constants) -> Result<(Rebuilt, u32), EventKind> {
    let Some(parameters) = parameters(constants) else { return Err(refused(TableRefusal::Constants, 0.0, 0.0)) };
    let begun = Rebuild::new(&scene::TABLE, &parameters, constants.scene_hash, scene::ACCURACY, scene::SPARE_SHAPE);
    let mut rebuild = begun.map_err(why)?;
    loop {
        if let Some(done) = rebuild.step().map_err(why)? {
            let done = done.clone();
            return Ok((done, rebuild.states()));
        }
        yield_now().await;
    }
}

fn why(error: RebuildError) -> EventKind {
    match error {
        RebuildError::Form => refused(TableRefusal::Form, 0.0, 0.0),
        RebuildError::Model { load_n, twist_rad, .. } => refused(TableRefusal::Model, load_n, twist_rad),
        RebuildError::Fit => refused(TableRefusal::Fit, 0.0, 0.0),
        RebuildError::Accuracy { contraction_m, tr_relative } => {
            refused(TableRefusal::Accuracy, contraction_m, tr_relative)
        }
        RebuildError::NotMonotone => refused(TableRefusal::NotMonotone, 0.0, 0.0),
    }
}

/// Into flash, when the rig stands.
async fn keep(store: &SharedStore, rebuilt: &Rebuilt) -> bool {
    let mut record = [0; store::RECORD];
    let Some(record) = rebuilt.write(&mut record).and_then(|length| record.get(..length)) else { return false };
    store.lock().await.keep(&[(store::TABLE, record)]).await
}
