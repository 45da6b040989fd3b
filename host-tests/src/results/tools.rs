//! Studies that the tools make: the rows that a command prints as JSON, or leaves as a file, put into a table by the templates of
//! `studies.toml`, which says how they are written.

use crate::root;
use crate::study::{Study, significant};
use anyhow::{Context, Result, anyhow, ensure};
use serde::Deserialize;
use serde_json::{Map, Value};
use std::path::Path;
use std::process::{Command, Stdio};

/// How tools measure a study.
#[derive(Debug, Default, Deserialize)]
pub struct Tools {
    /// Commands, below the project's folder.
    #[serde(default)]
    run: Vec<String>,
    /// A file that they leave, and where it is copied to.
    copy: Option<[String; 2]>,
    /// Rows in a file, CSV or JSON, instead of what the last command prints.
    rows: Option<String>,
    /// Head of a column, and its templates.
    #[serde(default)]
    columns: Vec<Vec<String>>,
    /// Of a single row: a value's name, words, unit and expression.
    #[serde(default)]
    lines: Vec<[String; 4]>,
    /// A value's name, which row it is of, and its expression.
    #[serde(default)]
    values: Vec<[String; 3]>,
    /// Templates of what is said about the first row.
    #[serde(default)]
    notes: Vec<String>,
}

impl Tools {
    /// Runs the commands; the rows that they make.
    ///
    /// # Errors
    /// If a command fails, or a file cannot be read.
    pub fn run(&self) -> Result<Vec<Value>> {
        let mut printed = Vec::new();
        for line in &self.run {
            eprintln!("> {line}");
            let mut words = line.split_whitespace();
            let mut command = Command::new(words.next().context("an empty command")?);
            let output =
                command.args(words).current_dir(root()).stderr(Stdio::inherit()).output().context(line.clone())?;
            ensure!(output.status.success(), "failed ({}): {line}", output.status);
            printed = output.stdout;
        }
        if let Some([from, to]) = &self.copy {
            std::fs::copy(root().join(from), root().join(to)).with_context(|| format!("{from} to {to}"))?;
        }
        if let Some(file) = &self.rows {
            let path = root().join(file);
            if file.ends_with(".csv") {
                return records(&path).with_context(|| file.clone());
            }
            printed = std::fs::read(path).with_context(|| file.clone())?;
        }
        // What is said to people, where a command only draws.
        if !printed.starts_with(b"{") {
            return Ok(Vec::new());
        }
        Ok(serde_json::Deserializer::from_slice(&printed).into_iter().collect::<Result<_, _>>()?)
    }

    /// The study of these rows.
    ///
    /// # Errors
    /// If a value is missing.
    pub fn study(&self, rows: &[Value]) -> Result<Study> {
        let first = rows.first().context("no rows")?;
        if self.columns.is_empty() && self.lines.is_empty() {
            return Ok(Study::deserialize(first)?);
        }
        let mut study = Study::new(self.columns.iter().map(|column| column[0].as_str()));
        for row in rows.iter().filter(|_| !self.columns.is_empty()) {
            let cell = |column: &Vec<String>| {
                let cells = column[1..].iter().map(|template| filled(row, template));
                cells.reduce(|one, other| one.or(other)).unwrap_or_else(|| Err(column[0].clone()))
            };
            let cells: Result<Vec<String>, String> = self.columns.iter().map(cell).collect();
            study.row(cells.map_err(|missing| anyhow!("no {missing}"))?);
        }
        if !self.lines.is_empty() {
            study = Study::new(["", ""]);
        }
        for [name, words, unit, expression] in &self.lines {
            let value = evaluated(first, expression);
            study.value(name, value);
            study.row([words.clone(), value.map_or("not measured".into(), |v| format!("{} {unit}", significant(v)))]);
        }
        for [name, which, expression] in &self.values {
            let of_rows: Vec<f64> = rows.iter().filter_map(|row| evaluated(row, expression)).collect();
            let value = match which.as_str() {
                "first" => of_rows.first().copied(),
                "last" => of_rows.last().copied(),
                _ => of_rows.iter().map(|value| value.abs()).reduce(f64::max),
            };
            study.value(name, Some(value.with_context(|| format!("no {expression}"))?));
        }
        let notes: Result<Vec<String>, String> = self.notes.iter().map(|note| filled(first, note)).collect();
        study.notes = notes.map_err(|missing| anyhow!("no {missing}"))?;
        Ok(study)
    }
}

/// The records of a CSV file, by its header.
fn records(path: &Path) -> Result<Vec<Value>> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(path)?;
    reader.deserialize::<Map<String, Value>>().map(|record| Ok(Value::Object(record?))).collect()
}

/// A template with its values.
///
/// # Errors
/// The first that is missing.
pub fn filled(row: &Value, template: &str) -> Result<String, String> {
    let mut rest = guarded(row, template).ok_or("a row for this")?;
    let mut text = String::new();
    while let Some((before, after)) = rest.split_once('{') {
        let (inside, after) = after.split_once('}').ok_or("}")?;
        let (expression, format) = inside.split_once(':').unwrap_or((inside, ""));
        let cell = if format.is_empty() { whole(row, expression) } else { None };
        let number = || evaluated(row, expression).map(|value| formatted(value, format));
        text += &(before.to_owned() + &cell.or_else(number).ok_or(expression)?);
        rest = after;
    }
    Ok(text + rest)
}

/// What stands behind `/key=word? `, if the row has that word there.
fn guarded<'t>(row: &Value, template: &'t str) -> Option<&'t str> {
    let Some((guard, rest)) = template.split_once("? ") else { return Some(template) };
    let (at, word) = guard.split_once('=')?;
    let found = match row.pointer(at) {
        None | Some(Value::Null) => "null".to_owned(),
        Some(_) => whole(row, at).unwrap_or_default(),
    };
    (found == word).then_some(rest)
}

/// A cell as it is.
fn whole(row: &Value, at: &str) -> Option<String> {
    match row.pointer(at)? {
        Value::String(text) if !text.is_empty() => Some(text.clone()),
        Value::Number(number) => Some(number.as_f64()?.to_string()),
        Value::Bool(value) => Some(value.to_string()),
        _ => None,
    }
}

/// Numbers and operators from left to right.
fn evaluated(row: &Value, expression: &str) -> Option<f64> {
    let mut words = guarded(row, expression)?.split_whitespace();
    let number =
        |word: &str| if word.starts_with('/') { whole(row, word)?.parse().ok() } else { word.parse::<f64>().ok() };
    let mut value: f64 = number(words.next()?)?;
    while let (Some(operator), Some(word)) = (words.next(), words.next()) {
        let other = number(word)?;
        value = match operator {
            "*" => value * other,
            "/" => value / other,
            "-" => value - other,
            _ => return None,
        };
    }
    Some(value)
}

/// `g` for three significant digits, else how many after the point, with `+` for a sign in any case.
fn formatted(value: f64, format: &str) -> String {
    let digits = format.trim_start_matches(['+', '.']).parse().unwrap_or(0);
    match format.chars().next() {
        None => value.to_string(),
        Some('g') => significant(value),
        Some('+') => format!("{value:+.digits$}"),
        _ => format!("{value:.digits$}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::List;
    use serde_json::json;

    #[test]
    fn a_template_reckons_from_left_to_right_and_names_what_is_missing() {
        let row = json!({"told": 2.5, "move": {"true_n": 2}, "name": "a", "cell": "0.5", "none": null});
        let fill = |template: &str| filled(&row, template);
        assert_eq!(fill("{/name}: {/told / /move/true_n - 1 * 100:+.1} %"), Ok("a: +25.0 %".into()));
        assert_eq!(fill("{/told}, {/move/true_n}, {1e3 * /cell:.0}, {/told:g}"), Ok("2.5, 2, 500, 2.50".into()));
        assert_eq!(fill("/name=a? yes"), Ok("yes".into()));
        assert!(fill("/name=b? yes").is_err());
        assert_eq!(fill("/none=null? -"), Ok("-".into()));
        assert_eq!(fill("{/told} {1e6 * /none:.1}"), Err("1e6 * /none".into()));
    }

    #[test]
    fn records_of_a_file_go_by_its_header() {
        let found = study("charts", &records(&root().join("docs/charts/scenes.csv")).unwrap()).unwrap();
        assert!(found.table.len() > 3 && found.table[1].iter().all(|cell| !cell.is_empty()), "{:?}", found.table);
    }

    /// A study of the tools by its name, of these rows.
    fn study(name: &str, rows: &[Value]) -> Result<Study> {
        let list = List::read().unwrap();
        list.sections.iter().find(|section| section.name == name).unwrap().tools.study(rows)
    }

    #[test]
    fn what_the_tools_print_becomes_the_rows_of_the_page() {
        let size = json!({"bytes": 76, "instructions": 162});
        let asked = |table: Value| json!({"contraction_m": 31e-6, "tr_relative": 0.022, "table": table});
        let row = |enough: Value| {
            json!({"scene": "finger", "rig": "ideal", "position_m": 9.71e-6, "load_relative": 0.133, "tier": "rigid",
                "enough": enough, "used": asked(size.clone())})
        };
        let rows = [row(asked(size.clone())), row(asked(Value::Null)), row(Value::Null)];
        let found = study("budget", &rows).unwrap();
        assert_eq!(found.table[0][7], "table used");
        let used = "31.0 µm, 2.20 %: 76, 162";
        assert_eq!(
            found.table[1],
            ["finger", "ideal", "9.71 µm", "13.3 %", "rigid", "31.0 µm, 2.20 %", "76, 162", used]
        );
        assert_eq!(found.table[2][5..7], ["31.0 µm, 2.20 %", "no table"]);
        assert_eq!(found.table[3][5..7], ["-", ""]);

        let way = |symbol: &str, of: &str, mean: &str| {
            json!({"symbol": symbol, "name": "table", "instructions_mean": mean, "instructions_max": "255", "bytes": "",
                "error": "1.302e-6", "error_of": of})
        };
        let found =
            study("cost", &[way("cost_rigid", "twist_relative", "90"), way("cost_lookup", "gap_m", "243.0")]).unwrap();
        assert_eq!(found.table[1], ["table", "90 (255)", "", "0.000130 %"]);
        assert_eq!(found.table[2], ["table", "243 (255)", "", "1.30 µm"]);
        assert_eq!(found.values["lookup_instructions"], 243.0);
        assert!(study("cost", &[json!({})]).is_err());

        let found = study("bench", &[json!({"model": {"scenes": [{"us": 2.43}]}})]).unwrap();
        assert_eq!(
            found.table[1..3],
            [["an equilibrium with all derivatives", "2.43 µs"], ["its instructions", "not measured"]]
        );
        assert_eq!(found.values["us_per_equilibrium"], 2.43);
    }
}
