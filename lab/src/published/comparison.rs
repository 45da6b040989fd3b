//! The paper's numbers beside the same numbers computed: rows for machines, tables for people, CSV.

use super::geometry;
use super::numbers::{Computed, Group, Kind, Quantity, Ratio, Row, Unit, changed_mechanism};
use anyhow::Result;
use rig_config::Scene;
use rigctl::csv_text::{csv_text, optional};
use rigctl::failure::ErrorBody;
use serde::Serialize;

/// One scene and what is computed for it.
pub struct Set {
    /// Name for people.
    pub name: String,
    /// The scene.
    pub scene: Scene,
    /// A number or a limit for each row.
    pub numbers: Vec<Result<Computed, ErrorBody>>,
    /// The same for each quoted ratio.
    pub ratios: Vec<Result<f64, ErrorBody>>,
}

/// One row as machines read it.
#[derive(Debug, Serialize)]
pub struct Compared<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    scene: Option<&'a str>,
    id: &'a str,
    quantity: Quantity,
    kind: Kind,
    published: f64,
    computed: Option<f64>,
    error: Option<f64>,
    unit: Unit,
    warnings: &'a [&'static str],
    #[serde(skip_serializing_if = "Option::is_none")]
    limit: Option<&'a ErrorBody>,
    /// What differs from Table 1 where the geometry is inferred.
    #[serde(skip_serializing_if = "Option::is_none")]
    inferred_geometry: Option<&'static str>,
}

impl Set {
    /// Computes every row and ratio for a scene.
    ///
    /// # Errors
    /// If the scene describes no mechanism.
    pub fn new(name: String, scene: Scene, rows: &[Row], ratios: &[Ratio], inferred: bool) -> Result<Self> {
        scene.mechanism()?;
        let ratio = |r: &Ratio| {
            let mechanism = changed_mechanism(&scene, if inferred { geometry::inferred(&r.place) } else { "" })?;
            r.compute(&mechanism).map_err(|e| super::numbers::body(&e))
        };
        Ok(Self {
            name,
            numbers: rows.iter().map(|row| row.compute(&scene)).collect(),
            ratios: ratios.iter().map(ratio).collect(),
            scene,
        })
    }
}

impl<'a> Compared<'a> {
    /// Row `k` of a set, named by its scene if there are `several` sets.
    pub(super) fn new(set: &'a Set, several: bool, k: usize, row: &'a Row, inferred: bool) -> Self {
        let computed = &set.numbers[k];
        Self {
            scene: several.then_some(set.name.as_str()),
            id: &row.id,
            quantity: row.quantity,
            kind: row.kind,
            published: row.value,
            computed: computed.as_ref().ok().map(|c| c.value),
            error: relative_error(row.value, computed),
            unit: row.unit,
            warnings: computed.as_ref().map_or(&[][..], |c| &c.warnings),
            limit: computed.as_ref().err(),
            inferred_geometry: inferred.then(|| geometry::inferred(&row.place)),
        }
    }
}

/// Computed over published, less one; none where nothing was computed.
pub(super) fn relative_error(published: f64, computed: &Result<Computed, ErrorBody>) -> Option<f64> {
    computed.as_ref().ok().map(|c| c.value / published - 1.0)
}

/// A relative error for people.
pub(super) fn per_cent(error: Option<f64>) -> String {
    let Some(error) = error else { return "–".into() };
    let text = format!("{:+.1} %", 100.0 * error).replace('-', "−");
    if text.ends_with("−0.0 %") { "0.0 %".into() } else { text }
}

/// A number's warnings, or the limit that refused it, in words; none for a number without either.
pub(super) fn remark(computed: &Result<Computed, ErrorBody>) -> Option<String> {
    match computed {
        Ok(c) if c.warnings.is_empty() => None,
        Ok(c) => Some(c.warnings.join(", ")),
        Err(limit) => Some(format!("refused: {}", limit.kind)),
    }
}

/// As JSON and CSV name it.
fn name(value: &impl Serialize) -> Result<String> {
    Ok(serde_json::to_value(value)?.as_str().unwrap_or_default().to_owned())
}

fn number(value: f64, unit: Unit) -> String {
    match unit {
        Unit::Millimetre => format!("{value:.3}"),
        Unit::RadianPerMillimetre => format!("{value:.4}"),
    }
}

pub(super) fn table(rows: &[Row], sets: &[Set]) -> Result<Vec<String>> {
    let mut lines = Vec::new();
    let mut heading = format!("{:<20} {:<25} {:<10} {:>9} {:<6}", "id", "quantity", "kind", "published", "unit");
    for (k, set) in (1..).zip(sets) {
        let title = if sets.len() > 1 { format!("set {k}") } else { "computed".into() };
        heading += &format!("  {title:>9}  {:>8}  ", "error");
        if sets.len() > 1 {
            lines.push(format!("set {k}: {}", set.name));
        }
    }
    lines.push(heading.trim_end().to_owned());
    for (k, row) in rows.iter().enumerate() {
        let (quantity, kind, unit) = (name(&row.quantity)?, name(&row.kind)?, row.unit.name());
        let mut line = format!("{:<20} {quantity:<25} {kind:<10} {:>9.2} {unit:<6}", row.id, row.value);
        for set in sets {
            let outcome = &set.numbers[k];
            let value = outcome.as_ref().map_or("refused".into(), |c| number(c.value, row.unit));
            let mark = if remark(outcome).is_some() { '!' } else { ' ' };
            line += &format!("  {value:>9}  {:>8} {mark}", per_cent(relative_error(row.value, outcome)));
        }
        lines.push(line.trim_end().to_owned());
    }
    Ok(lines)
}

/// The lines behind the marks of the table.
pub(super) fn remarks(rows: &[Row], sets: &[Set]) -> Vec<String> {
    let mut lines = Vec::new();
    for (k, set) in (1..).zip(sets) {
        for (row, outcome) in rows.iter().zip(&set.numbers) {
            let place = if sets.len() > 1 { format!("set {k}, ") } else { String::new() };
            match outcome {
                Err(limit) => lines.push(format!("! {place}{}: refused, {}: {}", row.id, limit.kind, limit.message)),
                Ok(c) if c.warnings.is_empty() => (),
                Ok(c) => lines.push(format!("! {place}{}: {}", row.id, c.warnings.join(", "))),
            }
        }
    }
    lines
}

/// Errors of some rows.
struct Errors {
    count: usize,
    computed: usize,
    rms: f64,
    median: f64,
    /// Relative error and id.
    worst: Option<(f64, String)>,
}

impl Errors {
    fn of(rows: &[Row], set: &Set, belongs: impl Fn(&Row) -> bool) -> Self {
        let rows: Vec<_> = rows.iter().zip(&set.numbers).filter(|(row, _)| belongs(row)).collect();
        let errors = rows.iter().filter_map(|(row, c)| Some((relative_error(row.value, c)?, row.id.clone())));
        let mut errors: Vec<(f64, String)> = errors.collect();
        errors.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let n = errors.len();
        let size = |k: usize| errors.get(k).map_or(f64::NAN, |e| e.0.abs());
        Self {
            count: rows.len(),
            computed: n,
            rms: (errors.iter().map(|e| e.0 * e.0).sum::<f64>() / n as f64).sqrt(),
            median: if n.is_multiple_of(2) { 0.5 * (size((n / 2).wrapping_sub(1)) + size(n / 2)) } else { size(n / 2) },
            worst: errors.pop(),
        }
    }

    fn line(&self, title: &str) -> String {
        let of = if self.computed < self.count { format!(" of {}", self.count) } else { String::new() };
        let Some((worst, id)) = &self.worst else { return format!("{title:<24} none computed{of}") };
        let (rms, median) = (100.0 * self.rms, 100.0 * self.median);
        let worst = per_cent(Some(*worst));
        format!(
            "{title:<24} {:>3}{of}   rms {rms:>6.2} %   median {median:>6.2} %   worst {worst} ({id})",
            self.computed
        )
    }
}

pub(super) fn summary(rows: &[Row], sets: &[Set]) -> Vec<String> {
    let mut lines = Vec::new();
    for set in sets {
        lines.push(String::new());
        lines.push(format!("relative errors of {}", set.name));
        for (group, title) in [(Group::Contraction, "contraction"), (Group::Tr, "TR"), (Group::Span, "span")] {
            let of = |kind: Option<Kind>| {
                Errors::of(rows, set, |r| r.quantity.group() == group && kind.is_none_or(|kind| kind == r.kind))
            };
            lines.push(of(None).line(title));
            let kinds = [(Kind::Theory, "theory"), (Kind::Experiment, "experiment")];
            let parts = kinds.map(|(kind, word)| (of(Some(kind)), word));
            lines.extend(parts.iter().filter(|(e, _)| e.count > 0).map(|(e, word)| e.line(&format!("  {word}"))));
        }
    }
    lines
}

pub(super) fn ratio_table(ratios: &[Ratio], sets: &[Set]) -> Result<Vec<String>> {
    let mut lines = Vec::new();
    for (k, ratio) in ratios.iter().enumerate() {
        let mut line = format!(
            "{:<28} {:<14} {:>6} to {:<5} N {:>5} turns {:>8}",
            ratio.id,
            name(&ratio.quantity)?,
            ratio.load_n,
            ratio.to_load_n,
            ratio.turns,
            ratio.value
        );
        for set in sets {
            let value = set.ratios[k].as_ref().map_or_else(|limit| limit.kind.clone(), |v| format!("{v:.4}"));
            let error = set.ratios[k].as_ref().ok().map(|v| v / ratio.value - 1.0);
            line += &format!("  {value:>9}  {:>8}", per_cent(error));
        }
        lines.push(line);
    }
    Ok(lines)
}

/// Published, computed, error and limit as cells.
fn outcome_cells(published: f64, computed: Result<f64, &ErrorBody>) -> [String; 4] {
    let value = computed.ok();
    let limit = computed.err().map_or(String::new(), |limit| limit.kind.clone());
    [published.to_string(), optional(value), optional(value.map(|v| v / published - 1.0)), limit]
}

pub(super) fn rows_csv(rows: &[Row], sets: &[Set]) -> Result<String> {
    let header = [
        "scene",
        "id",
        "quantity",
        "kind",
        "load_n",
        "changes",
        "published",
        "computed",
        "error",
        "limit",
        "unit",
        "warnings",
        "where",
    ];
    let mut lines = Vec::new();
    for set in sets {
        for (row, outcome) in rows.iter().zip(&set.numbers) {
            let mut line = vec![set.name.clone(), row.id.clone(), name(&row.quantity)?, name(&row.kind)?];
            line.extend([row.load_n.to_string(), row.changes.clone()]);
            line.extend(outcome_cells(row.value, outcome.as_ref().map(|c| c.value)));
            let warnings = outcome.as_ref().map_or(String::new(), |c| c.warnings.join(" "));
            line.extend([row.unit.name().into(), warnings, row.place.clone()]);
            lines.push(line);
        }
    }
    csv_text(&header, lines)
}

pub(super) fn ratios_csv(ratios: &[Ratio], sets: &[Set]) -> Result<String> {
    let header = [
        "scene",
        "id",
        "quantity",
        "kind",
        "load_n",
        "to_load_n",
        "turns",
        "published",
        "computed",
        "error",
        "limit",
        "where",
    ];
    let mut lines = Vec::new();
    for set in sets {
        for (ratio, outcome) in ratios.iter().zip(&set.ratios) {
            let mut line = vec![set.name.clone(), ratio.id.clone(), name(&ratio.quantity)?, name(&ratio.kind)?];
            line.extend([ratio.load_n, ratio.to_load_n, ratio.turns].map(|v| v.to_string()));
            line.extend(outcome_cells(ratio.value, outcome.as_ref().copied()));
            line.push(ratio.place.clone());
            lines.push(line);
        }
    }
    csv_text(&header, lines)
}
