//! A conversation with a board, emulated or real.

use crate::errors::{broken, error, wrong};
use crate::locked;
use crate::motion::{LOOK, Motion};
use crate::tool::printed;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeWarning};
use pyo3::prelude::*;
use rig_link::{LoadChoice, Request};
use rig_plant::{PlantChange, PlantKey};
use rigctl::board_settings;
use rigctl::commands::{calibrate::Calibrate, config::Config, sweep::Sweep, *};
use rigctl::diagnosis::examine;
use rigctl::failure::Failure;
use rigctl::log::{Header, Recorder};
use rigctl::lvdt_points::Point;
use rigctl::out_file::OutFile;
use rigctl::output::Output;
use rigctl::plan::Plan;
use rigctl::session::row::{Entry, Row};
use rigctl::session::sim::SimOptions;
use rigctl::session::{Place, Session, Target, homing, motion, stream, table};
use rigctl::trajectory::Trajectory;
use serde_json::json;
use std::ffi::CString;
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

/// How long an emulated rig hangs at rest before a sweep (s).
const HUNG_S: f64 = 3.0;

/// A board and what it has told so far. One thread at a time talks to it; the rows can be read meanwhile.
#[pyclass(frozen)]
pub(crate) struct Board(Arc<Shared>);

pub(crate) struct Shared {
    talk: Mutex<Talk>,
    rows: Mutex<Vec<Row>>,
    /// Everything that passes.
    entries: Mutex<Receiver<Entry>>,
    /// Stops what goes on in the session.
    interrupt: Arc<AtomicBool>,
}

pub(crate) struct Talk {
    /// `None` after [`Board::close`].
    session: Option<Session>,
    target: Target,
}

/// As the tool prints it with `--json`.
fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(broken)
}

fn load_choice(load_n: Option<f64>) -> LoadChoice {
    load_n.map_or(LoadChoice::Auto, |load_n| LoadChoice::Known(load_n as f32))
}

impl Shared {
    /// Does something with the session.
    pub(crate) fn work<T>(&self, work: impl FnOnce(&mut Session, &Target) -> Result<T, Failure>) -> Result<T, Failure> {
        let Talk { session, target } = &mut *locked(&self.talk);
        let session = session.as_mut().ok_or_else(closed)?;
        // What ended an earlier motion does not end this one; a fault is latched, and refuses it.
        session.take_events();
        let result = work(session, target);
        session.take_rows();
        result
    }

    /// Does something with the session, without Python's lock. Ctrl-C stops the board first.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Session, &Target) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        let mut signalled = false;
        let result = py.detach(|| {
            let (done, end) = mpsc::channel();
            // Python's signals are this thread's, whatever the other one waits for.
            std::thread::scope(|scope| {
                scope.spawn(move || done.send(self.work(work)));
                loop {
                    match end.recv_timeout(LOOK) {
                        Ok(result) => return result,
                        Err(RecvTimeoutError::Disconnected) => return Err(Failure::failed("it has panicked")),
                        Err(RecvTimeoutError::Timeout) => {}
                    }
                    if Python::attach(|py| py.check_signals()).is_err() {
                        signalled = true;
                        self.interrupt.store(true, Ordering::Relaxed);
                    }
                }
            })
        });
        if signalled {
            // It may have ended before its next step.
            self.interrupt.store(false, Ordering::Relaxed);
            return Err(PyKeyboardInterrupt::new_err("the board was stopped"));
        }
        result.map_err(error)
    }

    /// Runs a command of the tool in the session; what it prints, one object a line.
    fn command(
        &self,
        py: Python<'_>,
        run: impl FnOnce(&mut Session, &Target, &mut Output) -> Result<(), Failure> + Send,
    ) -> PyResult<String> {
        self.with(py, |session, target| printed(|output| run(session, target, output)))
    }

    /// Stops what another thread does with the session, and waits for its end.
    pub(crate) fn alone(&self) -> MutexGuard<'_, Talk> {
        self.interrupt.store(true, Ordering::Relaxed);
        let talk = locked(&self.talk);
        self.interrupt.store(false, Ordering::Relaxed);
        talk
    }

    /// All rows so far.
    fn rows(&self) -> MutexGuard<'_, Vec<Row>> {
        let mut rows = locked(&self.rows);
        rows.extend(locked(&self.entries).try_iter().filter_map(|entry| match entry {
            Entry::Row(row) => Some(row),
            _ => None,
        }));
        rows
    }

    fn newest_s(&self) -> f64 {
        self.rows().last().map_or(0.0, |row| row.t_s)
    }
}

/// As [`Target::connect`], without a handler for Ctrl-C: Python has its own.
fn connect(target: &Target, any_table: bool) -> Result<Session, Failure> {
    let scene = rigctl::scene_file::load_rig(&target.scene)?;
    let mut session = target.open()?;
    session.greet()?;
    if !any_table {
        if target.emulated().is_some() && session.require_identity()?.scene_hash != scene.hash() {
            table::send(&mut session, &scene, &target.scene)?;
        }
        target.check_scene(&session)?;
    }
    session.wait_started()?;
    Ok(session)
}

/// A stop that the board has not acknowledged may not have arrived.
fn acknowledged(stopped: bool) -> Result<(), Failure> {
    if stopped {
        Ok(())
    } else {
        Err(Failure::of_kind("board-silent", "the board did NOT acknowledge the stop: it may still turn the motor"))
    }
}

fn closed() -> Failure {
    Failure::of_kind("closed", "the rig is closed")
}

/// Stops what moves.
pub(crate) fn stop(talk: &mut Talk) -> Result<(), Failure> {
    let session = talk.session.as_mut().ok_or_else(closed)?;
    acknowledged(session.stop()?)
}

/// A log that is being written.
#[pyclass(frozen)]
pub(crate) struct Recording {
    shared: Arc<Shared>,
    /// `None` after [`Recording::end`].
    recorder: Mutex<Option<Recorder<Box<dyn Write + Send>>>>,
}

#[pymethods]
impl Recording {
    /// Ends the log, which says what broke it off; that is then raised.
    fn end(&self, py: Python<'_>, broken_off: Option<String>) -> PyResult<String> {
        let recorder = locked(&self.recorder).take();
        json(&self.shared.with(py, |session, _| {
            let result = broken_off.map_or(Ok(()), |why| Err(Failure::failed(why)));
            let (ended, ()) = recorder.ok_or_else(closed)?.end(session, result)?;
            Ok(json!(ended))
        })?)
    }
}

#[pymethods]
impl Board {
    /// Connects: `sim` starts an emulated board whose programs are in a folder, anything else is a serial device. With `any_table`
    /// the board's table may be for another scene.
    #[new]
    #[pyo3(signature = (port, scene, rig, seed, plant, programs, flash, plant_scene, plant_program, any_table))]
    #[expect(clippy::too_many_arguments, reason = "those of `tsa_rig.Rig`")]
    fn new(
        py: Python<'_>,
        port: &str,
        scene: PathBuf,
        rig: &str,
        seed: u64,
        plant: Vec<String>,
        programs: Option<PathBuf>,
        flash: Option<PathBuf>,
        plant_scene: Option<PathBuf>,
        plant_program: Option<String>,
        any_table: bool,
    ) -> PyResult<Self> {
        let place = if port == "sim" {
            let emulated = SimOptions {
                rig: Some(rig.parse().map_err(|e| wrong(format!("rig: {e}")))?),
                plant: plant.iter().map(|change| change.parse()).collect::<Result<_, _>>().map_err(wrong)?,
                seed,
                programs,
                flash,
                plant_program,
                ..SimOptions::new(plant_scene.unwrap_or_else(|| scene.clone()))
            };
            Place::Emulated(Box::new(emulated))
        } else if port == "auto" {
            Place::Device(rigctl::session::auto().map_err(error)?)
        } else {
            Place::Device(port.to_owned())
        };
        let target = Target { scene, place };
        let mut session = py.detach(|| connect(&target, any_table)).map_err(error)?;
        if let Some(warning) = session.known_settings().and_then(board_settings::warning) {
            let text = CString::new(warning).map_err(broken)?;
            PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &text, 2)?;
        }
        let (interrupt, entries) = (session.interrupt(), Mutex::new(session.watch()));
        let talk = Mutex::new(Talk { session: Some(session), target });
        Ok(Self(Arc::new(Shared { talk, rows: Mutex::default(), entries, interrupt })))
    }

    fn home(&self, py: Python<'_>, load_n: Option<f64>) -> PyResult<String> {
        json(&self.0.with(py, |session, _| homing::home(session, load_choice(load_n), |_| {}))?)
    }

    fn move_to(&self, py: Python<'_>, target_m: f64, speed_m_per_s: f64, load_n: Option<f64>) -> PyResult<String> {
        let load = load_choice(load_n);
        json(&self.0.with(py, |session, _| motion::move_to(session, target_m, speed_m_per_s, load, |_| {}))?)
    }

    /// As [`Board::move_to`], led by another thread.
    fn begin_move(&self, py: Python<'_>, target_m: f64, speed_m_per_s: f64, load_n: Option<f64>) -> PyResult<Motion> {
        let load = load_choice(load_n);
        Motion::begin(py, &self.0, move |session| motion::move_to(session, target_m, speed_m_per_s, load, |_| {}))
    }

    fn track(
        &self,
        py: Python<'_>,
        times_s: Vec<f64>,
        positions_m: Vec<f64>,
        speeds_m_per_s: Option<Vec<f64>>,
    ) -> PyResult<String> {
        let trajectory = Trajectory::new(&times_s, &positions_m, speeds_m_per_s.as_deref());
        let trajectory = trajectory.map_err(wrong)?;
        json(&self.0.with(py, |session, target| {
            let scene = rigctl::scene_file::load(&target.scene)?;
            let (values, load_n) = (session.settings()?.values, session.newest_row()?.and_then(|row| row.load_n));
            let refused = |(k, why)| Failure::of_kind("refused", format!("point {k}: {why}"));
            Plan::new(&scene, values, load_n)?.check_trajectory(&trajectory).map_err(refused)?;
            stream::track(session, &trajectory, |_| {})
        })?)
    }

    fn jog(&self, py: Python<'_>, speed_rad_per_s: f64, seconds: f64) -> PyResult<()> {
        self.0.with(py, |session, _| motion::jog(session, speed_rad_per_s, seconds))
    }

    /// Lets time pass (s): that of the motion which another thread leads, and what is left of it after its end.
    fn wait(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let end_s = self.0.newest_s() + seconds;
        let mut was_led = false;
        while py.detach(|| self.0.talk.try_lock().is_err()) {
            was_led = true;
            if self.0.newest_s() >= end_s {
                return Ok(());
            }
            py.detach(|| std::thread::sleep(Duration::from_millis(1)));
            py.check_signals()?;
        }
        let seconds = if was_led { end_s - self.0.newest_s() } else { seconds };
        self.0.with(py, |session, _| session.until(seconds, |_| false).map(drop))
    }

    /// Also stops what another thread does.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| drop(self.0.alone()));
        self.0.with(py, |session, _| acknowledged(session.stop()?))
    }

    fn clear(&self, py: Python<'_>) -> PyResult<()> {
        self.0.with(py, |session, _| session.request(&Request::Clear).map(drop))
    }

    fn status(&self, py: Python<'_>) -> PyResult<String> {
        self.0.command(py, status::of)
    }

    fn doctor(&self, py: Python<'_>, turn: bool, home: bool) -> PyResult<String> {
        json(&self.0.with(py, |session, target| {
            let scene = rigctl::scene_file::load_rig(&target.scene)?;
            Ok(doctor::report(&examine(session, &scene, turn, home)?, target.port(), target.rig()))
        })?)
    }

    /// Begins a log of everything that passes.
    fn record(&self, py: Python<'_>, out: PathBuf) -> PyResult<Recording> {
        let recorder = self.0.with(py, |session, target| {
            let head = Header::new(target, session, "record")?;
            let passed = session.watch();
            Recorder::new(OutFile::new(&out)?.begin()?, &head, passed, session)
        })?;
        Ok(Recording { shared: self.0.clone(), recorder: Mutex::new(Some(recorder)) })
    }

    /// The paper's experiment. On an emulated rig the load is hung first.
    fn sweep(&self, py: Python<'_>, load_n: f64, turns: f64, speed_rad_per_s: f64, out: PathBuf) -> PyResult<String> {
        let sweep = Sweep { load: load_n, after: None, turns, speed: speed_rad_per_s, out };
        self.0.command(py, |session, target, output| {
            let out = OutFile::new(&sweep.out)?;
            let table = &session.require_identity()?.table;
            let is_covered = (f64::from(table.load_min_n)..=f64::from(table.load_max_n)).contains(&load_n);
            // A load that is not covered is refused below.
            if let Some(emulated) = session.emulated().filter(|_| is_covered) {
                emulated.plant(PlantChange { key: PlantKey::Load, value: load_n })?;
                session.until(HUNG_S, |_| false)?;
            }
            sweep::of(session, target, &sweep, out, false, output)
        })
    }

    #[pyo3(signature = (gap_m, point, points, gauge_error_m))]
    fn calibrate_lvdt(
        &self,
        py: Python<'_>,
        gap_m: Option<f64>,
        point: Option<(f64, f64)>,
        points: Option<PathBuf>,
        gauge_error_m: f64,
    ) -> PyResult<String> {
        let point = point.map(|(gap_m, sensor_m)| Point { gap_m, sensor_m });
        self.calibrate(py, &Calibrate::Lvdt { gap: gap_m, point, points, gauge_error: gauge_error_m, no_points: false })
    }

    fn calibrate_zero(&self, py: Python<'_>) -> PyResult<String> {
        self.calibrate(py, &Calibrate::Zero)
    }

    /// Sends the board the table of a scene, which is the session's from then on.
    fn make_table(&self, py: Python<'_>, scene: Option<PathBuf>) -> PyResult<String> {
        let scene = scene.unwrap_or_else(|| locked(&self.0.talk).target.scene.clone());
        let sent = self.0.with(py, |session, _| {
            let checked = rigctl::scene_file::load_rig(&scene)?;
            let sent = table::send(session, &checked, &scene)?;
            let metadata = sent.fit.table.metadata;
            Ok(json!({
                "scene_hash": format!("{:08x}", checked.hash()),
                "bytes": sent.fit.table.numbers.bytes(),
                "contraction_error_m": metadata.contraction_error_m,
                "tr_relative_error": metadata.tr_relative_error,
                "kept": sent.kept,
            }))
        })?;
        locked(&self.0.talk).target.scene = scene;
        json(&sent)
    }

    fn config_get(&self, py: Python<'_>, name: Option<&str>) -> PyResult<String> {
        let name = name.map(board_settings::named).transpose().map_err(wrong)?;
        self.config(py, &Config::Get { name })
    }

    fn config_set(&self, py: Python<'_>, name: &str, value: String) -> PyResult<String> {
        let name = board_settings::named(name).map_err(wrong)?;
        self.config(py, &Config::Set { name, value })
    }

    fn config_backup(&self, py: Python<'_>, file: PathBuf) -> PyResult<String> {
        self.config(py, &Config::Backup { file })
    }

    fn config_restore(&self, py: Python<'_>, file: PathBuf, force: bool) -> PyResult<String> {
        self.config(py, &Config::Restore { file, force })
    }

    /// Changes an emulated rig (`load=0.5kg`).
    fn plant(&self, py: Python<'_>, change: &str) -> PyResult<()> {
        let change = change.parse().map_err(|e: rig_plant::PlantError| wrong(e))?;
        self.0.with(py, |session, _| match session.emulated() {
            Some(emulated) => emulated.plant(change),
            None => Err(Failure::Usage("only an emulated rig has a plant to change".into())),
        })
    }

    /// Telemetry since the connection, from the row of this number on, one JSON object a row.
    fn rows(&self, from: usize) -> PyResult<String> {
        json(&self.0.rows().get(from..).unwrap_or_default())
    }

    /// Stops what moves and ends the conversation.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let stopped = py.detach(|| {
            let mut talk = self.0.alone();
            if talk.session.is_none() {
                return Ok(());
            }
            let stopped = stop(&mut talk);
            talk.session = None;
            stopped
        });
        stopped.map_err(error)
    }
}

impl Board {
    fn calibrate(&self, py: Python<'_>, what: &Calibrate) -> PyResult<String> {
        self.0.command(py, |session, target, output| {
            let scene = rigctl::scene_file::load(&target.scene)?;
            calibrate::of(session, &scene.rig, what, true, output)
        })
    }

    fn config(&self, py: Python<'_>, what: &Config) -> PyResult<String> {
        self.0.command(py, |session, _, output| config::of(session, what, true, output))
    }
}
