//! Files of loads and turns, and the answers to them.

use crate::csv_text::columns;
use crate::failure::{Failure, Refused};
use crate::options::values::{load, of};
use crate::output::Output;
use crate::units::{NUMBER, Quantity};
use clap::Args;
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};

/// One load and number of turns, or a file of them.
#[derive(Debug, Clone, Args)]
pub struct At {
    /// Load on the rods (N or kg)
    #[arg(long, value_name = "L", allow_hyphen_values = true, value_parser = load,
        required_unless_present = "batch", conflicts_with = "batch")]
    pub load: Option<f64>,
    /// Turns past the half-turn pre-twist
    #[arg(long, value_name = "T", allow_hyphen_values = true, value_parser = of("turns", Quantity::Turns),
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
pub fn read(path: &Path) -> Result<Vec<Result<Query, Refused>>, Failure> {
    let text = rig_config::files::read_to_string(path).map_err(|e| e.to_string());
    text.and_then(|text| parse(&text)).map_err(|e| Failure::failed(format!("batch file {}: {e}", path.display())))
}

fn parse(text: &str) -> Result<Vec<Result<Query, Refused>>, String> {
    let query = |row: Result<[f64; 2], String>| {
        row.map(|[load_n, turns]| Query { load_n, turns }).map_err(|message| Refused::new("bad-row", message))
    };
    Ok(columns(text, ["load_n", "turns"])?.into_iter().map(|(_, row)| query(row)).collect())
}

impl At {
    /// The one point, if no file is named: the command line has seen to it that there is either.
    pub fn one(&self) -> Option<Query> {
        self.load.zip(self.turns).map(|(load_n, turns)| Query { load_n, turns })
    }
}

/// Answers every row of a file under a heading, a `line` each for people. Where a row fails, the others are answered all the
/// same.
///
/// # Errors
/// If the file cannot be read or lacks a column; if a row failed, but with `--json` only if all of them did.
pub fn answer<T: Serialize>(
    at: &At,
    output: &mut Output,
    heading: &str,
    solve: impl Fn(Query) -> Result<T, Refused>,
    line: impl Fn(&T) -> String,
) -> Result<(), Failure> {
    let path = at.batch.as_deref().unwrap_or(Path::new(""));
    let queries = read(path)?;
    output.line(heading)?;
    let (rows, mut failed) = (queries.len(), 0);
    for query in queries {
        let asked = query.as_ref().map_or(["", ""].map(String::from), |q| [q.load_n, q.turns].map(|x| NUMBER.exact(x)));
        match query.and_then(&solve) {
            Ok(answer) => {
                output.object(&answer)?;
                output.line(line(&answer))?;
            }
            Err(failure) => {
                failed += 1;
                output.object(&json!({ "error": failure }))?;
                output.line(format!("{:>10} {:>8}  {}", asked[0], asked[1], failure.message))?;
            }
        }
    }
    let failed = match failed {
        0 => return Ok(()),
        _ if failed == rows => format!("every one of its {rows} rows failed"),
        // Who reads JSON finds each failed row by itself.
        _ if output.json() => return Ok(()),
        _ => format!("{failed} of its {rows} rows failed"),
    };
    Err(Failure::failed(format!("batch file {}: {failed}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{self, Write};
    use std::sync::{Arc, Mutex};

    #[test]
    fn columns_by_name_and_bad_rows_in_place() {
        let rows = parse("\u{feff}scene, turns,\"load_n\"\r\nx,1.5,4.9\n\ny,zwei,3\nz,1\nw,nan,2\nv,1,4,9\n").unwrap();
        assert_eq!(rows.len(), 5);
        assert_eq!(rows[0], Ok(Query { load_n: 4.9, turns: 1.5 }));
        for (k, named) in [(1, ["line 4", "turns `zwei`"]), (2, ["line 5", "2 cells"]), (4, ["line 7", "4 cells"])] {
            let message = &rows[k].as_ref().unwrap_err().message;
            assert!(named.iter().all(|part| message.contains(part)), "{message}");
        }
        assert!(rows[3].is_ok(), "whether NaN is a twist is the solver's to say");
        for (text, named) in [
            ("load,turns\n1,2\n", "no column `load_n`"),
            ("load_n\n1\n", "no column `turns`"),
            ("turns,load_n,turns\n1,2,3\n", "two columns `turns`"),
            ("", "no column `load_n`"),
        ] {
            assert!(parse(text).unwrap_err().contains(named), "{text}");
        }
    }
    /// A sink, and what has been written to it.
    #[derive(Clone, Default)]
    struct Shown(Arc<Mutex<Vec<u8>>>);

    impl Shown {
        /// What has been written.
        fn text(&self) -> String {
            String::from_utf8_lossy(&self.0.lock().expect("whole")).into_owned()
        }
    }

    impl Write for Shown {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().expect("whole").extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_failed_row_is_a_line_for_people_and_fails_the_command() {
        let file = std::env::temp_dir().join(format!("rigctl-batch-{}.csv", std::process::id()));
        std::fs::write(&file, "load_n,turns\n4.9,2\n0,1\nx,1\n").expect("written");
        let at = At { load: None, turns: None, batch: Some(file.clone()) };
        let run = |json: bool| {
            let shown = Shown::default();
            let solve = |q: Query| {
                if q.load_n > 0.0 { Ok(q.turns) } else { Err(Refused::new("slack", "a slack string")) }
            };
            let ended = answer(&at, &mut Output::new(json, Box::new(shown.clone())), "heading", solve, |turns| {
                format!("{turns} turns")
            });
            (ended.map_err(|failure| failure.message().unwrap_or_default()), shown.text())
        };
        let (ended, shown) = run(false);
        assert_eq!(shown.lines().nth(2), Some("         0        1  a slack string"));
        assert!(shown.lines().nth(3).is_some_and(|row| row.trim().starts_with("line 4: load_n `x`")), "{shown}");
        assert!(ended.is_err_and(|why| why.ends_with("2 of its 3 rows failed")));
        let (ended, shown) = run(true);
        assert_eq!((ended, shown.matches("{\"error\"").count()), (Ok(()), 2));
        for (rows, fails) in [("0,1\nx,2\n", true), ("", false)] {
            std::fs::write(&file, format!("load_n,turns\n{rows}")).expect("written");
            let (ended, shown) = run(true);
            assert_eq!((ended.is_err(), shown.lines().count()), (fails, rows.lines().count()), "{rows:?}");
            assert!(ended.err().is_none_or(|why| why.ends_with("every one of its 2 rows failed")));
        }
        let _ = std::fs::remove_file(&file);
    }
}
