//! CSV: the rows of a text by the names of their columns, each error with its line and column; and rows as a text.

use csv::{ErrorKind, ReaderBuilder, StringRecord, Trim, Writer, WriterBuilder};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A text as its columns' names, its rows and its comments, which begin with `#`; each with its line, from 1.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table<'a> {
    /// Names of the columns, and the line that they stand in; empty without one.
    pub names: (usize, StringRecord),
    /// Cells without the blanks around them.
    pub rows: Vec<(usize, StringRecord)>,
    /// Comments.
    pub comments: Vec<(usize, &'a str)>,
}

impl<'a> Table<'a> {
    /// Takes a text apart. Blank lines are passed over.
    ///
    /// # Errors
    /// If it is no CSV.
    pub fn parse(text: &'a str) -> Result<Self, String> {
        // Spreadsheets put a byte-order mark in front.
        let lines = (1..).zip(text.trim_start_matches('\u{feff}').lines()).filter(|(_, line)| !line.trim().is_empty());
        let (comments, lines): (Vec<_>, Vec<(usize, &str)>) = lines.partition(|(_, line)| line.starts_with('#'));
        let body = lines.iter().map(|(_, line)| *line).collect::<Vec<_>>().join("\n");
        let reader =
            ReaderBuilder::new().trim(Trim::All).flexible(true).has_headers(false).from_reader(body.as_bytes());
        let mut rows = Vec::with_capacity(lines.len());
        for record in reader.into_records() {
            let record = record.map_err(|e| e.to_string())?;
            let at = record.position().map_or(1, |position| position.line()) as usize;
            rows.push((lines.get(at - 1).map_or(0, |(line, _)| *line), record));
        }
        let names = if rows.is_empty() { Default::default() } else { rows.remove(0) };
        Ok(Self { names, rows, comments })
    }

    /// Whether there is a column of this name.
    pub fn has(&self, name: &str) -> bool {
        self.names.1.iter().any(|other| other == name)
    }

    /// Checks that each of these columns is there once.
    ///
    /// # Errors
    /// Naming the first that is not.
    pub fn require(&self, names: &[&str]) -> Result<(), String> {
        names.iter().try_for_each(|name| match self.names.1.iter().filter(|other| other == name).count() {
            0 => Err(format!("has no column `{name}` in its first line")),
            1 => Ok(()),
            _ => Err(format!("has two columns `{name}` in its first line")),
        })
    }

    /// Checks that a row has a cell under each name: with a decimal comma, for one, it has more.
    fn check(&self, record: &StringRecord) -> Result<(), String> {
        let (cells, names) = (record.len(), self.names.1.len());
        if cells == names { Ok(()) } else { Err(format!("{cells} cells under {names} names")) }
    }

    /// A row by its names.
    ///
    /// # Errors
    /// Naming the column and the cell.
    pub fn row<T: DeserializeOwned>(&self, record: &StringRecord) -> Result<T, String> {
        self.check(record)?;
        record.deserialize(Some(&self.names.1)).map_err(|error| match error.kind() {
            ErrorKind::Deserialize { err, .. } => match err.field().map(|k| k as usize) {
                Some(k) => no_number(self.names.1.get(k).unwrap_or(""), record.get(k).unwrap_or("")),
                None => err.kind().to_string(),
            },
            _ => error.to_string(),
        })
    }

    /// The number in a column of a row; it may be infinite or none.
    ///
    /// # Errors
    /// Naming the column and the cell.
    pub fn number(&self, record: &StringRecord, name: &str) -> Result<f64, String> {
        self.check(record)?;
        let place = self.names.1.iter().position(|other| other == name);
        let cell = place.and_then(|place| record.get(place)).unwrap_or("");
        cell.parse().map_err(|_| no_number(name, cell))
    }
}

/// What is said of a cell that has to hold a number.
pub fn no_number(name: &str, cell: &str) -> String {
    format!("{name} `{cell}` is not a number")
}

/// A row's line, from 1, and its numbers or what is wrong with them.
pub type Numbers<const N: usize> = (usize, Result<[f64; N], String>);

/// The numbers in the columns of these names; others are ignored. A bad row is an error in its place.
///
/// # Errors
/// If a column is not there, or is there twice.
pub fn columns<const N: usize>(text: &str, names: [&str; N]) -> Result<Vec<Numbers<N>>, String> {
    let table = Table::parse(text)?;
    table.require(&names)?;
    let row = |(line, record): &(usize, StringRecord)| {
        let mut numbers = [0.0; N];
        for (number, name) in numbers.iter_mut().zip(names) {
            *number = table.number(record, name).map_err(|message| format!("line {line}: {message}"))?;
        }
        Ok(numbers)
    };
    Ok(table.rows.iter().map(|numbered| (numbered.0, row(numbered))).collect())
}

/// Rows as CSV; their fields' names are the header.
///
/// # Errors
/// If a row is nested.
pub fn named(rows: impl IntoIterator<Item = impl Serialize>) -> anyhow::Result<String> {
    written(Writer::from_writer(Vec::new()), rows)
}

/// Rows as CSV below a header, as tuples of as many cells.
///
/// # Errors
/// If a row has another number of cells.
pub fn below(header: &str, rows: impl IntoIterator<Item = impl Serialize>) -> anyhow::Result<String> {
    let mut writer = WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    writer.write_record(header.split(','))?;
    written(writer, rows)
}

fn written(mut writer: Writer<Vec<u8>>, rows: impl IntoIterator<Item = impl Serialize>) -> anyhow::Result<String> {
    for row in rows {
        writer.serialize(row)?;
    }
    Ok(String::from_utf8(writer.into_inner().map_err(|e| e.into_error())?)?)
}
