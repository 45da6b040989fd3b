//! `identify`: the scene's constants from recorded sweeps.

mod figure;
pub mod print;

use crate::failure::Failure;
use crate::identify::compete::Candidate;
use crate::identify::constants::{Constant, Unknowns};
use crate::identify::data::sweeps;
use crate::identify::laws::Law;
use crate::identify::plan::{Plan, plan};
use crate::identify::plausible::Hint;
use crate::identify::{Identified, identify, plausible};
use crate::options::Global;
use crate::options::values::radius_law;
use crate::out_file::{OutFile, distinct};
use crate::output::Output;
use crate::units::UM;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    found: &'a Identified,
    /// Of the errors of the fit.
    error_unit: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    next: Option<Plan>,
    bad_rows: &'a [String],
}

/// The constants to fit, and the data.
#[derive(Debug, Clone, Args)]
pub struct Identify {
    /// Recorded sweeps: CSV with load_n, turns (or twist_rad), gap_m (from an unknown zero) or contraction_m, and if
    /// known sigma_m, lines that begin with # passed over; or what `sweep` wrote
    #[arg(value_name = "SWEEP.csv", conflicts_with = "published")]
    pub sweeps: Vec<PathBuf>,
    /// The paper's 37 numbers instead, errors taken relative
    #[arg(long)]
    pub published: bool,
    /// Scene file to write
    #[arg(long, value_name = "SCENE.toml")]
    pub out: Option<PathBuf>,
    /// Picture to write: contraction by the scene before and by the identified one, with the measured points on it
    #[arg(long, value_name = "FILE.svg", conflicts_with = "published")]
    pub figure: Option<PathBuf>,
    /// Constants to fit, by symbol or key: k1, k2, k3, p, k4, K, R, L0, modulus, odd-curve (a1, a3, a5), curve (a1 to
    /// a5) [default: those of each radius model, with modulus and with odd-curve in turn; k1,k2,k3,modulus for --published]
    #[arg(long, value_name = "KEYS", value_delimiter = ',')]
    pub fit: Vec<String>,
    /// The one radius model to fit with, instead of letting all of them compete on held-out sweeps
    #[arg(long, value_parser = radius_law, value_name = "length-ratio|length-ratio-k4|twist-power")]
    pub law: Option<Law>,
    /// Also logs of sweeps that were cut short or broken off
    #[arg(long)]
    pub partial: bool,
    /// Which of the published numbers are only predicted, by their ids or kinds
    /// [default: l0-70,r0-2.5,k-0.01,experiment,span]; `none` fits everything
    #[arg(long, value_name = "WHAT", value_delimiter = ',')]
    pub hold_out: Vec<String>,
    /// Also say which further sweep would tell most, and whether any is worth its time
    #[arg(long, conflicts_with = "published")]
    pub next: bool,
}

/// Runs the command.
///
/// # Errors
/// If files or options are wrong, or the data cannot tell the constants.
pub fn run(global: &Global, options: &Identify, output: &mut Output) -> Result<(), Failure> {
    let scene = global.scene()?;
    distinct("--figure", options.figure.as_deref(), "--out", options.out.as_deref())?;
    let out = place("--out", options.out.as_deref(), &options.sweeps)?;
    let picture = place("--figure", options.figure.as_deref(), &options.sweeps)?;
    if options.sweeps.is_empty() {
        return Err(Failure::Usage("identify needs recorded sweeps, or --published".into()));
    }
    if !options.hold_out.is_empty() {
        return Err(Failure::Usage(
            "--hold-out: only with --published; of sweeps whole blocks are held out in turn".into(),
        ));
    }
    let data = sweeps(&scene, &options.sweeps, options.partial)?;
    let candidates = match given(options)? {
        None => Candidate::all(&scene, options.law, data.knows_its_zero()),
        Some(unknowns) => {
            let own = if unknowns.constants.contains(&Constant::K4) { Law::LengthRatioK4 } else { Law::of(&scene) };
            vec![Candidate::with(&scene, options.law.unwrap_or(own), unknowns)]
        }
    };
    let hints = plausible::checked(&data, &scene).map_err(Failure::failed)?;
    let found = identify(&scene, &data, &candidates).map_err(|e| hinted(&e.to_string(), &hints))?;
    hints.iter().for_each(|hint| crate::output::say!("is a unit wrong? {}", hint.text));
    data.bad.iter().for_each(|bad| crate::output::say!("passed over: {bad}"));
    data.remembering.iter().for_each(|text| crate::output::say!("{text}"));
    print::fit(&found.fit, &found.scene, UM, output)?;
    print::judged(&found, output)?;
    print::table(&scene, &found, output)?;
    let next = options.next.then(|| plan(&scene, &found)).flatten();
    if let Some(next) = &next {
        print::next(next, output)?;
    }
    let names = options.sweeps.iter().filter_map(|p| p.file_name()).map(|name| name.to_string_lossy());
    let source = names.collect::<Vec<_>>().join(", ");
    write(out, &print::file(&found.fit, &found.scene, &source, UM)?, output)?;
    if picture.is_some() {
        write(picture, &figure::figure(&scene, &data, &found)?, output)?;
    }
    Ok(output.object(&Report { found: &found, error_unit: "m", next, bad_rows: &data.bad })?)
}

/// An error with what may be the reason.
fn hinted(error: &str, hints: &[Hint]) -> Failure {
    let all: Vec<&str> = std::iter::once(error).chain(hints.iter().map(|hint| hint.text.as_str())).collect();
    Failure::failed(all.join("; "))
}

/// Where the scene or the picture goes: nowhere where a measurement is.
///
/// # Errors
/// Naming option and file.
pub fn place(option: &str, path: Option<&Path>, sweeps: &[PathBuf]) -> Result<Option<(OutFile, PathBuf)>, Failure> {
    let Some(path) = path else { return Ok(None) };
    let same = |sweep: &PathBuf| path.canonicalize().is_ok_and(|p| sweep.canonicalize().is_ok_and(|s| s == p));
    if sweeps.iter().any(same) {
        return Err(Failure::Usage(format!("{option} {} is one of the sweeps", path.display())));
    }
    Ok(Some((OutFile::new(path)?, path.to_owned())))
}

/// Writes the text if it goes somewhere.
///
/// # Errors
/// Naming the file.
pub fn write(place: Option<(OutFile, PathBuf)>, text: &str, output: &mut Output) -> Result<(), Failure> {
    let Some((file, path)) = place else { return Ok(()) };
    file.write(text)?;
    Ok(output.line(format!("written: {}", path.display()))?)
}

/// The constants that the operator wants fitted.
///
/// # Errors
/// Naming what `--fit` cannot have.
pub fn given(options: &Identify) -> Result<Option<Unknowns>, Failure> {
    if options.fit.is_empty() {
        return Ok(None);
    }
    let mut constants = Vec::new();
    for name in &options.fit {
        let unknown = || Failure::Usage(format!("--fit: `{name}` is none of {}", Constant::names()));
        let constant = Constant::named(name).ok_or_else(unknown)?;
        if constants.contains(&constant) {
            return Err(Failure::Usage(format!("--fit: `{name}` twice")));
        }
        constants.push(constant);
    }
    if constants.iter().filter(|c| c.is_material()).count() > 1 {
        return Err(Failure::Usage("--fit: modulus, odd-curve and curve are three ways to fit the same".into()));
    }
    Ok(Some(Unknowns { constants, expected: false }))
}
