//! `tsa-lab budget`: what each part of a rig contributes to the errors of position and load, and how accurate a table is worth
//! having.

use super::{Budget, Fraction, Part, RigErrors, SESSION_S, SPEED_M_PER_S, WORTH};
use rig_config::{Accuracy, Scene, SceneError, TableError};
use rig_plant::RigPreset;
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::options::values::gauge_error;
use rigctl::output::{Output, progress};
use rigctl::units::{MM_PER_S, N, PERCENT, S, TURNS, UM};
use serde::Serialize;
use std::path::Path;
use tsa_table::fit::{Fit, FitError};
use tsa_table::instruction_model::lookup_instructions;

/// `tsa-lab budget`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The LVDT is calibrated at points with gauges of this error, as for `calibrate lvdt --points` [default: it is not]
    #[arg(long, value_name = "E", value_parser = gauge_error)]
    gauge: Option<f64>,
    /// The table and tier that are enough, for every scene in the folder of --scene and each kind of rig, beside what is used
    #[arg(long)]
    pub all: bool,
}

/// A table for an accuracy.
#[derive(Clone, Serialize)]
struct TableCost {
    contraction_m: f64,
    tr_relative: f64,
    /// None where no table reaches it.
    table: Option<TableSize>,
}

#[derive(Clone, Serialize)]
struct TableSize {
    bytes: usize,
    instructions: u32,
    size: String,
    contraction_error_m: f64,
    tr_relative_error: f64,
}

/// What is enough in a scene on a kind of rig.
#[derive(Serialize)]
struct Enough<'a> {
    scene: &'a str,
    rig: &'static str,
    /// 90 % half widths of all parts but tier and table.
    position_m: f64,
    load_relative: f64,
    /// Cheapest tier of the model that is enough.
    tier: &'static str,
    enough: TableCost,
    /// The table of the accuracy in the scene; none where it has none.
    used: Option<TableCost>,
}

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// If a scene has no envelope, a state of it has no equilibrium, no table reaches an accuracy, or the folder cannot be read.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        if self.all { self.every_scene(global, output) } else { self.one_scene(global, output) }
    }

    /// The budget of one scene on the kind of rig at --rig.
    fn one_scene(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let scene = global.scene()?;
        let kind = global.board.rig.unwrap_or_default();
        let mut budget = self.budget(&scene, kind)?;
        let worth = budget.worth();
        let enough = fit(&scene, worth)?;
        let used = scene.accuracy.map(|accuracy| Ok::<_, Failure>((accuracy, fit(&scene, accuracy)?))).transpose()?;
        // The table that the firmware has; that which is enough where the scene says nothing.
        if let Some(fit) = used.as_ref().map_or(enough.as_ref(), |(_, fit)| fit.as_ref()) {
            budget.set_table(&fit.table.table());
        }
        let tier = budget.choose_tier().name();
        let parts = Part::ALL.map(|part| (part.name(), budget.fraction(part)));
        for (part, Fraction { position_m, load: load_relative }) in &parts {
            let object = serde_json::json!({ "part": part, "position_m": position_m, "load_relative": load_relative });
            output.object(&object)?;
        }
        let covered = scene.covered()?;
        let lvdt = match self.gauge {
            Some(gauge_m) => format!("calibrated at points with gauges of {}", UM.exact(gauge_m)),
            None => "not calibrated at points".into(),
        };
        let file = global.scene.display();
        output.line(format!("error budget of {file} on an actuator that is {kind}: 90 % uncertainties"))?;
        output.line(format!(
            "  {}, {}; moves at {}, {} after homing; LVDT {lvdt}",
            N.range(covered.load_n),
            TURNS.range(covered.turns),
            MM_PER_S.exact(SPEED_M_PER_S),
            S.exact(SESSION_S)
        ))?;
        output.line(format!("{:<9} {:>11} {:>8}", "part", "position", "load"))?;
        parts.iter().chain([&("total", budget.total())]).try_for_each(|(part, Fraction { position_m, load })| {
            output.line(format!("{part:<9} {:>11} {:>8}", UM.error(*position_m), PERCENT.error(*load)))
        })?;
        let enough = TableCost::new(worth, enough);
        output.line(format!(
            "more than {} buys nothing: the total of the other parts rises by {} at most",
            enough.wanted(),
            PERCENT.exact(WORTH)
        ))?;
        output.line(format!("  that takes {}", enough.takes()))?;
        output.line(format!(
            "  tier {tier} is the cheapest model that is enough by itself, and the one that `tier` counts; tables are fitted to \
             the full one, which costs the board nothing"
        ))?;
        if let Some((accuracy, fit)) = used {
            let used = TableCost::new(accuracy, fit);
            output.line(format!("  the scene asks for {}: {}", used.wanted(), used.takes()))?;
        }
        Ok(())
    }

    /// What is enough, for every scene in the folder of --scene that a table can be made for, on each kind of rig.
    fn every_scene(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let folder = global.scene.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let scenes = scenes(folder)?;
        let bar = progress(scenes.len() as u64, "budget");
        output.line(format!(
            "{:<14} {:<8} {:>9} {:>8}  {:<13} {:<35}   used: typed accuracy",
            "scene", "rig", "position", "load", "tier", "enough: table, TR, bytes, lookup"
        ))?;
        for (name, scene) in scenes {
            let cost = |accuracy| Ok::<_, Failure>(TableCost::new(accuracy, fit(&scene, accuracy)?));
            let used = scene.accuracy.map(cost).transpose()?;
            for kind in RigPreset::ALL {
                let mut budget = self.budget(&scene, kind)?;
                let (Fraction { position_m, load: load_relative }, enough) = (budget.total(), cost(budget.worth())?);
                let (tier, rig, used) = (budget.choose_tier().name(), kind.name(), used.clone());
                let enough = Enough { scene: &name, rig, position_m, load_relative, tier, enough, used };
                output.object(&enough)?;
                output.line(enough.text())?;
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(())
    }

    fn budget<'a>(&self, scene: &'a Scene, kind: RigPreset) -> Result<Budget<'a>, SceneError> {
        Budget::new(scene, &RigErrors { sizes: &|key| kind.rms(key), gauge_m: self.gauge })
    }
}

/// The scene's table with another accuracy; none if no table reaches it.
fn fit(scene: &Scene, accuracy: Accuracy) -> Result<Option<Fit>, Failure> {
    let scene = Scene { accuracy: Some(accuracy), ..scene.clone() };
    match scene.fit_table() {
        Ok(fit) => Ok(Some(fit)),
        Err(TableError::Fit(FitError::Accuracy { .. })) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// The scenes of a folder that say what a table must cover, by name.
fn scenes(folder: &Path) -> Result<Vec<(String, Scene)>, Failure> {
    let failed = |e: std::io::Error| Failure::failed(format!("folder {}: {e}", folder.display()));
    let entries =
        std::fs::read_dir(folder).and_then(|entries| entries.collect::<Result<Vec<_>, _>>()).map_err(failed)?;
    let mut files: Vec<_> = entries.into_iter().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|end| end == "toml"));
    files.sort();
    let load = |file: &std::path::PathBuf| {
        Ok((file.file_stem().unwrap_or_default().to_string_lossy().into_owned(), rigctl::scene_file::load(file)?))
    };
    let mut found = files.iter().map(load).collect::<Result<Vec<(String, Scene)>, Failure>>()?;
    found.retain(|(_, scene)| scene.envelope.is_some());
    Ok(found)
}

impl TableCost {
    fn new(Accuracy { contraction_m, tr_relative }: Accuracy, fit: Option<Fit>) -> Self {
        let table = fit.map(|fit| TableSize {
            bytes: fit.table.numbers.bytes(),
            instructions: lookup_instructions(&fit.table.numbers.series()),
            size: fit.table.numbers.size(),
            contraction_error_m: fit.error_bounds.errors.contraction_max_m,
            tr_relative_error: fit.error_bounds.errors.tr_max,
        });
        Self { contraction_m, tr_relative, table }
    }

    fn wanted(&self) -> String {
        format!("{} of contraction and {} of TR", UM.exact(self.contraction_m), PERCENT.exact(self.tr_relative))
    }

    fn takes(&self) -> String {
        let Some(table) = &self.table else { return "no table reaches it".into() };
        let TableSize { bytes, instructions, size, contraction_error_m, tr_relative_error } = table;
        format!(
            "{bytes} bytes, {instructions} instructions a lookup (predicted), {} ({size}); its errors: {}, {}",
            tsa_table::FORM,
            UM.error(*contraction_error_m),
            PERCENT.error(*tr_relative_error)
        )
    }

    /// Bytes and instructions, for a column.
    fn brief(&self) -> String {
        self.table.as_ref().map_or("no table".into(), |table| format!("{}, {}", table.bytes, table.instructions))
    }
}

impl Enough<'_> {
    fn text(&self) -> String {
        let cost = |cost: &TableCost| {
            format!("{}, {}: {}", UM.exact(cost.contraction_m), PERCENT.exact(cost.tr_relative), cost.brief())
        };
        let used = self.used.as_ref().map_or("none".into(), cost);
        let Self { scene, rig, tier, .. } = self;
        let (position, load, enough) =
            (UM.error(self.position_m), PERCENT.error(self.load_relative), cost(&self.enough));
        format!("{scene:<14} {rig:<8} {position:>9} {load:>8}  {tier:<13} {enough:<35}   {used}")
    }
}
