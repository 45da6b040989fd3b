//! `tsa-lab budget`: what each part of a rig contributes to the errors of position and load, and how accurate a table is worth
//! having.

use super::{At, Budget, Part, Rig, SESSION_S, SPEED_M_PER_S, Share, Spread, WORTH};
use rig_config::{Accuracy, Scene, SceneError, TableError};
use rig_plant::RigPreset;
use rigctl::failure::Failure;
use rigctl::options::Global;
use rigctl::options::values::gauge_error;
use rigctl::output::{Output, progress};
use serde::Serialize;
use std::path::Path;
use tsa_model::Tier;
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
struct Enough {
    scene: String,
    rig: &'static str,
    /// 90 % half widths of all parts but tier and table.
    position_m: f64,
    load_relative: f64,
    /// Cheapest tier of the model that is enough.
    tier: &'static str,
    /// The table that is enough, and that of the accuracy in the scene.
    enough: TableCost,
    /// None where the scene has none.
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
        let tier = budget.choose_tier();
        let parts = Part::ALL.map(|part| (part.name(), budget.share(part)));
        for (part, Share { position_m, load }) in &parts {
            let [position_m, load_relative] = [position_m.all, load.all];
            let object = serde_json::json!({ "part": part, "position_m": position_m, "load_relative": load_relative });
            output.object(&object)?;
        }
        heading(global, &scene, kind, self.gauge)?.iter().try_for_each(|line| output.line(line))?;
        parts.iter().chain([&("total", budget.total())]).try_for_each(|(part, share)| output.line(row(part, share)))?;
        let enough = cost(worth, enough);
        let used = used.map(|(accuracy, fit)| cost(accuracy, fit));
        closing(tier, &enough, used.as_ref()).iter().try_for_each(|line| output.line(line))?;
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
            let used =
                scene.accuracy.map(|accuracy| Ok::<_, Failure>(cost(accuracy, fit(&scene, accuracy)?))).transpose()?;
            for kind in RigPreset::ALL {
                let mut budget = self.budget(&scene, kind)?;
                let worth = budget.worth();
                let Share { position_m, load } = budget.total();
                let tier = budget.choose_tier();
                let enough = Enough {
                    scene: name.clone(),
                    rig: kind.name(),
                    position_m: position_m.all,
                    load_relative: load.all,
                    tier: tier.name(),
                    enough: cost(worth, fit(&scene, worth)?),
                    used: used.clone(),
                };
                output.object(&enough)?;
                output.line(enough.text())?;
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(())
    }

    fn budget<'a>(&self, scene: &'a Scene, kind: RigPreset) -> Result<Budget<'a>, SceneError> {
        Budget::new(scene, &Rig { sizes: &|key| kind.rms(key), gauge_m: self.gauge })
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

fn cost(accuracy: Accuracy, fit: Option<Fit>) -> TableCost {
    let size = |fit: Fit| TableSize {
        bytes: fit.table.numbers.bytes(),
        instructions: lookup_instructions(&fit.table.numbers.series()),
        size: fit.table.numbers.size(),
        contraction_error_m: fit.certificate.errors.contraction_max_m,
        tr_relative_error: fit.certificate.errors.tr_max,
    };
    TableCost { contraction_m: accuracy.contraction_m, tr_relative: accuracy.tr_relative, table: fit.map(size) }
}

/// The scenes of a folder that say what a table must cover, by name.
fn scenes(folder: &Path) -> Result<Vec<(String, Scene)>, Failure> {
    let failed = |e: std::io::Error| Failure::failed(format!("folder {}: {e}", folder.display()));
    let entries =
        std::fs::read_dir(folder).and_then(|entries| entries.collect::<Result<Vec<_>, _>>()).map_err(failed)?;
    let mut files: Vec<_> = entries.into_iter().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|end| end == "toml"));
    files.sort();
    let mut found = Vec::new();
    for file in files {
        let scene = rigctl::scene_file::load(&file)?;
        if scene.envelope.is_some() {
            found.push((file.file_stem().unwrap_or_default().to_string_lossy().into_owned(), scene));
        }
    }
    Ok(found)
}

fn heading(global: &Global, scene: &Scene, kind: RigPreset, gauge_m: Option<f64>) -> Result<[String; 3], Failure> {
    let envelope = scene.covered()?;
    let [[from_n, to_n], [from, to]] = [envelope.load_n, envelope.turns];
    let lvdt = match gauge_m {
        Some(gauge_m) => format!("calibrated at points with gauges of {} um", 1e6 * gauge_m),
        None => "not calibrated at points".into(),
    };
    Ok([
        format!(
            "error budget of {} on a rig that is {kind}: half widths that hold 90 of 100 cases",
            global.scene.display()
        ),
        format!(
            "  {from_n} to {to_n} N, {from} to {to} turns; moves at {} mm/s, {} min after homing; LVDT {lvdt}",
            1e3 * SPEED_M_PER_S,
            SESSION_S / 60.0
        ),
        format!(
            "{:<9} {:>11}   {:<34} {:>8}   {}",
            "part", "position", "worst; typical (N, turns)", "load", "worst; typical (N, turns)"
        ),
    ])
}

fn row(part: &str, share: &Share) -> String {
    let places = |spread: &Spread, scale: f64, unit: &str| {
        let place = |at: &At| format!("{:.1}, {:.2}", at.load_n, at.turns);
        format!("{:.1} {unit} at {}; {}", scale * spread.worst.error, place(&spread.worst), place(&spread.typical))
    };
    let Share { position_m, load } = share;
    format!(
        "{part:<9} {:>8.1} um   {:<34} {:>6.2} %   {}",
        1e6 * position_m.all,
        places(position_m, 1e6, "um"),
        1e2 * load.all,
        places(load, 1e2, "%")
    )
}

/// Which table and tier are enough, and what is used.
fn closing(tier: Tier, enough: &TableCost, used: Option<&TableCost>) -> Vec<String> {
    let mut lines = vec![
        format!(
            "more than {} buys nothing: the total of the other parts rises by {} % at most",
            enough.wanted(),
            1e2 * WORTH
        ),
        format!("  that takes {}", enough.takes()),
        format!(
            "  tier {} is the cheapest model that is enough by itself, and the one that `tier` counts; tables are fitted to the \
             full one, which costs the board nothing",
            tier.name()
        ),
    ];
    if let Some(used) = used {
        lines.push(format!("  the scene asks for {}: {}", used.wanted(), used.takes()));
    }
    lines
}

impl TableCost {
    fn wanted(&self) -> String {
        format!("{} um of contraction and {} % of TR", digits(1e6 * self.contraction_m), digits(1e2 * self.tr_relative))
    }

    fn takes(&self) -> String {
        let Some(table) = &self.table else { return "no table reaches it".into() };
        format!(
            "{} bytes, {} instructions a lookup (predicted), {} ({}); its errors: {:.2} um, {:.3} %",
            table.bytes,
            table.instructions,
            tsa_table::FORM,
            table.size,
            1e6 * table.contraction_error_m,
            1e2 * table.tr_relative_error
        )
    }

    /// Bytes and instructions, for a column.
    fn brief(&self) -> String {
        self.table.as_ref().map_or("no table".into(), |table| format!("{}, {}", table.bytes, table.instructions))
    }
}

/// A number of two digits after it was scaled.
fn digits(value: f64) -> String {
    ((value * 1e6).round() / 1e6).to_string()
}

impl Enough {
    fn text(&self) -> String {
        let used = self.used.as_ref().map_or("-".into(), |used| {
            let TableCost { contraction_m, tr_relative, .. } = used;
            format!("{} um, {} %: {}", digits(1e6 * contraction_m), digits(1e2 * tr_relative), used.brief())
        });
        format!(
            "{:<14} {:<8} {:>6.0} um {:>6.1} %  {:<13} {:>6} um, {:>5} %: {:<11}   {used}",
            self.scene,
            self.rig,
            1e6 * self.position_m,
            1e2 * self.load_relative,
            self.tier,
            digits(1e6 * self.enough.contraction_m),
            digits(1e2 * self.enough.tr_relative),
            self.enough.brief()
        )
    }
}
