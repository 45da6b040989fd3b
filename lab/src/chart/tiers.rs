//! The cheapest model over load and twist, and the model and table that each of five scenes needs.

use super::grid::Grid;
use super::{Inputs, Made};
use anyhow::{Context, Result};
use rig_config::Scene;
use rigctl::csv_text::below;
use rigctl::parallel::parallel;
use rigctl::plot::{Block, Figure, KeyRow, Panel, RGBColor};
use tsa_model::{Mechanism, SolveError, Tier, TierError, twist_from_turns};
use tsa_table::instruction_model::lookup_instructions;

/// Demanded accuracy of the contraction (m); TR is left free.
const WANTED_M: [f64; 3] = [5e-6, 24e-6, 100e-6];
/// Loads and twists of a map.
const CELLS: (usize, usize) = (32, 36);
/// The scenes of the table, in the folder of the operator's scene.
const SCENES: [&str; 5] = ["finger", "demonstration", "default", "niti-plateau", "long-string"];

/// From pale to dark: cheap to full.
const COLOURS: [RGBColor; 6] = [
    RGBColor(255, 255, 204),
    RGBColor(199, 233, 180),
    RGBColor(127, 205, 187),
    RGBColor(65, 182, 196),
    RGBColor(44, 127, 184),
    RGBColor(37, 52, 148),
];
const NO_EQUILIBRIUM: RGBColor = RGBColor(222, 222, 222);

/// The cheapest tier at a state (load in N, turns) whose own estimate meets the demand, and the error of its contraction (m).
fn cheapest(m: &Mechanism, (load_n, turns): (f64, f64), wanted: TierError) -> Result<(Tier, f64), SolveError> {
    let twist_rad = twist_from_turns(turns);
    let found = m.solve_auto(load_n, twist_rad, wanted)?;
    let full = m.solve_tier(Tier::Full, load_n, twist_rad)?;
    Ok((found.tier, (found.contraction_m() - full.contraction_m()).abs()))
}

/// Which fraction of some states each tier has, in words.
fn fractions(tiers: &[Tier]) -> String {
    let count = |tier: Tier| tiers.iter().filter(|t| **t == tier).count();
    let fractions = Tier::ALL
        .into_iter()
        .filter(|tier| count(*tier) > 0)
        .map(|tier| format!("{:.0} % {}", 100.0 * count(tier) as f64 / tiers.len().max(1) as f64, tier.name()));
    fractions.collect::<Vec<_>>().join(", ")
}

/// Draws the cheapest tiers of the scene and of the one with a plateau.
///
/// # Errors
/// If a scene has no envelope, or the drawing fails.
pub fn maps(inputs: &Inputs<'_>) -> Result<Made> {
    let (mut panels, mut rows, mut findings) = (Vec::new(), Vec::new(), Vec::new());
    for (name, scene) in &inputs.with_plateau() {
        let envelope = scene.table_requirement()?.0;
        let (grid, m) = (Grid::new(envelope.load_n, CELLS.0, envelope.turns, CELLS.1), scene.mechanism()?);
        let states = grid.states();
        let mut maps = Vec::new();
        for wanted_m in WANTED_M {
            let wanted = TierError { contraction_m: wanted_m, tr_relative: f64::INFINITY };
            let cells = parallel(inputs.progress, states.len(), |k| cheapest(&m, states[k], wanted));
            let title = format!("{name}, {:.0} µm", wanted_m * 1e6);
            let tiers: Vec<Tier> = cells.iter().flatten().map(|(tier, _)| *tier).collect();
            let worst_m = cells.iter().flatten().map(|(_, error_m)| *error_m).fold(0.0, f64::max);
            findings.push(format!("{title}: {}; worst {:.2} µm", fractions(&tiers), worst_m * 1e6));
            let colour = |k: usize| cells[k].as_ref().map_or(NO_EQUILIBRIUM, |(tier, _)| COLOURS[*tier as usize]);
            maps.push(grid.panel(title, colour));
            rows.extend(states.iter().zip(&cells).map(|((load_n, turns), cell)| {
                // Or why the state has none.
                let tier = cell.as_ref().map_or_else(SolveError::kind, |(tier, _)| tier.name());
                let error_m = cell.as_ref().ok().map(|(_, error)| format!("{error:.3e}"));
                let state = (format!("{wanted_m:.0e}"), format!("{load_n:.5}"), format!("{turns:.5}"));
                (name.clone(), state, tier, error_m)
            }));
        }
        panels.push(Panel::side_by_side(maps));
    }
    let key = Tier::ALL.map(|t| KeyRow::fill(COLOURS[t as usize], t.name()));
    let figure = Figure {
        heading: "The cheapest model that is good enough for the contraction".into(),
        rows: panels,
        panel_size: (400, 330),
        blocks: Block::split(3, key),
        notes: vec![
            "Each model chosen by its own estimate of its error; the true error against the full model is in the data. \
             Nothing is asked of TR here."
                .into(),
        ],
    };
    let header = "scene,wanted_m,load_n,turns,tier,contraction_error_m";
    Made::new(&figure, below(header, rows)?, findings)
}

/// A line of `scenes.csv`: the scene and the accuracy that it asks for; the tier, and how much of the plane each is enough for; the
/// table's form and size; its bytes and instructions; its errors.
type Needed = ((&'static str, f64, f64), (&'static str, String), (&'static str, String), (usize, u32), [String; 2]);
const NEEDED: &str = "scene,asked_contraction_m,asked_tr_relative,tier,tier_shares,table_form,table_size,bytes,\
    predicted_instructions,contraction_error_m,tr_relative_error";

/// The models and tables of five scenes.
///
/// # Errors
/// If one of them is not there, or allows no table.
pub fn scenes(inputs: &Inputs<'_>) -> Result<Made> {
    let needed = parallel(inputs.progress, SCENES.len(), |k| {
        let name = SCENES[k];
        needed(&Scene::load(inputs.scene_file.with_file_name(format!("{name}.toml")))?, name)
    });
    let needed = needed.into_iter().collect::<Result<Vec<_>>>()?;
    let finding = |((scene, ..), (tier, shares), _, (bytes, instructions), [contraction, tr]): &Needed| {
        format!(
            "{scene}: {tier} ({shares}); {bytes} bytes, {instructions} instructions, worst {contraction} m, {tr} of TR"
        )
    };
    let findings = needed.iter().map(finding).collect();
    Ok(Made { csv: below(NEEDED, needed)?, findings, ..Made::default() })
}

fn needed(scene: &Scene, name: &'static str) -> Result<Needed> {
    let (envelope, accuracy) = scene.table_requirement()?;
    let mechanism = scene.mechanism()?;
    let wanted = TierError { contraction_m: accuracy.contraction_m, tr_relative: accuracy.tr_relative };
    let states = Grid::new(envelope.load_n, 16, envelope.turns, 16).states();
    let tiers =
        states.iter().map(|at| Ok(cheapest(&mechanism, *at, wanted)?.0)).collect::<Result<Vec<_>, SolveError>>()?;
    let dearest = tiers.iter().copied().max_by_key(|t| *t as usize).unwrap_or(Tier::Full);
    let fit = scene.fit_table().context(name)?;
    let (series, errors) = (fit.table.numbers.series(), &fit.error_bounds.errors);
    Ok((
        (name, accuracy.contraction_m, accuracy.tr_relative),
        (dearest.name(), fractions(&tiers)),
        (tsa_table::FORM, fit.table.numbers.size()),
        (series.bytes(), lookup_instructions(&series)),
        [errors.contraction_max_m, errors.tr_max].map(|error| format!("{error:.3e}")),
    ))
}
