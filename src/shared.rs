//! The values that the tasks exchange.
//!
//! Each has one task that writes it; `main` writes [`TABLE`], [`SETTINGS`], [`SAVED_SETTINGS`] and [`SETTINGS_CORRUPT`]
//! before the tasks start. The exceptions:
//! - [`DRIVE_COMMAND`] and [`NEW_TABLE`] are also written by their reader, which puts back what it cannot use yet. It
//!   cannot overwrite a newer value: it does not await between taking and putting back, and the writer has no higher
//!   priority.
//! - [`PAUSE_WANTED`] is written by whoever holds the lock of the flash store.
//! - [`DRIVE_STALLED`] and [`BUS_OFF`] are set by the drive task and cleared by the control task, in one atomic swap.
//! - [`UNSENT`] is an atomic counter, and [`OUTBOX`] a queue: any task may add to them.

use crate::scene::RIG;
use core::cell::Cell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex as Raw;
use embassy_sync::channel::Channel;
use embassy_sync::signal::Signal;
use rig_control::{DriveCommand, DriveReading, LvdtBlock, SupplyReading, settings};
use rig_link::messages::{
    Dropped, Kept, Message, Request, Sensors, SettingValues, SettingsReport, TablePart, Telemetry,
};
use tsa_table::record::StoredTable;
use tsa_table::{Metadata, Table};

/// A value that is read and written as a whole.
pub struct Latest<T: Copy>(Mutex<Raw, Cell<T>>);

impl<T: Copy> Latest<T> {
    const fn new(value: T) -> Self {
        Self(Mutex::new(Cell::new(value)))
    }

    pub fn get(&self) -> T {
        self.0.lock(Cell::get)
    }

    pub fn set(&self, value: T) {
        self.0.lock(|cell| cell.set(value));
    }
}

/// Newest block of LVDT samples.
pub static LVDT: Latest<Option<LvdtBlock>> = Latest::new(None);
/// Newest report of the drive.
pub static DRIVE: Latest<DriveReading> = Latest::new(DriveReading::Starting);
/// The drive has sent a stall frame.
pub static DRIVE_STALLED: AtomicBool = AtomicBool::new(false);
/// The CAN controller has left the bus.
pub static BUS_OFF: AtomicBool = AtomicBool::new(false);
/// Newest report of the drive's supply.
pub static SUPPLY: Latest<Option<SupplyReading>> = Latest::new(None);
/// The settings in use, and how often they were set since the board started.
pub static SETTINGS: Latest<(SettingValues, u32)> = Latest::new((SettingValues::ZERO, 0));
/// Settings to be saved to flash, with that count.
pub static SETTINGS_TO_SAVE: Signal<Raw, (SettingValues, u32)> = Signal::new();
/// What flash holds of the settings, which of them are not used, and the count of [`SETTINGS`] to which that applies.
pub static SAVED_SETTINGS: Latest<(Kept, Dropped, u32)> = Latest::new((Kept::Nothing, Dropped::NONE, 0));
/// The sensors' readings of the newest tick.
pub static SENSORS: Latest<Option<Sensors>> = Latest::new(None);
/// Flash holds settings, or a table, that cannot be used.
pub static SETTINGS_CORRUPT: AtomicBool = AtomicBool::new(false);
/// Newest command for the drive. It replaces an older one that was not sent yet.
pub static DRIVE_COMMAND: Signal<Raw, DriveCommand> = Signal::new();
/// Time of the host's newest valid frame (µs since boot).
pub static HOST_HEARD_US: Latest<Option<u64>> = Latest::new(None);
/// Requests for the control task, with their sequence numbers.
pub static REQUESTS: Channel<Raw, (u16, Request), 8> = Channel::new();
/// Replies and events for the host; [`post`] fills it.
pub static OUTBOX: Channel<Raw, Message, 16> = Channel::new();
/// Number of messages that were dropped because the link was full.
pub static UNSENT: AtomicU32 = AtomicU32::new(0);
/// Newest telemetry for the host.
pub static TELEMETRY: Signal<Raw, Telemetry> = Signal::new();
/// The table in use; `None` is the built-in one.
pub static TABLE: Latest<Option<TableInUse>> = Latest::new(None);
/// Parts of a table from the host. It waits for the reply to each.
pub static TABLE_PARTS: Channel<Raw, TablePart, 2> = Channel::new();
/// A table for the control task to use from now on.
pub static NEW_TABLE: Signal<Raw, StoredTable> = Signal::new();
/// Flash is to be written, which stalls the core; the control task sets [`PAUSED`] when nothing moves.
pub static PAUSE_WANTED: AtomicBool = AtomicBool::new(false);
/// The control task has paused until [`PAUSE_WANTED`] is cleared; the drive holds its position.
pub static PAUSED: AtomicBool = AtomicBool::new(false);
/// Number of damaged frames from the host.
pub static LINK_ERRORS: AtomicU32 = AtomicU32::new(0);
/// Number of CAN frames, or of bytes on the serial line, that are not the drive's.
pub static FOREIGN_FRAMES: AtomicU32 = AtomicU32::new(0);

/// What the host is told of a table.
#[derive(Clone, Copy)]
pub struct TableInUse {
    /// Range, accuracy and origin.
    pub metadata: Metadata,
    /// Size of its numbers (bytes).
    pub bytes: usize,
    /// Its checksum.
    pub crc: u32,
}

impl TableInUse {
    /// That of a table.
    pub fn of(table: &Table<'_>) -> Self {
        Self { metadata: table.metadata, bytes: table.series.bytes(), crc: table.crc }
    }
}

/// Queues a reply or an event for the host. If the queue is full, because the host has not read for a while, the
/// message is dropped and counted; the host asks again.
pub fn post(message: Message) {
    if OUTBOX.try_send(message).is_err() {
        UNSENT.fetch_add(1, Ordering::Relaxed);
    }
}

/// The report of the settings for the host.
pub fn settings_report() -> SettingsReport {
    let (values, count) = SETTINGS.get();
    let (kept, dropped, saved_count) = SAVED_SETTINGS.get();
    let (kept, dropped) = if saved_count == count { (kept, dropped) } else { (Kept::Others, Dropped::NONE) };
    let (defaults, constants) = (settings::defaults(&RIG), settings::corrected(&RIG));
    SettingsReport { values, defaults, constants, kept, dropped }
}

/// Replaces the telemetry that is sent to the host next. One that was not sent yet is dropped and counted.
pub fn show(telemetry: Telemetry) {
    if TELEMETRY.signaled() {
        UNSENT.fetch_add(1, Ordering::Relaxed);
    }
    TELEMETRY.signal(telemetry);
}

/// Tasks that the watchdog supervises.
#[derive(Clone, Copy)]
#[repr(u32)]
pub enum Task {
    Control = 1,
    Drive = 2,
    Lvdt = 4,
    Link = 8,
}

/// All of [`Task`].
pub const ALL_TASKS: u32 = 15;

static ALIVE: AtomicU32 = AtomicU32::new(0);

/// Reports that a task runs.
pub fn alive(task: Task) {
    ALIVE.fetch_or(task as u32, Ordering::Relaxed);
}

/// The tasks that have reported since the last call, as a sum of [`Task`].
pub fn take_alive() -> u32 {
    ALIVE.swap(0, Ordering::Relaxed)
}
