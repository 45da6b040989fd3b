//! The cheapest model over load and twist, and the model and table that each of five scenes needs.

use super::grid::Grid;
use super::{Inputs, Made, stem};
use crate::csv;
use anyhow::{Context, Result};
use rig_config::Scene;
use rigctl::parallel::{Progress, parallel};
use rigctl::plot::{Block, Figure, KeyRow, Panel, RGBColor};
use serde::Serialize;
use tsa_model::{Mechanism, SolveError, Tier, TierError, twist_from_turns};
use tsa_table::instruction_model::lookup_instructions;

/// Demanded accuracy of the contraction (m); TR is left free.
const WANTED_M: [f64; 3] = [5e-6, 24e-6, 100e-6];
/// Loads and twists of a map.
const CELLS: (usize, usize) = (32, 36);
/// The scenes of the table, in the folder of the operator's scene.
const SCENES: [(&str, &str); 5] = [
    ("finger", "finger"),
    ("demonstration", "0.1 to 0.5 kg"),
    ("default", "the paper's rig"),
    ("niti-plateau", "plateau rod"),
    ("long-string", "long string"),
];

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

/// The cheapest tier at a state whose own estimate meets the demand, and the error of its contraction (m).
fn cheapest(m: &Mechanism, load_n: f64, turns: f64, wanted: TierError) -> Result<(Tier, f64), SolveError> {
    let twist_rad = twist_from_turns(turns);
    let found = m.solve_auto(load_n, twist_rad, wanted)?;
    let full = m.solve_tier(Tier::Full, load_n, twist_rad)?;
    Ok((found.tier, (found.contraction_m() - full.contraction_m()).abs()))
}

/// Which share of some states each tier has, in words.
fn shares(tiers: &[Tier]) -> String {
    let count = |tier: Tier| tiers.iter().filter(|t| **t == tier).count();
    let shares = Tier::ALL
        .into_iter()
        .filter(|tier| count(*tier) > 0)
        .map(|tier| format!("{:.0} % {}", 100.0 * count(tier) as f64 / tiers.len().max(1) as f64, tier.name()));
    shares.collect::<Vec<_>>().join(", ")
}

/// One map: a scene and an accuracy.
struct Map {
    scene: String,
    wanted_m: f64,
    grid: Grid,
    cells: Vec<Result<(Tier, f64), SolveError>>,
}

/// A state of a map, a line of `tiers.csv`.
#[derive(Serialize)]
struct Row {
    scene: String,
    wanted_m: String,
    load_n: String,
    turns: String,
    /// Or why the state has none.
    tier: &'static str,
    contraction_error_m: Option<String>,
}

impl Map {
    fn new(scene: &Scene, name: &str, wanted_m: f64, progress: &Progress<'_>) -> Result<Self> {
        let envelope = scene.table_demand()?.0;
        let grid = Grid::new(envelope.load_n, CELLS.0, envelope.turns, CELLS.1);
        let (m, states) = (scene.mechanism()?, grid.states());
        let wanted = TierError { contraction_m: wanted_m, tr_relative: f64::INFINITY };
        let cells = parallel(progress, states.len(), |k| cheapest(&m, states[k].0, states[k].1, wanted));
        Ok(Self { scene: name.into(), wanted_m, grid, cells })
    }

    fn panel(&self) -> Panel {
        let colour = |k: usize| self.cells[k].as_ref().map_or(NO_EQUILIBRIUM, |(tier, _)| COLOURS[*tier as usize]);
        self.grid.panel(format!("{}, {:.0} um", self.scene, self.wanted_m * 1e6), colour)
    }

    fn finding(&self) -> String {
        let solved = || self.cells.iter().flatten();
        let tiers: Vec<Tier> = solved().map(|(tier, _)| *tier).collect();
        let worst = solved().map(|(_, e)| *e).fold(0.0, f64::max);
        format!("{}, {:.0} um: {}; worst {:.2} um", self.scene, self.wanted_m * 1e6, shares(&tiers), worst * 1e6)
    }

    fn rows(&self) -> impl Iterator<Item = Row> {
        self.grid.states().into_iter().zip(&self.cells).map(|((load, turns), cell)| Row {
            scene: self.scene.clone(),
            wanted_m: format!("{:.0e}", self.wanted_m),
            load_n: format!("{load:.5}"),
            turns: format!("{turns:.5}"),
            tier: cell.as_ref().map_or_else(SolveError::kind, |(tier, _)| tier.name()),
            contraction_error_m: cell.as_ref().ok().map(|(_, error)| format!("{error:.3e}")),
        })
    }
}

/// Draws the cheapest tiers of the scene and of the one with a plateau.
///
/// # Errors
/// If a scene has no envelope, or the drawing fails.
pub fn maps(inputs: &Inputs<'_>) -> Result<Made> {
    let plateau = inputs.scene_file.with_file_name("niti-plateau.toml");
    let mut scenes = vec![(stem(inputs.scene_file), inputs.scene.clone())];
    if plateau != inputs.scene_file
        && let Ok(other) = Scene::load(&plateau)
    {
        scenes.push((stem(&plateau), other));
    }
    let row = |(name, scene): &(String, Scene)| {
        WANTED_M.iter().map(|m| Map::new(scene, name, *m, inputs.progress)).collect::<Result<Vec<_>>>()
    };
    let rows = scenes.iter().map(row).collect::<Result<Vec<_>>>()?;
    let key = Tier::ALL.map(|t| KeyRow::fill(COLOURS[t as usize], t.name()));
    let figure = Figure {
        heading: "The cheapest model that is good enough for the contraction".into(),
        rows: rows.iter().map(|row| Panel::side_by_side(row.iter().map(Map::panel))).collect(),
        panel_size: (400, 330),
        blocks: key.chunks(2).map(|rows| Block { rows: rows.to_vec() }).collect(),
        notes: vec![
            "Each model chosen by its own estimate of its error; the true error against the full model is in the data. \
             Nothing is asked of TR here."
                .into(),
        ],
    };
    let all = || rows.iter().flatten();
    Made::new("tiers", &figure, csv(all().flat_map(Map::rows))?, all().map(Map::finding).collect())
}

/// The model and table of one scene, a line of `scenes.csv`.
#[derive(Serialize)]
struct Taken {
    scene: &'static str,
    asked_contraction_m: f64,
    asked_tr_relative: f64,
    tier: &'static str,
    tier_shares: String,
    table_form: &'static str,
    table_size: String,
    bytes: usize,
    predicted_instructions: u32,
    contraction_error_m: String,
    tr_relative_error: String,
    #[serde(skip)]
    finding: String,
}

/// The models and tables of five scenes.
///
/// # Errors
/// If one of them is not there, or allows no table.
pub fn scenes(inputs: &Inputs<'_>) -> Result<Made> {
    let taken = parallel(inputs.progress, SCENES.len(), |k| {
        let (name, title) = SCENES[k];
        taken(&Scene::load(inputs.scene_file.with_file_name(format!("{name}.toml")))?, name, title)
    });
    let taken = taken.into_iter().collect::<Result<Vec<_>>>()?;
    let findings = taken.iter().map(|t| t.finding.clone()).collect();
    Ok(Made { name: "scenes", svg: None, csv: csv(taken)?, findings, left_out: Vec::new() })
}

fn taken(scene: &Scene, name: &'static str, title: &'static str) -> Result<Taken> {
    let (envelope, accuracy) = scene.table_demand()?;
    let mechanism = scene.mechanism()?;
    let wanted = TierError { contraction_m: accuracy.contraction_m, tr_relative: accuracy.tr_relative };
    let states = Grid::new(envelope.load_n, 16, envelope.turns, 16).states();
    let tier = |(load, turns): &(f64, f64)| Ok(cheapest(&mechanism, *load, *turns, wanted)?.0);
    let tiers = states.iter().map(tier).collect::<Result<Vec<_>, SolveError>>()?;
    let dearest = tiers.iter().copied().max_by_key(|t| *t as usize).unwrap_or(Tier::Full);
    let fit = scene.fit_table().context(name)?;
    let (series, errors) = (fit.table.numbers.series(), &fit.certificate.errors);
    let (shares, size, instructions) = (shares(&tiers), fit.table.numbers.size(), lookup_instructions(&series));
    Ok(Taken {
        finding: format!(
            "{title:<16} asked {:>3.0} um, {:.1} %: {:<13} ({shares}); {} of {size}, {} bytes, {instructions} instructions, \
             worst {:.1} um, {:.2} %",
            accuracy.contraction_m * 1e6,
            accuracy.tr_relative * 1e2,
            dearest.name(),
            tsa_table::FORM,
            series.bytes(),
            errors.contraction_max_m * 1e6,
            errors.tr_max * 1e2
        ),
        scene: name,
        asked_contraction_m: accuracy.contraction_m,
        asked_tr_relative: accuracy.tr_relative,
        tier: dearest.name(),
        tier_shares: shares,
        table_form: tsa_table::FORM,
        table_size: size,
        bytes: series.bytes(),
        predicted_instructions: instructions,
        contraction_error_m: format!("{:.3e}", errors.contraction_max_m),
        tr_relative_error: format!("{:.3e}", errors.tr_max),
    })
}
