//! The commands of `rigctl` that need no rig, in this process.

use crate::errors::{error, wrong};
use crate::locked;
use clap::Parser;
use pyo3::prelude::*;
use rig_config::Scene;
use rigctl::cli::{self, Cli};
use rigctl::failure::Failure;
use rigctl::identify::compete::Candidate;
use rigctl::identify::constants::Constant;
use rigctl::identify::fit::{IdentifyError, fit};
use rigctl::identify::laws::Law;
use rigctl::identify::{data, plausible};
use rigctl::output::Output;
use serde_json::json;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// What a command prints.
#[derive(Clone, Default)]
struct Printed(Arc<Mutex<Vec<u8>>>);

impl Write for Printed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        locked(&self.0).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// What a command prints with `--json`, one object a line.
pub(crate) fn printed(run: impl FnOnce(&mut Output) -> Result<(), Failure>) -> Result<String, Failure> {
    let printed = Printed::default();
    let mut output = Output::new(true, Box::new(printed.clone()));
    run(&mut output)?;
    output.flush()?;
    let bytes = std::mem::take(&mut *locked(&printed.0));
    Ok(String::from_utf8(bytes)?)
}

/// Runs a command with `--json`; what it prints, one object a line.
#[pyfunction]
pub(crate) fn tool(py: Python<'_>, arguments: Vec<String>) -> PyResult<String> {
    let words = ["rigctl".to_owned(), "--json".to_owned()].into_iter().chain(arguments);
    let cli = Cli::try_parse_from(words).map_err(wrong)?;
    py.detach(|| printed(|output| cli::run(&cli, output))).map_err(error)
}

/// A law and a material fitted to recorded sweeps, or to other values of their rows and with what is expected of the unknowns
/// shifted (in standard deviations): as JSON the scene's keys, of each row the value, the computed one and its standard deviation,
/// which rows are a sweep, and how many unknowns there are.
#[pyfunction]
#[pyo3(signature = (scene, sweeps, law, material, values=None, shifts=vec![]))]
pub(crate) fn refit(
    py: Python<'_>,
    scene: PathBuf,
    sweeps: Vec<PathBuf>,
    law: &str,
    material: &str,
    values: Option<Vec<f64>>,
    shifts: Vec<f64>,
) -> PyResult<String> {
    let unknown = || wrong(format!("no law `{law}` with a material `{material}`"));
    let law = Law::named(law).ok_or_else(unknown)?;
    let material = Constant::named(material).ok_or_else(unknown)?;
    let fitted = py.detach(|| {
        let scene = Scene::load(scene)?;
        let data = data::sweeps(&scene, &sweeps, false)?;
        plausible::checked(&data, &scene).map_err(Failure::failed)?;
        let candidates = Candidate::all(&scene, Some(law), data.knows_its_zero());
        let Some(candidate) = candidates.into_iter().find(|candidate| candidate.material == Some(material)) else {
            return Ok(None);
        };
        let refused = |e: IdentifyError| Failure::failed(e.to_string());
        let (unknowns, start) = (&candidate.unknowns, candidate.start().map_err(refused)?);
        let mut data = data.based_on(&start);
        let wanted = data.rows.len();
        let values = values.unwrap_or_else(|| data.rows.iter().map(|row| row.value).collect());
        if values.len() != wanted || !values.iter().chain(&shifts).all(|number| number.is_finite()) {
            return Err(Failure::Usage(format!("values must be {wanted} finite numbers, and shifts finite")));
        }
        data.rows.iter_mut().zip(values).for_each(|(row, value)| row.value = value);
        let fit = fit(unknowns, &start, &data, &shifts).map_err(refused)?;
        Ok(Some(json!({
            "scene": unknowns.scene(&candidate.scene, &start, &fit.x),
            "values": data.rows.iter().map(|row| row.value).collect::<Vec<_>>(),
            "computed": fit.rows.iter().map(|row| row.computed).collect::<Vec<_>>(),
            "deviations": data.rows.iter().map(|row| row.sigma).collect::<Vec<_>>(),
            "sweeps": data.runs(),
            "unknowns": unknowns.count(),
        })))
    });
    Ok(fitted.map_err(error)?.ok_or_else(unknown)?.to_string())
}
