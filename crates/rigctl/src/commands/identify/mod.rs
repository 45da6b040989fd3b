//! `identify`: the scene's constants from recorded sweeps, or from the paper's numbers.

mod figure;
mod print;

use crate::failure::Failure;
use crate::identify::compete::{Candidate, Scored};
use crate::identify::constants::{Constant, Unknowns};
use crate::identify::correction::Corrected;
use crate::identify::data;
use crate::identify::fit::{Fit, fit};
use crate::identify::laws::{K4, Law};
use crate::identify::memory::Memory;
use crate::identify::plan::{Plan, plan};
use crate::identify::plausible::Hint;
use crate::identify::predict::Prediction;
use crate::identify::{Identified, Misfit, identify, plausible};
use crate::options::Global;
use crate::options::commands::Identify;
use crate::out_file::OutFile;
use crate::output::Output;
use rig_config::Scene;
use serde::Serialize;
use std::path::{Path, PathBuf};
use tsa_model::Parameters;

/// What model.md section 6 left out of its fit: the rows that the default scene predicts.
const HELD_OUT: [&str; 5] = ["l0-70", "r0-2.5", "k-0.01", "experiment", "span"];

/// A law and a material.
#[derive(Serialize)]
struct Named {
    law: &'static str,
    material: &'static str,
}

/// The answer for recorded sweeps beyond the fit.
#[derive(Serialize)]
struct Judged<'a> {
    candidates: &'a [Scored],
    chosen: Named,
    /// Which others are not worse.
    indistinguishable: Vec<Named>,
    law_holds: bool,
    misfit: Misfit,
    /// What the law misses as a surface, if the scene has one.
    correction: Option<&'a Corrected>,
    /// Why it has none, though no law holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    uncorrected: Option<&'a str>,
    predictions: &'a [Prediction],
    /// What the rods remember of a heavier load; empty without sweeps that show it.
    rod_memory: &'a [Memory],
    /// Size of the scene's table (bytes); none if it has none, or asks for none.
    table_bytes: Option<usize>,
    /// Why there is no table.
    #[serde(skip_serializing_if = "Option::is_none")]
    untabled: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    next: Option<Plan>,
}

impl<'a> Judged<'a> {
    fn of(found: &'a Identified, next: Option<Plan>) -> Self {
        let competition = &found.competition;
        let named = |k: usize| Named { law: competition.scored[k].law, material: competition.scored[k].material };
        let others = competition.equals().into_iter().filter(|k| *k != competition.chosen);
        Self {
            candidates: &competition.scored,
            chosen: named(competition.chosen),
            indistinguishable: others.map(named).collect(),
            law_holds: found.misfit.holds,
            misfit: found.misfit,
            correction: found.corrected.as_ref().and_then(|found| found.as_ref().ok()),
            uncorrected: found.corrected.as_ref().and_then(|found| found.as_ref().err()).map(String::as_str),
            predictions: &found.predictions,
            rod_memory: &found.memories,
            table_bytes: found.table.as_ref().map(|fit| fit.table.numbers.bytes()),
            untabled: found.untabled.as_deref(),
            next,
        }
    }
}

#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    fit: &'a Fit,
    /// `relative` for the paper's numbers, `m` for sweeps.
    error_unit: &'static str,
    #[serde(flatten)]
    judged: Option<Judged<'a>>,
    scene: &'a Scene,
    bad_rows: &'a [String],
}

/// Runs the command.
///
/// # Errors
/// If files or options are wrong, or the data cannot tell the constants.
pub fn run(global: &Global, options: &Identify, output: &mut Output) -> Result<(), Failure> {
    let scene = global.scene()?;
    let out = options.out.as_deref().map(|path| place("--out", path, &options.sweeps)).transpose()?;
    let picture = options.figure.as_deref().map(|path| place("--figure", path, &options.sweeps)).transpose()?;
    if options.published {
        return published(&scene, options, out, output);
    }
    if options.sweeps.is_empty() {
        return Err(Failure::Usage("identify needs recorded sweeps, or --published".into()));
    }
    if !options.hold_out.is_empty() {
        return Err(Failure::Usage(
            "--hold-out: only with --published; of sweeps whole blocks are held out in turn".into(),
        ));
    }
    let data = data::sweeps(&scene, &options.sweeps, options.partial)?;
    let known = data.knows_its_zero();
    let candidates = match given(options)? {
        None => Candidate::all(&scene, options.law, known),
        Some(unknowns) => {
            let own = if unknowns.constants.contains(&Constant::K4) { Law::LengthRatioK4 } else { Law::of(&scene) };
            vec![Candidate::with(&scene, options.law.unwrap_or(own), unknowns)]
        }
    };
    let hints = plausible::checked(&data, &scene).map_err(Failure::failed)?;
    let found = identify(&scene, &data, &candidates).map_err(|e| hinted(&e.to_string(), &hints))?;
    hints.iter().for_each(|hint| eprintln!("is a unit wrong? {}", hint.text));
    for bad in &data.bad {
        eprintln!("passed over: {bad}");
    }
    let start = found.candidate.start().map_err(|e| Failure::failed(e.to_string()))?;
    print::fit(&found.fit, &found.candidate.unknowns, &start, &found.scene, print::Unit::Metres, output)?;
    print::judged(&found, output)?;
    print::table(&scene, &found, output)?;
    let next = options.next.then(|| plan(&scene, &found)).flatten();
    if let Some(next) = &next {
        print::next(next, output)?;
    }
    let report = Report {
        fit: &found.fit,
        error_unit: "m",
        judged: Some(Judged::of(&found, next)),
        scene: &found.scene,
        bad_rows: &data.bad,
    };
    let text = print::file(&found.fit, &found.scene, options, print::Unit::Metres)?;
    write(out, options.out.as_deref(), &text, output)?;
    if picture.is_some() {
        write(picture, options.figure.as_deref(), &figure::figure(&scene, &data, &found)?, output)?;
    }
    output.object(&report)?;
    Ok(())
}

/// The paper's numbers, to which one law is fitted.
fn published(scene: &Scene, options: &Identify, out: Option<OutFile>, output: &mut Output) -> Result<(), Failure> {
    let mut scene = options.law.map_or_else(|| scene.clone(), |law| law.start(scene));
    let default = || HELD_OUT.map(str::to_owned).to_vec();
    let held_out = if options.hold_out.is_empty() { default() } else { options.hold_out.clone() };
    let held_out: Vec<String> = held_out.into_iter().filter(|h| h != "none").collect();
    let data = data::published(&scene, &held_out)?;
    // These numbers stand at two twists only: they cannot tell the constants of growth apart.
    let usual = || Unknowns::usual(Law::LengthRatio, Constant::Modulus, false);
    let unknowns = given(options)?.unwrap_or_else(usual);
    if unknowns.constants.contains(&Constant::K4) && scene.string.k4 == 0.0 {
        scene.string.k4 = K4;
    }
    let start = Parameters::new(&scene.geometry, &scene.string, &scene.material)?;
    let fit = fit(&unknowns, &start, &data).map_err(|e| Failure::failed(e.to_string()))?;
    let fitted = unknowns.scene(&scene, &start, &fit.x);
    fitted.validate()?;
    print::rows(&fit, output)?;
    print::fit(&fit, &unknowns, &start, &fitted, print::Unit::Relative, output)?;
    let text = print::file(&fit, &fitted, options, print::Unit::Relative)?;
    write(out, options.out.as_deref(), &text, output)?;
    output.object(&Report { fit: &fit, error_unit: "relative", judged: None, scene: &fitted, bad_rows: &[] })?;
    Ok(())
}

/// An error with what may be the reason.
fn hinted(error: &str, hints: &[Hint]) -> Failure {
    let all: Vec<&str> = std::iter::once(error).chain(hints.iter().map(|hint| hint.text.as_str())).collect();
    Failure::failed(all.join("; "))
}

/// Where the scene or the picture goes: nowhere where a measurement is.
fn place(option: &str, path: &Path, sweeps: &[PathBuf]) -> Result<OutFile, Failure> {
    let same = |sweep: &PathBuf| path.canonicalize().is_ok_and(|p| sweep.canonicalize().is_ok_and(|s| s == p));
    if sweeps.iter().any(same) {
        return Err(Failure::Usage(format!("{option} {} is one of the sweeps", path.display())));
    }
    OutFile::new(path)
}

fn write(out: Option<OutFile>, path: Option<&Path>, text: &str, output: &mut Output) -> Result<(), Failure> {
    if let (Some(out), Some(path)) = (out, path) {
        out.write(text)?;
        output.line(format!("written: {}", path.display()))?;
    }
    Ok(())
}

/// The constants that the operator wants fitted.
fn given(options: &Identify) -> Result<Option<Unknowns>, Failure> {
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
