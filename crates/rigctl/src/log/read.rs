//! Reading a log back. Every line is checked; each refusal names the line.

use super::write::HOMED;
use super::{CONSTANTS, FORMAT, Header, SETTINGS};
use crate::board_settings;
use crate::lvdt_points;
use crate::request;
use rig_link::{CorrectedConstants, HomingResult, Request, Setting, SettingValues, State};
use std::path::Path;

/// The columns of a row that the control code uses. SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogRow {
    /// Time (s).
    pub t_s: f64,
    /// State of the rig.
    pub state: State,
    /// Target of the move.
    pub target_m: Option<f64>,
    /// The planner's set-point.
    pub setpoint_m: Option<f64>,
    /// Position measured by the LVDT.
    pub position_m: Option<f64>,
    /// Twist of the strings.
    pub twist_rad: Option<f64>,
    /// Estimated load.
    pub load_n: Option<f64>,
    /// Stated error of `load_n`; older logs do not have it.
    pub load_error_n: Option<f64>,
    /// Stated error of `position_m`; older logs do not have it.
    pub position_error_m: Option<f64>,
    /// Transmission ratio.
    pub tr_rad_per_m: Option<f64>,
    /// Motor current.
    pub drive_current_a: f64,
    /// Speed of the motor shaft.
    pub drive_speed_rad_per_s: f64,
    /// Learned scale of the twist.
    pub twist_scale: Option<f64>,
}

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
    /// Telemetry in order of time.
    pub rows: Vec<LogRow>,
    /// Requests and events between the rows.
    pub marks: Vec<Marked>,
    /// Whether the head is whole: the names of the columns are there, which follow it.
    pub has_head: bool,
    /// Whether the line that ends a log is there.
    pub complete: bool,
}

/// Why a text is not a log.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LogError {
    /// The text is empty.
    #[error("is empty")]
    Empty,
    /// Another kind of file.
    #[error("is not a log of this tool: its first line is not `# format = {FORMAT}`")]
    Format,
    /// A line is wrong.
    #[error("line {line}: {message}")]
    Line {
        /// From 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// The last line is missing.
    #[error("was cut short after {rows} rows: its last line, `# end rows = …`, is missing")]
    Cut {
        /// Rows that are there.
        rows: usize,
    },
}

/// Columns that every log has.
const NEEDED: [&str; 4] = ["t_s", "state", "position_m", "twist_rad"];

impl Log {
    /// Reads a file.
    ///
    /// # Errors
    /// In words, without the file's name.
    pub fn load(path: &Path) -> Result<Self, String> {
        Self::parse(&Self::text(path)?).map_err(|e| e.to_string())
    }

    /// The text of a file.
    ///
    /// # Errors
    /// In words, without the file's name.
    pub fn text(path: &Path) -> Result<String, String> {
        let bytes = rig_config::files::read(path).map_err(|e| e.to_string())?;
        String::from_utf8(bytes).map_err(|e| format!("is not text from byte {} on", e.utf8_error().valid_up_to()))
    }

    /// Reads a text. A log that was cut short is read as far as it goes; see [`Log::whole`].
    ///
    /// # Errors
    /// [`LogError`], naming the line.
    pub fn parse(text: &str) -> Result<Self, LogError> {
        if text.trim().is_empty() {
            return Err(LogError::Empty);
        }
        let mut log = Self::default();
        let mut columns: Option<Vec<&str>> = None;
        // A last line without a line end was cut in the middle.
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        for (line, content) in (1..).zip(whole.lines()) {
            let fail = |message: String| LogError::Line { line, message };
            if log.complete && !content.trim().is_empty() {
                return Err(fail("comes after the log's end".into()));
            }
            if let Some(comment) = content.strip_prefix('#') {
                log.comment(comment.trim()).map_err(fail)?;
                if line == 1 && log.header.get("format") != Some(FORMAT) {
                    return Err(LogError::Format);
                }
                continue;
            }
            if line == 1 {
                return Err(LogError::Format);
            }
            match &columns {
                None => {
                    let names: Vec<&str> = content.split(',').map(str::trim).collect();
                    if let Some(missing) = NEEDED.iter().find(|n| !names.contains(n)) {
                        return Err(fail(format!("there is no column `{missing}`")));
                    }
                    columns = Some(names);
                    log.has_head = true;
                }
                Some(names) => {
                    let row = row(names, content).map_err(fail)?;
                    if log.rows.last().is_some_and(|last| row.t_s < last.t_s) {
                        return Err(fail(format!("t_s {} lies before the row above", row.t_s)));
                    }
                    log.rows.push(row);
                }
            }
        }
        if log.header.get("format").is_none() {
            return Err(LogError::Format);
        }
        Ok(log)
    }

    /// The log itself, if it is complete.
    ///
    /// # Errors
    /// [`LogError::Cut`].
    pub fn whole(self) -> Result<Self, LogError> {
        if self.complete { Ok(self) } else { Err(LogError::Cut { rows: self.rows.len() }) }
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
            if name == lvdt_points::NAME {
                values.lvdt_curve = Some(lvdt_points::from_text(text)?);
                continue;
            }
            let setting = board_settings::named(name)?;
            let value = board_settings::value(setting, text).map_err(|e| e.to_string())?;
            let value = setting.check(value, defaults.get(setting)).map_err(|refusal| refusal.to_string())?;
            values = values.with(setting, value);
            missing.retain(|other| *other != setting);
        }
        Ok((values, missing))
    }

    fn comment(&mut self, text: &str) -> Result<(), String> {
        if let Some(count) = text.strip_prefix("end rows = ") {
            if count.parse() != Ok(self.rows.len()) {
                return Err(format!("the log's end counts {count} rows, there are {}", self.rows.len()));
            }
            self.complete = true;
        } else if let Some(mark) = text.strip_prefix("at ") {
            let (time, what) = mark.split_once(' ').ok_or("a mark without a time and what happened")?;
            let t_s = time
                .parse()
                .ok()
                .filter(|t: &f64| t.is_finite())
                .ok_or_else(|| format!("time `{time}` is not a number"))?;
            let mark = if let Some(request) = what.strip_prefix("request ") {
                Mark::Request(request::from_text(request)?)
            } else if let Some(event) = what.strip_prefix("event ") {
                event_mark(event)?
            } else {
                return Err(format!("`{what}` is neither a request nor an event"));
            };
            self.marks.push(Marked { row: self.rows.len(), t_s, mark });
        } else if let Some((key, value)) = text.split_once(" = ") {
            self.header.add(key.trim(), value.trim());
        }
        Ok(())
    }
}

fn event_mark(text: &str) -> Result<Mark, String> {
    match text.strip_prefix(HOMED).filter(|result| result.starts_with('{')) {
        Some(result) => serde_json::from_str(result).map(Mark::Homed).map_err(|e| format!("event homed: {e}")),
        None => Ok(Mark::Event(text.to_owned())),
    }
}

fn row(names: &[&str], content: &str) -> Result<LogRow, String> {
    let cells: Vec<&str> = content.split(',').map(str::trim).collect();
    if cells.len() != names.len() {
        return Err(format!("has {} cells under {} names", cells.len(), names.len()));
    }
    let cell = |name: &str| names.iter().position(|n| *n == name).map_or("", |k| cells[k]);
    let number = |name: &str| match cell(name) {
        "" => Ok(None),
        text => match text.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(Some(x)),
            _ => Err(format!("{name} `{text}` is not a number")),
        },
    };
    let state = cell("state");
    Ok(LogRow {
        t_s: number("t_s")?.ok_or("t_s is empty")?,
        state: State::from_name(state).ok_or_else(|| format!("there is no state `{state}`"))?,
        target_m: number("target_m")?,
        setpoint_m: number("setpoint_m")?,
        position_m: number("position_m")?,
        twist_rad: number("twist_rad")?,
        load_n: number("load_n")?,
        load_error_n: number("load_error_n")?,
        position_error_m: number("position_error_m")?,
        tr_rad_per_m: number("tr_rad_per_m")?,
        drive_current_a: number("drive_current_a")?.unwrap_or(0.0),
        drive_speed_rad_per_s: number("drive_speed_rad_per_s")?.unwrap_or(0.0),
        twist_scale: number("twist_scale")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "# format = tsa-log 1\n# scene_hash = 01234567\nt_s,state,position_m,twist_rad,load_n\n\
        # at 0.01 request move 0.008 speed=0.002 load=auto\n0.02,ready,0.001,3.2,\n\
        # at 0.02 event homed {\"zero_error_rad\":0.001,\"load_n\":4.9,\"load_error_n\":0.25,\"friction_n\":0.1,\
        \"reference_gap_m\":0.1,\"gap_noise_m\":4e-6,\"jump_m\":0.0,\"twist_scale\":1.0,\"curve\":{\"middle_rad\":22.0,\"half_rad\":14.0,\
        \"coefficients_m\":[0.0001,0.0,0.0,0.0]},\"covariance\":[1e-4,0.0,1e-8],\"drive_lag_s\":0.05}\n\
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
        assert!(matches!(log.marks[0].mark, Mark::Request(Request::Move { target_m: 0.008, .. })));
    }

    #[test]
    fn stated_errors_are_read() {
        let text = GOOD
            .replace("twist_rad,load_n\n", "twist_rad,load_n,load_error_n,position_error_m\n")
            .replace("3.2,\n", "3.2,,,\n")
            .replace("3.3,4.9\n", "3.3,4.9,0.2,0.0001\n");
        let log = Log::parse(&text).and_then(Log::whole).unwrap();
        let errors = |k: usize| [log.rows[k].load_error_n, log.rows[k].position_error_m];
        assert_eq!((errors(0), errors(1)), ([None; 2], [Some(0.2), Some(0.0001)]));
    }

    #[test]
    fn the_homing_of_an_older_log_is_another_event() {
        let homed = GOOD.lines().find(|line| line.contains("homed")).unwrap();
        let older = "# at 0.02 event homed twist_error_estimate_rad=0.001 load_n=4.9 gap_offset_m=0.0001";
        let log = Log::parse(&GOOD.replace(homed, older)).and_then(Log::whole).unwrap();
        assert!(matches!(log.marks[1].mark, Mark::Event(_)));
    }

    #[test]
    fn a_cut_log_is_known_wherever_it_was_cut() {
        let mut seen = [0; 3];
        for end in 0..GOOD.len() {
            match Log::parse(&GOOD[..end]).and_then(Log::whole) {
                Err(LogError::Empty | LogError::Format) => seen[0] += 1,
                Err(LogError::Cut { .. }) => seen[1] += 1,
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
            let Err(LogError::Line { line: at, message }) = Log::parse(&text) else { panic!("{to}") };
            assert!(at == line && message.contains(named), "{to}: line {at}: {message}");
        }
        assert_eq!(Log::parse(""), Err(LogError::Empty));
        assert_eq!(Log::parse("load_n,turns\n1,2\n"), Err(LogError::Format));
        assert_eq!(Log::parse(&GOOD.replace("tsa-log 1", "tsa-log 2")), Err(LogError::Format));
    }
}
