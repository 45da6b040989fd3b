//! A recorded log in the formats of other tools: MCAP for Foxglove and PlotJuggler ([`mod@mcap`]), and CSV without the comment
//! lines, which many readers of CSV do not pass over. All columns of the file are there, also those that the control code does
//! not use.

pub mod mcap;

use crate::csv_text::{Table as Csv, no_number};
use crate::log::Log;
use crate::log::read::whole_lines;
use clap::ValueEnum;
use std::collections::HashSet;

/// The columns that hold words; all others hold finite numbers. An empty cell is not known.
pub const WORDS: [&str; 7] = ["state", "fault", "faults", "limit", "doubts", "load_at_range_end", "homing_failure"];
/// Times that every format can hold, as nanoseconds in 64 bits (s): 30 years.
const TIMES_S: std::ops::RangeInclusive<f64> = 0.0..=1e9;

/// A log, whole as it stands in its file.
#[derive(Debug, Clone, PartialEq)]
pub struct Table<'a> {
    /// As the tool reads it.
    pub log: Log,
    /// Its names and cells, checked.
    pub cells: Csv<'a>,
}

impl<'a> Table<'a> {
    /// Takes a log apart. `partial` also takes one that was cut short, as far as its last whole row.
    ///
    /// # Errors
    /// In words, naming the line: if the text is not a log, was cut short, or has no rows.
    pub fn read(text: &'a str, partial: bool) -> Result<Self, String> {
        let log = Log::parse(text)?;
        let log = if partial { log } else { log.whole().map_err(|e| format!("{e}; --partial exports the rest"))? };
        if log.rows.is_empty() {
            return Err("has no rows: there is nothing to export".into());
        }
        if let Some(outside) = log.rows.iter().map(|row| row.t_s).find(|t_s| !TIMES_S.contains(t_s)) {
            return Err(format!("t_s is {outside}, and can be {} to {} s", TIMES_S.start(), TIMES_S.end()));
        }
        let cells = Csv::parse(whole_lines(text))?;
        let (mut seen, names) = (HashSet::new(), &cells.names.1);
        for name in names {
            if name.is_empty() {
                return Err("a column has no name".to_owned());
            }
            if !seen.insert(name) {
                return Err(format!("there are two columns `{name}`"));
            }
        }
        for (line, record) in &cells.rows {
            for (name, cell) in names.iter().zip(record) {
                let finite = cell.parse().is_ok_and(f64::is_finite);
                if !(finite || cell.is_empty() || WORDS.contains(&name)) {
                    return Err(format!("line {line}: {}", no_number(name, cell)));
                }
            }
        }
        Ok(Self { log, cells })
    }

    /// Requests and events, in the log's order: when (s), and `request …` or `event …` as in the log.
    pub fn marks(&self) -> impl Iterator<Item = (f64, &'a str)> {
        // Their form was checked with the log.
        self.cells.comments.iter().filter_map(|(_, comment)| {
            let (time, text) = comment.trim_start_matches('#').trim().strip_prefix("at ")?.split_once(' ')?;
            Some((time.parse().ok()?, text))
        })
    }

    /// The line of names and the rows.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn csv(&self) -> Result<Vec<u8>, String> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let rows = self.cells.rows.iter().map(|(_, record)| record);
        std::iter::once(&self.cells.names.1)
            .chain(rows)
            .try_for_each(|record| writer.write_record(record))
            .map_err(|e| e.to_string())?;
        writer.into_inner().map_err(|e| e.to_string())
    }
}

/// The format of another tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For Foxglove and PlotJuggler: JSON messages with schemas, at wall-clock times
    Mcap,
    /// The rows alone, under one line of names
    Csv,
}

impl Format {
    /// The content of a file of this format.
    ///
    /// # Errors
    /// In words, without the log's name.
    pub fn encode(self, table: &Table<'_>) -> Result<Vec<u8>, String> {
        match self {
            Self::Mcap => mcap::encode(table).map_err(|e| e.to_string()),
            Self::Csv => table.csv(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::session::row::{RangeEnd, Row};
    use rig_link::{Fault, HomingFailure, Limit};

    const LOG: &str = "# format = tsa-log 1\n# seed = 3\nt_s,state,position_m,twist_rad,limit,new_one\n\
        # at 0.01 request home\n0.02,ready,0.001,3.2,,\n# at 0.02 event stopped\n0.03,moving,-1e-7,3.3,travel,4\n\
        # lost_frames = 0\n# end rows = 2\n";

    #[test]
    fn every_column_is_there_and_an_empty_cell_is_none() {
        let table = Table::read(LOG, false).expect("a log");
        let cells: Vec<Vec<&str>> = table.cells.rows.iter().map(|(_, record)| record.iter().collect()).collect();
        assert_eq!(cells[1], ["0.03", "moving", "-1e-7", "3.3", "travel", "4"], "the last one of a later version");
        assert_eq!(table.log.rows[1].position_m, Some(-1e-7));
        let marks: Vec<_> = table.marks().collect();
        assert_eq!(marks, [(0.01, "request home"), (0.02, "event stopped")]);
        assert_eq!(table.log.header.get("lost_frames"), Some("0"));
        let csv = String::from_utf8(table.csv().expect("CSV")).expect("text");
        assert_eq!(
            csv,
            "t_s,state,position_m,twist_rad,limit,new_one\n0.02,ready,0.001,3.2,,\n0.03,moving,-1e-7,3.3,travel,4\n"
        );
    }

    #[test]
    fn the_columns_of_words_are_those_of_a_row() {
        let mut row = Row::new(0.0, &fixtures::telemetry(0), None, None);
        (row.fault, row.faults, row.limit) = (Some(Fault::Supply), Some("x y".into()), Some(Limit::Travel));
        (row.doubts, row.homing_failure) = (Some("x y".into()), Some(HomingFailure::Stopped));
        row.load_at_range_end = Some(RangeEnd::Low);
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
            (LOG.replace("travel,4", "travel,four"), "line 7: new_one `four`"),
            (LOG.replace("travel,4", "travel,inf"), "line 7: new_one `inf`"),
            (LOG.replace("0.02,ready", "-5,ready"), "t_s is -5"),
            (LOG.replace("0.03,moving", "1e10,moving"), "t_s is 10000000000"),
        ] {
            let error = Table::read(&text, false).expect_err(named);
            assert!(error.contains(named), "{named}: {error}");
        }
        // In the middle of the second row: the first one is whole.
        let cut = &LOG[..LOG.find(",3.3").expect("there")];
        assert!(Table::read(cut, false).is_err_and(|e| e.contains("after 1 rows")));
        assert_eq!(Table::read(cut, true).expect("a row").log.rows[0].t_s, 0.02);
    }
}
