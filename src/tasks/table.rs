//! Builds a table for other constants. It runs in the thread-mode executor, so every task but that of the settings
//! interrupts it.

use crate::flash_store::{self, RECORD_MAX, SharedStore, Store, Unreadable};
use crate::scene;
use crate::shared;
use core::sync::atomic::{AtomicUsize, Ordering};
use embassy_futures::yield_now;
use embassy_time::Instant;
use rig_link::messages::{Constants, EventKind, Message, TableRefusal};
use static_cell::StaticCell;
use tsa_model::{Correction, Geometry, Material, Parameters, StringParameters};
use tsa_table::rebuild::{Rebuild, RebuildError, Rebuilt};
use tsa_table::{Table, Uncertainty};

/// Number of tables that one run of the firmware can use. No table is freed, because the control task may still use it.
const TABLES_MAX: usize = 4;

/// Loads the table from flash, if a valid one is there.
pub async fn load(store: &mut Store) -> Option<&'static Table<'static>> {
    let rebuilt = match store.fetch(flash_store::TABLE).await {
        Ok(record) => Rebuilt::read(&scene::TABLE, scene::SPARE_SHAPES, record?),
        Err(Unreadable) => None,
    };
    if rebuilt.is_none() {
        defmt::warn!("the table in flash is damaged or not for this firmware: the built-in table is used");
        shared::SETTINGS_CORRUPT.store(true, Ordering::Relaxed);
    }
    make_static(rebuilt?)
}

/// How many tables are in static memory.
static TABLES: AtomicUsize = AtomicUsize::new(0);

/// Moves a table into static memory; `None` if [`TABLES_MAX`] tables are there already.
fn make_static(rebuilt: Rebuilt) -> Option<&'static Table<'static>> {
    static CELLS: [(StaticCell<Rebuilt>, StaticCell<Table<'static>>); TABLES_MAX] =
        [const { (StaticCell::new(), StaticCell::new()) }; TABLES_MAX];
    let (numbers, table) = CELLS.get(TABLES.fetch_add(1, Ordering::Relaxed))?;
    let numbers: &'static Rebuilt = numbers.try_init(rebuilt)?;
    table.try_init(numbers.table()).map(|t| &*t)
}

#[embassy_executor::task]
pub async fn run(store: &'static SharedStore) -> ! {
    loop {
        let constants = shared::REBUILD.wait().await;
        let began = Instant::now();
        // What has no room is not made, and not saved for the next start either.
        let room = TABLES.load(Ordering::Relaxed) < TABLES_MAX;
        let made = if room { build(&constants).await } else { Err(refused(TableRefusal::NoRoom, 0.0, 0.0)) };
        let kind = match made {
            Err(refused) => refused,
            Ok((rebuilt, states)) => {
                let took_us = Instant::now().saturating_duration_since(began).as_micros();
                let kept = save(store, &rebuilt).await;
                let m = rebuilt.metadata;
                match make_static(rebuilt) {
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

/// The constants if they are possible ones.
fn parameters(c: &Constants) -> Option<Parameters> {
    let [string_length_m, rod_span_m, clamp_width_m, rod_radius_m] = c.geometry_m;
    let law = Parameters::new(
        &Geometry { string_length_m, rod_span_m, clamp_width_m, rod_radius_m },
        &StringParameters::from_constants(c.string, c.twist_exponent),
        &Material { stress_coefficients_pa: c.stress_coefficients_pa },
    )
    .ok()?;
    let correction = c.correction.map(|c| Correction {
        load_n: c.load_n.map(f64::from),
        turns: c.turns.map(f64::from),
        coefficients_m: c.coefficients_m.map(|row| row.map(f64::from)),
    });
    correction.as_ref().map_or(Ok(()), Correction::validate).ok()?;
    Some(Parameters { correction, ..law })
}

async fn build(constants: &Constants) -> Result<(Rebuilt, u32), EventKind> {
    let Some(parameters) = parameters(constants) else { return Err(refused(TableRefusal::Constants, 0.0, 0.0)) };
    let Some(uncertainty) = Uncertainty::from_numbers(constants.uncertainty) else {
        return Err(refused(TableRefusal::Constants, 0.0, 0.0));
    };
    let (hash, accuracy) = (constants.scene_hash, scene::ACCURACY);
    let begun = Rebuild::new(&scene::TABLE, &parameters, hash, uncertainty, accuracy, scene::SPARE_SHAPES);
    let mut rebuild = begun.map_err(refusal)?;
    loop {
        if let Some(done) = rebuild.step().map_err(refusal)? {
            let done = done.clone();
            return Ok((done, rebuild.states()));
        }
        yield_now().await;
    }
}

fn refusal(error: RebuildError) -> EventKind {
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

/// Saves the table to flash when the rig stands, and returns whether that succeeded.
async fn save(store: &SharedStore, rebuilt: &Rebuilt) -> bool {
    let mut record = [0; RECORD_MAX];
    let Some(record) = rebuilt.write(&mut record).and_then(|length| record.get(..length)) else { return false };
    store.lock().await.write_at_rest(&[(flash_store::TABLE, record)]).await
}
