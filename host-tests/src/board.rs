//! The firmware's ELF, unmodified, on the emulated board with the emulated rig.

use crate::{root, scene};
use rig_config::{DriveTransport, Scene};
use rig_emulator::machine::{Config, Machine};
use rig_link::messages::{
    EventKind, HomingResult, Identity, Kept, LoadChoice, Message, Refusal, Request, Sensors, SettingsReport, State,
    TablePart, TableRefusal, Telemetry,
};
use rig_link::{Accepted, Decoder, Versions, encode};
use rig_plant::board::Stimulus;
use rig_plant::rig::EmulatedRig;
use rig_plant::trial::TrialBench;
use std::process::Command;
use tsa_table::Table;
use tsa_table::record::RECORD_MAX;

/// What these tests greet the board with.
pub const HELLO: Request = Request::Hello(Versions::own("host-tests", ""));

/// The firmware that would be flashed. Built first if it is not there, like the others.
pub fn firmware() -> Vec<u8> {
    image("tsa-firmware.elf", &["xtask", "firmware"])
}

/// The same for a rig with another LVDT and a lower current limit, and its scene.
pub fn other_rig() -> (Vec<u8>, Scene) {
    let elf = image("other-rig/tsa-firmware.elf", &["xtask", "firmware", "--variant", "other-rig"]);
    let scene = Scene::load(root().join("target/firmware/other-rig/scene.toml"));
    (elf, scene.unwrap_or_else(|e| panic!("{e}")))
}

/// The image that tests a board without a rig.
pub fn selftest() -> Vec<u8> {
    image("tsa-selftest.elf", &["xtask", "selftest", "--emulated"])
}

fn image(name: &str, cargo: &[&str]) -> Vec<u8> {
    let path = root().join("target/firmware").join(name);
    if !path.exists() {
        let status = Command::new("cargo").args(cargo).current_dir(root()).status();
        assert!(status.is_ok_and(|s| s.success()), "`cargo {}` failed", cargo.join(" "));
    }
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The default scene with the drive on the serial line.
pub fn uart_scene() -> Scene {
    let mut scene = scene().clone();
    scene.rig.drive_transport = DriveTransport::Uart;
    scene
}

/// The control tick with most instructions, and what it came in.
#[derive(Clone, Debug, Default)]
pub struct LongestTick {
    /// Instructions.
    pub instructions: u64,
    /// Emulated time (s).
    pub t_s: f64,
    /// State before it.
    pub state: Option<State>,
    /// What was asked last.
    pub asked: Option<Request>,
}

/// A host on one side, the emulated board on the other.
pub struct Bench {
    /// The board with its rig.
    pub machine: Machine<EmulatedRig>,
    /// Every event so far.
    pub events: Vec<EventKind>,
    /// Replies that came, newest last.
    pub replies: Vec<(u16, Result<Accepted, Refusal>)>,
    /// Newest telemetry.
    pub last: Option<Telemetry>,
    /// What the board answered a greeting with.
    pub versions: Option<Versions>,
    /// What the board said it is.
    pub identity: Option<Identity>,
    /// Newest report of the settings.
    pub settings: Option<SettingsReport>,
    /// Newest answer to `ReadSensors`.
    pub sensors: Option<Sensors>,
    /// What the last homing found.
    pub found: Option<HomingResult>,
    /// True gap when homing ended (m).
    pub home_gap_m: Option<f64>,
    /// Whether heartbeats go out.
    pub heartbeat: bool,
    /// Telemetry frames so far.
    pub frames: u64,
    /// Longest control tick so far.
    pub longest_tick: LongestTick,
    /// Newest request, heartbeats aside.
    asked: Option<Request>,
    decoder: Decoder<Message>,
    damaged: usize,
    sequence: u16,
    steps: u64,
}

impl Bench {
    /// Boots a fresh board. Strict: anything that the real chip would not do stops it.
    pub fn new(keys: &[(&str, &str)], seed: u64) -> Self {
        Self::with(&firmware(), scene(), keys, seed)
    }

    /// The same with the drive on the serial line.
    pub fn over_uart(keys: &[(&str, &str)], seed: u64) -> Self {
        let elf = image("uart/tsa-firmware.elf", &["xtask", "firmware", "--variant", "uart"]);
        Self::with(&elf, &uart_scene(), keys, seed)
    }

    /// An image of one's own on the rig of a scene.
    pub fn with(elf: &[u8], scene: &Scene, keys: &[(&str, &str)], seed: u64) -> Self {
        Self::on(elf, scene, Config::default(), keys, seed)
    }

    /// The same on a chip of one's own.
    pub fn on(elf: &[u8], scene: &Scene, config: Config, keys: &[(&str, &str)], seed: u64) -> Self {
        let rig = EmulatedRig::new(scene, rig_plant::bench::settings(keys), seed).unwrap_or_else(|e| panic!("{e}"));
        Self::wired(elf, rig, config)
    }

    /// The same with a rig of one's own.
    pub fn wired(elf: &[u8], rig: EmulatedRig, config: Config) -> Self {
        let mut machine = Machine::new(elf, rig, config).unwrap_or_else(|e| panic!("{e}"));
        assert!(machine.watch_function("control_tick"), "the ELF has no control_tick");
        Self {
            machine,
            events: Vec::new(),
            replies: Vec::new(),
            last: None,
            versions: None,
            identity: None,
            settings: None,
            sensors: None,
            found: None,
            home_gap_m: None,
            heartbeat: true,
            frames: 0,
            longest_tick: LongestTick::default(),
            asked: None,
            decoder: Decoder::new(),
            damaged: 0,
            sequence: 0,
            steps: 0,
        }
    }

    /// Puts raw bytes on the host link.
    pub fn raw(&mut self, bytes: Vec<u8>) {
        self.machine.send(Stimulus::Uart { usart: 2, bytes });
    }

    /// Sends a request; its number.
    pub fn post(&mut self, request: &Request) -> u16 {
        self.sequence = self.sequence.wrapping_add(1);
        if !matches!(request, Request::Heartbeat) {
            self.asked = Some(*request);
        }
        // Numbers come round again: an answer of the last time is none.
        let number = self.sequence;
        self.replies.retain(|(to, _)| *to != number);
        let mut buffer = [0; rig_link::MAX_FRAME];
        let frame = encode(self.sequence, request, &mut buffer).expect("every request fits a frame").to_vec();
        self.raw(frame);
        self.sequence
    }

    /// 10 ms later.
    pub fn step(&mut self) {
        if self.heartbeat && self.steps.is_multiple_of(10) {
            self.post(&Request::Heartbeat);
        }
        self.steps += 1;
        let until = self.machine.now_s() + 0.01;
        self.machine.run_until(until).unwrap_or_else(|e| panic!("{e}"));
        self.machine.defmt_lines();
        let instructions = self.machine.tick_stats().instructions_max;
        if instructions > self.longest_tick.instructions {
            let (t_s, state, asked) = (self.machine.now_s(), self.last.map(|t| t.state), self.asked);
            self.longest_tick = LongestTick { instructions, t_s, state, asked };
        }
        for byte in self.machine.board_mut().take_host_bytes() {
            let Some(frame) = self.decoder.push(byte) else { continue };
            let Ok(frame) = frame else {
                self.damaged += 1;
                // A reset may cut one short; nothing else damages any.
                let resets = self.machine.stats().resets.len();
                assert!(self.damaged <= resets, "{} damaged frames from the board, {resets} resets", self.damaged);
                continue;
            };
            match frame.body {
                Message::Telemetry(telemetry) => {
                    self.last = Some(telemetry);
                    self.frames += 1;
                }
                Message::Identity(identity) => self.identity = Some(identity),
                Message::Hello(versions) => self.versions = Some(versions),
                Message::Reply { to, result } => self.replies.push((to, result)),
                Message::Settings(report) => self.settings = Some(report),
                Message::Sensors(sensors) => self.sensors = Some(sensors),
                Message::Event { kind, .. } => {
                    if let EventKind::Homed(found) = kind {
                        (self.found, self.home_gap_m) = (Some(found), Some(self.machine.board().truth().gap_m));
                    }
                    self.events.push(kind);
                }
            }
        }
    }

    /// For the given time (s).
    pub fn run(&mut self, seconds: f64) {
        self.until(seconds, |_| false);
    }

    /// Until `done`, at most the given number of seconds; whether it was done.
    pub fn until(&mut self, seconds: f64, mut done: impl FnMut(&Self) -> bool) -> bool {
        for _ in 0..(seconds * 100.0) as u64 {
            self.step();
            if done(self) {
                return true;
            }
        }
        false
    }

    /// What the rig is doing.
    pub fn state(&self) -> State {
        self.last.map_or(State::Boot, |t| t.state)
    }

    /// Sends a request and waits for its reply.
    pub fn ask(&mut self, request: &Request) -> Result<Accepted, Refusal> {
        let number = self.post(request);
        assert!(
            self.until(1.0, |b| b.replies.iter().any(|(to, _)| *to == number)),
            "no reply to {request:?}, resets {:?}",
            self.machine.stats().resets
        );
        self.replies.iter().find(|(to, _)| *to == number).expect("just seen").1
    }

    /// Sends a table and waits until the board uses it; whether it is in flash.
    ///
    /// # Errors
    /// The board's refusal.
    pub fn send_table(&mut self, table: &Table<'_>) -> Result<bool, TableRefusal> {
        let mut record = [0; RECORD_MAX];
        let length = table.write(&mut record).expect("small enough");
        self.send_record(&record[..length])
    }

    /// The same of any record.
    ///
    /// # Errors
    /// The board's refusal.
    pub fn send_record(&mut self, record: &[u8]) -> Result<bool, TableRefusal> {
        self.events.clear();
        for part in TablePart::of_record(record) {
            self.ask(&Request::TablePart(part)).expect("it is at rest");
        }
        let end = |e: &EventKind| match e {
            EventKind::TableStored { kept, .. } => Some(Ok(*kept)),
            EventKind::TableRefused(reason) => Some(Err(*reason)),
            _ => None,
        };
        self.until(5.0, |b| b.events.iter().any(|e| end(e).is_some()));
        let ended = self.events.iter().find_map(end).unwrap_or_else(|| panic!("no table: {:?}", self.events));
        self.run(0.1);
        ended
    }

    /// Greets after a start, again and again as the tool does: what comes before its UART is up, after 2 ms, or while a sector
    /// of its flash is erased, is lost, as on the real board.
    pub fn greet(&mut self) {
        self.run(0.05);
        let answered = (0..4).any(|_| {
            let number = self.post(&HELLO);
            self.until(0.5, |b| b.replies.iter().any(|(to, _)| *to == number))
        });
        assert!(answered, "not answered, resets {:?}", self.machine.stats().resets);
        self.ask(&HELLO).expect("same protocol");
    }

    /// Takes the power away for a moment.
    pub fn power_cycle(&mut self) {
        self.machine.board_mut().power_cycle();
        self.machine.power_cycle();
        (self.last, self.settings) = (None, None);
    }

    /// The settings as the board tells them.
    pub fn settings(&mut self) -> SettingsReport {
        self.settings = None;
        self.ask(&Request::GetSettings).expect("never refused");
        self.until(0.5, |b| b.settings.is_some());
        self.settings.expect("follows the reply")
    }

    /// Sets, and waits until it is in flash.
    pub fn set(&mut self, request: &Request) -> Result<Accepted, Refusal> {
        let reply = self.ask(request)?;
        let written = |b: &Self| b.settings.is_some_and(|s| matches!(s.kept, Kept::These));
        self.settings = None;
        assert!(self.until(2.0, written), "not kept: {:?}", self.settings);
        Ok(reply)
    }

    /// Mean of the gap that the LVDT shows (m).
    pub fn mean_gap_m(&mut self) -> f64 {
        let mut sum = 0.0;
        for _ in 0..25 {
            self.ask(&Request::ReadSensors).expect("never refused");
            self.step();
            sum += f64::from(self.sensors.and_then(|s| s.gap_m).expect("a healthy LVDT"));
        }
        sum / 25.0
    }

    /// Proves the directions of a rig at rest, so that a jog begins at once.
    pub fn prove(&mut self) {
        self.ask(&Request::CheckDirection).expect("idle");
        assert!(self.until(5.0, |b| b.state() == State::Unhomed), "{:?}", self.last);
    }

    /// Greets after a start and waits for the drive.
    pub fn ready(&mut self) {
        self.greet();
        assert!(self.until(6.0, |b| b.state() == State::Unhomed), "{:?} {:?}", self.last, self.events);
    }

    /// Greets, waits for the drive, homes; homing time (s).
    pub fn home(&mut self) -> f64 {
        self.ready();
        self.home_at_rest(&Request::HOME, "after the start")
    }

    /// Homes a rig that is at rest, with a request for it; homing time (s). `when` is part of the message where it fails.
    pub fn home_at_rest(&mut self, request: &Request, when: &str) -> f64 {
        let (start_s, truth) = (self.machine.now_s(), self.machine.board().truth());
        let what = format!("{when}, homed from {start_s:.2} s on, {truth:?}");
        self.play(request, 60.0, [State::Homing, State::Ready]).unwrap_or_else(|why| panic!("{what}: {why}"));
        self.machine.now_s() - start_s
    }

    /// Sends a request and waits as long as it is under way.
    ///
    /// # Errors
    /// In words, if it is refused or ends otherwise.
    fn play(&mut self, request: &Request, limit_s: f64, [under_way, done]: [State; 2]) -> Result<(), String> {
        self.ask(request).map_err(|refusal| format!("refused: {refusal}"))?;
        // The telemetry may still show the state before the request.
        self.until(0.5, |b| b.state() == under_way);
        self.until(limit_s, |b| b.state() != under_way);
        let (state, now_s) = (self.state(), self.machine.now_s());
        (state == done).then_some(()).ok_or_else(|| format!("{state} at {now_s:.2} s, {:?}", self.events.last()))
    }

    /// True position since homing (m).
    pub fn true_position_m(&self) -> f64 {
        self.home_gap_m.map_or(f64::NAN, |gap| gap - self.machine.board().truth().gap_m)
    }
}

impl TrialBench for Bench {
    fn rig(&mut self) -> &mut EmulatedRig {
        self.machine.board_mut()
    }

    fn true_position_m(&self) -> f64 {
        self.true_position_m()
    }

    fn telemetry(&self) -> Option<Telemetry> {
        self.last
    }

    fn run(&mut self, seconds: f64) {
        self.run(seconds);
    }

    fn reply(&mut self, request: Request) -> Option<Result<Accepted, Refusal>> {
        Some(self.ask(&request))
    }

    fn home(&mut self) -> Result<(), String> {
        if self.versions.is_none() {
            self.greet();
        }
        self.until(6.0, |b| b.state() != State::Boot);
        self.play(&Request::HOME, 60.0, [State::Homing, State::Ready])
    }

    fn move_to(&mut self, target_m: f32, speed_m_per_s: f32) -> Result<(), String> {
        let request = Request::Move { target_m, speed_m_per_s, load: LoadChoice::Auto };
        self.play(&request, 120.0, [State::Moving, State::Holding])
    }
}
