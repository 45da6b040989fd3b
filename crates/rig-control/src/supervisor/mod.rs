//! The rig as one state machine. [`Rig::step`] is one control tick; time comes in with the readings.
//!
//! ```text
//!          drive and LVDT heard          home                 done             move
//!   boot ───────────────────────> unhomed ───> homing ─────────────> ready ───────────> moving
//!     ^                              ^           │ stop, failed        ^                 │   │ arrived, stop,
//!     │                              └───────────┘                     │ home       move │   v hold
//!     │ clear (drive restarted)                                        └─────────── holding <┘
//!     ├────────── fault  <── anything wrong, from every state; latched
//!     └────────── estop  <── emergency stop open, from every state; latched
//! ```
//! What a fault does, and which one outranks which, stands in one table ([`fault_policy`]): torque-off would let the strings
//! untwist and drop the load. Nothing clears itself, and after a fault that loses the position, an emergency stop or a
//! reset nothing moves until told, and the rig is homed anew. A [`Limit`] only clips: it is reported beside the state, and gone when it holds nothing back any more.

mod checks;
mod configure;
mod drive_checks;
pub mod fault_policy;
mod lvdt_jump;
mod motion;
mod requests;
mod told;

use crate::adaptation::{Adaptation, Learned};
use crate::homing::{Homed, Homing, Progress, Seen};
use crate::mechanism::Mechanism;
use crate::observer::{Confidence, LoadObserver};
use crate::planner::{Planner, Ramp};
use crate::position_loop::PositionLoop;
use crate::sensors::{DriveReading, GAP_DELAY_S, Lvdt, LvdtBlock, LvdtReading, SupplyReading};
use crate::{RigConstants, TICK_S, TICK_US, angle_rad, seconds};
use checks::Checks;
use fault_policy::{ENCODER, Latched, POLICY};
use rig_link::messages::{
    Accepted, Counters, EventKind, Fault, Faults, HomingFailure, Limit, Refusal, Request, Setting, SettingValues,
    State, Telemetry,
};
use rmds405::DriveCommand;
use tsa_table::Table;

/// Everything a tick sees.
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
    /// The same at the lower end (greatest gap).
    pub lower_limit_open: bool,
    /// The emergency-stop contact is open (or its wire broken).
    pub estop_open: bool,
    /// When the host was last heard (µs since boot).
    pub host_heard_us: Option<u64>,
    /// What the host asks.
    pub request: Option<Request>,
    /// What was ignored and counted.
    pub counters: Counters,
}

/// What ended or went wrong in a tick.
pub type Events = heapless::Vec<EventKind, 8>;

/// Everything a tick decides.
#[derive(Clone, Debug)]
pub struct Outputs {
    /// For the drive.
    pub drive: DriveCommand,
    /// Answer to the request, if there was one that wants an answer.
    pub reply: Option<Result<Accepted, Refusal>>,
    /// What ended or went wrong.
    pub events: Events,
    /// For the host.
    pub telemetry: Telemetry,
    /// Gap that the LVDT shows (m), homed or not.
    pub gap_m: Option<f32>,
}

/// What is being done in [`State::Moving`].
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// Planned move of the load.
    Load { speed_m_per_s: f32, stopping: bool },
    /// Turning at a constant speed.
    Jog { speed_rad_per_s: f32 },
}

/// The rig.
#[derive(Clone)]
pub struct Rig<'t> {
    table: &'t Table<'t>,
    /// As the scene says.
    scene: RigConstants,
    settings: SettingValues,
    /// As the settings correct them.
    constants: RigConstants,
    state: State,
    latched: Latched,
    limit: Option<Limit>,
    lvdt: Lvdt,
    checks: Checks,
    /// Shaft set-point (rad by the encoder) and its speed.
    shaft: Ramp,
    /// Own count less the drive's, taken when the drive became ready.
    drive_offset: Option<i64>,
    restart_drive: bool,
    awaiting_restart: bool,
    /// Own and drive's counts have been matched since the drive's last start.
    matched: bool,
    /// In [`State::EStop`]: the contact has closed again, and it did so in this tick.
    estop_closed: bool,
    estop_closes: bool,
    /// Ticks that came late since boot.
    late_ticks: u32,
    homing: Homing,
    homed: Option<Homed>,
    adaptation: Adaptation,
    observer: LoadObserver,
    planner: Planner,
    position_loop: PositionLoop,
    motion: Motion,
    /// Time until the set-point is at its target, friction aside (s); `None` until the first tick of a move.
    run_s: Option<f32>,
    /// Ticks that the load has stood at its target.
    at_rest_ticks: u16,
    arrived_ticks: u16,
    /// Ticks that it has stood there with the strings at the end of their travel.
    end_ticks: u16,
    /// Newest measured position (m).
    last_position_m: f32,
    standing_ticks: u16,
    /// Shaft angle in the tick before (rad).
    last_shaft_rad: Option<f32>,
    /// Age of the newest gap (s).
    gap_age_s: f32,
}

/// Share of the gap by which the LVDT may differ from the model, and what the twist's scale may differ from what is
/// expected, before the load is told as unknown: emulated rigs whose LVDT is 15 % off in gain, or all of whose constants
/// are 25 % off, come out beyond these and weigh 17 to 38 % wrongly.
const DOUBTFUL_OFFSET: f32 = 0.08;
const DOUBTFUL_SCALE: f32 = 0.08;
/// Motor speed (rpm) below which the shaft counts as standing: three quanta of the drive's speed measurement.
const STANDING_RPM: u16 = 45;
/// For how long.
const STANDING_TICKS: u16 = ticks(20);

/// Longest silence of the host during a motion (µs).
pub const HOST_SILENT_US: u64 = 400_000;
/// Greatest jog speed (rad/s).
pub const JOG_SPEED_MAX: f32 = 4.0;
/// Greatest speed that can be asked of the load (m/s); a setting may lower it.
pub const SPEED_MAX_M_PER_S: f32 = Setting::SpeedMax.spec().range[1];

impl<'t> Rig<'t> {
    /// As after power-up: nothing known, nothing moves. `reset` is the fault that the last reset amounts to, if the
    /// board was not started by power or by hand.
    pub fn new(table: &'t Table<'t>, constants: RigConstants, reset: Option<Fault>) -> Self {
        let mut latched = Latched::NONE;
        reset.into_iter().for_each(|fault| latched.insert(fault));
        if !table.is_intact() {
            latched.insert(Fault::TableCorrupt);
        }
        Self {
            table,
            scene: constants,
            settings: crate::settings::defaults(&constants),
            constants,
            state: if latched == Latched::NONE { State::Boot } else { State::Fault },
            latched,
            limit: None,
            lvdt: Lvdt::new(),
            checks: Checks::new(),
            shaft: Ramp::at(0.0),
            drive_offset: None,
            // Its first frame is a Reset: the drive may still follow what the run before told it.
            restart_drive: true,
            awaiting_restart: false,
            matched: false,
            estop_closed: false,
            estop_closes: false,
            late_ticks: 0,
            homing: Homing::new(),
            homed: None,
            adaptation: Adaptation::new(1.0),
            observer: LoadObserver::new(table.metadata.load_min_n, 0.0, 0.0),
            planner: Planner::at(0.0),
            position_loop: PositionLoop::default(),
            motion: Motion::Jog { speed_rad_per_s: 0.0 },
            run_s: None,
            at_rest_ticks: 0,
            arrived_ticks: 0,
            end_ticks: 0,
            last_position_m: 0.0,
            standing_ticks: 0,
            last_shaft_rad: None,
            gap_age_s: 0.0,
        }
    }

    /// What the rig is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// The gravest of the faults that stopped it.
    pub fn fault(&self) -> Option<Fault> {
        self.latched.gravest()
    }

    /// All faults that stopped it.
    pub fn faults(&self) -> Faults {
        self.latched.all()
    }

    /// The last homing, as long as it holds.
    pub fn homed(&self) -> Option<&Homed> {
        self.homed.as_ref()
    }

    /// What has been learned since homing, for storing; `None` while not homed.
    pub fn learned(&self) -> Option<Learned> {
        self.homed.map(|h| self.adaptation.learned(h.twist_scale, h.friction_n))
    }

    /// Takes up a stored scale of the twist, as far as it is within the drift that homing's allows. False while not homed,
    /// or if it is no number.
    pub fn recall(&mut self, learned: &Learned) -> bool {
        let Some(homed) = self.homed.as_mut().filter(|_| learned.twist_scale.is_finite()) else { return false };
        homed.twist_scale = self.adaptation.bounded(learned.twist_scale);
        true
    }

    /// One control tick. Call every [`TICK_US`].
    pub fn step(&mut self, inputs: &Inputs) -> Outputs {
        let mut events = heapless::Vec::new();
        self.limit = None;
        let shaft_rad = angle_rad(inputs.encoder_counts, self.constants.counts_per_rad);
        let lvdt = self.lvdt.read(inputs.now_us, inputs.lvdt, &self.constants);
        self.watch(inputs, lvdt, shaft_rad, &mut events);
        let reply =
            inputs.request.as_ref().and_then(|request| self.request(request, inputs, lvdt, shaft_rad, &mut events));
        // A setting may have changed what a count is.
        let shaft_rad = angle_rad(inputs.encoder_counts, self.constants.counts_per_rad);
        let (gap_m, age_s) = match lvdt {
            LvdtReading::Valid { gap_m, t_us } => {
                (Some(gap_m), seconds(inputs.now_us.saturating_sub(t_us)) + GAP_DELAY_S)
            }
            _ => (None, 0.0),
        };
        self.gap_age_s = age_s;
        // Where the shaft was when the gap was measured: the two belong together.
        let turned = shaft_rad - self.last_shaft_rad.replace(shaft_rad).unwrap_or(shaft_rad);
        let shaft_then_rad = shaft_rad - turned * age_s / TICK_S;
        let observed = self.homed.filter(|h| self.table_knows(shaft_then_rad - h.zero_rad)).map(|h| {
            let mechanism = Mechanism { table: self.table, twist_scale: h.twist_scale };
            (h, self.observer.step(&mechanism, shaft_then_rad - h.zero_rad, gap_m))
        });
        if self.homed.is_some() && observed.is_none() {
            self.observer.lose();
        }
        if self.homed.is_some() && observed.is_none_or(|(_, o)| o.confidence != Confidence::Sure) {
            self.limit = Some(Limit::LoadUnknown);
        }
        if observed.is_some_and(|(_, o)| o.at_range_end) {
            self.limit = Some(Limit::LoadRange);
        }
        if self.load_out_of_range(observed.as_ref().map(|(_, o)| o)) {
            self.latch(Faults::NONE.with(Fault::LoadRange), shaft_rad, &mut events);
        }
        match self.state {
            State::Boot => self.leave_boot(inputs, lvdt, shaft_rad),
            State::Homing => {
                let current_a = match inputs.drive {
                    DriveReading::Reports { current_ma, .. } => {
                        f32::from(current_ma) * 1e-3 * self.constants.twist_sign()
                    }
                    _ => 0.0,
                };
                let seen = gap_m.map(|gap_m| Seen { shaft_rad, shaft_then_rad, gap_m, current_a });
                self.step_homing(seen, shaft_rad, &mut events);
            }
            State::Moving | State::Holding => self.step_motion(observed.as_ref(), gap_m, &mut events),
            State::Unhomed | State::Ready | State::Fault | State::EStop => self.shaft.speed = 0.0,
        }
        if !(self.shaft.position.is_finite() && self.shaft.speed.is_finite()) {
            self.latch(Faults::NONE.with(Fault::NotFinite), shaft_rad, &mut events);
        }
        let drive = self.drive_command(inputs);
        let telemetry = self.telemetry(inputs, gap_m, shaft_rad, observed.map(|(_, o)| o));
        Outputs { drive, reply, events, telemetry, gap_m }
    }

    /// Whether the table says anything of this twist (rad).
    fn table_knows(&self, twist_rad: f32) -> bool {
        let m = &self.table.metadata;
        (m.twist_min_rad - motion::OUTSIDE_RAD..=m.twist_max_rad + motion::OUTSIDE_RAD).contains(&twist_rad)
    }

    /// Until its first command the drive gives no torque and a loaded string untwists. So: command a hold at once, and
    /// compare own and drive's counts only when the shaft stands, because a report is up to 10 ms old.
    fn leave_boot(&mut self, inputs: &Inputs, lvdt: LvdtReading, shaft_rad: f32) {
        let DriveReading::Reports { position_qc, speed_rpm, .. } = inputs.drive else {
            self.awaiting_restart = false;
            return;
        };
        // A report from before the restart counts from another zero.
        if self.awaiting_restart {
            return;
        }
        let offset = inputs.encoder_counts - i64::from(position_qc);
        if self.drive_offset.is_none() {
            self.drive_offset = Some(offset);
            self.shaft = Ramp::at(shaft_rad);
        }
        // What a sensor says first after power-up is not believed.
        let settled = speed_rpm.unsigned_abs() < STANDING_RPM && matches!(lvdt, LvdtReading::Valid { .. });
        self.standing_ticks = if settled { self.standing_ticks + 1 } else { 0 };
        if self.standing_ticks >= STANDING_TICKS {
            self.drive_offset = Some(offset);
            self.matched = true;
            self.shaft = Ramp::at(shaft_rad);
            self.state = State::Unhomed;
        }
    }

    fn step_homing(&mut self, seen: Option<Seen>, shaft_rad: f32, events: &mut Events) {
        let Some(seen) = seen else { return };
        match self.homing.step(self.table, &self.constants, &seen) {
            Progress::Turning(ramp) => self.shaft = ramp,
            Progress::Done(homed) => {
                self.resume(homed);
                let _ = events.push(EventKind::Homed {
                    twist_error_estimate_rad: homed.zero_error_rad,
                    load_n: homed.load_n,
                    gap_offset_m: homed.gap_offset_m,
                });
            }
            Progress::Failed(failure) => self.end_homing(failure, shaft_rad, events),
        }
    }

    /// Homed, at rest at the half-turn pre-twist: what the end of a homing does, and the start of a replay.
    pub fn resume(&mut self, mut homed: Homed) {
        let zero_m = self.settings.get(Setting::PositionZero);
        homed.reference_gap_m -= zero_m;
        self.homed = Some(homed);
        self.adaptation = Adaptation::new(homed.twist_scale);
        self.observer = LoadObserver::new(homed.load_n, homed.gap_offset_m, homed.friction_n);
        let scale_off = (homed.twist_scale - self.settings.get(Setting::TwistScale)).abs();
        if homed.gap_offset_m.abs() > DOUBTFUL_OFFSET * homed.reference_gap_m || scale_off > DOUBTFUL_SCALE {
            self.observer.distrust();
        }
        self.planner = Planner::at(-zero_m);
        self.shaft = Ramp::at(homed.zero_rad + core::f32::consts::PI);
        self.state = State::Ready;
    }

    fn end_homing(&mut self, failure: HomingFailure, shaft_rad: f32, events: &mut Events) {
        self.shaft = Ramp::at(shaft_rad);
        self.state = State::Unhomed;
        let _ = events.push(EventKind::HomingRefused(failure));
    }

    /// Latches what is new among `found`; the strings stop where they are.
    fn latch(&mut self, found: Faults, shaft_rad: f32, events: &mut Events) {
        let news = self.latched.news(found, self.checks.ticks_missed_lately());
        if news.is_empty() || self.state == State::EStop {
            return;
        }
        for row in POLICY.iter().filter(|row| news.contains(row.fault)) {
            self.latched.insert(row.fault);
            let _ = events.push(EventKind::FaultRaised(row.fault));
        }
        // What is held already is held where the first fault found it.
        if self.state != State::Fault {
            self.state = State::Fault;
            let by_drive = self.checks.drive_counts().zip(self.drive_offset).filter(|_| self.own_encoder_is_wrong());
            self.shaft = Ramp::at(
                by_drive.map_or(shaft_rad, |(drive, offset)| angle_rad(drive + offset, self.constants.counts_per_rad)),
            );
        }
    }

    fn own_encoder_is_wrong(&self) -> bool {
        self.latched.all().meets(Faults::of(&ENCODER))
    }

    /// Takes another table, for which the rig must be homed anew. Not while anything moves: false, ask again later.
    pub fn use_table(&mut self, table: &'t Table<'t>) -> bool {
        if matches!(self.state, State::Moving | State::Homing) {
            return false;
        }
        self.table = table;
        self.homed = None;
        if matches!(self.state, State::Ready | State::Holding) {
            self.state = State::Unhomed;
        }
        true
    }

    /// Whether the rig stands, and the core may stall for a while: nothing is homing or moving.
    pub fn stands(&self) -> bool {
        !matches!(self.state, State::Moving | State::Homing | State::Boot)
    }

    /// No tick for a while, on purpose: the next one is not late.
    pub fn pause(&mut self) {
        self.checks.pause();
    }
}

/// Ticks in a time given in hundredths of a second.
const fn ticks(hundredths: u16) -> u16 {
    (hundredths as u64 * 10_000 / TICK_US) as u16
}
