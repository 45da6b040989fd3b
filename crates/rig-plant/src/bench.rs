//! The control code and the rig in one process, without the emulated chip: [`ControlBench`] plays the microcontroller.
//! It is hundreds of times faster than the whole board, for scenarios by the dozen. The chip's share (drivers, interrupts,
//! timing) is tested with the ELF on the emulated board.

use crate::board::{Board, CanFrame, Stimulus};
use crate::rig::EmulatedRig;
use crate::{PlantSettings, Truth};
use rig_config::Scene;
use rig_control::observer::SETTLED_TICKS;
use rig_control::sensors::EncoderCount;
use rig_control::{Controller, DriveCommand, DriveReading, Inputs, LvdtBlock, Outputs, RigConstants, TICK_S};
use rig_link::messages::{EventKind, HomingFailure, HomingResult, LoadChoice, Request, State, Telemetry};
use rmds405::{Address, Conversation, Received, Report};
use std::collections::VecDeque;
use std::sync::{Arc, OnceLock};
use tsa_table::Table;
use tsa_table::fit::OwnedTable;

/// The default scene.
pub fn scene() -> &'static Scene {
    static SCENE: OnceLock<Scene> = OnceLock::new();
    SCENE.get_or_init(|| {
        Scene::from_toml_str(include_str!("../../../scenes/default.toml")).expect("the default scene is good")
    })
}

/// Its table, as the firmware has it.
pub fn table() -> &'static Table<'static> {
    static OWNED: OnceLock<OwnedTable> = OnceLock::new();
    static TABLE: OnceLock<Table<'static>> = OnceLock::new();
    TABLE
        .get_or_init(|| OWNED.get_or_init(|| scene().fit_table().expect("the default scene has a table").table).table())
}

/// The rig's constants, as the build script derives them.
pub fn constants() -> RigConstants {
    scene().constants()
}

/// Control code of the default scene that has just booted.
pub fn booted() -> Controller {
    Controller::new(table(), constants(), None)
}

/// The rig with these plant keys.
///
/// # Panics
/// If there is no such rig.
pub fn settings(keys: &[(&str, &str)]) -> PlantSettings {
    let mut settings = PlantSettings::default();
    for (key, value) in keys {
        settings.set(key, value).unwrap_or_else(|e| panic!("{e}"));
    }
    settings
}

/// Longest start of the drive (s), longest homing (s), longest move beyond what distance and speed need (s).
const START_S: f64 = 10.0;
const HOMING_S: f64 = 120.0;
const MOVE_SLACK_S: f64 = 60.0;
/// What is said of a drive that does not report.
const NO_START: &str = "the drive does not start: is it powered, is the bus wired?";

/// Samples of one LVDT block, and the time between two of them, as on the board.
const BLOCK: usize = 256;
const SAMPLE_S: f64 = 492.0 / 21e6;

/// What decides about the rig, once a tick: the firmware's control code, or something to hold it against.
pub trait ControlLaw {
    /// What it decided.
    type Decision: Clone;

    /// One tick.
    fn step(&mut self, inputs: &Inputs) -> Self::Decision;

    /// What the drive is told.
    fn drive(decision: &Self::Decision) -> DriveCommand;

    /// What ended or went wrong.
    fn events(_decision: &Self::Decision) -> &[EventKind] {
        &[]
    }
}

impl ControlLaw for Controller {
    type Decision = Outputs;

    fn step(&mut self, inputs: &Inputs) -> Outputs {
        Controller::step(self, inputs)
    }

    fn drive(decision: &Outputs) -> DriveCommand {
        decision.drive
    }

    fn events(decision: &Outputs) -> &[EventKind] {
        &decision.events
    }
}

/// What comes between the rig and what the controller sees of it.
pub type Tamper = Arc<dyn Fn(&mut Inputs) + Send + Sync>;

/// A controller wired to an emulated rig.
#[derive(Clone)]
pub struct ControlBench<C: ControlLaw = Controller> {
    /// The rig.
    pub rig: EmulatedRig,
    /// The controller.
    pub control: C,
    /// What the last tick decided.
    pub last: Option<C::Decision>,
    /// Every event so far, with its time (s).
    pub events: Vec<(f64, EventKind)>,
    /// What the last homing found.
    pub found: Option<HomingResult>,
    /// Why the last homing failed, until the next one begins.
    pub homing_failure: Option<HomingFailure>,
    /// Mean true gap over the ticks from which homing took its reference (m).
    pub home_gap_m: Option<f64>,
    /// Whether the host sends heartbeats.
    pub host_alive: bool,
    /// Changes what the controller sees, each tick.
    pub tamper: Option<Tamper>,
    time_s: f64,
    next_sample_s: f64,
    codes: Vec<u16>,
    block: Option<LvdtBlock>,
    encoder: EncoderCount,
    drive: Conversation,
    address: Address,
    estop: bool,
    limits_open: [bool; 2],
    heard_us: Option<u64>,
    /// True gaps of the last ticks (m).
    gaps_m: VecDeque<f64>,
}

impl ControlBench {
    /// A rig with these plant keys, and control code that has just booted.
    pub fn new(keys: &[(&str, &str)], seed: u64) -> Self {
        Self::with(scene(), booted(), keys, seed)
    }
}

impl<C: ControlLaw> ControlBench<C> {
    /// The rig of a scene with these plant keys, under a controller.
    pub fn with(scene: &Scene, control: C, keys: &[(&str, &str)], seed: u64) -> Self {
        Self::on(EmulatedRig::new(scene, settings(keys), seed).unwrap_or_else(|e| panic!("{e}")), control)
    }

    /// A controller on a rig that has just been switched on.
    pub fn on(mut rig: EmulatedRig, control: C) -> Self {
        let encoder = EncoderCount::new(rig.quadrature(0.0, 3) as u16);
        let parameters = rig.parameters();
        let address = Address::new(parameters.drive_group, parameters.drive_number).expect("the rig was checked");
        let drive = Conversation::new(address, parameters.supply_divider.map(|divider| divider as f32));
        Self {
            rig,
            control,
            last: None,
            events: Vec::new(),
            found: None,
            homing_failure: None,
            home_gap_m: None,
            host_alive: true,
            tamper: None,
            time_s: 0.0,
            next_sample_s: SAMPLE_S,
            codes: Vec::with_capacity(BLOCK),
            block: None,
            encoder,
            drive,
            address,
            estop: false,
            limits_open: [false; 2],
            heard_us: None,
            gaps_m: VecDeque::new(),
        }
    }

    /// Emulated time (s).
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// What really is.
    pub fn truth(&self) -> Truth {
        self.rig.truth()
    }

    /// True position since homing (m).
    pub fn true_position_m(&self) -> f64 {
        self.home_gap_m.map_or(f64::NAN, |gap| gap - self.rig.truth().gap_m)
    }

    fn send(&mut self, frame: Option<rmds405::Frame>) {
        let Some(frame) = frame else { return };
        let frame = CanFrame { id: u32::from(frame.id), extended: false, remote: false, dlc: 8, data: frame.data };
        self.rig.can_tx(self.time_s, &frame);
    }

    /// As the drive's task does it: motor power after the frame.
    fn switch_motor_power(&mut self) {
        self.rig.gpio_out(self.time_s, 'B', u16::from(self.drive.motor_power()) << 10);
    }

    /// One control tick later.
    pub fn tick(&mut self, request: Option<Request>) -> C::Decision {
        self.time_s = ((self.time_s / f64::from(TICK_S)).round() + 1.0) * 0.01;
        while self.next_sample_s <= self.time_s {
            self.codes.push(self.rig.adc(self.next_sample_s, 0));
            if self.codes.len() == BLOCK {
                self.block = LvdtBlock::from_codes((self.next_sample_s * 1e6) as u64, &self.codes);
                self.codes.clear();
            }
            self.next_sample_s += SAMPLE_S;
        }
        for stimulus in self.rig.poll(self.time_s) {
            match stimulus {
                Stimulus::Can(frame) => {
                    let received = Received { id: frame.id, extended: false, remote: false, data: &frame.data };
                    if let Ok(report) = Report::decode(self.address, &received) {
                        let frame = self.drive.hear((self.time_s * 1e6) as u64, report);
                        self.send(frame);
                    }
                }
                Stimulus::Pin { port: 'B', pin: 5, high } => self.estop = high,
                Stimulus::Pin { port: 'A', pin: 8, high } => self.limits_open[0] = high,
                Stimulus::Pin { port: 'C', pin: 7, high } => self.limits_open[1] = high,
                _ => {}
            }
        }
        let now_us = (self.time_s * 1e6).round() as u64;
        let frame = self.drive.tick(now_us);
        self.send(frame);
        self.switch_motor_power();
        if self.host_alive && now_us.is_multiple_of(100_000) {
            self.heard_us = Some(now_us);
        }
        let raw = self.rig.quadrature(self.time_s, 3) as u16;
        let mut inputs = Inputs {
            now_us,
            encoder_counts: self.encoder.update(raw),
            lvdt: self.block,
            drive: self.drive.reading(),
            drive_stalled: self.drive.take_stall(),
            // No controller to leave the bus: that needs the chip.
            bus_off: false,
            supply: self.drive.supply(),
            upper_limit_open: self.limits_open[0],
            lower_limit_open: self.limits_open[1],
            estop_open: self.estop,
            host_heard_us: self.heard_us,
            request,
        };
        if let Some(tamper) = &self.tamper {
            tamper(&mut inputs);
        }
        let decision = self.control.step(&inputs);
        self.gaps_m.push_back(self.rig.truth().gap_m);
        if self.gaps_m.len() > usize::from(SETTLED_TICKS) {
            self.gaps_m.pop_front();
        }
        let frame = self.drive.command(now_us, C::drive(&decision)).expect("limits from the scene");
        self.send(frame);
        self.switch_motor_power();
        for kind in C::events(&decision) {
            match kind {
                EventKind::Homed(found) => {
                    let mean_m = self.gaps_m.iter().sum::<f64>() / self.gaps_m.len() as f64;
                    (self.found, self.home_gap_m) = (Some(*found), Some(mean_m));
                }
                EventKind::HomingRefused(failure) => self.homing_failure = Some(*failure),
                _ => {}
            }
            self.events.push((self.time_s, *kind));
        }
        self.last = Some(decision.clone());
        decision
    }

    /// Ticks until `done` or `limit_s` more seconds; whether it was done.
    pub fn until(&mut self, limit_s: f64, mut done: impl FnMut(&Self) -> bool) -> bool {
        let end = self.time_s + limit_s;
        while self.time_s < end {
            self.tick(None);
            if done(self) {
                return true;
            }
        }
        false
    }

    /// For the given time (s), looked at after each tick.
    pub fn watch(&mut self, seconds: f64, mut look: impl FnMut(&Self)) {
        self.until(seconds, |bench| {
            look(bench);
            false
        });
    }

    /// For the given time (s).
    pub fn run(&mut self, seconds: f64) {
        self.watch(seconds, |_| {});
    }
}

/// How far (rad of the motor) a target of [`MotorSpeed`] may lead the shaft: at standstill, and further by the way of this time (s).
const LEAD_RAD: f64 = 1.0;
const LEAD_S: f64 = 0.1;

/// No control code: the motor turns at a speed, with a current limit. The drive gets what the control code would send for it, a
/// position that moves on in every tick.
#[derive(Clone, Debug)]
pub struct MotorSpeed {
    /// Wanted speed of the motor shaft (rad/s).
    pub speed_rad_per_s: f64,
    /// Maximum current (A).
    pub current_a: f64,
    counts_per_rad: f64,
    /// Where the shaft is to be (drive counts); `None` until the drive reports.
    position_qc: Option<f64>,
    asked: bool,
}

/// One tick of [`MotorSpeed`].
#[derive(Clone, Copy, Debug)]
pub struct MotorTick {
    /// For the drive.
    pub drive: DriveCommand,
    /// What the sensors showed.
    pub inputs: Inputs,
}

impl MotorSpeed {
    /// At standstill, with the rig's own current limit.
    pub fn of(rig: &EmulatedRig) -> Self {
        let parameters = rig.parameters();
        Self {
            speed_rad_per_s: 0.0,
            current_a: parameters.drive_current_limit_a,
            counts_per_rad: parameters.counts_per_rad() / parameters.gear(),
            position_qc: None,
            asked: false,
        }
    }

    fn command(&mut self, drive: DriveReading) -> DriveCommand {
        let DriveReading::Reports { position_qc, .. } = drive else {
            self.position_qc = None;
            let first = !std::mem::replace(&mut self.asked, true);
            return if first || drive == DriveReading::Failed { DriveCommand::Restart } else { DriveCommand::Silence };
        };
        let (here, speed) = (f64::from(position_qc), self.speed_rad_per_s);
        let lead = (LEAD_RAD + LEAD_S * speed.abs()) * self.counts_per_rad.abs();
        let next = self.position_qc.unwrap_or(here) + speed * f64::from(TICK_S) * self.counts_per_rad;
        let position = next.clamp(here - lead, here + lead);
        self.position_qc = Some(position);
        // Room to catch up, as the control code gives it.
        let rpm = (1.3 * speed.abs() + LEAD_RAD / LEAD_S) * 60.0 / std::f64::consts::TAU;
        DriveCommand::Follow {
            position_qc: position as i32,
            speed_limit_rpm: rpm as i16,
            current_limit_ma: (1e3 * self.current_a) as i16,
        }
    }
}

impl ControlBench<MotorSpeed> {
    /// Waits until the drive reports.
    ///
    /// # Errors
    /// In words, if it does not.
    pub fn start(&mut self) -> Result<(), String> {
        let reports = |last: &MotorTick| matches!(last.inputs.drive, DriveReading::Reports { .. });
        let started = self.until(START_S, |b| b.last.as_ref().is_some_and(reports));
        started.then_some(()).ok_or_else(|| NO_START.into())
    }
}

impl ControlLaw for MotorSpeed {
    type Decision = MotorTick;

    fn step(&mut self, inputs: &Inputs) -> MotorTick {
        MotorTick { drive: self.command(inputs.drive), inputs: *inputs }
    }

    fn drive(decision: &MotorTick) -> DriveCommand {
        decision.drive
    }
}

impl ControlBench {
    /// Proves the directions of a rig at rest, so that a jog begins at once.
    ///
    /// # Panics
    /// If they are wrong.
    pub fn prove(&mut self) {
        self.tick(Some(Request::CheckDirection));
        assert!(self.until(5.0, |d| d.control.state() == State::Unhomed), "{:?}", self.control.fault());
    }

    /// What the last tick told the host.
    pub fn telemetry(&self) -> Option<Telemetry> {
        self.last.as_ref().map(|last| last.telemetry)
    }

    /// Asks for something, which takes a tick.
    ///
    /// # Errors
    /// The refusal, in words.
    pub fn ask(&mut self, request: Request) -> Result<(), String> {
        match self.tick(Some(request)).reply {
            Some(Ok(_)) => Ok(()),
            Some(Err(refusal)) => Err(format!("refused: {refusal}")),
            None => Err("no answer".into()),
        }
    }

    /// Waits for the drive after its start.
    ///
    /// # Errors
    /// In words, if it does not report.
    pub fn ready(&mut self) -> Result<(), String> {
        let starts = |d: &Self| d.control.state() == State::Boot;
        let started = !starts(self) || self.until(START_S, |d| !starts(d));
        started.then_some(()).ok_or_else(|| NO_START.into())
    }

    /// Waits for the drive, homes; homing time (s) or how it failed.
    ///
    /// # Errors
    /// In words.
    pub fn home(&mut self) -> Result<f64, String> {
        self.home_under(LoadChoice::Auto)
    }

    /// The same under a load that somebody has weighed.
    ///
    /// # Errors
    /// In words.
    pub fn home_under(&mut self, load: LoadChoice) -> Result<f64, String> {
        self.ready()?;
        self.play(Request::Home { load }, HOMING_S, [State::Homing, State::Ready], "while homing")
    }

    /// Moves and waits until the load stands; time taken (s) or how it failed.
    ///
    /// # Errors
    /// In words.
    pub fn move_to(&mut self, target_m: f32, speed_m_per_s: f32, load: LoadChoice) -> Result<f64, String> {
        let from_m = self.telemetry().and_then(|t| t.position_m).unwrap_or(target_m);
        // A heavy load may be slower than requested, because the motor has its own limit.
        let limit_s = 4.0 * f64::from((target_m - from_m).abs() / speed_m_per_s.abs().clamp(1e-6, 1e-3)) + MOVE_SLACK_S;
        let request = Request::Move { target_m, speed_m_per_s, load };
        self.play(request, limit_s, [State::Moving, State::Holding], "on the way")
    }

    /// Asks for something and waits as long as it is under way; the time it took (s), or how it failed.
    fn play(&mut self, request: Request, limit_s: f64, states: [State; 2], when: &str) -> Result<f64, String> {
        let [under_way, done] = states;
        let start_s = self.time_s;
        self.ask(request)?;
        // A new homing forgets why the last one failed; a move begins on a homed rig only, where none has.
        self.homing_failure = None;
        self.until(limit_s, |d| d.control.state() != under_way);
        match (self.control.state(), self.control.fault(), self.homing_failure) {
            (state, ..) if state == done => Ok(self.time_s - start_s),
            (.., Some(failure)) => Err(format!("homing failed: {failure}")),
            (State::Fault, Some(fault), _) => Err(format!("fault {fault} {when}")),
            (State::EStop, ..) => Err(format!("emergency stop {when}")),
            (state, ..) => Err(format!("{state} {when}")),
        }
    }
}

#[cfg(test)]
pub(crate) fn address() -> Address {
    Address::new(scene().rig.drive_group, scene().rig.drive_number).expect("the scene was checked")
}
