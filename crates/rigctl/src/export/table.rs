//! A log by its columns. All columns of the file are there, also those that the control code does not use.

use crate::log::Log;
use std::collections::HashSet;

/// The columns that hold words; all others hold numbers.
const WORDS: [&str; 6] = ["state", "fault", "faults", "limit", "doubts", "homing_failure"];
/// Times that every format can hold, as nanoseconds in 64 bits (s): 30 years.
const TIMES_S: std::ops::RangeInclusive<f64> = 0.0..=1e9;

/// The cells of one column; an empty one is `None`.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells<'a> {
    /// Finite numbers.
    Numbers(Vec<Option<f64>>),
    /// Words.
    Words(Vec<Option<&'a str>>),
}

/// One column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column<'a> {
    /// Its name, with the unit at its end.
    pub name: &'a str,
    /// Its cells.
    pub cells: Cells<'a>,
}

/// A request or an event between the rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mark<'a> {
    /// When (s).
    pub t_s: f64,
    /// `request …` or `event …`, as in the log.
    pub text: &'a str,
}

/// A log by its columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Table<'a> {
    /// The facts of the header and of the log's end.
    pub facts: Vec<(String, String)>,
    /// The columns, in the log's order.
    pub columns: Vec<Column<'a>>,
    /// Times of the rows (s).
    pub t_s: Vec<f64>,
    /// Requests and events, in the log's order.
    pub marks: Vec<Mark<'a>>,
    lines: Vec<&'a str>,
}

impl<'a> Table<'a> {
    /// Takes a log apart. `partial` also takes one that was cut short, as far as its last whole row.
    ///
    /// # Errors
    /// In words, naming the line: if the text is not a log, was cut short, or has no rows.
    pub fn read(text: &'a str, partial: bool) -> Result<Self, String> {
        let log = Log::parse(text).map_err(|e| e.to_string())?;
        let log = if partial { log } else { log.whole().map_err(|e| format!("{e}; --partial exports the rest"))? };
        if log.rows.is_empty() {
            return Err("has no rows: there is nothing to export".into());
        }
        let (facts, t_s) = (log.header.0, log.rows.iter().map(|row| row.t_s).collect::<Vec<_>>());
        if let Some(outside) = t_s.iter().find(|t_s| !TIMES_S.contains(t_s)) {
            return Err(format!("t_s is {outside}, and can be {} to {} s", TIMES_S.start(), TIMES_S.end()));
        }
        // A last line without a line end was cut in the middle.
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        let numbered = (1..).zip(whole.lines());
        let (comments, rows): (Vec<_>, Vec<_>) =
            numbered.filter(|(_, line)| !line.trim().is_empty()).partition(|(_, line)| line.starts_with('#'));
        let marks = comments.iter().filter_map(|(_, line)| mark(line)).collect();
        let mut columns = names(rows.first().map_or("", |(_, line)| line))?;
        for (line, content) in rows.iter().skip(1) {
            // Their number was checked with the log.
            for (column, cell) in columns.iter_mut().zip(content.split(',').map(str::trim)) {
                column.push(cell).map_err(|message| format!("line {line}: {message}"))?;
            }
        }
        Ok(Self { facts, columns, t_s, marks, lines: rows.into_iter().map(|(_, line)| line).collect() })
    }

    /// The line of names and the rows.
    pub fn csv(&self) -> Vec<u8> {
        let mut text = self.lines.join("\n");
        text.push('\n');
        text.into_bytes()
    }
}

impl<'a> Column<'a> {
    fn push(&mut self, cell: &'a str) -> Result<(), String> {
        match &mut self.cells {
            Cells::Words(words) => words.push(Some(cell).filter(|word| !word.is_empty())),
            Cells::Numbers(numbers) if cell.is_empty() => numbers.push(None),
            Cells::Numbers(numbers) => match cell.parse::<f64>() {
                Ok(x) if x.is_finite() => numbers.push(Some(x)),
                _ => return Err(format!("{} `{cell}` is not a number", self.name)),
            },
        }
        Ok(())
    }
}

/// Empty columns by the line of names.
fn names(line: &str) -> Result<Vec<Column<'_>>, String> {
    let mut seen = HashSet::new();
    let column = |name: &'_ str| match () {
        () if name.is_empty() => Err("a column has no name".to_owned()),
        () if !seen.insert(name.to_owned()) => Err(format!("there are two columns `{name}`")),
        () => Ok(()),
    };
    line.split(',').map(str::trim).try_for_each(column)?;
    let empty = |name| match WORDS.contains(&name) {
        true => Cells::Words(Vec::new()),
        false => Cells::Numbers(Vec::new()),
    };
    Ok(line.split(',').map(str::trim).map(|name| Column { name, cells: empty(name) }).collect())
}

/// The mark in a comment line, whose form was checked with the log.
fn mark(line: &str) -> Option<Mark<'_>> {
    let (time, text) = line.trim_start_matches('#').trim().strip_prefix("at ")?.split_once(' ')?;
    Some(Mark { t_s: time.parse().ok()?, text })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::session::row::Row;
    use rig_link::{Fault, HomingFailure, Limit};

    const LOG: &str = "# format = tsa-log 1\n# seed = 3\nt_s,state,position_m,twist_rad,limit,new_one\n\
        # at 0.01 request home\n0.02,ready,0.001,3.2,,\n# at 0.02 event stopped\n0.03,moving,-1e-7,3.3,speed,4\n\
        # lost_frames = 0\n# end rows = 2\n";

    #[test]
    fn every_column_is_there_and_an_empty_cell_is_none() {
        let table = Table::read(LOG, false).expect("a log");
        let cells = |name: &str| &table.columns.iter().find(|c| c.name == name).expect(name).cells;
        assert_eq!(cells("position_m"), &Cells::Numbers(vec![Some(0.001), Some(-1e-7)]));
        assert_eq!(cells("limit"), &Cells::Words(vec![None, Some("speed")]));
        assert_eq!(cells("new_one"), &Cells::Numbers(vec![None, Some(4.0)]), "of a later version");
        assert_eq!(table.t_s, [0.02, 0.03]);
        let marks: Vec<_> = table.marks.iter().map(|m| (m.t_s, m.text)).collect();
        assert_eq!(marks, [(0.01, "request home"), (0.02, "event stopped")]);
        assert!(table.facts.contains(&("lost_frames".into(), "0".into())), "{:?}", table.facts);
        let csv = String::from_utf8(table.csv()).expect("text");
        assert_eq!(
            csv,
            "t_s,state,position_m,twist_rad,limit,new_one\n0.02,ready,0.001,3.2,,\n0.03,moving,-1e-7,3.3,speed,4\n"
        );
    }

    #[test]
    fn the_columns_of_words_are_those_of_a_row() {
        let mut row = Row::new(0.0, &fixtures::telemetry(0), None, None);
        (row.fault, row.faults, row.limit) = (Some(Fault::Supply), Some("x y".into()), Some(Limit::Travel));
        (row.doubts, row.homing_failure) = (Some("x y".into()), Some(HomingFailure::Stopped));
        let serde_json::Value::Object(row) = serde_json::to_value(&row).expect("an object") else { panic!() };
        let words: Vec<&str> = row.iter().filter(|(_, v)| v.is_string()).map(|(name, _)| name.as_str()).collect();
        assert!(words.iter().all(|word| WORDS.contains(word)) && words.len() == WORDS.len(), "{words:?}");
    }

    #[test]
    fn what_cannot_be_exported_is_named() {
        let headless = "# format = tsa-log 1\n# end rows = 0\n";
        let empty = "# format = tsa-log 1\nt_s,state,position_m,twist_rad\n# end rows = 0\n";
        for (text, named) in [
            ("load_n,turns\n1,2\n".to_owned(), "not a log of this tool"),
            (LOG[..LOG.len() - 40].to_owned(), "--partial"),
            (empty.to_owned(), "no rows"),
            (headless.to_owned(), "no rows"),
            (LOG.replace("limit", "state"), "two columns `state`"),
            (LOG.replace("limit", ""), "no name"),
            (LOG.replace("speed,4", "speed,four"), "line 7: new_one `four`"),
            (LOG.replace("speed,4", "speed,inf"), "line 7: new_one `inf`"),
            (LOG.replace("0.02,ready", "-5,ready"), "t_s is -5"),
            (LOG.replace("0.03,moving", "1e10,moving"), "t_s is 10000000000"),
        ] {
            let error = Table::read(&text, false).expect_err(named);
            assert!(error.contains(named), "{named}: {error}");
        }
        // In the middle of the second row: the first one is whole.
        let cut = &LOG[..LOG.find(",3.3").expect("there")];
        assert!(Table::read(cut, false).is_err_and(|e| e.contains("after 1 rows")));
        assert_eq!(Table::read(cut, true).expect("a row").t_s, [0.02]);
    }
}
