//! Requests with replies, events, telemetry: the conversation with one board.

mod requests;

use super::interrupt;
use super::link::{Link, Port};
use super::row::{Entry, RangeEnd, Row, TruthRecords};
use super::silence::Hearing;
use super::sim::Sim;
use crate::failure::{BrokenOff, Failure, Why};
use rig_link::{
    Accepted, EventKind, HomingFailure, Identity, Kept, Message, Refusal, Request, Sensors, Setting, SettingsReport,
    State, Telemetry, Versions,
};
use rig_plant::Run;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};

/// What this tool greets with.
const TOOL: Versions = Versions::own(env!("CARGO_PKG_VERSION"), "");
/// Time between two greetings of a board that has not answered, nor sent anything that can be read (s).
const GREETING_S: f64 = 1.0;
/// Longest wait for flash (s): a sector may have to be erased, or a table that is being made goes first.
const FLASH_S: f64 = 10.0;
/// How often a stop is sent before the conversation ends, and exchanges in which it reaches the board and its answer comes
/// back: half a second in all.
const STOPS: u32 = 5;
const STOP_EXCHANGES: u32 = 10;

/// A conversation with one board.
pub struct Session {
    /// The frames below the messages: damaged and lost ones, heartbeats.
    pub link: Link,
    /// Greets the board by itself whenever it has started, as a script needs it.
    pub greets: bool,
    replies: VecDeque<(u16, Result<Accepted, Refusal>)>,
    events: VecDeque<(f64, EventKind)>,
    rows: VecDeque<Row>,
    log: Vec<String>,
    /// What was true in the rig; empty on a real one.
    pub truth: TruthRecords,
    /// Emulated time of the board's last start (s).
    boot_s: f64,
    /// The board loses its power, and has not started again since.
    lost_power: bool,
    hearing: Hearing,
    /// The conversation goes on while the board is silent, for who says so to the operator: [`Session::silent_s`]. Meanwhile the
    /// board is asked to stop, in case that it still hears.
    pub bears_silence: bool,
    /// Whether a step goes on although the board has been reset, for who shows that to somebody.
    pub bears_reset: bool,
    was_reset: bool,
    last: Option<Telemetry>,
    /// Versions of the board that has answered a greeting.
    board: Option<Versions>,
    /// When a board that sends nothing readable is greeted again, on the port's clock (s).
    next_greeting_s: f64,
    identity: Option<Identity>,
    settings: Option<SettingsReport>,
    sensors: Option<Sensors>,
    /// Why the last homing failed, until the next one begins.
    homing_failure: Option<HomingFailure>,
    watchers: Vec<Sender<Entry>>,
    interrupt: Arc<AtomicBool>,
}

impl Session {
    /// Over this port.
    pub fn new(port: Box<dyn Port>) -> Self {
        Self {
            link: Link::new(port),
            greets: false,
            replies: VecDeque::new(),
            events: VecDeque::new(),
            rows: VecDeque::new(),
            log: Vec::new(),
            truth: TruthRecords::default(),
            boot_s: 0.0,
            lost_power: false,
            hearing: Hearing::default(),
            bears_silence: false,
            bears_reset: false,
            was_reset: false,
            last: None,
            board: None,
            next_greeting_s: GREETING_S,
            identity: None,
            settings: None,
            sensors: None,
            homing_failure: None,
            watchers: Vec::new(),
            interrupt: Arc::default(),
        }
    }

    /// Setting it stops what goes on in this session, as Ctrl-C does in all: for another thread of a program.
    pub fn interrupt(&self) -> Arc<AtomicBool> {
        self.interrupt.clone()
    }

    /// Time on the port's clock (s).
    pub fn now_s(&self) -> f64 {
        self.link.now_s()
    }

    /// Time on the board's clock (s), of the newest telemetry: that of rows and events. A real port's clock is another one.
    pub fn board_s(&self) -> f64 {
        self.last.map_or(0.0, |t| self.boot_s + t.t_us as f64 * 1e-6)
    }

    /// The newest telemetry.
    pub fn telemetry(&self) -> Option<&Telemetry> {
        self.last.as_ref()
    }

    /// The board's identity, once it has been greeted.
    pub fn identity(&self) -> Option<&Identity> {
        self.identity.as_ref()
    }

    /// The board's identity.
    ///
    /// # Errors
    /// If the board has not been greeted.
    pub fn require_identity(&self) -> Result<&Identity, Failure> {
        self.identity().ok_or_else(|| Failure::failed("the board did not send its identity"))
    }

    /// The end of the table's range that a load (N) stands at, by the board's identity.
    pub fn range_end(&self, load_n: f32) -> Option<RangeEnd> {
        let table = &self.identity.as_ref()?.table;
        RangeEnd::of(load_n, [table.load_min_n, table.load_max_n])
    }

    /// The newest report of the board's settings.
    pub fn known_settings(&self) -> Option<&SettingsReport> {
        self.settings.as_ref()
    }

    /// The emulated rig behind the port, if it is one.
    pub fn emulated(&mut self) -> Option<&mut Sim> {
        self.link.emulated()
    }

    /// Rows since the last call.
    pub fn take_rows(&mut self) -> Vec<Row> {
        self.rows.drain(..).collect()
    }

    /// Events since the last call, with their times (s).
    pub fn take_events(&mut self) -> Vec<(f64, EventKind)> {
        self.events.drain(..).collect()
    }

    /// The firmware's own log since the last call; emulated boards only.
    pub fn take_log(&mut self) -> Vec<String> {
        std::mem::take(&mut self.log)
    }

    /// Replies since the last call that nobody waited for, with the number of their request.
    pub fn take_replies(&mut self) -> Vec<(u16, Result<Accepted, Refusal>)> {
        self.replies.drain(..).collect()
    }

    /// Everything that passes from now on, in order.
    pub fn watch(&mut self) -> Receiver<Entry> {
        let (watcher, entries) = mpsc::channel();
        self.watchers.push(watcher);
        entries
    }

    fn note(&mut self, entry: impl Fn() -> Entry) {
        // Who does not listen any more is forgotten.
        self.watchers.retain(|watcher| watcher.send(entry()).is_ok());
    }

    /// How long the board has sent no telemetry (s), from half a second on. A board without power is not silent, but off.
    pub fn silent_s(&self) -> Option<f64> {
        self.hearing.silent_s().filter(|_| !self.lost_power)
    }

    /// Rows that the board has made and that never came, by their times.
    pub fn lost_rows(&self) -> u64 {
        self.hearing.lost()
    }

    /// Queues a request for the next step and returns its number.
    ///
    /// # Errors
    /// Never for the messages that exist: each fits a frame.
    pub fn post(&mut self, request: &Request) -> Result<u16, Failure> {
        match request {
            Request::SetSetting { .. } | Request::SetSettings(_) | Request::TablePart(_) => {
                self.hearing.may_store(FLASH_S)
            }
            _ => {}
        }
        let number = self.link.post(request)?;
        let t_s = self.board_s();
        self.note(|| Entry::Request(t_s, *request));
        Ok(number)
    }

    /// One step: everything queued goes out, everything that came is sorted.
    ///
    /// # Errors
    /// If the port fails, or the emulated board stopped; [`BrokenOff`] if the operator interrupts, or the board falls silent or is reset.
    pub fn step(&mut self) -> Result<(), Failure> {
        let why = if interrupt::wanted() || self.interrupt.swap(false, Ordering::Relaxed) {
            Why::Interrupted
        } else {
            self.exchange()?;
            match (self.silent_s().is_some() && !self.bears_silence, std::mem::take(&mut self.was_reset)) {
                (true, _) => Why::Silent,
                (false, true) if !self.bears_reset => Why::Reset,
                _ => return Ok(()),
            }
        };
        Err(BrokenOff { why, stopped: self.stop()? }.into())
    }

    /// Stops the board, before the conversation ends, and returns whether it has acknowledged that.
    ///
    /// # Errors
    /// If the port fails, or the emulated board stopped.
    pub fn stop(&mut self) -> Result<bool, Failure> {
        for _ in 0..STOPS {
            let number = self.post_anew(&Request::Stop)?;
            for _ in 0..STOP_EXCHANGES {
                self.exchange()?;
                if let Some(place) = self.reply_to(number) {
                    return Ok(self.replies[place].1.is_ok());
                }
            }
        }
        Ok(false)
    }

    fn exchange(&mut self) -> Result<(), Failure> {
        // A board of another protocol may send nothing that this tool can read, and still answers a greeting.
        let is_unknown = self.last.is_none() && self.board.is_none();
        if self.greets && is_unknown && self.now_s() >= self.next_greeting_s {
            self.next_greeting_s = self.now_s() + GREETING_S;
            self.post(&Request::Hello(TOOL))?;
        }
        self.link.beat_with_stops(self.silent_s().is_some());
        let (messages, Run { truth, log, .. }) = self.link.exchange()?;
        self.hearing.listened(self.link.now_s());
        self.truth.extend(truth);
        self.log.extend(log);
        messages.into_iter().for_each(|message| self.take(message));
        Ok(self.board.map_or(Ok(()), |board| TOOL.check_board(&board))?)
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Hello(board) => self.board = Some(board),
            Message::Reply { to, result } => self.replies.push_back((to, result)),
            Message::Identity(identity) => self.identity = Some(identity),
            Message::Settings(report) => {
                if report.kept != Kept::Others {
                    self.hearing.may_store(0.0);
                }
                self.settings = Some(report);
            }
            Message::Sensors(sensors) => self.sensors = Some(sensors),
            Message::Event { t_us, kind } => self.take_event(self.boot_s + t_us as f64 * 1e-6, kind),
            Message::Telemetry(telemetry) => self.take_telemetry(telemetry),
        }
    }

    fn take_event(&mut self, t_s: f64, kind: EventKind) {
        match kind {
            EventKind::Homed { .. } => self.truth.home_gap_m = self.truth.at(t_s).map(|t| t.gap_m),
            EventKind::HomingRefused(failure) => self.homing_failure = Some(failure),
            EventKind::TableStored { .. } | EventKind::TableRefused(_) => self.hearing.may_store(0.0),
            _ => {}
        }
        self.note(|| Entry::Event(t_s, kind));
        self.events.push_back((t_s, kind));
    }

    fn take_telemetry(&mut self, telemetry: Telemetry) {
        if self.last.is_some_and(|last| telemetry.t_us < last.t_us) {
            // The board's clock went back: it was reset, and has forgotten everything.
            // Rows go on from the last one, by whichever clock is ahead: a real port's begins when it is opened.
            self.boot_s = (self.now_s() - telemetry.t_us as f64 * 1e-6).max(self.board_s());
            self.was_reset = !self.lost_power;
            self.truth.home_gap_m = None;
            self.settings = None;
            self.homing_failure = None;
            self.lost_power = false;
            self.hearing.restarted();
        }
        self.hearing.row(telemetry.t_us);
        if telemetry.state == State::Homing {
            self.homing_failure = None;
        }
        let started = self.last.is_none_or(|last| telemetry.t_us < last.t_us);
        if started && self.greets {
            // The longest request that exists fits a frame, so these do.
            let _ = self.post(&Request::Hello(TOOL));
            let _ = self.post(&Request::GetSettings);
        }
        let t_s = self.boot_s + telemetry.t_us as f64 * 1e-6;
        let zero_m = self.settings.map_or(0.0, |s| f64::from(s.values.get(Setting::PositionZero)));
        let zero_gap_m = self.truth.home_gap_m.map(|gap_m| gap_m - zero_m);
        let mut row = Row::new(t_s, &telemetry, self.truth.at(t_s).as_ref(), zero_gap_m);
        row.homing_failure = self.homing_failure;
        row.load_at_range_end = row.load_n.and_then(|load_n| self.range_end(load_n));
        self.note(|| Entry::Row(row.clone()));
        self.rows.push_back(row);
        self.last = Some(telemetry);
    }

    /// Steps until `done`, at most for `seconds`, and returns whether it was done.
    ///
    /// # Errors
    /// As [`Session::step`].
    pub fn until(&mut self, seconds: f64, mut done: impl FnMut(&Self) -> bool) -> Result<bool, Failure> {
        let end = self.now_s() + seconds;
        while self.now_s() < end {
            self.step()?;
            if done(self) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The board's state by the newest telemetry.
    pub fn state(&self) -> State {
        self.last.map_or(State::Boot, |t| t.state)
    }

    /// Whether a motion goes on.
    pub fn is_moving(&self) -> bool {
        self.state() == State::Moving
    }

    /// Whether the board is starting: it refuses commands that it will accept in a moment.
    pub fn is_starting(&self) -> bool {
        self.lost_power || self.state() == State::Boot
    }

    /// Takes the emulated board's power away for a moment, or expects that of a real one, and returns whether there is an
    /// emulated board.
    ///
    /// # Errors
    /// If the emulator is gone.
    pub fn power_cycle(&mut self) -> Result<bool, Failure> {
        self.lost_power = true;
        let Some(emulated) = self.link.emulated() else { return Ok(false) };
        emulated.power_cycle()?;
        Ok(true)
    }

    /// Waits until the board has started, also into a fault: wrong settings may be its cause.
    ///
    /// # Errors
    /// If it does not start within 10 s.
    pub fn wait_started(&mut self) -> Result<(), Failure> {
        if !self.until(10.0, |s| s.state() != State::Boot)? {
            return Err(Failure::failed("the drive does not start: is it powered, is the bus wired?"));
        }
        Ok(())
    }

    /// Waits until the drive has started and the board can accept a motion.
    ///
    /// # Errors
    /// If it does not start within 10 s, or is in fault.
    pub fn wait_ready(&mut self) -> Result<(), Failure> {
        self.wait_started()?;
        match (self.state(), self.last.and_then(|t| t.fault)) {
            (State::Fault, Some(fault)) => Err(Failure::of_kind("fault", format!("the board is in fault: {fault}"))),
            (State::EStop, _) => Err(Failure::of_kind("estop", "the emergency stop is pressed")),
            _ => Ok(()),
        }
    }
}
