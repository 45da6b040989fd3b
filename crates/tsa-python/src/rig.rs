//! A conversation with a board, emulated or real.

use crate::tool::error;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyRuntimeWarning, PyValueError};
use pyo3::prelude::*;
use rig_link::{LoadChoice, Request};
use rigctl::board_settings;
use rigctl::failure::Failure;
use rigctl::session::row::Row;
use rigctl::session::sim::SimOptions;
use rigctl::session::{Place, Session, Target, homing, interrupt, motion, stream};
use rigctl::trajectory::Trajectory;
use std::ffi::CString;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A board and what it has told so far. One thread at a time talks to it.
#[pyclass(frozen)]
pub(crate) struct Board(Mutex<Talk>);

struct Talk {
    /// `None` after [`Board::close`].
    session: Option<Session>,
    rows: Vec<Row>,
}

/// As the tool prints it with `--json`.
fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|e| PyRuntimeError::new_err(e.to_string()))
}

fn load_choice(load_n: Option<f64>) -> LoadChoice {
    load_n.map_or(LoadChoice::Auto, |load_n| LoadChoice::Known(load_n as f32))
}

impl Board {
    fn talk(&self) -> MutexGuard<'_, Talk> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does something with the session, without Python's lock. Ctrl-C stops the board first.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Session, &mut dyn FnMut(&Row)) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        let result = py.detach(|| {
            let Talk { session, rows } = &mut *self.talk();
            let session = session.as_mut().ok_or_else(|| Failure::failed("the rig is closed"))?;
            let mut each = |row: &Row| {
                rows.push(row.clone());
                if Python::attach(|py| py.check_signals()).is_err() {
                    interrupt::ask();
                }
            };
            // What ended an earlier motion does not end this one; a fault is latched, and refuses it.
            session.take_events();
            let result = work(session, &mut each);
            session.take_rows().iter().for_each(&mut each);
            result
        });
        if interrupt::wanted() {
            interrupt::forget();
            return Err(PyKeyboardInterrupt::new_err("the board was stopped"));
        }
        result.map_err(error)
    }
}

/// As [`Target::connect`], without a handler for Ctrl-C: Python has its own.
fn connect(target: &Target) -> Result<Session, Failure> {
    rigctl::scene_file::load_rig(&target.scene)?;
    let mut session = target.open()?;
    session.greet()?;
    target.check_scene(&session)?;
    session.wait_started()?;
    Ok(session)
}

/// A stop that the board has not acknowledged may not have arrived.
fn acknowledged(stopped: bool) -> Result<(), Failure> {
    if stopped {
        Ok(())
    } else {
        Err(Failure::failed("the board did NOT acknowledge the stop: it may still turn the motor"))
    }
}

#[pymethods]
impl Board {
    /// Connects: `sim` starts an emulated board whose programs are in a folder, anything else is a serial device.
    #[new]
    #[pyo3(signature = (port, scene, rig, seed, plant, programs))]
    fn new(
        py: Python<'_>,
        port: &str,
        scene: PathBuf,
        rig: &str,
        seed: u64,
        plant: Vec<String>,
        programs: Option<PathBuf>,
    ) -> PyResult<Self> {
        let wrong = |e: &dyn std::fmt::Display| PyValueError::new_err(e.to_string());
        let place = if port == "sim" {
            let emulated = SimOptions {
                rig: Some(rig.parse().map_err(|e| wrong(&e))?),
                plant: plant.iter().map(|change| change.parse()).collect::<Result<_, _>>().map_err(|e| wrong(&e))?,
                seed,
                programs,
                ..SimOptions::new(scene.clone())
            };
            Place::Emulated(Box::new(emulated))
        } else if port == "auto" {
            Place::Device(rigctl::session::auto().map_err(error)?)
        } else {
            Place::Device(port.to_owned())
        };
        let session = py.detach(|| connect(&Target { scene, place })).map_err(error)?;
        if let Some(warning) = session.known_settings().and_then(board_settings::warning) {
            let text = CString::new(warning).map_err(|e| wrong(&e))?;
            PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &text, 2)?;
        }
        Ok(Self(Mutex::new(Talk { session: Some(session), rows: Vec::new() })))
    }

    fn home(&self, py: Python<'_>, load_n: Option<f64>) -> PyResult<String> {
        json(&self.with(py, |session, each| homing::home(session, load_choice(load_n), each))?)
    }

    fn move_to(&self, py: Python<'_>, target_m: f64, speed_m_per_s: f64, load_n: Option<f64>) -> PyResult<String> {
        let load = load_choice(load_n);
        json(&self.with(py, |session, each| motion::move_to(session, target_m, speed_m_per_s, load, each))?)
    }

    fn track(
        &self,
        py: Python<'_>,
        times_s: Vec<f64>,
        positions_m: Vec<f64>,
        speeds_m_per_s: Option<Vec<f64>>,
    ) -> PyResult<String> {
        let trajectory = Trajectory::new(&times_s, &positions_m, speeds_m_per_s.as_deref());
        let trajectory = trajectory.map_err(PyValueError::new_err)?;
        json(&self.with(py, |session, each| stream::track(session, &trajectory, each))?)
    }

    /// Lets time pass (s).
    fn wait(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        self.with(py, |session, each| {
            let end_s = session.now_s() + seconds;
            while session.now_s() < end_s {
                session.step()?;
                session.take_rows().iter().for_each(&mut *each);
            }
            Ok(())
        })
    }

    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |session, _| acknowledged(session.stop()?))
    }

    fn clear(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |session, _| session.request(&Request::Clear).map(drop))
    }

    /// Changes an emulated rig (`load=0.5kg`).
    fn plant(&self, py: Python<'_>, change: &str) -> PyResult<()> {
        let change = change.parse().map_err(|e: rig_plant::PlantError| PyValueError::new_err(e.to_string()))?;
        self.with(py, |session, _| match session.emulated() {
            Some(emulated) => emulated.plant(change),
            None => Err(Failure::Usage("only an emulated rig has a plant to change".into())),
        })
    }

    /// All telemetry since the connection, one JSON object a row.
    fn rows(&self) -> PyResult<String> {
        json(&self.talk().rows)
    }

    /// Stops what moves and ends the conversation.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        if self.talk().session.is_none() {
            return Ok(());
        }
        let stopped = self.with(py, |session, _| acknowledged(session.stop()?));
        self.talk().session = None;
        stopped
    }
}
