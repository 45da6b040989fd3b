//! What happens between the moves of a long run, and how the rig has to take it.

use crate::board::Bench;
use crate::rigs::commission::{SWEEP_LOADS_KG, calibrate};
use crate::rigs::subject::Subject;
use crate::sweep::{identified, swept};
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};
use rig_config::Scene;
use rig_link::messages::{EventKind, Kept, LoadChoice, Refusal, Request, Setting, State, StreamEnd};
use rig_plant::RigFault as Fault;
use rig_plant::units::STANDARD_GRAVITY;

/// Something that happens to a rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum InjectedEvent {
    /// A fault while the load moves, which is cleared.
    FaultUnderWay,
    /// The drive restarts while the load hangs still.
    DriveReset,
    /// The board loses its power while the load hangs still.
    PowerCycle,
    /// The same while the load moves.
    PowerCycleUnderWay,
    /// The same while a setting is written to flash.
    PowerCutInWrite,
    /// The load changes all at once by up to a quarter.
    LoadStep,
    /// Set-points are streamed, and then no longer.
    Stream,
    /// A table for strings that are a little thicker is sent to the board.
    NewTable,
    /// The LVDT is calibrated, three sweeps are recorded, the constants identified, and the board is sent the table of them, with
    /// which the run goes on. Half an hour's work, so not at random.
    Identify,
}

/// Each in words; those that come at random first.
pub const INJECTED_EVENTS: [(InjectedEvent, &str); 9] = [
    (InjectedEvent::FaultUnderWay, "faults under way"),
    (InjectedEvent::DriveReset, "restarts of the drive"),
    (InjectedEvent::PowerCycle, "power failures at rest"),
    (InjectedEvent::PowerCycleUnderWay, "power failures under way"),
    (InjectedEvent::PowerCutInWrite, "power failures in a write to flash"),
    (InjectedEvent::LoadStep, "steps of the load"),
    (InjectedEvent::Stream, "streams"),
    (InjectedEvent::NewTable, "tables sent to the board"),
    (InjectedEvent::Identify, "identifications"),
];
/// How many come at random.
pub const FREQUENT: usize = 8;

/// Faults that come while a load moves. All can be cleared; some lose the twist.
const FAULTS: [Fault; 7] = [
    Fault::CanSilent,
    Fault::DriveStall,
    Fault::EncoderStuck,
    Fault::LvdtOpen,
    Fault::LvdtNoisy,
    Fault::LvdtFrozen,
    Fault::Estop,
];

/// A shaft that is not commanded turns by less than this (rad).
const STANDS_RAD: f64 = 0.05;
/// Tenths of a second within which a shaft that was stopped stands.
const STANDS_WITHIN: u32 = 30;
/// Fraction by which a load changes at most, all at once.
const LOAD_STEP: f64 = 0.25;
/// Amplitude (m) and frequency (rad/s) of a stream, how often its set-points come and how long each holds (s).
const STREAM_M: f32 = 0.5e-3;
const STREAM_PER_S: f32 = 3.0;
const STREAM_EVERY_S: f32 = 0.05;
const STREAM_HOLDS_S: f32 = 0.15;
/// Longest wait for the end of a stream (s): one that ends where the strings' travel does waits 6 s for its place.
const STREAM_ENDS_S: f64 = 10.0;

/// Turns past the half-turn pre-twist of the sweeps.
const SWEEP_TURNS: f64 = 7.0;

/// A run in which incidents happen.
pub(super) struct Run<'a, R> {
    pub(super) board: &'a mut Bench,
    pub(super) random: &'a mut R,
    /// Homings so far, and power failures.
    pub(super) homings: u32,
    pub(super) restarts: u32,
    /// Faults that a step of the load has raised.
    pub(super) load_faults: u32,
    /// What hangs there (kg).
    pub(super) load_kg: f64,
    /// What the board's table is made for.
    pub(super) scene: Scene,
    /// The rig.
    pub(super) subject: Subject,
}

impl<R: Rng> Run<'_, R> {
    /// Lets it happen, and brings the rig back to where it can move.
    ///
    /// # Panics
    /// Where the rig does not take it as it should.
    pub(super) fn take(&mut self, injected_event: InjectedEvent) {
        match injected_event {
            InjectedEvent::FaultUnderWay => {
                let fault = *FAULTS.choose(self.random).expect("seven");
                self.fault(fault);
            }
            InjectedEvent::DriveReset => self.fault(Fault::DriveReset),
            InjectedEvent::PowerCycle | InjectedEvent::PowerCycleUnderWay => self.restart(),
            InjectedEvent::PowerCutInWrite => self.cut_in_a_write(),
            InjectedEvent::LoadStep => self.step_load(),
            InjectedEvent::Stream => self.stream(),
            InjectedEvent::NewTable => self.new_table(),
            InjectedEvent::Identify => self.identify(),
        }
    }

    fn twist_rad(&self) -> f64 {
        self.board.machine.board().truth().twist_rad
    }

    /// The rig latches it, its shaft stands, it is cleared, and homed again if the twist was lost.
    fn fault(&mut self, fault: Fault) {
        let b = &mut *self.board;
        b.machine.board_mut().set_fault(fault, true);
        // A restart of the drive cannot be taken back; the others are.
        let latched = |b: &Bench| matches!(b.state(), State::Fault | State::EStop | State::Unhomed);
        assert!(b.until(4.0, latched), "{fault:?} not seen: {:?}", b.last);
        b.run(0.5);
        if fault != Fault::DriveReset {
            b.machine.board_mut().set_fault(fault, false);
        }
        b.run(0.5);
        assert!(latched(b), "{fault:?} cleared itself");
        self.go_on();
    }

    /// Clears, and homes if the twist was lost.
    pub(super) fn go_on(&mut self) {
        let fault = self.board.last.and_then(|t| t.fault);
        // The shaft may still come to rest at its hold; `clear` is refused until then.
        let cleared = (0..STANDS_WITHIN).any(|_| {
            self.board.run(0.1);
            self.board.ask(&Request::Clear).is_ok()
        });
        assert!(cleared, "{fault:?} cannot be cleared: {:?}", self.board.events.last());
        let idle = |b: &Bench| matches!(b.state(), State::Unhomed | State::Ready | State::Holding);
        assert!(self.board.until(10.0, idle), "after {fault:?}: {:?}", self.board.last);
        if self.board.state() == State::Unhomed {
            self.home(&Request::HOME, &format!("after {fault:?}"));
        }
    }

    /// Homes a rig that nothing has moved.
    fn home(&mut self, request: &Request, when: &str) {
        let before_rad = self.twist_rad();
        self.board.run(0.5);
        let turned_rad = (self.twist_rad() - before_rad).abs();
        assert!(turned_rad < STANDS_RAD, "{when} the shaft turns by {turned_rad} rad");
        self.board.home_at_rest(request, when);
        self.homings += 1;
    }

    /// The power comes back: the board starts, moves nothing, and is homed again.
    fn restart(&mut self) {
        self.board.power_cycle();
        self.restarts += 1;
        self.board.ready();
        self.home(&Request::HOME, "after a power failure");
    }

    /// A setting that is being written has its old value or its new one.
    fn cut_in_a_write(&mut self) {
        let before = self.board.settings().values.get(Setting::SpeedMax);
        let value = self.random.random_range(0.012..0.018f32);
        self.board.post(&Request::SetSetting { setting: Setting::SpeedMax, value });
        self.board.run(self.random.random_range(0.0..0.15));
        self.restart();
        let report = self.board.settings();
        let found = report.values.get(Setting::SpeedMax);
        assert!(found == before || found == value, "{found} instead of {before} or {value}");
        assert_ne!(report.kept, Kept::Damaged);
    }

    /// The load is back at its place, or a fault holds it.
    fn step_load(&mut self) {
        let fraction = self.random.random_range(-LOAD_STEP..LOAD_STEP);
        self.load_kg = (self.load_kg * (1.0 + fraction)).clamp(0.3, 1.5);
        self.hang();
        self.board.run(4.0);
        match self.board.state() {
            State::Fault => {
                self.load_faults += 1;
                self.go_on();
            }
            state => assert!(matches!(state, State::Holding | State::Ready), "{state:?} after a step of the load"),
        }
    }

    fn hang(&mut self) {
        let load = format!("{}kg", self.load_kg);
        self.board.machine.board_mut().set_plant("load", &load).expect("a plant key");
    }

    /// A stream about the present place, which ends as one that has dried up.
    fn stream(&mut self) {
        let Some(place_m) = self.board.last.and_then(|t| t.position_m) else { return };
        let mut followed = false;
        for k in 1..=40u8 {
            let phase = STREAM_PER_S * STREAM_EVERY_S * f32::from(k);
            // It goes up first, where there is way, and comes back.
            let position_m = place_m + STREAM_M * (1.0 - phase.cos());
            let speed_m_per_s = STREAM_M * STREAM_PER_S * phase.sin();
            let reply = self.board.ask(&Request::Track { position_m, speed_m_per_s, for_s: STREAM_HOLDS_S });
            if reply.is_err() {
                break;
            }
            followed = true;
            let next_s = self.board.machine.now_s() + f64::from(STREAM_EVERY_S);
            while self.board.machine.now_s() < next_s - 0.02 {
                self.board.step();
            }
        }
        assert!(
            self.board.until(STREAM_ENDS_S, |b| matches!(b.state(), State::Holding | State::Ready)),
            "{:?}",
            self.board.last
        );
        let end = |e: &EventKind| if let EventKind::StreamEnded(end) = e { Some(*end) } else { None };
        let end = self.board.events.iter().rev().find_map(end);
        assert!(!followed || matches!(end, Some(StreamEnd::Late | StreamEnd::Refused)), "{end:?}");
    }

    /// Nothing moves while the board takes a table, and it is homed again.
    fn new_table(&mut self) {
        let mut thicker = self.scene.clone();
        thicker.string.k2 *= self.random.random_range(1.0..1.02);
        // The rig's strings are those of before.
        for scene in [thicker, self.scene.clone()] {
            self.change_table(&scene);
        }
    }

    /// The board is sent the scene's table, and is homed with it.
    fn change_table(&mut self, scene: &Scene) {
        let fit = scene.fit_table().unwrap_or_else(|why| panic!("{why}: {scene:?}"));
        assert_eq!(self.board.send_table(&fit.table.table()), Ok(true));
        assert_eq!(self.board.state(), State::Unhomed, "with a new table");
        self.home(&Request::HOME, "with a new table");
    }

    /// The LVDT is calibrated, the rig swept under three weighed loads, and the run goes on with the table of what was identified.
    fn identify(&mut self) {
        let values = calibrate(&self.subject).unwrap_or_else(|why| panic!("calibration: {why}"));
        self.board.ask(&Request::SetSettings(values)).unwrap_or_else(|refusal| panic!("calibration: {refusal}"));
        self.board.run(0.5);
        let sweep = |load_kg: f64| {
            self.lay_on(load_kg);
            let load_n = load_kg * STANDARD_GRAVITY;
            self.home(&Request::Home { load: LoadChoice::Known(load_n as f32) }, "for a sweep");
            let homed = self.board.found.expect("homed");
            let sweep = swept(&mut *self.board, &homed, load_n, SWEEP_TURNS);
            (format!("{load_kg} kg"), sweep.unwrap_or_else(|why| panic!("sweep under {load_kg} kg: {why}")))
        };
        let sweeps: Vec<_> = SWEEP_LOADS_KG.into_iter().map(sweep).collect();
        let found = identified(&sweeps).unwrap_or_else(|why| panic!("{why}"));
        if let Some(why) = found.untabled {
            panic!("no table of the identified scene: {why}");
        }
        self.change_table(&found.scene);
        self.scene = found.scene;
    }

    /// Another load (kg) is laid on by hand, 2 N a second: all at once it would be a broken string, or a load that runs away.
    pub(super) fn lay_on(&mut self, load_kg: f64) {
        while f64::abs(load_kg - self.load_kg) > 1e-9 {
            self.load_kg += f64::clamp(load_kg - self.load_kg, -0.01, 0.01);
            self.hang();
            self.board.run(0.05);
        }
        self.board.run(1.0);
        // A load laid on faster than it can be held leaves its place: that is a fault of its own.
        if self.board.state() == State::Fault {
            self.load_faults += 1;
            self.go_on();
        }
    }

    /// Whether a move has so much of its way before it that a fault of the shaft shows.
    pub(super) fn is_turning(&self) -> bool {
        self.board.last.is_some_and(|t| {
            self.board.state() == State::Moving
                && t.drive_speed_rad_per_s.abs() > TURNS_RAD_PER_S
                && t.time_left_s.is_some_and(|left_s| left_s > TURNS_S)
        })
    }

    /// Asks for a move (m, m/s); where it goes to, if the reach of this load is shorter (m).
    pub(super) fn begin_move(&mut self, target_m: f32, speed_m_per_s: f32) -> f32 {
        let mut go = |target_m| self.board.ask(&Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto });
        // A load heavier than at homing hangs lower and cannot come up as far, a lighter one not down as far.
        let first = go(target_m);
        let target_m = match first {
            Err(Refusal::OutOfRange { min, max, .. }) => min + 0.8 * (max - min),
            _ => return target_m,
        };
        if let Err(e) = go(target_m) {
            let truth = self.board.machine.board().truth();
            panic!(
                "move to {target_m} m under {} kg: {e}, after {first:?}; {:?}; {truth:?}",
                self.load_kg, self.board.last
            );
        }
        target_m
    }
}

/// Speed of the motor from which the shaft turns (rad/s), and time for which it must go on turning (s): a shaft that stands
/// shows no fault of its own.
const TURNS_RAD_PER_S: f32 = 1.0;
const TURNS_S: f32 = 0.5;
