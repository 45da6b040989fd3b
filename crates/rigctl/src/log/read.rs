//! Reading a log back. Every line is checked; each refusal names the line.

use super::write::HOMED;
use super::{CONSTANTS, FORMAT, Header, SETTINGS};
use crate::board_settings;
use crate::csv_text::{Table, no_number};
use crate::request;
use crate::session::row::Row;
use rig_link::{CorrectedConstants, HomingResult, Request, Setting, SettingValues};
use std::path::Path;

/// A request or event between two rows.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// The host sent a request.
    Request(Request),
    /// Homing ended. In older logs this is another event: they do not hold all of the result.
    Homed(HomingResult),
    /// Any other event of the board.
    Event(String),
}

/// A mark and its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Marked {
    /// Number of rows before it.
    pub row: usize,
    /// When (s).
    pub t_s: f64,
    /// What.
    pub mark: Mark,
}

/// A log.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Log {
    /// The facts before the first row.
    pub header: Header,
    /// Telemetry in order of time. What an older log has no column for is not known.
    pub rows: Vec<Row>,
    /// Requests and events between the rows.
    pub marks: Vec<Marked>,
    /// Whether the head is whole: the names of the columns are there, which follow it.
    pub has_head: bool,
    /// Whether the line that ends a log is there.
    pub complete: bool,
}

/// Columns that every log has.
const NEEDED: [&str; 4] = ["t_s", "state", "position_m", "twist_rad"];

/// A text as far as its last whole line: a last line without a line end was cut in the middle.
pub fn whole_lines(text: &str) -> &str {
    text.rfind('\n').map_or("", |end| &text[..end])
}

impl Log {
    /// Reads a file.
    ///
    /// # Errors
    /// In words, without the file's name.
    pub fn load(path: &Path) -> Result<Self, String> {
        Self::parse(&Self::text(path)?)
    }

    /// The text of a file.
    ///
    /// # Errors
    /// In words, without the file's name.
    pub fn text(path: &Path) -> Result<String, String> {
        let bytes = rig_config::files::read(path).map_err(|e| e.to_string())?;
        String::from_utf8(bytes).map_err(|e| format!("is not text from byte {} on", e.utf8_error().valid_up_to()))
    }

    /// Whether a file begins as a log does.
    pub fn is_one(content: &[u8]) -> bool {
        content.strip_prefix("\u{feff}".as_bytes()).unwrap_or(content).starts_with(b"# format =")
    }

    /// Reads a text. A log that was cut short is read as far as it goes; see [`Log::whole`].
    ///
    /// # Errors
    /// In words, naming the line.
    pub fn parse(text: &str) -> Result<Self, String> {
        if text.trim().is_empty() {
            return Err("is empty".into());
        }
        // Spreadsheets put a byte-order mark in front.
        let text = whole_lines(text.trim_start_matches('\u{feff}'));
        let first = text.lines().next().and_then(|line| line.strip_prefix('#')?.split_once(" = "));
        if first.is_none_or(|(key, value)| (key.trim(), value.trim()) != ("format", FORMAT)) {
            return Err(format!("is not a log of this tool: its first line is not `# format = {FORMAT}`"));
        }
        let fail = |line: usize, message: String| format!("line {line}: {message}");
        let table = Table::parse(text).map_err(|message| fail(1, message))?;
        let mut log = Self { has_head: !table.names.1.is_empty(), ..Self::default() };
        if log.has_head {
            table.require(&NEEDED).map_err(|message| fail(table.names.0, message))?;
        }
        for (line, record) in &table.rows {
            let row: Row = table.row(record).map_err(|message| fail(*line, message))?;
            let infinite = |cell: &&str| cell.parse::<f32>().is_ok_and(|number| !number.is_finite());
            if let Some(k) = record.iter().position(|cell| infinite(&cell)) {
                return Err(fail(*line, no_number(&table.names.1[k], &record[k])));
            }
            if log.rows.last().is_some_and(|last| row.t_s < last.t_s) {
                return Err(fail(*line, format!("t_s {} lies before the row above", row.t_s)));
            }
            log.rows.push(row);
        }
        for (line, comment) in &table.comments {
            let rows = table.rows.partition_point(|(row, _)| row < line);
            log.comment(comment.trim_start_matches('#').trim(), rows).map_err(|message| fail(*line, message))?;
            let last = table.rows.last().map_or(0, |(row, _)| *row).max(table.comments.last().map_or(0, |(at, _)| *at));
            if log.complete && *line < last {
                return Err(fail(last, "comes after the log's end".into()));
            }
        }
        Ok(log)
    }

    /// The log itself, if it is complete.
    ///
    /// # Errors
    /// As [`Log::cut`].
    pub fn whole(self) -> Result<Self, String> {
        self.cut().map_or(Ok(self), Err)
    }

    /// Where the log was cut short, in words, if it was.
    pub fn cut(&self) -> Option<String> {
        let rows = self.rows.len();
        let cut = || format!("was cut short after {rows} rows: its last line, `# end rows = …`, is missing");
        (!self.complete).then(cut)
    }

    /// The constants of the board that its settings correct, if the header has all of them.
    pub fn constants(&self) -> Option<CorrectedConstants> {
        let number = |name: &str| self.header.get(&format!("{CONSTANTS}{name}"))?.parse().ok();
        Some(CorrectedConstants {
            gear_ratio: number("gear_ratio")?,
            counts_per_rad: number("counts_per_rad")?,
            lvdt_gap_at_code_zero_m: number("lvdt_gap_at_code_zero_m")?,
            lvdt_metres_per_code: number("lvdt_metres_per_code")?,
        })
    }

    /// The settings that the board ran with. Those that the header does not have are taken from `defaults`, and named.
    ///
    /// # Errors
    /// Naming a setting that this tool does not know, or a value that is out of range.
    pub fn settings(&self, defaults: &SettingValues) -> Result<(SettingValues, Vec<Setting>), String> {
        let (mut values, mut missing) = (*defaults, Setting::ALL.to_vec());
        for (key, text) in &self.header.0 {
            let Some(name) = key.strip_prefix(SETTINGS) else { continue };
            values = board_settings::put(&values, defaults, name, text)?;
            missing.retain(|setting| setting.name() != name);
        }
        Ok((values, missing))
    }

    /// Takes a comment that follows so many rows.
    fn comment(&mut self, text: &str, row: usize) -> Result<(), String> {
        if let Some(count) = text.strip_prefix("end rows = ") {
            if count.parse() != Ok(row) {
                return Err(format!("the log's end counts {count} rows, there are {row}"));
            }
            self.complete = true;
        } else if let Some(mark) = text.strip_prefix("at ") {
            let (time, what) = mark.split_once(' ').ok_or("a mark without a time and what happened")?;
            let t_s: f64 = time.parse().map_err(|_| no_number("time", time))?;
            if !t_s.is_finite() {
                return Err(no_number("time", time));
            }
            let mark = if let Some(request) = what.strip_prefix("request ") {
                Mark::Request(request::from_text(request)?)
            } else if let Some(event) = what.strip_prefix("event ") {
                match event.strip_prefix(HOMED).filter(|result| result.starts_with('{')) {
                    Some(result) => Mark::Homed(serde_json::from_str(result).map_err(|e| format!("event homed: {e}"))?),
                    None => Mark::Event(event.to_owned()),
                }
            } else {
                return Err(format!("`{what}` is neither a request nor an event"));
            };
            self.marks.push(Marked { row, t_s, mark });
        } else if let Some((key, value)) = text.split_once(" = ") {
            self.header.add(key.trim(), value.trim());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "# format = tsa-log 1\n# scene_hash = 01234567\nt_s,state,position_m,twist_rad,load_n\n\
        # at 0.01 request move 0.008 speed=0.002 load=auto\n0.02,ready,0.001,3.2,\n\
        # at 0.02 event homed {\"zero_error_rad\":0.001,\"load_n\":4.9,\"load_error_n\":0.25,\"friction_n\":0.1,\
        \"reference_gap_m\":0.1,\"gap_noise_m\":4e-6,\"jump_m\":0.0,\"twist_scale\":1.0,\"curve\":{\"middle_rad\":22.0,\"half_rad\":14.0,\
        \"coefficients_m\":[0.0001,0.0,0.0,0.0]},\"covariance\":[1e-4,0.0,1e-8,0.0,0.0,1e-8],\"drive_lag_s\":0.05}\n\
        0.03,moving,0.001,3.3,4.9\n# lost_frames = 0\n# end rows = 2\n";

    #[test]
    fn a_log() {
        let log = Log::parse(GOOD).and_then(Log::whole).unwrap();
        assert_eq!((log.rows.len(), log.marks.len()), (2, 2));
        assert_eq!((log.header.get("scene_hash"), log.header.get("lost_frames")), (Some("01234567"), Some("0")));
        assert_eq!(log.rows[1].load_n, Some(4.9));
        assert_eq!(log.marks[1].row, 1);
        let Mark::Homed(found) = log.marks[1].mark else { panic!("{:?}", log.marks[1]) };
        assert_eq!((found.load_n, found.load_error_n, found.curve.coefficients_m[0]), (4.9, 0.25, 0.0001));
        assert_eq!(log.rows[1].load_error_n, None, "written before errors were stated");
        let raw = |row: &Row| (row.gap_m, row.encoder_rad, row.supply_v, row.load_at_range_end);
        assert_eq!(raw(&log.rows[1]), (None, None, None, None), "written before these columns were there");
        assert!(matches!(log.marks[0].mark, Mark::Request(Request::Move { target_m: 0.008, .. })));
    }

    #[test]
    fn other_columns_and_homings_of_other_versions() {
        let text = GOOD
            .replace("twist_rad,load_n\n", "twist_rad,load_n,load_error_n,position_error_m\n")
            .replace("3.2,\n", "3.2,,,\n")
            .replace("3.3,4.9\n", "3.3,4.9,0.2,0.0001\n");
        let homed = GOOD.lines().find(|line| line.contains("homed")).unwrap();
        let older = "# at 0.02 event homed twist_error_estimate_rad=0.001 load_n=4.9 gap_offset_m=0.0001";
        let log = Log::parse(&text.replace(homed, older)).and_then(Log::whole).unwrap();
        let errors = |k: usize| [log.rows[k].load_error_n, log.rows[k].position_error_m];
        assert_eq!((errors(0), errors(1)), ([None; 2], [Some(0.2), Some(0.0001)]));
        assert!(matches!(log.marks[1].mark, Mark::Event(_)));
    }

    #[test]
    fn a_cut_log_is_known_wherever_it_was_cut() {
        let mut seen = [0; 2];
        for end in 0..GOOD.len() {
            match Log::parse(&GOOD[..end]).and_then(Log::whole) {
                Err(why) if why.contains("is empty") || why.contains("not a log") => seen[0] += 1,
                Err(why) if why.contains("cut short") => seen[1] += 1,
                other => panic!("cut at {end}: {other:?}"),
            }
        }
        assert!(seen[0] > 10 && seen[1] > 100, "{seen:?}");
    }

    #[test]
    fn damage_is_named_with_its_line() {
        for (from, to, line, named) in [
            ("twist_rad,load_n", "twist,load_n", 3, "twist_rad"),
            ("0.02,ready", "0.02,reedy", 5, "reedy"),
            ("0.02,ready", "x,ready", 5, "t_s"),
            ("0.02,ready", "nan,ready", 5, "t_s"),
            ("0.02,ready,", "0.02,ready,,", 5, "cells"),
            ("0.03,moving", "0.01,moving", 7, "before"),
            ("move 0.008", "mov 0.008", 4, "mov"),
            ("load_n\":4.9", "load_n\":inf", 6, "event homed"),
            ("at 0.02", "at noon", 6, "noon"),
            ("end rows = 2", "end rows = 3", 9, "3 rows"),
        ] {
            let text = GOOD.replace(from, to);
            let message = Log::parse(&text).expect_err(to);
            assert!(message.starts_with(&format!("line {line}: ")) && message.contains(named), "{to}: {message}");
        }
        for (text, named) in [
            (String::new(), "is empty"),
            ("load_n,turns\n1,2\n".into(), "not a log"),
            (GOOD.replace("tsa-log 1", "tsa-log 2"), "not a log"),
        ] {
            assert!(Log::parse(&text).is_err_and(|why| why.contains(named)), "{text}");
        }
    }
}
