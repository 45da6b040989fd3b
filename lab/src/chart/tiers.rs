//! The cheapest model over load and twist, and the model and table that each of five scenes needs.

use super::grid::Grid;
use super::{Inputs, Made};
use anyhow::{Context, Result};
use plotters::style::RGBColor;
use rig_config::Scene;
use rigctl::csv_text::csv_text;
use rigctl::parallel::{Progress, parallel};
use rigctl::plot::{Axis, Block, Figure, Item, KeyRow, Panel, Sample};
use std::path::Path;
use tsa_model::{Mechanism, SolveError, Tier, TierError, twist_from_turns};

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

/// The cheapest tier at a state whose own estimate meets the demand, and the error of its contraction (m).
fn cheapest(m: &Mechanism, load_n: f64, turns: f64, wanted: TierError) -> Result<(Tier, f64), SolveError> {
    let twist_rad = twist_from_turns(turns);
    let found = m.solve_auto(load_n, twist_rad, wanted)?;
    let full = m.solve_tier(Tier::Full, load_n, twist_rad)?;
    Ok((found.tier, (found.contraction_m() - full.contraction_m()).abs()))
}

/// One map: a scene and an accuracy.
struct Map {
    scene: String,
    wanted_m: f64,
    grid: Grid,
    cells: Vec<Result<(Tier, f64), SolveError>>,
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

    fn panel(&self, first: bool) -> Panel {
        let loads = self.grid.load_n.len();
        let tier = |k: usize| self.cells[k].as_ref().ok().map(|(tier, _)| *tier);
        let fills = self.grid.strips(|a, b| tier(a) == tier(b)).into_iter().map(|s| {
            let colour = tier(s.cell).map_or(RGBColor(222, 222, 222), |t| COLOURS[t as usize]);
            Item::Fill { from: s.from, to: s.to, colour }
        });
        let x = Axis::linear("turns past the pre-twist", self.grid.turn_range).tight(self.grid.turn_range);
        let ticks = [0.5, 1.0, 2.0, 5.0, 10.0].map(|load| (load, load.to_string()));
        let y = Axis::log_named("load, N", self.grid.load_range_n, ticks.to_vec());
        debug_assert_eq!(loads * self.grid.turns.len(), self.cells.len());
        Panel {
            title: format!("{}, {:.0} um", self.scene, self.wanted_m * 1e6),
            x,
            y: if first { y } else { y.unnamed() },
            items: fills.collect(),
        }
    }

    fn finding(&self) -> String {
        let solved: Vec<&(Tier, f64)> = self.cells.iter().filter_map(|c| c.as_ref().ok()).collect();
        let share = |tier: Tier| solved.iter().filter(|(t, _)| *t == tier).count() as f64 / solved.len().max(1) as f64;
        let shares: Vec<String> = Tier::ALL
            .into_iter()
            .filter(|t| share(*t) > 0.0)
            .map(|t| format!("{:.0} % {}", share(t) * 100.0, t.name()))
            .collect();
        let worst = solved.iter().map(|(_, e)| *e).fold(0.0, f64::max);
        format!("{}, {:.0} um: {}; worst {:.2} um", self.scene, self.wanted_m * 1e6, shares.join(", "), worst * 1e6)
    }
}

/// Draws the cheapest tiers of the scene and of the one with a plateau.
///
/// # Errors
/// If a scene has no envelope, or the drawing fails.
pub fn maps(inputs: &Inputs<'_>) -> Result<Made> {
    let scene_file = inputs.scene_file;
    let name = |file: &Path| file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut scenes = vec![(name(scene_file), inputs.scene.clone())];
    let plateau = scene_file.with_file_name("niti-plateau.toml");
    if plateau != scene_file
        && let Ok(other) = Scene::load(&plateau)
    {
        scenes.push((name(&plateau), other));
    }
    let mut rows = Vec::new();
    for (name, scene) in &scenes {
        rows.push(WANTED_M.iter().map(|m| Map::new(scene, name, *m, inputs.progress)).collect::<Result<Vec<_>, _>>()?);
    }
    let key = Tier::ALL.into_iter().map(|t| KeyRow::sample(Sample::Fill(COLOURS[t as usize]), t.name()));
    let key: Vec<KeyRow> = key.collect();
    let figure = Figure {
        heading: "The cheapest model that is good enough for the contraction".into(),
        rows: rows.iter().map(|row| row.iter().enumerate().map(|(k, m)| m.panel(k == 0)).collect()).collect(),
        panel_size: (400, 330),
        blocks: key.chunks(2).map(|rows| Block { rows: rows.to_vec() }).collect(),
        notes: vec![
            "Each model chosen by its own estimate of its error; the true error against the full model is in the data. \
             Nothing is asked of TR here."
                .into(),
        ],
    };
    let all: Vec<&Map> = rows.iter().flatten().collect();
    let findings = all.iter().map(|m| m.finding()).collect();
    Ok(Made { name: "tiers", svg: Some(figure.svg()?), csv: maps_csv(&all)?, findings, left_out: Vec::new() })
}

fn maps_csv(maps: &[&Map]) -> Result<String> {
    let lines = maps.iter().flat_map(|m| {
        m.grid.states().into_iter().zip(&m.cells).map(|((load, turns), cell)| {
            let (tier, error) = match cell {
                Ok((tier, error)) => (tier.name().to_owned(), format!("{error:.3e}")),
                Err(e) => (e.kind().to_owned(), String::new()),
            };
            vec![
                m.scene.clone(),
                format!("{:.0e}", m.wanted_m),
                format!("{load:.5}"),
                format!("{turns:.5}"),
                tier,
                error,
            ]
        })
    });
    csv_text(&["scene", "wanted_m", "load_n", "turns", "tier", "contraction_error_m"], lines.collect::<Vec<_>>())
}

/// The model and table of one scene.
struct Taken {
    scene: &'static str,
    title: &'static str,
    asked_m: f64,
    asked_tr: f64,
    tier: Tier,
    shares: String,
    form: &'static str,
    size: String,
    bytes: usize,
    instructions: u32,
    error_m: f64,
    error_tr: f64,
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
    let findings = taken.iter().map(|t| {
        format!(
            "{:<16} asked {:>3.0} um, {:.1} %: {:<13} ({}); {} of {}, {} bytes, {} instructions, worst {:.1} um, {:.2} %",
            t.title,
            t.asked_m * 1e6,
            t.asked_tr * 1e2,
            t.tier.name(),
            t.shares,
            t.form,
            t.size,
            t.bytes,
            t.instructions,
            t.error_m * 1e6,
            t.error_tr * 1e2
        )
    });
    let lines = taken.iter().map(|t| {
        vec![
            t.scene.into(),
            t.asked_m.to_string(),
            t.asked_tr.to_string(),
            t.tier.name().into(),
            t.shares.clone(),
            t.form.into(),
            t.size.clone(),
            t.bytes.to_string(),
            t.instructions.to_string(),
            format!("{:.3e}", t.error_m),
            format!("{:.3e}", t.error_tr),
        ]
    });
    let header = [
        "scene",
        "asked_contraction_m",
        "asked_tr_relative",
        "tier",
        "tier_shares",
        "table_form",
        "table_size",
        "bytes",
        "predicted_instructions",
        "contraction_error_m",
        "tr_relative_error",
    ];
    Ok(Made {
        name: "scenes",
        svg: None,
        csv: csv_text(&header, lines)?,
        findings: findings.collect(),
        left_out: Vec::new(),
    })
}

fn taken(scene: &Scene, name: &'static str, title: &'static str) -> Result<Taken> {
    let (envelope, accuracy) = scene.table_demand()?;
    let mechanism = scene.mechanism()?;
    let wanted = TierError { contraction_m: accuracy.contraction_m, tr_relative: accuracy.tr_relative };
    let states = Grid::new(envelope.load_n, 16, envelope.turns, 16).states();
    let mut counts = [0usize; 6];
    for (load, turns) in &states {
        counts[cheapest(&mechanism, *load, *turns, wanted)?.0 as usize] += 1;
    }
    let shares: Vec<String> = Tier::ALL
        .into_iter()
        .filter(|t| counts[*t as usize] > 0)
        .map(|t| format!("{:.0} % {}", 100.0 * counts[t as usize] as f64 / states.len() as f64, t.name()))
        .collect();
    let dearest = Tier::ALL.into_iter().rev().find(|t| counts[*t as usize] > 0).unwrap_or(Tier::Full);
    let fit = scene.fit_table().context(name)?;
    let table = fit.table.table();
    Ok(Taken {
        scene: name,
        title,
        asked_m: accuracy.contraction_m,
        asked_tr: accuracy.tr_relative,
        tier: dearest,
        shares: shares.join(", "),
        form: tsa_table::FORM,
        size: fit.table.numbers.size(),
        bytes: table.series.bytes(),
        instructions: tsa_table::instruction_model::lookup_instructions(&table.series),
        error_m: fit.certificate.errors.contraction_max_m,
        error_tr: fit.certificate.errors.tr_max,
    })
}
