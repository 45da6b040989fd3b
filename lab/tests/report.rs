//! `report` says beforehand what takes long.

mod common;

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

#[test]
fn a_page_whose_charts_take_minutes_says_so_first() {
    let page = std::env::temp_dir().join(format!("tsa-lab-report-{}.html", std::process::id()));
    let mut report = Command::new(env!("CARGO_BIN_EXE_tsa-lab"));
    report.args(["report", "--out"]).arg(&page).current_dir(common::root());
    let mut report = report.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("tsa-lab starts");
    let mut line = String::new();
    BufReader::new(report.stderr.take().expect("piped")).read_line(&mut line).expect("a line");
    report.kill().and_then(|()| report.wait()).expect("ended");
    assert!(line.contains("minutes") && line.contains("--charts"), "{line}");
}
