//! The native part of the Python package `tsa_rig`: arrays in, arrays out. What a user sees, with its documentation, is in
//! `python/tsa_rig`.

use errors::{broken, of_kind, wrong};
use numpy::{PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};

mod bench;
mod errors;
mod inverse;
mod motion;
mod rig;
mod tool;
mod trial;

/// Points that one thread takes at once: the first of each may be slow, the next ones are not.
const CHUNK: usize = 256;

/// Numbers of a point by row, and why points were refused, by their place.
type Columns<'py> = (Bound<'py, PyArray2<f64>>, Vec<(usize, String)>);

/// A scene, checked.
#[pyclass(frozen)]
struct Scene(rig_config::Scene);

/// What a panic has left is as good as any other state: who locks it next goes on.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What is wrong with a scene.
fn unfit(error: impl Into<rigctl::failure::Failure>) -> PyErr {
    match error.into() {
        failure if failure.kind() == "no-file" => errors::error(failure),
        failure => of_kind("scene", &failure.message().unwrap_or_default()),
    }
}

fn finite(name: &str, value: f64) -> Result<(), String> {
    if value.is_finite() { Ok(()) } else { Err(format!("{name} {value} must be finite")) }
}

/// `f` at each load and number of turns on all cores, without Python's lock; a refused point is not a number.
fn columns<'py, const N: usize>(
    py: Python<'py>,
    load_n: &PyReadonlyArray1<'py, f64>,
    turns: &PyReadonlyArray1<'py, f64>,
    f: impl Fn(rigctl::batch::Query) -> Result<[f64; N], String> + Sync,
) -> PyResult<Columns<'py>> {
    let (load_n, turns) = (load_n.as_slice()?, turns.as_slice()?);
    if load_n.len() != turns.len() {
        return Err(wrong(format!("{} loads and {} turns", load_n.len(), turns.len())));
    }
    let queries: Vec<_> =
        load_n.iter().zip(turns).map(|(&load_n, &turns)| rigctl::batch::Query { load_n, turns }).collect();
    let chunks: Vec<_> = queries.chunks(CHUNK).collect();
    let solved = py.detach(|| {
        rigctl::parallel::parallel(&|_, _| {}, chunks.len(), |k| chunks[k].iter().map(|q| f(*q)).collect::<Vec<_>>())
    });
    let (mut rows, mut refused) = (vec![Vec::with_capacity(queries.len()); N], Vec::new());
    for (k, point) in solved.into_iter().flatten().enumerate() {
        let values = point.unwrap_or_else(|why| {
            refused.push((k, why));
            [f64::NAN; N]
        });
        rows.iter_mut().zip(values).for_each(|(row, value)| row.push(value));
    }
    Ok((PyArray2::from_vec2(py, &rows)?, refused))
}

#[pymethods]
impl Scene {
    #[staticmethod]
    fn load(path: std::path::PathBuf) -> PyResult<Self> {
        rig_config::Scene::load(path).map(Self).map_err(unfit)
    }

    #[staticmethod]
    fn parse(text: &str) -> PyResult<Self> {
        rig_config::Scene::from_toml_str(text).map(Self).map_err(unfit)
    }

    /// From all keys, as [`Scene::json`] gives them.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let scene: rig_config::Scene = serde_json::from_str(text).map_err(unfit)?;
        scene.validate().map_err(unfit)?;
        Ok(Self(scene))
    }

    fn json(&self) -> PyResult<String> {
        serde_json::to_string(&self.0).map_err(broken)
    }

    /// Equilibria by the full model, in the order of `Equilibria` of the Python part.
    fn solve<'py>(
        &self,
        py: Python<'py>,
        load_n: PyReadonlyArray1<'py, f64>,
        turns: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Columns<'py>> {
        let mechanism = self.0.mechanism().map_err(unfit)?;
        columns(py, &load_n, &turns, |query| {
            finite("load_n", query.load_n)?;
            finite("turns", query.turns)?;
            let twist_rad = tsa_model::twist_from_turns(query.turns);
            let at = |twist_rad| mechanism.solve(query.load_n, twist_rad).map_err(|e| e.to_string());
            let (start, e) = (at(tsa_model::PRETWIST_RAD)?, at(twist_rad)?);
            Ok([
                e.alpha_rad,
                e.x_m,
                e.d_m,
                e.w_m,
                e.r_m,
                e.tension_n,
                e.bending_strain,
                start.gap_m - e.gap_m,
                start.gap_m - mechanism.start_length_m(),
                e.tr_rad_per_m(),
                e.gap_m,
                e.dgap_dtwist_m_per_rad,
                e.dgap_dload_m_per_n,
            ])
        })
    }

    /// The conservative torque (N m); it takes 25 equilibria.
    fn torque<'py>(
        &self,
        py: Python<'py>,
        load_n: PyReadonlyArray1<'py, f64>,
        turns: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Columns<'py>> {
        let mechanism = self.0.mechanism().map_err(unfit)?;
        columns(py, &load_n, &turns, |query| {
            let twist_rad = tsa_model::twist_from_turns(query.turns);
            Ok([mechanism.conservative_torque_nm(query.load_n, twist_rad).map_err(|e| e.to_string())?])
        })
    }

    /// The load (N) under which a gap (m) is held at a twist.
    fn force<'py>(
        &self,
        py: Python<'py>,
        gap_m: PyReadonlyArray1<'py, f64>,
        turns: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Columns<'py>> {
        let mechanism = self.0.mechanism().map_err(unfit)?;
        columns(py, &gap_m, &turns, |query| Ok([inverse::force(&mechanism, query.load_n, query.turns)?]))
    }

    /// The turns that hold a gap (m) under a load.
    fn twist<'py>(
        &self,
        py: Python<'py>,
        load_n: PyReadonlyArray1<'py, f64>,
        gap_m: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Columns<'py>> {
        let mechanism = self.0.mechanism().map_err(unfit)?;
        columns(py, &load_n, &gap_m, |query| Ok([inverse::twist(&mechanism, query.load_n, query.turns)?]))
    }

    /// The table that the firmware carries for this scene.
    fn table(&self, py: Python<'_>) -> PyResult<Table> {
        py.detach(|| self.0.fit_table()).map(Table).map_err(unfit)
    }
}

/// A fitted table.
#[pyclass(frozen)]
struct Table(tsa_table::fit::Fit);

#[pymethods]
impl Table {
    /// The board's own lookup, in the order of `Looked` of the Python part.
    fn lookup<'py>(
        &self,
        py: Python<'py>,
        load_n: PyReadonlyArray1<'py, f64>,
        turns: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Columns<'py>> {
        let table = self.0.table.table();
        columns(py, &load_n, &turns, |query| {
            let a = rigctl::commands::lookup::look_up(&table, query).map_err(|e| e.message)?;
            Ok([a.contraction_m, a.gap_m, a.tr_rad_per_m, a.dgap_dload_m_per_n].map(f64::from))
        })
    }

    #[getter]
    fn bytes(&self) -> usize {
        self.0.table.numbers.bytes()
    }

    /// Largest errors against the full model: of the contraction (m), and of TR (relative).
    #[getter]
    fn errors(&self) -> (f64, f64) {
        let m = self.0.table.table().metadata;
        (f64::from(m.contraction_error_m), f64::from(m.tr_relative_error))
    }
}

/// The native module of `tsa_rig`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::bench::{Bench, Plant};
    #[pymodule_export]
    use super::motion::Motion;
    #[pymodule_export]
    use super::rig::{Board, Recording};
    #[pymodule_export]
    use super::tool::{refit, tool};
    #[pymodule_export]
    use super::trial::trial;
    #[pymodule_export]
    use super::{Scene, Table};
}
