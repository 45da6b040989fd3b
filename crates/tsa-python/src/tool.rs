//! The commands of `rigctl` that need no rig, in this process.

use clap::Parser;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rigctl::cli::{Cli, dispatch};
use rigctl::failure::Failure;
use rigctl::output::Output;
use std::io::{self, Write};
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
        dispatch::run(&cli, &mut output)
    })
    .map_err(error)?;
    let bytes = std::mem::take(&mut *printed.0.lock().unwrap_or_else(PoisonError::into_inner));
    String::from_utf8(bytes).map_err(|e| PyRuntimeError::new_err(e.to_string()))
}
