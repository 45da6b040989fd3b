//! The emulated board on the other end of the pseudo-terminal.

use super::{SCENE, said};
use rig_plant::RigPreset;
use rigctl::session::sim::{Sim, SimOptions};
use rigctl::session::{Port, Truth};
use serialport::{SerialPort, TTYPort};
use std::io::{Read, Write};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Slice of time (s) that the board runs at once.
const SLICE_S: f64 = 0.01;
/// Maximum of lost real time that the board catches up; for a tool that runs it waits all the same.
const LATE: Duration = Duration::from_millis(100);
/// Emulated time (s) without a byte of a tool that runs, after which the board waits: the tool beats every 0.1 s, so
/// it is this machine that has kept it from running.
const WAIT_S: f64 = 0.2;
/// When the drive has started, emulated (s).
const STARTED_S: f64 = 4.0;
/// Longest wait for what a rig does within seconds: on a busy machine the board falls behind.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// The tool, which bears that this machine delivers late.
pub fn rigctl() -> Command {
    patient(Command::new(env!("CARGO_BIN_EXE_rigctl")))
}

pub fn patient(mut tool: Command) -> Command {
    tool.env("RIGCTL_SILENT_S", "5");
    tool
}

/// The board that a test has handed on to the next one: started, not homed, at rest and without a fault.
static HANDED_ON: Mutex<Option<Board>> = Mutex::new(None);

/// A test on a board that has started, which it may hand on. One at a time: several boards on a busy machine would keep each
/// other from running in real time.
pub fn on_a_board(test: impl FnOnce(Board) -> Option<Board>) {
    // A test that fails takes its board along.
    let mut handed_on = HANDED_ON.lock().unwrap_or_else(PoisonError::into_inner);
    let board = handed_on.take().unwrap_or_else(Board::new);
    board.wait("the drive's start", |truth| truth.t_s > STARTED_S);
    *handed_on = test(board);
}

/// What is broken of a line that stays open, and whether the board is to lose its power for a moment.
#[derive(Default)]
struct Wires {
    to_board: AtomicBool,
    from_board: AtomicBool,
    power_cycle: AtomicBool,
}

/// An emulated board behind a device name, until it is dropped.
pub struct Board {
    pub device: String,
    stop: Arc<AtomicBool>,
    /// A tool runs.
    pub met: Arc<AtomicBool>,
    /// The rig as it is now.
    truth: Arc<Mutex<Option<Truth>>>,
    wires: Arc<Wires>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Board {
    fn new() -> Self {
        let (mut master, slave) = TTYPort::pair().expect("a pseudo-terminal");
        master.set_timeout(Duration::from_millis(1)).expect("a time-out");
        let device = slave.name().expect("a name");
        // It is locked while it is open; between two calls of the tool nobody listens.
        drop(slave);
        let stop = Arc::new(AtomicBool::new(false));
        let met = Arc::new(AtomicBool::new(false));
        let truth = Arc::new(Mutex::new(None));
        let (seen, heard, told) = (Arc::clone(&stop), Arc::clone(&met), Arc::clone(&truth));
        let wires = Arc::new(Wires::default());
        let broken = Arc::clone(&wires);
        let thread = std::thread::spawn(move || {
            let options = SimOptions { rig: Some(RigPreset::Ideal), ..SimOptions::new(SCENE.into()) };
            let mut board = Sim::start(&options).unwrap_or_else(|e| panic!("{:?}", e.message()));
            let (mut buffer, mut heard_s, mut due) = ([0; 512], 0.0, Instant::now());
            while !seen.load(Ordering::Relaxed) {
                let count = master.read(&mut buffer).unwrap_or(0);
                if count > 0 || !heard.load(Ordering::Relaxed) {
                    heard_s = board.now_s();
                } else if board.now_s() > heard_s + WAIT_S {
                    continue;
                }
                if broken.power_cycle.swap(false, Ordering::Relaxed) {
                    board.power_cycle().unwrap_or_else(|e| panic!("{:?}", e.message()));
                }
                let arrives = if broken.to_board.load(Ordering::Relaxed) { 0 } else { count };
                let answer = board.pass(&buffer[..arrives], SLICE_S).unwrap_or_else(|e| panic!("{:?}", e.message()));
                if let Some(last) = answer.truth.last() {
                    *told.lock().expect("nobody panics with it") = Some(*last);
                }
                // A line that nobody reads is full at some time: what does not fit is lost, as on a wire.
                if !broken.from_board.load(Ordering::Relaxed) {
                    let _ = master.write_all(&answer.uart);
                }
                let now = Instant::now();
                due = (due + Duration::from_secs_f64(SLICE_S)).max(now - LATE);
                std::thread::sleep(due.saturating_duration_since(now));
            }
        });
        Self { device, stop, met, truth, wires, thread: Some(thread) }
    }

    /// Breaks the wires from and to the board, or mends them. The line stays open.
    pub fn breaks(&self, from_board: bool, to_board: bool) {
        self.wires.from_board.store(from_board, Ordering::Relaxed);
        self.wires.to_board.store(to_board, Ordering::Relaxed);
    }

    /// Takes the board's power away for a moment.
    pub fn power_cycle(&self) {
        self.wires.power_cycle.store(true, Ordering::Relaxed);
    }

    /// Starts the tool, which turns the strings, and waits for a turn of one radian.
    pub fn turning(&self, arguments: &[&str]) -> Child {
        let before = self.now();
        let mut tool = rigctl();
        tool.args(["--port", &self.device, "--scene", SCENE]).args(arguments);
        self.met.store(true, Ordering::Relaxed);
        let mut tool = tool.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("rigctl runs");
        let mut ended = false;
        self.wait("a turn", |truth| {
            ended |= tool.try_wait().is_ok_and(|status| status.is_some());
            ended || (truth.twist_rad - before.twist_rad).abs() > 1.0
        });
        if ended {
            panic!("the tool ended before a turn: {}", said(&tool.wait_with_output().expect("it has ended")));
        }
        tool
    }

    /// The output of a tool that ends by itself. Its board then goes on alone.
    pub fn end_of(&self, tool: Child) -> Output {
        let ended = tool.wait_with_output().expect("it ends");
        self.met.store(false, Ordering::Relaxed);
        ended
    }

    /// The rig stands still, some time after the present one.
    pub fn stands(&self) {
        let now = self.now();
        let stopped = self.wait("the stop", |truth| truth.t_s > now.t_s + 2.0);
        let later = self.wait("a later time", |truth| truth.t_s > stopped.t_s + 1.0);
        let [stopped_rad, later_rad] = [stopped, later].map(|truth| truth.twist_rad);
        assert!((later_rad - stopped_rad).abs() < 0.01, "{stopped_rad} rad, {later_rad} rad");
    }

    /// Waits for the rig, and tells how it then is.
    pub fn wait(&self, what: &str, mut reached: impl FnMut(&Truth) -> bool) -> Truth {
        let end = Instant::now() + PATIENCE;
        loop {
            let truth = *self.truth.lock().expect("the board runs");
            match truth {
                Some(truth) if reached(&truth) => return truth,
                truth => assert!(Instant::now() < end, "{what} not within {PATIENCE:?}: {truth:?}"),
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// The rig as it is now.
    pub fn now(&self) -> Truth {
        self.wait("a time", |_| true)
    }

    pub fn rigctl(&self, arguments: &[&str]) -> Output {
        self.timed(arguments).0
    }

    /// Runs the tool, and tells how long that took the board (s).
    pub fn timed(&self, arguments: &[&str]) -> (Output, f64) {
        let mut command = rigctl();
        command.args(["--json", "--port", &self.device]).args(arguments);
        self.met.store(true, Ordering::Relaxed);
        let before_s = self.now().t_s;
        let output = command.output().expect("rigctl runs");
        // The board still waits for a tool, so that its time does not go on while this machine does something else.
        let took_s = self.now().t_s - before_s;
        self.met.store(false, Ordering::Relaxed);
        (output, took_s)
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(std::thread::JoinHandle::join);
    }
}
