//! What the tasks tell each other. Each value has one writer.

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex as Raw;
use embassy_sync::channel::Channel;
use embassy_sync::signal::Signal;
use rig_control::{DriveCommand, DriveReading, LvdtBlock, SupplyReading};
use rig_link::messages::{Constants, Kept, Message, Request, Sensors, SettingValues, SettingsReport, Telemetry};
use tsa_table::Table;

/// A value that is read whole and written whole.
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
/// The settings in use, and how often they were set since the start.
pub static SETTINGS: Latest<(SettingValues, u32)> =
    Latest::new((SettingValues([0.0; rig_link::messages::Setting::ALL.len()]), 0));
/// Settings to be kept, with that count.
pub static KEEP: Signal<Raw, (SettingValues, u32)> = Signal::new();
/// What flash holds, and the count of that.
pub static FLASHED: Latest<(Kept, u32)> = Latest::new((Kept::Nothing, 0));
/// What the sensors showed in the newest tick.
pub static SENSORS: Latest<Option<Sensors>> = Latest::new(None);
/// What is kept in flash could not be used.
pub static SETTINGS_CORRUPT: AtomicBool = AtomicBool::new(false);
/// Newest command for the drive; an older one that was not sent yet is out of date.
pub static DRIVE_COMMAND: Signal<Raw, DriveCommand> = Signal::new();
/// When the host was last heard (µs since boot).
pub static HOST_HEARD_US: Latest<Option<u64>> = Latest::new(None);
/// Requests for the control task, with their sequence numbers.
pub static REQUESTS: Channel<Raw, (u16, Request), 8> = Channel::new();
/// Replies and events for the host; [`post`] fills it.
pub static OUTBOX: Channel<Raw, Message, 16> = Channel::new();
/// Messages that could not be sent: the link was full.
pub static UNSENT: AtomicU32 = AtomicU32::new(0);
/// Newest telemetry for the host.
pub static TELEMETRY: Signal<Raw, Telemetry> = Signal::new();
/// The table in use.
pub static TABLE: Latest<&'static Table<'static>> = Latest::new(&crate::scene::TABLE);
/// A table to be made.
pub static REBUILD: Signal<Raw, Constants> = Signal::new();
/// A table for the control task.
pub static NEW_TABLE: Signal<Raw, &'static Table<'static>> = Signal::new();
/// The core is about to stall for flash; the control task answers with [`PAUSED`] when nothing moves.
pub static PAUSE_WANTED: AtomicBool = AtomicBool::new(false);
/// The control task decides nothing until [`PAUSE_WANTED`] is taken back; the drive holds.
pub static PAUSED: AtomicBool = AtomicBool::new(false);
/// Damaged frames from the host.
pub static LINK_ERRORS: AtomicU32 = AtomicU32::new(0);
/// CAN frames, or bytes on the serial line, that are not the drive's.
pub static FOREIGN_FRAMES: AtomicU32 = AtomicU32::new(0);

/// Puts a reply or an event out for the host. A full outbox means that it has not read for a while; it will ask again.
pub fn post(message: Message) {
    if OUTBOX.try_send(message).is_err() {
        UNSENT.fetch_add(1, Ordering::Relaxed);
    }
}

/// The settings, for the host.
pub fn settings_report() -> SettingsReport {
    let (values, count) = SETTINGS.get();
    let (kept, flashed) = FLASHED.get();
    let kept = if flashed == count { kept } else { Kept::Others };
    SettingsReport { values, defaults: rig_control::settings::defaults(&crate::scene::RIG), kept }
}

/// Puts the newest telemetry out for the host; what has not gone out by now never will.
pub fn show(telemetry: Telemetry) {
    if TELEMETRY.signaled() {
        UNSENT.fetch_add(1, Ordering::Relaxed);
    }
    TELEMETRY.signal(telemetry);
}

/// Tasks that the watchdog wants to see.
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

static SEEN: AtomicU32 = AtomicU32::new(0);

/// A task says that it lives.
pub fn alive(task: Task) {
    SEEN.fetch_or(task as u32, Ordering::Relaxed);
}

/// Which tasks have said so since the last call.
pub fn take_seen() -> u32 {
    SEEN.swap(0, Ordering::Relaxed)
}
