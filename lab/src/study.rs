//! One value of a scene varied over any range: what contraction and TR become, and where a limit of the model ends them.

use crate::curves::{self, Column, Curve};
use crate::published::numbers::{Group, body, warnings};
use crate::scene_key::{self, KeyError};
use crate::trace::{Trace, trace};
use anyhow::Result;
use rig_config::Scene;
use rigctl::csv_text::{csv_text, optional};
use rigctl::failure::ErrorBody;
use rigctl::plot::{Figure, colour};
use serde::Serialize;
use tsa_model::{Equilibrium, Mechanism, twist_from_turns};

/// What is varied, and where it is looked at.
#[derive(Debug, Clone)]
pub struct Options {
    /// The varied key as in a scene file.
    pub key: String,
    /// Its values (SI).
    pub values: Vec<f64>,
    /// Load (N).
    pub load_n: f64,
    /// First and last number of turns past the half-turn pre-twist.
    pub turns: [f64; 2],
}

/// A study with its results.
pub struct Study {
    options: Options,
    points: Vec<Point>,
    column: Column,
}

/// The result for one value. SI units; what a limit of the model leaves unknown is null.
#[derive(Debug, Serialize)]
pub struct Point {
    /// The varied key as in a scene file.
    key: String,
    /// Its value.
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
    warnings: Vec<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    limit: Option<Limit>,
}

/// What ends the curve before its last turn.
#[derive(Debug, Serialize)]
struct Limit {
    #[serde(flatten)]
    what: ErrorBody,
    /// The last turns before it; null if already the first are refused.
    turns: Option<f64>,
}

impl Point {
    fn new(options: &Options, value: f64, mechanism: &Mechanism, way: &Trace) -> Self {
        let Options { key, load_n, turns: [from, to], .. } = options;
        let at = |turns| mechanism.solve(*load_n, twist_from_turns(turns));
        let (pretwist, start) = (at(0.0), at(*from).ok());
        let mut limit = way.ends.first().map(|e| Limit { what: e.limit.clone(), turns: e.at.map(|p| p.turns) });
        if let (None, Err(e)) = (&limit, &pretwist) {
            limit = Some(Limit { what: body(e), turns: None });
        }
        let end = at(*to).ok().filter(|_| limit.is_none());
        Self {
            key: key.clone(),
            value,
            load_n: *load_n,
            turns_start: *from,
            turns_end: *to,
            contraction_m: end.zip(pretwist.ok()).map(|(end, pretwist)| pretwist.gap_m - end.gap_m),
            tr_start_rad_per_m: start.as_ref().and_then(Equilibrium::finite_tr_rad_per_m),
            tr_end_rad_per_m: end.as_ref().and_then(Equilibrium::finite_tr_rad_per_m),
            span_start_m: start.map(|e| e.d_m),
            span_end_m: end.map(|e| e.d_m),
            bending_strain: end.map(|e| e.bending_strain),
            warnings: warnings(start.iter().chain(&end)),
            limit,
        }
    }

    fn remark(&self) -> String {
        match &self.limit {
            None => self.warnings.join(", "),
            Some(Limit { what, turns: Some(turns) }) => format!("{} after {turns:.3} turns", what.kind),
            Some(Limit { what, turns: None }) => format!("{} from the start", what.kind),
        }
    }
}

impl Study {
    /// Solves for every value. All values are checked first: one that no rig can have stops the study before it begins.
    ///
    /// # Errors
    /// [`KeyError`]: the scene has no such key, or one of the values can describe no rig.
    pub fn new(scene: &Scene, options: Options) -> Result<Self, KeyError> {
        let mechanism = |value: &f64| Ok(scene_key::set(scene, &options.key, (*value).into())?.mechanism()?);
        let mechanisms = options.values.iter().map(mechanism).collect::<Result<Vec<Mechanism>, KeyError>>()?;
        let (mut points, mut column) = (Vec::new(), Column { curves: Vec::new() });
        for (k, (value, mechanism)) in options.values.iter().zip(&mechanisms).enumerate() {
            let way = trace(mechanism, options.load_n, options.turns, curves::STEPS);
            points.push(Point::new(&options, *value, mechanism, &way));
            let label = scene_key::shown(&options.key, *value);
            column.curves.push(Curve { label, colour: colour(k, mechanisms.len()), way });
        }
        Ok(Self { options, points, column })
    }

    /// One result for each value, as `--json` prints it.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// A table for people, in lines.
    pub fn text(&self) -> Vec<String> {
        let Options { key, load_n, turns: [from, to], .. } = &self.options;
        let mut lines = vec![
            format!("{key} at {load_n} N, {from} to {to} turns past the half-turn pre-twist"),
            format!(
                "{:>12}  {:>14}  {:>21}  {:>17}  {:>8}  remarks",
                scene_key::symbol(key),
                "contraction mm",
                "TR rad/mm",
                "span mm",
                "strain %"
            ),
        ];
        lines.extend(self.points.iter().zip(&self.column.curves).map(|(point, curve)| row(&curve.label, point)));
        lines
    }

    /// Data and figure as file names and contents; `scene_name` stands in the figure's heading.
    ///
    /// # Errors
    /// If the figure cannot be drawn.
    pub fn files(&self, scene_name: &str) -> Result<[(&'static str, String); 3]> {
        let (symbol, load_n) = (scene_key::symbol(&self.options.key), self.options.load_n);
        let heading = format!("{symbol} varied, {load_n} N, scene {scene_name}");
        Ok([
            ("study.csv", values_csv(&self.points)?),
            ("study-curves.csv", curves_csv(&self.points, &self.column)?),
            ("study.svg", figure(heading, symbol, &self.column, self.options.turns).svg()?),
        ])
    }
}

fn row(value: &str, s: &Point) -> String {
    let cell = |value: Option<f64>, factor: f64, places: usize| {
        value.map_or("–".into(), |v| format!("{:.places$}", v * factor))
    };
    let way = |start, end, factor, places| format!("{} → {}", cell(start, factor, places), cell(end, factor, places));
    format!(
        "{value:>12}  {:>14}  {:>21}  {:>17}  {:>8}  {}",
        cell(s.contraction_m, 1e3, 4),
        way(s.tr_start_rad_per_m, s.tr_end_rad_per_m, 1e-3, 4),
        way(s.span_start_m, s.span_end_m, 1e3, 2),
        cell(s.bending_strain, 1e2, 3),
        s.remark()
    )
    .trim_end()
    .to_owned()
}

fn values_csv(studied: &[Point]) -> Result<String> {
    let header = [
        "key",
        "value",
        "load_n",
        "turns_start",
        "turns_end",
        "contraction_m",
        "tr_start_rad_per_m",
        "tr_end_rad_per_m",
        "span_start_m",
        "span_end_m",
        "bending_strain",
        "warnings",
        "limit",
        "limit_turns",
    ];
    let line = |s: &Point| {
        let mut cells = vec![s.key.clone()];
        cells.extend([s.value, s.load_n, s.turns_start, s.turns_end].map(|v| v.to_string()));
        let numbers = [s.contraction_m, s.tr_start_rad_per_m, s.tr_end_rad_per_m, s.span_start_m, s.span_end_m];
        cells.extend(numbers.map(optional));
        cells.extend([optional(s.bending_strain), s.warnings.join(" ")]);
        let limit = s.limit.as_ref();
        cells.extend([limit.map_or(String::new(), |l| l.what.kind.clone()), optional(limit.and_then(|l| l.turns))]);
        cells
    };
    csv_text(&header, studied.iter().map(line))
}

fn curves_csv(studied: &[Point], column: &Column) -> Result<String> {
    let lines = studied.iter().zip(&column.curves).flat_map(|(s, curve)| {
        curve.way.reached.iter().map(|p| {
            let tr = Some(p.tr_rad_per_m).filter(|tr| tr.is_finite());
            let [value, turns, contraction] = [s.value, p.turns, p.contraction_m].map(|v| v.to_string());
            vec![s.key.clone(), value, turns, contraction, optional(tr)]
        })
    });
    csv_text(&["key", "value", "turns", "contraction_m", "tr_rad_per_m"], lines)
}

fn figure(heading: String, symbol: &str, column: &Column, turns: [f64; 2]) -> Figure {
    let columns = std::slice::from_ref(column);
    let panels = |group, title: &str| {
        let mut panels = curves::panels(group, columns, &[], turns);
        panels.iter_mut().for_each(|p| p.title = title.into());
        panels
    };
    let mut blocks = vec![curves::colour_key(symbol, &column.curves)];
    blocks.extend(curves::limit_key(columns));
    Figure {
        heading,
        rows: curves::grid(vec![panels(Group::Contraction, "contraction"), panels(Group::Tr, "transmission ratio")]),
        panel_size: (590, 430),
        blocks,
        notes: Vec::new(),
    }
}
