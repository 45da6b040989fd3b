//! `identify --published`: a scene's constants from the paper's numbers instead of recorded sweeps.

use super::numbers::{self, Kind};
use rig_config::Scene;
use rigctl::commands::identify::{self, Identify, given, place, print, write};
use rigctl::failure::Failure;
use rigctl::identify::constants::{Constant, Unknowns};
use rigctl::identify::data::{Data, Quantity, Row};
use rigctl::identify::fit::fit;
use rigctl::identify::laws::{K4, Law};
use rigctl::options::Global;
use rigctl::output::Output;
use rigctl::units::PERCENT;
use serde_json::{Value, json};
use tsa_model::{Parameters, twist_from_turns};

/// What lab/paper.md left out of its fit: the rows that the default scene predicts.
const HELD_OUT: [&str; 5] = ["l0-70", "r0-2.5", "k-0.01", "experiment", "span"];
/// Kinds of numbers that `--hold-out` takes beside their ids.
const KINDS: [&str; 5] = ["theory", "experiment", "tr", "span", "contraction"];

/// Fits one law to the paper's numbers; without `--published` runs the tool's own command.
///
/// # Errors
/// If options are wrong, or the numbers cannot tell the constants.
pub fn run(global: &Global, options: &Identify, output: &mut Output) -> Result<(), Failure> {
    if !options.published {
        return identify::run(global, options, output);
    }
    let scene = global.scene()?;
    let out = place("--out", options.out.as_deref(), &[])?;
    let mut scene = options.law.map_or_else(|| scene.clone(), |law| law.start(&scene));
    let default = || HELD_OUT.map(str::to_owned).to_vec();
    let held_out = if options.hold_out.is_empty() { default() } else { options.hold_out.clone() };
    let data = data(&scene, &held_out.into_iter().filter(|name| name != "none").collect::<Vec<_>>())?;
    // These numbers stand at two twists only: they cannot tell the constants of growth apart.
    let usual = || Unknowns::usual(Law::LengthRatio, Constant::Modulus, false);
    let unknowns = given(options)?.unwrap_or_else(usual);
    if unknowns.constants.contains(&Constant::K4) && scene.string.k4 == 0.0 {
        scene.string.k4 = K4;
    }
    let start = Parameters::new(&scene.geometry, &scene.string, &scene.material)?;
    let fit = fit(&unknowns, &start, &data, &[]).map_err(|e| Failure::failed(e.to_string()))?;
    let fitted = unknowns.scene(&scene, &start, &fit.x);
    fitted.validate()?;
    for r in &fit.rows {
        let mark = if r.held_out { "held out" } else { "" };
        let error = r.error.map_or_else(|| r.refused.clone().unwrap_or_default(), |e| PERCENT.error(e));
        output.line(format!("{:<20} {error:>10}  {mark}", r.id).trim_end())?;
    }
    print::fit(&fit, &fitted, PERCENT, output)?;
    write(out, &print::file(&fit, &fitted, "the paper's numbers", PERCENT)?, output)?;
    let mut report = serde_json::to_value(&fit)?;
    let more = [("error_unit", json!("relative")), ("scene", serde_json::to_value(&fitted)?), ("bad_rows", json!([]))];
    more.into_iter().for_each(|(key, value): (&str, Value)| report[key] = value);
    Ok(output.object(&report)?)
}

/// The paper's numbers; `held_out` are ids or kinds.
fn data(scene: &Scene, held_out: &[String]) -> Result<Data, Failure> {
    let rows = numbers::rows()?;
    if let Some(name) =
        held_out.iter().find(|name| !KINDS.contains(&name.as_str()) && !rows.iter().any(|r| r.id == **name))
    {
        return Err(Failure::Usage(format!("--hold-out: no published number is called `{name}`")));
    }
    let mut data = Data::default();
    for r in rows {
        let quantity = r.group();
        let (group, si) = match quantity {
            Quantity::Tr => ("tr", 1e3),
            Quantity::Span => ("span", 1e-3),
            Quantity::Contraction | Quantity::Gap => ("contraction", 1e-3),
        };
        let kind = if r.kind == Kind::Theory { "theory" } else { "experiment" };
        let changed = numbers::apply(scene, &r.changes).map_err(|e| Failure::failed(format!("{}: {e}", r.id)))?;
        let base = Parameters::new(&changed.geometry, &changed.string, &changed.material)?;
        let twist_rad = twist_from_turns(r.turns());
        data.rows.push(Row {
            held_out: held_out.iter().any(|name| *name == r.id || name == kind || name == group),
            fixed: r.changes,
            ..Row::new(r.id, quantity, r.load_n, twist_rad, r.value * si, &base)
        });
    }
    Ok(data)
}
