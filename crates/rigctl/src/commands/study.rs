//! `study`: one value of the scene varied over any range.

use super::curves::{self, Column, Curve};
use super::published::optional;
use super::solve::finite_tr_rad_per_m;
use crate::batch::ErrorBody;
use crate::cli::Global;
use crate::failure::Failure;
use crate::output::{Output, csv_text, write_file};
use crate::plot::{Figure, colour};
use crate::published::Group;
use crate::range::{TurnRange, Vary};
use crate::scene_key::{self, KeyError};
use crate::trace::{self, Trace, trace};
use serde::Serialize;
use std::path::Path;
use tsa_model::{Mechanism, twist_from_turns};

/// One value of the study. SI units; what a limit of the model leaves unknown is null.
#[derive(Debug, Serialize)]
struct Studied<'a> {
    /// The varied key as in a scene file.
    key: &'a str,
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

/// What ends the way before its last turn.
#[derive(Debug, Serialize)]
struct Limit {
    #[serde(flatten)]
    what: ErrorBody,
    /// The last turns before it; null if already the first are refused.
    turns: Option<f64>,
}

impl<'a> Studied<'a> {
    fn new(key: &'a str, value: f64, mechanism: &Mechanism, load_n: f64, turns: TurnRange, way: &Trace) -> Self {
        let at = |turns| mechanism.solve(load_n, twist_from_turns(turns));
        let (pretwist, start) = (at(0.0), at(turns.from).ok());
        let mut limit = way.ends.first().map(|e| Limit { what: e.limit.clone(), turns: e.at.map(|p| p.turns) });
        if let (None, Err(e)) = (&limit, &pretwist) {
            limit = Some(Limit { what: trace::body(e), turns: None });
        }
        let end = at(turns.to).ok().filter(|_| limit.is_none());
        Self {
            key,
            value,
            load_n,
            turns_start: turns.from,
            turns_end: turns.to,
            contraction_m: end.zip(pretwist.ok()).map(|(end, pretwist)| pretwist.gap_m - end.gap_m),
            tr_start_rad_per_m: start.as_ref().and_then(finite_tr_rad_per_m),
            tr_end_rad_per_m: end.as_ref().and_then(finite_tr_rad_per_m),
            span_start_m: start.map(|e| e.d_m),
            span_end_m: end.map(|e| e.d_m),
            bending_strain: end.map(|e| e.bending_strain),
            warnings: trace::warnings(start.iter().chain(&end)),
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

/// Runs the command.
///
/// # Errors
/// If the scene has no such key, one of the values can describe no rig, or the folder cannot be written.
pub fn run(
    global: &Global,
    vary: &Vary,
    load_n: f64,
    turns: TurnRange,
    out: Option<&Path>,
    output: &mut Output,
) -> Result<(), Failure> {
    let scene = super::scene(global)?;
    // All of them first: a value that no rig can have is a slip of the operator and stops the study before it prints.
    let mechanisms = vary.values().into_iter().map(|value| {
        let changed = scene_key::set(&scene, &vary.key, value.into()).map_err(|e| match e {
            KeyError::Value(_) => Failure::failed(format!("vary: {e}")),
            KeyError::Form(_) | KeyError::Unknown { .. } => Failure::Usage(format!("vary: {e}")),
        })?;
        Ok((value, changed.mechanism()?))
    });
    let mechanisms = mechanisms.collect::<Result<Vec<(f64, Mechanism)>, Failure>>()?;
    let symbol = scene_key::symbol(&vary.key);
    output.line(format!(
        "{} at {load_n} N, {} to {} turns past the half-turn pre-twist",
        vary.key, turns.from, turns.to
    ))?;
    output.line(format!(
        "{symbol:>12}  {:>14}  {:>21}  {:>17}  {:>8}  remarks",
        "contraction mm", "TR rad/mm", "span mm", "strain %"
    ))?;
    let mut studied = Vec::new();
    let mut column = Column { curves: Vec::new() };
    for (k, (value, mechanism)) in mechanisms.iter().enumerate() {
        let way = trace(mechanism, load_n, [turns.from, turns.to], curves::STEPS);
        let s = Studied::new(&vary.key, *value, mechanism, load_n, turns, &way);
        output.object(&s)?;
        output.line(row(&vary.quantity.show(*value), &s))?;
        studied.push(s);
        column.curves.push(Curve { label: vary.quantity.show(*value), colour: colour(k, mechanisms.len()), way });
    }
    if let Some(folder) = out {
        write_file(folder, "study.csv", &values_csv(&studied)?)?;
        write_file(folder, "study-curves.csv", &curves_csv(&studied, &column)?)?;
        let heading = format!("{symbol} varied, {load_n} N, scene {}", global.scene.display());
        write_file(folder, "study.svg", &figure(heading, symbol, column, turns).svg()?)?;
        output.line(format!("written: study.csv, study-curves.csv, study.svg in {}", folder.display()))?;
    }
    Ok(())
}

fn row(value: &str, s: &Studied<'_>) -> String {
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

fn values_csv(studied: &[Studied<'_>]) -> Result<String, Failure> {
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
    let line = |s: &Studied<'_>| {
        let mut cells = vec![s.key.to_owned()];
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

fn curves_csv(studied: &[Studied<'_>], column: &Column) -> Result<String, Failure> {
    let lines = studied.iter().zip(&column.curves).flat_map(|(s, curve)| {
        curve.way.reached.iter().map(|p| {
            let tr = Some(p.tr_rad_per_m).filter(|tr| tr.is_finite());
            let [value, turns, contraction] = [s.value, p.turns, p.contraction_m].map(|v| v.to_string());
            vec![s.key.to_owned(), value, turns, contraction, optional(tr)]
        })
    });
    csv_text(&["key", "value", "turns", "contraction_m", "tr_rad_per_m"], lines)
}

fn figure(heading: String, symbol: &str, column: Column, turns: TurnRange) -> Figure {
    let columns = [column];
    let panels = |group, title: &str| {
        let mut panels = curves::panels(group, &columns, &[], [turns.from, turns.to]);
        panels.iter_mut().for_each(|p| p.title = title.into());
        panels
    };
    let mut blocks = vec![curves::colour_key(symbol, &columns[0].curves)];
    blocks.extend(curves::limit_key(&columns));
    Figure {
        heading,
        rows: curves::grid(vec![panels(Group::Contraction, "contraction"), panels(Group::Tr, "transmission ratio")]),
        panel_size: (590, 430),
        blocks,
        notes: Vec::new(),
    }
}
