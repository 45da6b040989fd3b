//! The paper's numbers beside the same numbers computed: rows for machines, tables for people, CSV.

use super::contradictions;
use super::numbers::{self, Computed, Kind, Ratio, Row, changed_mechanism};
use anyhow::Result;
use rig_config::Scene;
use rigctl::csv_text::below;
use rigctl::failure::Refused;
use rigctl::identify::data::Quantity;
use rigctl::statistics::Errors;
use serde::Serialize;
use serde_json::{Value, json};

/// Every printed number and quoted ratio, computed for some scenes.
pub(super) struct Comparison {
    pub rows: Vec<Row>,
    pub ratios: Vec<Ratio>,
    pub sets: Vec<Set>,
    /// Whether some sweeps have the geometry that is inferred for them.
    pub inferred: bool,
}

/// One scene and what is computed for it.
pub(super) struct Set {
    /// Name for people.
    pub name: String,
    pub scene: Scene,
    /// A number or a limit for each row.
    pub numbers: Vec<Result<Computed, Refused>>,
    /// The same for each quoted ratio.
    pub ratios: Vec<Result<f64, Refused>>,
}

/// A set, a printed number, and what is computed for it.
type Line<'a> = (&'a Set, &'a Row, &'a Result<Computed, Refused>);

/// Computed over published, less one; none where nothing was computed.
pub(super) fn relative_error(published: f64, computed: &Result<Computed, Refused>) -> Option<f64> {
    computed.as_ref().ok().map(|c| c.value / published - 1.0)
}

/// A relative error for people.
pub(super) fn per_cent(error: Option<f64>) -> String {
    let Some(error) = error else { return "–".into() };
    let text = format!("{:+.1} %", 100.0 * error).replace('-', "−");
    if text.ends_with("−0.0 %") { "0.0 %".into() } else { text }
}

/// A number's warnings, or the limit that refused it, in words; none for a number without either.
pub(super) fn remark(computed: &Result<Computed, Refused>) -> Option<String> {
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

impl Comparison {
    /// Computes all of them for scenes with their names, on request with the geometry that is `inferred` for some.
    ///
    /// # Errors
    /// If a scene describes no mechanism.
    pub fn new(scenes: Vec<(String, Scene)>, inferred: bool) -> Result<Self> {
        let (mut rows, ratios) = (numbers::rows()?, numbers::ratios()?);
        if inferred {
            rows.iter_mut().for_each(|row| row.changes = numbers::changed(numbers::inferred(&row.place), &row.changes));
        }
        let set = |(name, scene): (String, Scene)| {
            scene.mechanism()?;
            let ratio = |r: &Ratio| {
                let mechanism = changed_mechanism(&scene, if inferred { numbers::inferred(&r.place) } else { "" })?;
                Ok(r.compute(&mechanism)?)
            };
            let numbers = rows.iter().map(|row| row.compute(&scene)).collect();
            Ok(Set { name, numbers, ratios: ratios.iter().map(ratio).collect(), scene })
        };
        let sets = scenes.into_iter().map(set).collect::<Result<_>>()?;
        Ok(Self { rows, ratios, sets, inferred })
    }

    /// Every row of every set.
    fn lines(&self) -> impl Iterator<Item = Line<'_>> {
        let rows = self.sets.iter().flat_map(|set| self.rows.iter().zip(&set.numbers).map(move |row| (set, row)));
        rows.map(|(set, (row, computed))| (set, row, computed))
    }

    /// A row for each printed number and scene as `--json` prints it: the scene if there are several, the warnings as a list, the
    /// limit with its words, and what differs from Table 1 where the geometry is inferred.
    pub fn json(&self) -> Vec<Value> {
        let object = |(set, row, computed): Line<'_>| {
            let (value, warnings) = computed.as_ref().map_or((None, &[][..]), |c| (Some(c.value), &c.warnings));
            let mut object = json!({
                "id": row.id, "quantity": row.quantity, "kind": row.kind, "published": row.value, "computed": value,
                "error": relative_error(row.value, computed), "unit": row.unit, "warnings": warnings,
            });
            if self.sets.len() > 1 {
                object["scene"] = set.name.as_str().into();
            }
            if let Err(limit) = computed {
                object["limit"] = json!(limit);
            }
            if self.inferred {
                object["inferred_geometry"] = numbers::inferred(&row.place).into();
            }
            object
        };
        self.lines().map(object).collect()
    }

    /// Both as CSV: file names and contents.
    ///
    /// # Errors
    /// Never for the rows that exist.
    pub fn data(&self) -> Result<Vec<(String, String)>> {
        let mut ratios = Vec::new();
        for set in &self.sets {
            ratios.extend(self.ratios.iter().zip(&set.ratios).map(|(r, computed)| {
                let (value, limit) = (computed.as_ref().ok(), computed.as_ref().err().map(|limit| limit.kind));
                let error = value.map(|v| v / r.value - 1.0);
                let what = (&set.name, &r.id, r.quantity, r.kind, r.load_n, r.to_load_n, r.turns);
                (what, r.value, value, error, limit, &r.place)
            }));
        }
        let numbers = self.lines().map(|(set, row, computed)| {
            let (value, limit) = (computed.as_ref().ok(), computed.as_ref().err().map(|limit| limit.kind));
            let what = (&set.name, &row.id, &row.quantity, row.kind, row.load_n, &row.changes, row.value);
            let found = (value.map(|c| c.value), relative_error(row.value, computed), limit);
            (what, found, &row.unit, value.map_or(String::new(), |c| c.warnings.join(" ")), &row.place)
        });
        let of_numbers = "scene,id,quantity,kind,load_n,changes,published,computed,error,limit,unit,warnings,where";
        let of_ratios = "scene,id,quantity,kind,load_n,to_load_n,turns,published,computed,error,limit,where";
        let file = |name: &str, content| (name.to_owned(), content);
        Ok(vec![file("published.csv", below(of_numbers, numbers)?), file("ratios.csv", below(of_ratios, ratios)?)])
    }

    /// Tables, remarks and sums of errors for people, in lines.
    ///
    /// # Errors
    /// Never for the quantities that exist: each has a name.
    pub fn text(&self) -> Result<Vec<String>> {
        let mut lines = if self.inferred { numbers::inferred_text() } else { Vec::new() };
        self.table(&mut lines)?;
        for (k, set) in (1..).zip(&self.sets) {
            let place = if self.sets.len() > 1 { format!("set {k}, ") } else { String::new() };
            lines.extend(self.rows.iter().zip(&set.numbers).filter_map(|(row, outcome)| match outcome {
                Err(limit) => Some(format!("! {place}{}: refused, {}: {}", row.id, limit.kind, limit.message)),
                Ok(_) => remark(outcome).map(|warnings| format!("! {place}{}: {warnings}", row.id)),
            }));
        }
        self.sets.iter().for_each(|set| self.errors(set, &mut lines));
        lines.extend([String::new(), "ratios that the text quotes".into()]);
        for (k, ratio) in self.ratios.iter().enumerate() {
            let Ratio { id, load_n, to_load_n, turns, value, .. } = ratio;
            let quantity = name(&ratio.quantity)?;
            let mut line =
                format!("{id:<28} {quantity:<14} {load_n:>6} to {to_load_n:<5} N {turns:>5} turns {value:>8}");
            for set in &self.sets {
                let computed = set.ratios[k].as_ref();
                let shown = computed.map_or_else(|limit| limit.kind.to_owned(), |v| format!("{v:.4}"));
                line += &format!("  {shown:>9}  {:>8}", per_cent(computed.ok().map(|v| v / value - 1.0)));
            }
            lines.push(line);
        }
        lines.extend(contradictions::text(&numbers::rows()?)?);
        Ok(lines)
    }

    fn table(&self, lines: &mut Vec<String>) -> Result<()> {
        let several = self.sets.len() > 1;
        let mut heading = format!("{:<20} {:<25} {:<10} {:>9} {:<6}", "id", "quantity", "kind", "published", "unit");
        for (k, set) in (1..).zip(&self.sets) {
            let title = if several { format!("set {k}") } else { "computed".into() };
            heading += &format!("  {title:>9}  {:>8}  ", "error");
            if several {
                lines.push(format!("set {k}: {}", set.name));
            }
        }
        lines.push(heading.trim_end().to_owned());
        for (k, row) in self.rows.iter().enumerate() {
            let (Row { id, quantity, value, unit, .. }, kind) = (row, name(&row.kind)?);
            let mut line = format!("{id:<20} {quantity:<25} {kind:<10} {value:>9.2} {unit:<6}");
            for outcome in self.sets.iter().map(|set| &set.numbers[k]) {
                let places = if row.group() == Quantity::Tr { 4 } else { 3 };
                let value = outcome.as_ref().map_or("refused".into(), |c| format!("{:.places$}", c.value));
                let mark = if remark(outcome).is_some() { '!' } else { ' ' };
                line += &format!("  {value:>9}  {:>8} {mark}", per_cent(relative_error(row.value, outcome)));
            }
            lines.push(line.trim_end().to_owned());
        }
        Ok(())
    }

    /// Sums of a set's errors.
    fn errors(&self, set: &Set, lines: &mut Vec<String>) {
        lines.extend([String::new(), format!("relative errors of {}", set.name)]);
        for (group, title) in [(Quantity::Contraction, "contraction"), (Quantity::Tr, "TR"), (Quantity::Span, "span")] {
            for (kind, title) in
                [(None, title), (Some(Kind::Theory), "  theory"), (Some(Kind::Experiment), "  experiment")]
            {
                let belongs = |r: &Row| r.group() == group && kind.is_none_or(|kind| kind == r.kind);
                let rows: Vec<_> = self.rows.iter().zip(&set.numbers).filter(|(row, _)| belongs(row)).collect();
                if kind.is_none() || !rows.is_empty() {
                    lines.push(errors_line(title, &rows));
                }
            }
        }
    }
}

/// Count, rms, median and worst of some rows' errors.
fn errors_line(title: &str, rows: &[(&Row, &Result<Computed, Refused>)]) -> String {
    let errors = || rows.iter().filter_map(|(row, c)| Some((relative_error(row.value, c)?, &row.id)));
    let of = |n: usize| if n < rows.len() { format!(" of {}", rows.len()) } else { String::new() };
    let Some((worst, id)) = errors().max_by(|a, b| a.0.abs().total_cmp(&b.0.abs())) else {
        return format!("{title:<24} none computed{}", of(0));
    };
    let Errors { count, rms, median, .. } = Errors::over(errors().map(|(error, _)| error));
    let ([rms, median], worst) = ([100.0 * rms, 100.0 * median], per_cent(Some(worst)));
    format!("{title:<24} {count:>3}{}   rms {rms:>6.2} %   median {median:>6.2} %   worst {worst} ({id})", of(count))
}
