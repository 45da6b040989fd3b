//! One value of a scene varied over any range: what contraction and TR become, and where a limit of the model ends them.

use crate::curves::{self, Curve};
use crate::published::numbers::warnings;
use crate::range::{Vary, turn_range};
use crate::scene_key::{self, KeyError};
use crate::trace::{self, Trace, trace};
use rig_config::Scene;
use rigctl::csv_text::below;
use rigctl::failure::{Failure, Refused};
use rigctl::identify::data::Quantity;
use rigctl::options::Global;
use rigctl::options::values::load;
use rigctl::out_file::write_file;
use rigctl::output::Output;
use rigctl::plot::{Figure, Panel, colour};
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
    #[arg(long, value_name = "FROM..TO", default_value = "0..7.5", allow_hyphen_values = true, value_parser = turn_range)]
    turns: [f64; 2],
    /// Also write study.csv, study-curves.csv and study.svg into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// The result for one value. SI units; nothing where a limit of the model leaves it unknown.
struct Point {
    value: f64,
    /// Since the half-turn pre-twist, at the last turn.
    contraction_m: Option<f64>,
    /// At the first turns and at the last.
    ends: [Option<Equilibrium>; 2],
    warnings: Vec<&'static str>,
    /// What ends the curve before its last turn, and the last turns before it; none if already the first are refused.
    limit: Option<(Refused, Option<f64>)>,
}

/// Numbers of a point, as `--json` and `study.csv` name them: contraction at the last turn, TR and span between the rods' tips at both
/// ends, strain at the clamp at the last turn.
const NUMBERS: [&str; 6] =
    ["contraction_m", "tr_start_rad_per_m", "tr_end_rad_per_m", "span_start_m", "span_end_m", "bending_strain"];

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// If the scene has no such key, one of the values can describe no rig, or the folder cannot be written.
    pub fn run(&self, global: &Global, output: &mut Output) -> Result<(), Failure> {
        let (points, curves) = self.solve(&global.scene()?).map_err(|e| match e {
            KeyError::Value(_) => Failure::failed(format!("vary: {e}")),
            KeyError::Key(_) => Failure::Usage(format!("vary: {e}")),
        })?;
        let Self { vary, load: load_n, turns: [from, to], out } = self;
        let symbol = scene_key::symbol(&vary.key);
        for point in &points {
            output.object(&self.json(point))?;
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
                curve.way.reached.iter().map(move |p| (&vary.key, line(p)))
            });
            let rows = points.iter().map(|point| {
                let (kind, turns) =
                    point.limit.as_ref().map_or((None, None), |(what, turns)| (Some(what.kind), *turns));
                let what = (&vary.key, point.value, load_n, from, to);
                (what, point.numbers(), point.warnings.join(" "), kind, turns)
            });
            let header =
                format!("key,value,load_n,turns_start,turns_end,{},warnings,limit,limit_turns", NUMBERS.join(","));
            let curves_header = "key,value,turns,contraction_m,tr_rad_per_m";
            let heading = format!("{symbol} varied, {load_n} N, scene {}", global.scene.display());
            let files = [
                ("study.csv", below(&header, rows)?),
                ("study-curves.csv", below(curves_header, lines)?),
                ("study.svg", figure(heading, symbol, &[curves], self.turns).svg()?),
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
            let way = trace(mechanism, self.load, self.turns, curves::STEPS);
            let point = self.point(*value, mechanism, &way);
            (point, Curve { label: scene_key::shown(&self.vary.key, *value), colour: colour(k, values.len()), way })
        });
        Ok(solved.unzip())
    }

    fn point(&self, value: f64, mechanism: &Mechanism, way: &Trace) -> Point {
        let [from, to] = self.turns;
        let at = |turns| mechanism.solve(self.load, twist_from_turns(turns));
        let (pretwist, start) = (at(0.0), at(from).ok());
        let ends = way.ends.first().map(|e| (e.limit.clone(), e.at.map(|p| p.turns)));
        let limit = ends.or_else(|| pretwist.as_ref().err().map(|&e| (e.into(), None)));
        let end = at(to).ok().filter(|_| limit.is_none());
        Point {
            value,
            contraction_m: end.zip(pretwist.ok()).map(|(end, pretwist)| pretwist.gap_m - end.gap_m),
            warnings: warnings(start.iter().chain(&end)),
            ends: [start, end],
            limit,
        }
    }

    /// A point as `--json` prints it, the limit with its words.
    fn json(&self, point: &Point) -> Value {
        let Self { vary, load: load_n, turns: [from, to], .. } = self;
        let mut object = json!({
            "key": vary.key, "value": point.value, "load_n": load_n, "turns_start": from, "turns_end": to,
            "warnings": point.warnings,
        });
        for (name, number) in NUMBERS.into_iter().zip(point.numbers()) {
            object[name] = number.into();
        }
        if let Some((what, turns)) = &point.limit {
            object["limit"] = json!({ "kind": what.kind, "message": what.message, "turns": turns });
        }
        object
    }
}

impl Point {
    fn numbers(&self) -> [Option<f64>; 6] {
        let [start, end] = &self.ends;
        let [tr, span] = [Equilibrium::finite_tr_rad_per_m, |e: &Equilibrium| Some(e.d_m)]
            .map(|of| [start, end].map(|e| e.as_ref().and_then(of)));
        [self.contraction_m, tr[0], tr[1], span[0], span[1], end.as_ref().map(|e| e.bending_strain)]
    }

    fn text(&self, value: &str) -> String {
        let cell = |value: Option<f64>, factor: f64, places: usize| {
            value.map_or("–".into(), |v| format!("{:.places$}", v * factor))
        };
        let way =
            |start, end, factor, places| format!("{} → {}", cell(start, factor, places), cell(end, factor, places));
        let [contraction_m, tr_start, tr_end, span_start, span_end, strain] = self.numbers();
        let remark = match &self.limit {
            None => self.warnings.join(", "),
            Some((what, Some(turns))) => format!("{} after {turns:.3} turns", what.kind),
            Some((what, None)) => format!("{} from the start", what.kind),
        };
        let line = format!(
            "{value:>12}  {:>14}  {:>21}  {:>17}  {:>8}  {remark}",
            cell(contraction_m, 1e3, 4),
            way(tr_start, tr_end, 1e-3, 4),
            way(span_start, span_end, 1e3, 2),
            cell(strain, 1e2, 3),
        );
        line.trim_end().to_owned()
    }
}

fn figure(heading: String, symbol: &str, columns: &[Vec<Curve>], turns: [f64; 2]) -> Figure {
    let panels =
        [(Quantity::Contraction, "contraction"), (Quantity::Tr, "transmission ratio")].map(|(group, title)| {
            let panels = curves::panels(group, columns, &[], turns);
            panels.into_iter().map(|panel| Panel { title: title.into(), ..panel }).collect()
        });
    let key = [curves::colour_key(symbol, &columns[0])];
    Figure {
        heading,
        rows: curves::grid(panels.into()),
        panel_size: (590, 430),
        blocks: key.into_iter().chain(curves::limit_key(columns)).collect(),
        notes: Vec::new(),
    }
}
