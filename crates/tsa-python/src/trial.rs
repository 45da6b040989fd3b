//! Trials of emulated rigs on the fast bench.

use crate::errors::{broken, wrong};
use pyo3::prelude::*;
use rig_plant::RigPreset;
use rig_plant::bench::booted;
use rig_plant::trial::{Stated, Trial};
use serde::Serialize;

/// A trial with what was found.
#[derive(Serialize)]
struct Tried {
    #[serde(flatten)]
    trial: Trial,
    stated: Vec<Stated>,
    /// Why it ended early; empty if it did not.
    ended: String,
}

/// The trial of a kind of rig that a seed names, as built, as JSON.
#[pyfunction]
pub(crate) fn trial(py: Python<'_>, kind: &str, seed: u64) -> PyResult<String> {
    let trial = Trial::new(kind.parse::<RigPreset>().map_err(wrong)?, seed);
    let (stated, ended) = py.detach(|| trial.run(booted()));
    serde_json::to_string(&Tried { trial, stated, ended }).map_err(broken)
}
