//! One value of a scene varied over any range: what contraction and TR become, and where a limit of the model ends them.

use crate::curves::{self, Curve};
use crate::published::numbers::{body, warnings};
use crate::range::{TurnRange, Vary};
use crate::scene_key::{self, KeyError};
use crate::trace::{self, Trace, trace};
use crate::{csv, table};
use anyhow::{Context, Result};
use rig_config::Scene;
use rigctl::failure::Failure;
use rigctl::identify::data::Quantity;
use rigctl::options::Global;
use rigctl::options::values::load;
use rigctl::out_file::write_file;
use rigctl::output::Output;
use rigctl::plot::{Figure, Panel, colour};
use serde::Serialize;
use serde_json::{Value, json};
use std::path::PathBuf;
use tsa_model::{Equilibrium, Mechanism, twist_from_turns};

/// `tsa-lab study`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Which value, between which limits, and how many (default 5); `log` spaces them in equal ratios. KEY is
    /// D0, R, L0, r0, K, c, k1, k2, k3, k4, p or a key of a scene file
    #[arg(long, value_name = "KEY=FROM..TO[:COUNT[log]]")]
    vary: Vary,
    /// Load on the rods (N or kg)
    #[arg(long, value_name = "L", default_value = "7.5N", allow_hyphen_values = true, value_parser = load)]
    load: f64,
    /// Turns past the half-turn pre-twist
    #[arg(long, value_name = "FROM..TO", default_value = "0..7.5", allow_hyphen_values = true)]
    turns: TurnRange,
    /// Also write study.csv, study-curves.csv and study.svg into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// The result for one value, a line of `study.csv`. SI units; nothing where a limit of the model leaves it unknown.
#[derive(Debug, Serialize)]
struct Point {
    /// The varied key as in a scene file.
    key: String,
    value: f64,
    load_n: f64,
    turns_start: f64,
    turns_end: f64,
    /// Since the half-turn pre-twist, at the last turn.
    contraction_m: Option<f64>,
    tr_start_rad_per_m: Option<f64>,
    tr_end_rad_per_m: Option<f64>,
    /// Between the rods' tips.
    span_start_m: Option<f64>,
    span_end_m: Option<f64>,
    /// At the clamp, at the last turn.
    bending_strain: Option<f64>,
    warnings: String,
    /// Kind of what ends the curve before its last turn, and the last turns before it; none if already the first are refused.
    limit: Option<String>,
    limit_turns: Option<f64>,
    /// The limit in words.
    #[serde(skip)]
    limit_message: String,
}

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// If the scene has no such key, one of the values can describe no rig, or the folder cannot be written.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let (points, curves) = self.solve(&global.scene()?).map_err(|e| match e {
            KeyError::Value(_) => Failure::failed(format!("vary: {e}")),
            KeyError::Form(_) | KeyError::Unknown { .. } => Failure::Usage(format!("vary: {e}")),
        })?;
        let Self { vary, load: load_n, turns: TurnRange { from, to }, out } = self;
        let symbol = scene_key::symbol(&vary.key);
        for point in &points {
            output.object(&point.json()?)?;
        }
        output.line(format!("{} at {load_n} N, {from} to {to} turns past the half-turn pre-twist", vary.key))?;
        output.line(format!(
            "{symbol:>12}  {:>14}  {:>21}  {:>17}  {:>8}  remarks",
            "contraction mm", "TR rad/mm", "span mm", "strain %"
        ))?;
        points.iter().zip(&curves).try_for_each(|(point, curve)| output.line(point.text(&curve.label)))?;
        if let Some(folder) = out {
            let lines = points.iter().zip(&curves).flat_map(|(point, curve)| {
                let finite = |tr: f64| Some(tr).filter(|tr| tr.is_finite());
                let line = move |p: &trace::Point| (point.value, p.turns, p.contraction_m, finite(p.tr_rad_per_m));
                curve.way.reached.iter().map(move |p| (&point.key, line(p)))
            });
            let header = "key,value,turns,contraction_m,tr_rad_per_m";
            let heading = format!("{symbol} varied, {load_n} N, scene {}", global.scene.display());
            let files = [
                ("study.csv", csv(&points)?),
                ("study-curves.csv", table(header, lines)?),
                ("study.svg", figure(heading, symbol, &[curves], [*from, *to]).svg()?),
            ];
            files.iter().try_for_each(|(name, content)| write_file(folder, name, content))?;
            output.line(format!("written: {} in {}", files.map(|(name, _)| name).join(", "), folder.display()))?;
        }
        Ok(())
    }

    /// A point and a curve for every value. All values are checked first: one that no rig can have stops the study before it begins.
    fn solve(&self, scene: &Scene) -> Result<(Vec<Point>, Vec<Curve>), KeyError> {
        let values = self.vary.values();
        let mechanism = |value: &f64| Ok(scene_key::set(scene, &self.vary.key, (*value).into())?.mechanism()?);
        let mechanisms = values.iter().map(mechanism).collect::<Result<Vec<Mechanism>, KeyError>>()?;
        let solved = values.iter().zip(&mechanisms).enumerate().map(|(k, (value, mechanism))| {
            let way = trace(mechanism, self.load, [self.turns.from, self.turns.to], curves::STEPS);
            let point = self.point(*value, mechanism, &way);
            (point, Curve { label: scene_key::shown(&self.vary.key, *value), colour: colour(k, values.len()), way })
        });
        Ok(solved.unzip())
    }

    fn point(&self, value: f64, mechanism: &Mechanism, way: &Trace) -> Point {
        let TurnRange { from, to } = self.turns;
        let at = |turns| mechanism.solve(self.load, twist_from_turns(turns));
        let (pretwist, start) = (at(0.0), at(from).ok());
        let ends = way.ends.first().map(|e| (e.limit.clone(), e.at.map(|p| p.turns)));
        let limit = ends.or_else(|| pretwist.as_ref().err().map(|e| (body(e), None)));
        let end = at(to).ok().filter(|_| limit.is_none());
        Point {
            key: self.vary.key.clone(),
            value,
            load_n: self.load,
            turns_start: from,
            turns_end: to,
            contraction_m: end.zip(pretwist.ok()).map(|(end, pretwist)| pretwist.gap_m - end.gap_m),
            tr_start_rad_per_m: start.as_ref().and_then(Equilibrium::finite_tr_rad_per_m),
            tr_end_rad_per_m: end.as_ref().and_then(Equilibrium::finite_tr_rad_per_m),
            span_start_m: start.map(|e| e.d_m),
            span_end_m: end.map(|e| e.d_m),
            bending_strain: end.map(|e| e.bending_strain),
            warnings: warnings(start.iter().chain(&end)).join(" "),
            limit_turns: limit.as_ref().and_then(|(_, turns)| *turns),
            limit_message: limit.as_ref().map_or(String::new(), |(what, _)| what.message.clone()),
            limit: limit.map(|(what, _)| what.kind),
        }
    }
}

impl Point {
    /// As `--json` prints it: the warnings as a list, the limit with its words.
    fn json(&self) -> Result<Value> {
        let mut point = serde_json::to_value(self)?;
        point["warnings"] = self.warnings.split_whitespace().collect();
        let fields = point.as_object_mut().context("a point is an object")?;
        let turns = fields.remove("limit_turns");
        if let Some(Value::String(kind)) = fields.remove("limit") {
            let limit = json!({ "kind": kind, "message": self.limit_message, "turns": turns });
            fields.insert("limit".into(), limit);
        }
        Ok(point)
    }

    fn text(&self, value: &str) -> String {
        let cell = |value: Option<f64>, factor: f64, places: usize| {
            value.map_or("–".into(), |v| format!("{:.places$}", v * factor))
        };
        let way =
            |start, end, factor, places| format!("{} → {}", cell(start, factor, places), cell(end, factor, places));
        let remark = match (&self.limit, self.limit_turns) {
            (None, _) => self.warnings.replace(' ', ", "),
            (Some(kind), Some(turns)) => format!("{kind} after {turns:.3} turns"),
            (Some(kind), None) => format!("{kind} from the start"),
        };
        let line = format!(
            "{value:>12}  {:>14}  {:>21}  {:>17}  {:>8}  {remark}",
            cell(self.contraction_m, 1e3, 4),
            way(self.tr_start_rad_per_m, self.tr_end_rad_per_m, 1e-3, 4),
            way(self.span_start_m, self.span_end_m, 1e3, 2),
            cell(self.bending_strain, 1e2, 3),
        );
        line.trim_end().to_owned()
    }
}

fn figure(heading: String, symbol: &str, columns: &[Vec<Curve>], turns: [f64; 2]) -> Figure {
    let panels = |group, title: &str| {
        let panels = curves::panels(group, columns, &[], turns);
        panels.into_iter().map(|panel| Panel { title: title.into(), ..panel }).collect()
    };
    let key = [curves::colour_key(symbol, &columns[0])];
    Figure {
        heading,
        rows: curves::grid(vec![
            panels(Quantity::Contraction, "contraction"),
            panels(Quantity::Tr, "transmission ratio"),
        ]),
        panel_size: (590, 430),
        blocks: key.into_iter().chain(curves::limit_key(columns)).collect(),
        notes: Vec::new(),
    }
}
