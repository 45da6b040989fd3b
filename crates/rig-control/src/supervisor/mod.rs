//! The rig as one state machine. [`Controller::step`] is one control tick; time comes in with the readings.
//!
//! ```text
//!          drive and LVDT ready          home                 done             move
//!   boot ───────────────────────> unhomed ───> homing ─────────────> ready ───────────> moving
//!     ^                              ^           │ stop, failed        ^                 │   │ arrived,
//!     │                              └───────────┘                     │ home       move │   v stop
//!     │ clear (drive restarts)                                         └─────────── holding <┘
//!     ├────────── fault  <── anything wrong, from every state; latched
//!     └────────── estop  <── emergency stop open, from every state; latched
//! ```
//! The first motion after each start of the drive, a homing or a jog, begins with the check of the directions
//! ([`crate::direction`]), after which the drive starts again in closed loop. Until then the motor is only braked.
//!
//! A jog starts from unhomed, ready or holding. It ends in ready if the rig is homed, else in unhomed. A `clear` that does
//! not restart the drive leads from fault to ready or unhomed in the same way.
//!
//! The rooms, in the order in which a tick passes through them:
//! - `sensing`: inputs to readings in SI units; where the drive counts from.
//! - `tracking`: what is known of load and position since homing, with the stated errors, and what this tick's readings add.
//! - `guard`: what is wrong. [`fault_policy`] is the table of what is done about it.
//! - `requests`: what the host asks, and the settings.
//! - `modes`: what each mode does in a tick. `load_control` is what moves and holds the load: planner, position loop, set-point
//!   of the shaft, adaptation; a move, its further approaches where the load sticks, and the hold after it.
//! - `outputs`: the command to the drive, and the telemetry.
//!
//! **An LVDT sample**: `LvdtBlock` in [`Inputs`] → [`crate::sensors::Lvdt::read`] → `Readings` → `LoadTracking::observe`
//! (position, load, TR) → `Guard::check` → `LoadControl` (error of the position) → set-point of the shaft → drive command.
//!
//! **A `move`**: `Controller::answer` → `Controller::start_move` → [`crate::move_check`] → `Mode::Moving` → `Controller::control_load` each
//! tick: planner, position loop, friction compensation, set-point of the shaft → `Mode::Holding`.
//!
//! **A stream** of set-points (`track`): `Controller::track` for each of them → `Mode::Streaming` → `Stream::step` each tick. It
//! ends in a `Move` that brakes, and so in a hold.
//!
//! **A fault**: `Guard::check` → `Controller::raise` (latches it; the set-point stops) → `Mode::Fault` → `Controller::drive_command` by
//! the fault's response → `Controller::clear`.
//!
//! Without torque the strings can untwist and drop the load, so no fault takes the torque away from a drive that holds.
//! Nothing clears itself. After a fault that loses the position, an emergency stop or a reset, nothing moves without a
//! request, and the rig must be homed again. A [`Limit`] only clips: it is reported beside the state, and disappears when
//! it no longer holds anything back.

pub mod fault_policy;
mod guard;
mod load_control;
mod modes;
mod outputs;
mod requests;
mod sensing;
mod stream;
mod tracking;

use crate::RigConstants;
use crate::homing::Homed;
use crate::ramp::Ramp;
use crate::sensors::{DriveReading, LvdtBlock, SupplyReading};
use guard::Guard;
use modes::{Boot, Mode};
use rig_link::messages::{
    Accepted, EventKind, Fault, Faults, Limit, Refusal, Request, SettingValues, State, Telemetry,
};
use rmds405::DriveCommand;
use sensing::Sensing;
use tracking::LoadTracking;
use tsa_table::Table;
use tsa_table::record::StoredTable;

/// Inputs of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Inputs {
    /// Time since boot (µs).
    pub now_us: u64,
    /// Counts of the rig's own encoder since boot.
    pub encoder_counts: i64,
    /// Newest LVDT block.
    pub lvdt: Option<LvdtBlock>,
    /// What the drive reports.
    pub drive: DriveReading,
    /// The drive has sent its stall frame since the last tick.
    pub drive_stalled: bool,
    /// The CAN controller has left the bus since the last tick.
    pub bus_off: bool,
    /// Supply of the drive; `None` where it is not wired.
    pub supply: Option<SupplyReading>,
    /// The limit switch at the upper end of the rail (least gap) is open, or its wire broken.
    pub upper_limit_open: bool,
    /// The same at the lower end (maximum gap).
    pub lower_limit_open: bool,
    /// The emergency-stop contact is open (or its wire broken).
    pub estop_open: bool,
    /// When the host was last heard (µs since boot).
    pub host_heard_us: Option<u64>,
    /// What the host asks.
    pub request: Option<Request>,
}

/// What ended or went wrong in a tick.
pub type Events = heapless::Vec<EventKind, 8>;

/// Decisions of one tick.
#[derive(Clone, Debug)]
pub struct Outputs {
    /// For the drive.
    pub drive: DriveCommand,
    /// Answer to the request, if there was one that the control code answers.
    pub reply: Option<Result<Accepted, Refusal>>,
    /// What ended or went wrong.
    pub events: Events,
    /// The settings have been set: they are to be saved.
    pub save_settings: bool,
    /// For the host.
    pub telemetry: Telemetry,
}

/// The rig.
#[derive(Clone)]
pub struct Controller {
    table: StoredTable,
    /// Constants of the scene.
    scene: RigConstants,
    settings: SettingValues,
    /// Constants of the scene, corrected by the settings.
    constants: RigConstants,
    mode: Mode,
    sensing: Sensing,
    guard: Guard,
    /// What is known of the load; `None` while the rig is not homed.
    tracking: Option<LoadTracking>,
    /// Heaviest load (N) by the setting and since power-up, which the rods remember.
    heaviest_n: f32,
    /// When a stop ended a stream, or when its last set-point came since then or in a fault (µs since boot).
    stream_ended_us: Option<u64>,
    /// Set-point of the shaft (rad as the own encoder counts) and its speed (rad/s).
    shaft: Ramp,
    /// How fast the set-point has turned lately (rad/s): a shaft that is behind it may still have to.
    speed_lately: f32,
    /// Whether the drive follows a position. It does once the directions are proven since its start. Until then it applies a
    /// voltage, 0 except in the check of the directions, so that a motor or an encoder of the wrong sign cannot run away; the
    /// shorted motor brakes the load and does not hold it. Only a restart of the drive changes this.
    closed_loop: bool,
    /// The next command restarts the drive.
    restart_drive: bool,
    /// What held the load or the strings back in this tick.
    limit: Option<Limit>,
}

/// Motor speed (rpm) below which the shaft counts as standing: three quanta of the drive's speed measurement.
const STANDING_RPM: u16 = 45;

/// Longest silence of the host during a motion (µs).
pub const HOST_SILENT_US: u64 = 400_000;
/// Maximum jog speed (rad/s).
pub const JOG_SPEED_MAX: f32 = 4.0;

impl Controller {
    /// As after power-up: nothing is known and nothing moves. `reset` is the fault that the last reset amounts to, if the
    /// board was not started by power or by hand.
    pub fn new(table: &Table<'_>, constants: RigConstants, reset: Option<Fault>) -> Self {
        let table = StoredTable::copy_of(table);
        let corrupt = (!table.table().is_intact()).then_some(Fault::TableCorrupt);
        let mut guard = Guard::default();
        reset.into_iter().chain(corrupt).for_each(|fault| guard.latched.insert(fault));
        Self {
            table,
            scene: constants,
            settings: crate::settings::defaults(&constants),
            constants,
            mode: if guard.latched.gravest.is_none() { Mode::Boot(Boot::default()) } else { Mode::Fault },
            sensing: Sensing::default(),
            guard,
            tracking: None,
            heaviest_n: 0.0,
            stream_ended_us: None,
            shaft: Ramp::at(0.0),
            speed_lately: 0.0,
            closed_loop: false,
            // The drive may still follow the last command of the run before.
            restart_drive: true,
            limit: None,
        }
    }

    /// What the rig is doing.
    pub fn state(&self) -> State {
        self.mode.state(self.tracking.is_some())
    }

    /// The most severe of the latched faults.
    pub fn fault(&self) -> Option<Fault> {
        self.guard.latched.gravest
    }

    /// All latched faults.
    pub fn faults(&self) -> Faults {
        self.guard.latched.all
    }

    /// The last homing, as long as it holds.
    pub fn homed(&self) -> Option<&Homed> {
        self.tracking.as_ref().map(|tracking| &tracking.homed)
    }

    /// Minimum and maximum load (N) that the table covers.
    pub fn load_range_n(&self) -> [f32; 2] {
        let m = self.table.metadata();
        [m.load_min_n, m.load_max_n]
    }

    /// Control ticks that came late since boot.
    pub fn late_ticks(&self) -> u32 {
        self.guard.timing.late_ticks
    }

    /// One control tick. Call every [`crate::TICK_US`].
    pub fn step(&mut self, inputs: &Inputs) -> Outputs {
        let mut events = Events::new();
        self.sensing.read(inputs, &self.constants);
        if let Some(tracking) = &mut self.tracking {
            tracking.observe(&self.table.table(), &self.sensing.readings);
            self.heaviest_n = self.heaviest_n.max(tracking.observer.memory.heaviest_n);
        }
        self.watch_estop(inputs.estop_open, &mut events);
        let raised = self.watch(inputs, &mut events);
        let reply = inputs.request.as_ref().and_then(|request| match request {
            // Nobody can have read of a fault that was raised in this tick.
            Request::Clear if raised => Some(Err(Refusal::CauseRemains { fault: self.fault()? })),
            request => self.answer(request, inputs, &mut events),
        });
        self.limit = self.step_mode(inputs, &mut events);
        if !(self.shaft.position.is_finite() && self.shaft.speed.is_finite()) {
            self.raise(Faults::NONE.with(Fault::NotFinite), &mut events);
        }
        let sets = matches!(inputs.request, Some(Request::SetSetting { .. } | Request::SetSettings(_)));
        let save_settings = sets && matches!(reply, Some(Ok(_)));
        Outputs { drive: self.drive_command(inputs), reply, events, save_settings, telemetry: self.telemetry(inputs) }
    }

    fn watch_estop(&mut self, open: bool, events: &mut Events) {
        let was_open = match self.mode {
            Mode::EStop { open, .. } => open,
            _ if open => false,
            _ => return,
        };
        if open != was_open {
            let _ = events.push(if open { EventKind::EStopOpened } else { EventKind::EStopClosed });
        }
        self.mode = Mode::EStop { open, closing: was_open && !open };
        self.tracking = None;
    }

    /// Checks everything; whether a new fault was raised.
    fn watch(&mut self, inputs: &Inputs, events: &mut Events) -> bool {
        let mut guard = self.guard;
        let found = guard.check(self, inputs);
        self.guard = guard;
        self.raise(found, events)
    }

    /// Latches what is new among the faults that were found; the strings stop where they are. Whether anything was new.
    fn raise(&mut self, found: Faults, events: &mut Events) -> bool {
        let own_was_wrong = self.guard.latched.own_encoder_is_wrong();
        if matches!(self.mode, Mode::EStop { .. }) || !self.guard.latch(found, events) {
            return false;
        }
        // A shaft that is held already stays where the first fault stopped it, if the encoder that said where that is was right.
        let own_is_wrong = self.guard.latched.own_encoder_is_wrong();
        if !matches!(self.mode, Mode::Fault) || own_is_wrong && !own_was_wrong {
            self.mode = Mode::Fault;
            let by_drive = self.guard.drive.last_drive_qc.filter(|_| own_is_wrong);
            let by_drive_rad =
                by_drive.and_then(|counts| self.sensing.drive_zero.shaft_rad(counts.into(), &self.constants));
            self.shaft = Ramp::at(by_drive_rad.unwrap_or(self.sensing.readings.shaft_rad));
        }
        true
    }

    /// Homed, at rest at the half-turn pre-twist: the end of a homing, and the start of a replay.
    pub fn resume(&mut self, homed: Homed) {
        self.shaft = Ramp::at(homed.zero_rad + core::f32::consts::PI);
        self.closed_loop = true;
        self.tracking = Some(LoadTracking::new(homed, &self.table.table(), &self.settings));
        self.mode = Mode::Idle;
    }

    /// Takes another table, for which the rig must be homed again. Returns false while anything moves: ask again later.
    pub fn use_table(&mut self, table: &StoredTable) -> bool {
        if matches!(self.state(), State::Moving | State::Homing) {
            return false;
        }
        self.table.clone_from(table);
        self.forget_position();
        true
    }

    /// The position is not known any more, while nothing moves.
    fn forget_position(&mut self) {
        self.tracking = None;
        if matches!(self.mode, Mode::Holding(_)) {
            self.mode = Mode::Idle;
        }
    }

    /// Whether nothing moves, homes or starts, so that the core may stall for a while.
    pub fn stands(&self) -> bool {
        !matches!(self.state(), State::Moving | State::Homing | State::Boot)
    }

    /// Announces that no tick will come for a while: the next one is not late.
    pub fn pause(&mut self) {
        self.guard.timing.pause();
    }
}

/// Counts how many ticks in a row a condition holds; true when it has lasted `limit` ticks.
fn lasts(counter: &mut u16, holds: bool, limit: u16) -> bool {
    *counter = if holds { counter.saturating_add(1) } else { 0 };
    *counter >= limit
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Inputs of a healthy rig that is switched on, at a time (µs).
    pub(super) fn inputs(now_us: u64) -> Inputs {
        Inputs {
            now_us,
            encoder_counts: 0,
            lvdt: None,
            drive: DriveReading::Starting,
            drive_stalled: false,
            bus_off: false,
            supply: None,
            upper_limit_open: false,
            lower_limit_open: false,
            estop_open: false,
            host_heard_us: Some(now_us),
            request: None,
        }
    }

    #[test]
    fn a_condition_lasts_when_it_holds_in_that_many_ticks_in_a_row() {
        let mut counter = 0;
        let held = [true, true, false, true, true, true].map(|holds| lasts(&mut counter, holds, 3));
        assert_eq!(held, [false, false, false, false, false, true]);
    }
}
