//! Requests with replies, events and telemetry over a [`Port`].

use super::interrupt;
use super::order::Order;
use super::port::{Emulated, Port};
use super::row::Row;
use crate::failure::Failure;
use crate::log::Entry;
use rig_link::{
    Accepted, Decoder, EventKind, HEARTBEAT_PERIOD_MS, HomingFailure, Identity, Kept, MAX_FRAME, Message,
    PROTOCOL_HASH, Refusal, Request, Sensors, Setting, SettingsReport, State, Telemetry, encode,
};
use sim_link::Truth;
use std::collections::VecDeque;

/// Time that passes in one step (s).
pub const STEP_S: f64 = 0.01;
/// Longest wait for a reply (s).
const REPLY_S: f64 = 1.0;
/// Longest wait for the first word of a board (s): a drive's start-up does not hold the link back.
const HELLO_S: f64 = 3.0;
/// Longest wait for flash (s): a sector erased on the way, or a table being made that goes first.
const FLASH_S: f64 = 10.0;
/// Readings of the gap that are averaged, half a second of them: noise and an LVDT count's grain come down to some µm.
const GAP_READINGS: u32 = 25;
/// Steps in which a stop gets to the board, and its answer back.
const LAST_STEPS: u32 = 5;
/// How much truth is kept to be paired with telemetry (records of 1 ms).
const TRUTH_KEPT: usize = 500;

/// A conversation with one board.
pub struct Session {
    port: Box<dyn Port>,
    decoder: Decoder<Message>,
    sequence: u16,
    outgoing: Vec<u8>,
    steps: u64,
    heartbeat: bool,
    /// Greets the board by itself whenever it has started.
    greets: bool,
    /// State of the generator of link noise, while it is on.
    noise: Option<u64>,
    replies: VecDeque<(u16, Result<Accepted, Refusal>)>,
    events: VecDeque<(f64, EventKind)>,
    rows: VecDeque<Row>,
    log: Vec<String>,
    truth: VecDeque<Truth>,
    /// Emulated time of the board's last start (s).
    boot_s: f64,
    /// The board has lost its power, and has not been heard since.
    lost_power: bool,
    last: Option<Telemetry>,
    order: Order,
    identity: Option<Identity>,
    settings: Option<SettingsReport>,
    sensors: Option<Sensors>,
    home_gap_m: Option<f64>,
    /// Why the last homing failed, until the next one begins.
    homing_failure: Option<HomingFailure>,
    /// Everything that passes, in order, for who records it.
    journal: Option<Vec<Entry>>,
}

impl Session {
    /// Over this way.
    pub fn new(port: Box<dyn Port>) -> Self {
        Self {
            port,
            decoder: Decoder::new(),
            sequence: 0,
            outgoing: Vec::new(),
            steps: 0,
            heartbeat: true,
            greets: false,
            noise: None,
            replies: VecDeque::new(),
            events: VecDeque::new(),
            rows: VecDeque::new(),
            log: Vec::new(),
            truth: VecDeque::new(),
            boot_s: 0.0,
            lost_power: false,
            last: None,
            order: Order::default(),
            identity: None,
            settings: None,
            sensors: None,
            home_gap_m: None,
            homing_failure: None,
            journal: None,
        }
    }

    /// Time on the port's clock (s).
    pub fn now_s(&self) -> f64 {
        self.port.now_s()
    }

    /// The newest telemetry.
    pub fn telemetry(&self) -> Option<&Telemetry> {
        self.last.as_ref()
    }

    /// Who the board said it is.
    pub fn identity(&self) -> Option<&Identity> {
        self.identity.as_ref()
    }

    /// The newest report of its settings.
    pub fn known_settings(&self) -> Option<&SettingsReport> {
        self.settings.as_ref()
    }

    /// The true gap (m); emulated rigs only.
    pub fn true_gap_m(&self) -> Option<f64> {
        self.truth.back().map(|t| t.gap_m)
    }

    /// Damaged frames so far.
    pub fn damaged_frames(&self) -> u32 {
        self.decoder.errors()
    }

    /// Frames of the board that never came, by the gaps in their numbers.
    pub fn lost_frames(&self) -> u32 {
        self.order.lost()
    }

    /// The emulated rig behind it, if it is one.
    pub fn emulated(&mut self) -> Option<&mut dyn Emulated> {
        self.port.emulated()
    }

    /// Rows since last asked.
    pub fn take_rows(&mut self) -> Vec<Row> {
        self.rows.drain(..).collect()
    }

    /// Events since last asked, with their times (s).
    pub fn take_events(&mut self) -> Vec<(f64, EventKind)> {
        self.events.drain(..).collect()
    }

    /// The firmware's own log since last asked; emulated boards only.
    pub fn take_log(&mut self) -> Vec<String> {
        std::mem::take(&mut self.log)
    }

    /// Replies since last asked that nobody waited for, with their request's number.
    pub fn take_replies(&mut self) -> Vec<(u16, Result<Accepted, Refusal>)> {
        self.replies.drain(..).collect()
    }

    /// From now on keeps everything that passes, for [`Session::take_journal`].
    pub fn keep_journal(&mut self) {
        self.journal.get_or_insert_default();
    }

    /// What has passed since last asked; nothing if it is not kept.
    pub fn take_journal(&mut self) -> Vec<Entry> {
        self.journal.as_mut().map(std::mem::take).unwrap_or_default()
    }

    fn note(&mut self, entry: impl FnOnce(&Self) -> Entry) {
        if self.journal.is_some() {
            let entry = entry(self);
            self.journal.get_or_insert_default().push(entry);
        }
    }

    /// Sends heartbeats, or stops to.
    pub fn set_heartbeat(&mut self, on: bool) {
        self.heartbeat = on;
    }

    /// Greets the board by itself whenever it has started, as a script wants it.
    pub fn greet_at_boot(&mut self) {
        self.greets = true;
    }

    /// Mixes random bytes between the frames, or stops to.
    pub fn set_link_noise(&mut self, seed: Option<u64>) {
        self.noise = seed;
    }

    /// Queues a request for the next step; its number.
    ///
    /// # Errors
    /// Never for the messages there are: each fits a frame.
    pub fn post(&mut self, request: &Request) -> Result<u16, Failure> {
        self.sequence = self.sequence.wrapping_add(1);
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(self.sequence, request, &mut buffer).map_err(|e| Failure::failed(e.to_string()))?;
        self.outgoing.extend_from_slice(frame);
        if !matches!(request, Request::Heartbeat) {
            self.note(|s| Entry::Request(s.last.map_or(0.0, |t| s.boot_s + t.t_us as f64 * 1e-6), *request));
        }
        Ok(self.sequence)
    }

    /// One step: everything queued goes out, everything that came is sorted.
    ///
    /// # Errors
    /// If the port fails, the emulated board stopped, or somebody wants to end it: then the board has been told to stop.
    pub fn step(&mut self) -> Result<(), Failure> {
        if !interrupt::wanted() {
            return self.exchange();
        }
        self.stop()?;
        Err(Failure::failed("interrupted: the board was told to stop"))
    }

    /// Tells the board to stop, before nobody asks it anything any more.
    ///
    /// # Errors
    /// If the port fails, or the emulated board stopped.
    pub fn stop(&mut self) -> Result<(), Failure> {
        self.post(&Request::Stop)?;
        (0..LAST_STEPS).try_for_each(|_| self.exchange())
    }

    fn exchange(&mut self) -> Result<(), Failure> {
        let period = u64::from(HEARTBEAT_PERIOD_MS) / 10;
        if self.heartbeat && self.steps.is_multiple_of(period) {
            self.post(&Request::Heartbeat)?;
        }
        self.steps += 1;
        let mut bytes = std::mem::take(&mut self.outgoing);
        if let Some(state) = &mut self.noise {
            let mut noise = noise_bytes(state);
            noise.append(&mut bytes);
            bytes = noise;
        }
        let received = self.port.pass(&bytes, STEP_S)?;
        self.truth.extend(received.truth);
        while self.truth.len() > TRUTH_KEPT {
            self.truth.pop_front();
        }
        self.log.extend(received.log);
        for byte in received.bytes {
            if let Some(Ok(frame)) = self.decoder.push(byte) {
                self.order.take(frame).into_iter().for_each(|message| self.take(message));
            }
        }
        Ok(())
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Reply { to, result } => self.replies.push_back((to, result)),
            Message::Identity(identity) => self.identity = Some(identity),
            Message::Settings(report) => self.settings = Some(report),
            Message::Sensors(sensors) => self.sensors = Some(sensors),
            Message::Event { t_us, kind } => {
                let t_s = self.boot_s + t_us as f64 * 1e-6;
                if matches!(kind, EventKind::Homed { .. }) {
                    self.home_gap_m = self.truth_at(t_s).map(|t| t.gap_m);
                }
                if let EventKind::HomingRefused(failure) = kind {
                    self.homing_failure = Some(failure);
                }
                self.note(|_| Entry::Event(t_s, kind));
                self.events.push_back((t_s, kind));
            }
            Message::Telemetry(telemetry) => {
                if self.last.is_some_and(|last| telemetry.t_us < last.t_us) {
                    // The board's clock went back: it was reset, and knows nothing any more.
                    self.boot_s = (self.now_s() - telemetry.t_us as f64 * 1e-6).max(0.0);
                    self.home_gap_m = None;
                    self.settings = None;
                    self.homing_failure = None;
                    self.lost_power = false;
                }
                if telemetry.state == State::Homing {
                    self.homing_failure = None;
                }
                let started = self.last.is_none_or(|last| telemetry.t_us < last.t_us);
                if started && self.greets {
                    // The longest request there is fits a frame, so this one does.
                    let _ = self.post(&Request::Hello { protocol_hash: PROTOCOL_HASH });
                    let _ = self.post(&Request::GetSettings);
                }
                let t_s = self.boot_s + telemetry.t_us as f64 * 1e-6;
                let truth = self.truth_at(t_s);
                let zero_m = self.settings.map_or(0.0, |s| f64::from(s.values.get(Setting::PositionZero)));
                let zero_gap_m = self.home_gap_m.map(|gap_m| gap_m - zero_m);
                let mut row = Row::new(t_s, &telemetry, truth.as_ref(), zero_gap_m);
                row.homing_failure = self.homing_failure.map(|failure| failure.name());
                self.note(|_| Entry::Row(row.clone()));
                self.rows.push_back(row);
                self.last = Some(telemetry);
            }
        }
    }

    /// The record nearest to a time.
    fn truth_at(&self, t_s: f64) -> Option<Truth> {
        let distance = |t: &&Truth| (t.t_s - t_s).abs();
        self.truth.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
    }

    /// Steps until `done`, at most `seconds`; whether it was done.
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

    /// Sends a request and waits for its reply.
    ///
    /// # Errors
    /// The board's refusal, in words, or that no reply came.
    pub fn request(&mut self, request: &Request) -> Result<Accepted, Failure> {
        let number = self.post(request)?;
        // Numbers come round again: an answer of the last time is none.
        self.replies.retain(|(to, _)| *to != number);
        self.until(REPLY_S, |s| s.replies.iter().any(|(to, _)| *to == number))?;
        match self.replies.iter().position(|(to, _)| *to == number).and_then(|i| self.replies.remove(i)) {
            Some((_, Ok(accepted))) => Ok(accepted),
            Some((_, Err(refusal))) => Err(Failure::failed(format!("refused: {refusal}"))),
            None => Err(Failure::failed(format!("no reply from the board within {REPLY_S} s"))),
        }
    }

    /// Greets the board and learns who it is.
    ///
    /// # Errors
    /// If nobody answers, or board and tool were built from different message tables.
    pub fn hello(&mut self) -> Result<Identity, Failure> {
        if !self.until(HELLO_S, |s| s.last.is_some())? {
            return Err(Failure::failed(format!("no telemetry within {HELLO_S} s: is the board on, is it this port?")));
        }
        self.identity = None;
        self.request(&Request::Hello { protocol_hash: PROTOCOL_HASH })?;
        self.until(REPLY_S, |s| s.identity.is_some())?;
        let identity = self.identity.clone().ok_or_else(|| Failure::failed("the board did not say who it is"))?;
        self.settings()?;
        Ok(identity)
    }

    /// Asks the board for its settings.
    ///
    /// # Errors
    /// If it does not answer.
    pub fn settings(&mut self) -> Result<SettingsReport, Failure> {
        self.settings = None;
        self.request(&Request::GetSettings)?;
        self.until(REPLY_S, |s| s.settings.is_some())?;
        self.settings.ok_or_else(|| Failure::failed("the board did not tell its settings"))
    }

    /// Changes settings and waits until they are in flash: whether that lost the position.
    ///
    /// # Errors
    /// The board's refusal in words, or that they are in use and not in flash.
    pub fn set(&mut self, request: &Request) -> Result<bool, Failure> {
        let accepted = self.request(request)?;
        // A report that came with the reply may be older; one that is asked for now is not.
        let end_s = self.now_s() + FLASH_S;
        while self.now_s() < end_s {
            match self.settings()?.kept {
                Kept::These => return Ok(accepted == Accepted::Unhomed),
                Kept::Nothing => break,
                Kept::Others | Kept::Damaged => self.until(0.1, |_| false)?,
            };
        }
        Err(Failure::failed("in use, but NOT kept in flash: lost with the next reset. The board's log says why"))
    }

    /// What the sensors show, homed or not.
    ///
    /// # Errors
    /// If the board does not answer.
    pub fn sensors(&mut self) -> Result<Sensors, Failure> {
        self.sensors = None;
        self.request(&Request::ReadSensors)?;
        self.until(REPLY_S, |s| s.sensors.is_some())?;
        self.sensors.ok_or_else(|| Failure::failed("the board did not tell its sensors"))
    }

    /// Gaps that the LVDT shows (m), over half a second, homed or not.
    ///
    /// # Errors
    /// If one of them is no valid reading.
    pub fn gaps_m(&mut self) -> Result<Vec<f64>, Failure> {
        let mut gaps_m = Vec::new();
        for _ in 0..GAP_READINGS {
            let gap_m = self.sensors()?.gap_m.ok_or_else(|| Failure::failed("no valid reading from the LVDT"))?;
            gaps_m.push(f64::from(gap_m));
            self.until(STEP_S, |_| false)?;
        }
        Ok(gaps_m)
    }

    /// Their mean (m).
    ///
    /// # Errors
    /// As [`Session::gaps_m`].
    pub fn gap_m(&mut self) -> Result<f64, Failure> {
        Ok(self.gaps_m()?.iter().sum::<f64>() / f64::from(GAP_READINGS))
    }

    fn state(&self) -> State {
        self.last.map_or(State::Boot, |t| t.state)
    }

    /// Whether the board starts, so that it refuses what it will take in a moment.
    pub fn starts(&self) -> bool {
        self.lost_power || self.state() == State::Boot
    }

    /// Takes the emulated board's power away for a moment; whether there is one.
    ///
    /// # Errors
    /// If the emulator is gone.
    pub fn power_cycle(&mut self) -> Result<bool, Failure> {
        let Some(emulated) = self.port.emulated() else { return Ok(false) };
        emulated.power_cycle()?;
        self.lost_power = true;
        Ok(true)
    }

    /// Waits until the board has left its start, be it into a fault: settings may be what is wrong.
    ///
    /// # Errors
    /// If it does not come to that within 10 s.
    pub fn wait_started(&mut self) -> Result<(), Failure> {
        if !self.until(10.0, |s| s.state() != State::Boot)? {
            return Err(Failure::failed("the drive does not start: is it powered, is the bus wired?"));
        }
        Ok(())
    }

    /// Waits until the drive has started and the board can take a motion.
    ///
    /// # Errors
    /// If it does not come to that within 10 s, or is in fault.
    pub fn wait_ready(&mut self) -> Result<(), Failure> {
        self.wait_started()?;
        match (self.state(), self.last.and_then(|t| t.fault)) {
            (State::Fault, Some(fault)) => Err(Failure::failed(format!("the board is in fault: {fault}"))),
            (State::EStop, _) => Err(Failure::failed("the emergency stop is pressed")),
            _ => Ok(()),
        }
    }
}

/// Up to 40 random bytes, SplitMix64.
fn noise_bytes(state: &mut u64) -> Vec<u8> {
    let mut next = || {
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = *state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let count = next() % 41;
    (0..count).map(|_| next() as u8).collect()
}
