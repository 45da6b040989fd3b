//! The commands of `rigctl` that need no rig, in this process.

use clap::Parser;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rig_config::Scene;
use rigctl::cli::{self, Cli};
use rigctl::failure::Failure;
use rigctl::identify::compete::Candidate;
use rigctl::identify::constants::Constant;
use rigctl::identify::laws::Law;
use rigctl::identify::{bootstrap, data, plausible};
use rigctl::output::Output;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// What a command prints.
#[derive(Clone, Default)]
struct Printed(Arc<Mutex<Vec<u8>>>);

impl Write for Printed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The error of a failed command: wrong usage is a `ValueError`.
pub(crate) fn error(failure: Failure) -> PyErr {
    let text = failure.message().unwrap_or_else(|| "failed".into());
    match failure {
        Failure::Usage(_) => PyValueError::new_err(text),
        Failure::Failed(_) | Failure::Reported => PyRuntimeError::new_err(text),
    }
}

/// Runs a command with `--json`; what it prints, one object a line.
#[pyfunction]
pub(crate) fn tool(py: Python<'_>, arguments: Vec<String>) -> PyResult<String> {
    let words = ["rigctl".to_owned(), "--json".to_owned()].into_iter().chain(arguments);
    let cli = Cli::try_parse_from(words).map_err(|e| PyValueError::new_err(e.to_string()))?;
    let printed = Printed::default();
    py.detach(|| {
        let mut output = Output::new(true, Box::new(printed.clone()));
        cli::run(&cli, &mut output)
    })
    .map_err(error)?;
    let bytes = std::mem::take(&mut *printed.0.lock().unwrap_or_else(PoisonError::into_inner));
    String::from_utf8(bytes).map_err(|e| PyRuntimeError::new_err(e.to_string()))
}

/// All keys (JSON) of the scene with a law and a material fitted to recorded sweeps, or to a resample of them with a seed.
#[pyfunction]
#[pyo3(signature = (scene, sweeps, law, material, seed))]
pub(crate) fn refit(
    py: Python<'_>,
    scene: PathBuf,
    sweeps: Vec<PathBuf>,
    law: &str,
    material: &str,
    seed: Option<u64>,
) -> PyResult<String> {
    let unknown = || PyValueError::new_err(format!("no law `{law}` with a material `{material}`"));
    let law = Law::named(law).ok_or_else(unknown)?;
    let material = Constant::named(material).ok_or_else(unknown)?;
    let fitted = py.detach(|| {
        let scene = Scene::load(scene)?;
        let data = data::sweeps(&scene, &sweeps, false)?;
        plausible::checked(&data, &scene).map_err(Failure::failed)?;
        let candidates = Candidate::all(&scene, Some(law), data.knows_its_zero());
        let candidate = candidates.into_iter().find(|candidate| candidate.material == Some(material));
        let fitted = candidate.map(|candidate| bootstrap::refit(&data, &candidate, seed)).transpose();
        fitted.map_err(|e| Failure::failed(e.to_string()))
    });
    let fitted = fitted.map_err(error)?.ok_or_else(unknown)?;
    serde_json::to_string(&fitted).map_err(|e| PyRuntimeError::new_err(e.to_string()))
}
