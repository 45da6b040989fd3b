//! `identify`: the scene's constants from recorded sweeps, or from the paper's numbers.

use crate::failure::Failure;
use crate::identify::constants::{Constant, Unknowns};
use crate::identify::data::{self, Data};
use crate::identify::{Errors, Fit, envelope, fit, plausible, uncertainty};
use crate::options::Global;
use crate::options::commands::Identify;
use crate::out_file::OutFile;
use crate::output::Output;
use rig_scene::Scene;
use serde::Serialize;
use std::path::{Path, PathBuf};
use tsa_model::{Parameters, RadiusLaw};

/// What model.md section 6 left out of its fit: the rows that the default scene predicts.
const HELD_OUT: [&str; 5] = ["l0-70", "r0-2.5", "k-0.01", "experiment", "span"];
/// How much worse than the fitted rows the held out ones may be predicted without a word.
const SURPRISING: f64 = 3.0;
/// Exponent and k4 that a fit starts from when the scene has none.
const EXPONENT: f64 = 0.4;
const K4: f64 = 0.1;

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    fit: Fit,
    /// `relative` for the paper's numbers, `m` for sweeps.
    error_unit: &'static str,
    scene: Scene,
    bad_rows: Vec<String>,
}

/// Runs the command.
///
/// # Errors
/// If files or options are wrong, or the data cannot tell the constants.
pub fn run(global: &Global, options: &Identify, output: &mut Output) -> Result<(), Failure> {
    let mut scene = global.scene()?;
    match options.law {
        Some(RadiusLaw::LengthRatio) => {
            (scene.string.radius_law, scene.string.twist_exponent) = (RadiusLaw::LengthRatio, None);
        }
        Some(RadiusLaw::TwistPower) => {
            (scene.string.radius_law, scene.string.k4) = (RadiusLaw::TwistPower, 0.0);
            scene.string.twist_exponent.get_or_insert(EXPONENT);
        }
        None => {}
    }
    let named = |name: &String| Constant::named(name) == Some(Constant::K4);
    if scene.string.radius_law == RadiusLaw::LengthRatio && scene.string.k4 == 0.0 && options.fit.iter().any(named) {
        scene.string.k4 = K4;
    }
    let out = options.out.as_deref().map(|path| place(path, &options.sweeps)).transpose()?;
    let (data, unit) = measured(options, &scene)?;
    let unknowns = constants(options, &scene, data.knows_its_zero())?;
    let start = Parameters::new(&scene.geometry, &scene.string, &scene.material)?;
    if let Some(why) = plausible::impossible(&data, scene.geometry.string_length_m) {
        return Err(Failure::failed(why));
    }
    let (x, fit) = fit(&unknowns, &start, &data).map_err(|e| {
        let hints: Vec<String> = std::iter::once(e.to_string()).chain(plausible::likely(&data, &scene)).collect();
        Failure::failed(hints.join("; "))
    })?;
    plausible::likely(&data, &scene).iter().for_each(|hint| eprintln!("is a unit wrong? {hint}"));
    let mut fitted = unknowns.scene(&scene, &start, &x);
    if unknowns.expected {
        fitted.uncertainty = uncertainty(&fit);
    }
    fitted.validate()?;
    for bad in &data.bad {
        eprintln!("passed over: {bad}");
    }
    let narrowed_from_n = if unit == "m" { envelope::narrow(&mut fitted) } else { None };
    print(&fit, &unknowns, &start, &fitted, unit, output)?;
    if let (Some(before_n), Some(envelope)) = (narrowed_from_n, fitted.envelope) {
        output.line(format!(
            "envelope.load_n begins at {} N instead of {before_n} N: with these constants no table reaches the accuracy under \
             lighter loads at {} turns",
            envelope.load_n[0], envelope.turns[1]
        ))?;
    }
    if unit == "m" && fit.held_out.rms > SURPRISING * fit.fitted.rms.max(data::SIGMA_M) {
        eprintln!(
            "what was held out is predicted {:.0} times worse than what was fitted: is there a wrong row in it, or too much \
             fitted?",
            fit.held_out.rms / fit.fitted.rms
        );
    }
    if let (Some(out), Some(path)) = (out, &options.out) {
        out.write(&file(&fit, &fitted, options, unit)?)?;
        output.line(format!("written: {}", path.display()))?;
    }
    output.object(&Report { fit, error_unit: unit, scene: fitted, bad_rows: data.bad })?;
    Ok(())
}

/// Where the scene goes: nowhere where a measurement is.
fn place(path: &Path, sweeps: &[PathBuf]) -> Result<OutFile, Failure> {
    let same = |sweep: &PathBuf| path.canonicalize().is_ok_and(|p| sweep.canonicalize().is_ok_and(|s| s == p));
    if sweeps.iter().any(same) {
        return Err(Failure::Usage(format!("--out {} is one of the sweeps", path.display())));
    }
    OutFile::new(path)
}

fn constants(options: &Identify, scene: &Scene, known: bool) -> Result<Unknowns, Failure> {
    if options.fit.is_empty() {
        let mut usual = Unknowns::usual(&scene.string, known);
        if options.published {
            // The paper's numbers stand at two twists only: they cannot tell k2, k3 and p or k4 apart.
            usual.constants.retain(|c| ![Constant::Exponent, Constant::K4].contains(c));
        }
        return Ok(usual);
    }
    let mut unknowns = Vec::new();
    for name in &options.fit {
        let unknown = || Failure::Usage(format!("--fit: `{name}` is none of {}", Constant::names()));
        let constant = Constant::named(name).ok_or_else(unknown)?;
        if unknowns.contains(&constant) {
            return Err(Failure::Usage(format!("--fit: `{name}` twice")));
        }
        unknowns.push(constant);
    }
    let curves = [Constant::Modulus, Constant::OddCurve, Constant::Curve];
    if unknowns.iter().filter(|c| curves.contains(c)).count() > 1 {
        return Err(Failure::Usage("--fit: modulus, odd-curve and curve are three ways to fit the same".into()));
    }
    Ok(Unknowns { constants: unknowns, expected: false })
}

fn measured(options: &Identify, scene: &Scene) -> Result<(Data, &'static str), Failure> {
    if options.published {
        let default = || HELD_OUT.map(str::to_owned).to_vec();
        let held_out = if options.hold_out.is_empty() { default() } else { options.hold_out.clone() };
        let held_out: Vec<String> = held_out.into_iter().filter(|h| h != "none").collect();
        return Ok((data::published(scene, &held_out)?, "relative"));
    }
    if options.sweeps.is_empty() {
        return Err(Failure::Usage("identify needs recorded sweeps, or --published".into()));
    }
    let every = match &options.hold_out[..] {
        [] => data::HOLD_OUT,
        [n] if n == "none" => 0,
        [n] => n.parse().map_err(|_| Failure::Usage(format!("--hold-out: `{n}` is not a number of rows")))?,
        _ => return Err(Failure::Usage("--hold-out: of sweeps, one number: every so many rows".into())),
    };
    Ok((data::sweeps(scene, &options.sweeps, every, options.partial)?, "m"))
}

/// An error in the unit of the data, for people.
fn shown(error: f64, unit: &str) -> String {
    if unit == "m" { format!("{:.2} um", error * 1e6) } else { format!("{:.2} %", error * 1e2) }
}

fn summary(name: &str, e: &Errors, unit: &str) -> String {
    let [rms, median, worst] = [e.rms, e.median, e.worst].map(|x| shown(x, unit));
    format!("{name:<10} {:>4} numbers: rms {rms}, median {median}, worst {worst}", e.count)
}

fn print(
    fit: &Fit,
    unknowns: &Unknowns,
    start: &Parameters,
    fitted: &Scene,
    unit: &str,
    output: &mut Output,
) -> Result<(), Failure> {
    if unit == "relative" {
        for r in &fit.rows {
            let mark = if r.held_out { "held out" } else { "" };
            let error = r.error.map_or_else(|| r.refused.clone().unwrap_or_default(), |e| format!("{:+.2} %", e * 1e2));
            output.line(format!("{:<20} {error:>10}  {mark}", r.id).trim_end())?;
        }
    }
    output.line(summary("fitted", &fit.fitted, unit))?;
    output.line(summary("held out", &fit.held_out, unit))?;
    for r in fit.rows.iter().filter_map(|r| r.refused.as_ref().map(|why| (r, why))) {
        output.line(format!("refused: {} ({})", r.0.id, r.1))?;
    }
    let s = &fitted.string;
    output.line("constants (standard errors of positive ones are relative):")?;
    for e in &fit.estimates {
        let value = match Constant::named(&e.name) {
            Some(Constant::Modulus) => start.stress_coefficients_pa[0] * e.unknown.exp(),
            Some(_) => e.unknown.exp(),
            None => e.unknown,
        };
        output.line(format!("  {:<18} {value:>14.6e}  +- {:.3} %", e.name, e.standard_error * 1e2))?;
    }
    let curves = [Constant::OddCurve, Constant::Curve];
    if unknowns.constants.iter().any(|c| curves.contains(c)) {
        let a = fitted.material.stress_coefficients_pa.map(|a| format!("{a:.4e}")).join(", ");
        output.line(format!("  a1..a5 = {a} Pa: a tangent written as sums of squares is nowhere negative"))?;
    }
    output.line(match s.twist_exponent {
        Some(p) => format!("  radius grows as (twist/pi)^p, p = {p:.4}"),
        None if s.k4 > 0.0 => format!("  radius grows by eq. 6 and k4 ln(twist/pi), k4 = {:.4}", s.k4),
        None => "  radius grows by eq. 6".to_owned(),
    })?;
    output.line("correlations:")?;
    for (e, row) in fit.estimates.iter().zip(&fit.correlations) {
        let cells: Vec<String> = row.iter().map(|c| format!("{c:>6.2}")).collect();
        output.line(format!("  {:<18} {}", e.name, cells.join(" ")))?;
    }
    Ok(())
}

/// The scene file, with a head that says where its constants come from.
fn file(fit: &Fit, fitted: &Scene, options: &Identify, unit: &str) -> Result<String, Failure> {
    let source = if options.published {
        "the paper's numbers".to_owned()
    } else {
        let names = options.sweeps.iter().filter_map(|p| p.file_name()).map(|n| n.to_string_lossy().into_owned());
        names.collect::<Vec<_>>().join(", ")
    };
    let mut text = format!("# Identified by rigctl {} from {source}.\n", env!("CARGO_PKG_VERSION"));
    for line in [summary("fitted", &fit.fitted, unit), summary("held out", &fit.held_out, unit)] {
        text += &format!("# {line}\n");
    }
    for e in &fit.estimates {
        text += &format!("# {}: standard error {:.3} %\n", e.name, e.standard_error * 1e2);
    }
    Ok(text + "\n" + &toml::to_string(fitted).map_err(|e| Failure::failed(format!("scene: {e}")))?)
}
