//! Files of loads and turns.

use crate::failure::{ErrorBody, Failure};
use crate::options::values::{load, turns};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A row that failed, as machines read it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RowError {
    /// Why it failed.
    pub error: ErrorBody,
}

impl RowError {
    /// A failed row.
    pub fn new(kind: &str, message: impl ToString) -> Self {
        Self { error: ErrorBody { kind: kind.into(), message: message.to_string() } }
    }
}

/// One load and number of turns, or a file of them.
#[derive(Debug, Clone, Args)]
pub struct At {
    /// Load on the rods (N or kg)
    #[arg(long, value_name = "L", allow_hyphen_values = true, value_parser = load,
        required_unless_present = "batch", conflicts_with = "batch")]
    pub load: Option<f64>,
    /// Turns past the half-turn pre-twist
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = turns,
        required_unless_present = "batch", conflicts_with = "batch")]
    pub turns: Option<f64>,
    /// A CSV file with the columns load_n and turns
    #[arg(long, value_name = "FILE.csv")]
    pub batch: Option<PathBuf>,
}

/// One load and number of turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Query {
    /// Load (N).
    pub load_n: f64,
    /// Turns past the half-turn pre-twist.
    pub turns: f64,
}

/// Reads the columns `load_n` and `turns` and ignores others. A bad row is an error in its place.
///
/// # Errors
/// If the file cannot be read or lacks a column.
pub fn read(path: &Path) -> Result<Vec<Result<Query, RowError>>, Failure> {
    let text = rig_config::files::read_to_string(path)
        .map_err(|e| Failure::failed(format!("batch file {}: {e}", path.display())))?;
    parse(&text).map_err(|e| Failure::failed(format!("batch file {}: {e}", path.display())))
}

/// The end of a batch: rows may fail, but not all of them.
///
/// # Errors
/// If there were rows and all of them failed.
pub fn all_failed(path: &Path, rows: usize, failed: usize) -> Result<(), Failure> {
    if rows > 0 && failed == rows {
        return Err(Failure::failed(format!("batch file {}: every one of its {rows} rows failed", path.display())));
    }
    Ok(())
}

fn parse(text: &str) -> Result<Vec<Result<Query, RowError>>, String> {
    let query = |row: Result<[f64; 2], String>| match row {
        Ok([load_n, turns]) => Ok(Query { load_n, turns }),
        Err(message) => Err(RowError::new("bad-row", message)),
    };
    Ok(columns(text, ["load_n", "turns"])?.into_iter().map(|(_, row)| query(row)).collect())
}

/// A row's line in its file, from 1, and its numbers or what is wrong with them.
pub type Numbers<const N: usize> = (usize, Result<[f64; N], String>);

/// The numbers in the columns of these names; others are ignored. A bad row is an error in its place.
///
/// # Errors
/// If a column is not there, or is there twice.
pub fn columns<const N: usize>(text: &str, names: [&str; N]) -> Result<Vec<Numbers<N>>, String> {
    // Spreadsheets put a byte-order mark in front.
    let mut lines = (1..).zip(text.trim_start_matches('\u{feff}').lines()).filter(|(_, l)| !l.trim().is_empty());
    let header: Vec<&str> = lines.next().map(|(_, l)| fields(l).collect()).unwrap_or_default();
    let column = |name: &str| {
        let mut places = header.iter().enumerate().filter(|(_, h)| **h == name).map(|(k, _)| k);
        match (places.next(), places.next()) {
            (Some(k), None) => Ok(k),
            (Some(_), Some(_)) => Err(format!("has two columns `{name}` in its first line")),
            (None, _) => Err(format!("has no column `{name}` in its first line")),
        }
    };
    let places = names.iter().map(|name| column(name)).collect::<Result<Vec<usize>, String>>()?;
    let row = |line: usize, content: &str| {
        let cells: Vec<&str> = fields(content).collect();
        if cells.len() != header.len() {
            // A decimal comma, for one.
            return Err(format!("line {line}: {} cells under {} names", cells.len(), header.len()));
        }
        let mut numbers = [0.0; N];
        for ((number, name), place) in numbers.iter_mut().zip(names).zip(&places) {
            let cell = cells[*place];
            *number = cell.parse().map_err(|_| format!("line {line}: {name} `{cell}` is not a number"))?;
        }
        Ok(numbers)
    };
    Ok(lines.map(|(line, content)| (line, row(line, content))).collect())
}

fn fields(line: &str) -> impl Iterator<Item = &str> {
    line.split(',').map(|f| f.trim().trim_matches('"').trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_by_name_and_bad_rows_in_place() {
        let rows = parse("\u{feff}scene, turns,\"load_n\"\r\nx,1.5,4.9\n\ny,zwei,3\nz,1\nw,nan,2\nv,1,4,9\n").unwrap();
        assert_eq!(rows.len(), 5);
        assert_eq!(rows[0], Ok(Query { load_n: 4.9, turns: 1.5 }));
        let message = &rows[1].as_ref().unwrap_err().error.message;
        assert!(message.contains("line 4") && message.contains("turns") && message.contains("zwei"), "{message}");
        for (k, named) in [(2, "2 cells"), (4, "4 cells")] {
            let message = &rows[k].as_ref().unwrap_err().error.message;
            assert!(message.contains(named), "{message}");
        }
        assert!(rows[3].is_ok(), "whether NaN is a twist is the solver's to say");
    }

    #[test]
    fn missing_columns_are_named() {
        assert!(parse("load,turns\n1,2\n").unwrap_err().contains("load_n"));
        assert!(parse("load_n\n1\n").unwrap_err().contains("turns"));
        assert!(parse("turns,load_n,turns\n1,2,3\n").unwrap_err().contains("two columns `turns`"));
        assert!(parse("").is_err());
    }
}
