//! `selftest`: the checks of a board without a rig, on the emulated board.

use crate::failure::Failure;
use crate::options::{Global, no_effect};
use crate::output::Output;
use crate::session::sim;
use anyhow::Context;
use serde_json::json;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

/// Begin of the last line of the log, and of its rest if all checks are ok (src/bin/selftest/table.rs).
const END: &str = "selftest ended: ";
const WELL: &str = "all ";
/// The jumper wires of docs/tutorial/first-board.md.
const WIRES: [&str; 7] = ["PA1-PA0", "PA5-PA6", "PB6-PA7", "PA9-PA10", "PB10-PB5", "PC7-PA8", "PB9-PB8"];

/// Runs the self-test's image on an emulated board with jumper wires, and prints its table.
///
/// # Errors
/// If a check is not ok, or emulator or image are not built; and for a real board, which `cargo xtask selftest` flashes.
pub fn run(global: &Global, output: &mut Output) -> Result<(), Failure> {
    no_effect(global.of_emulated_board().into_iter().take(4), "this board has no rig, and is a new one each time");
    if let Some(port) = global.given_device() {
        return Err(Failure::Usage(format!(
            "--port {port}: on a real board the self-test is an image of its own, flashed and read over the ST-LINK: run `cargo \
             xtask selftest`"
        )));
    }
    let emulator = sim::emulator(None)?;
    let image = match &global.board.firmware {
        Some(path) => path.clone(),
        None => sim::beside(None, "../firmware/tsa-selftest.elf")?,
    };
    sim::there(&image, "cargo xtask selftest --emulated")?;
    let mut command = Command::new(&emulator);
    command.arg("--bare").arg("--elf").arg(&image).args(["--ok", &format!("{END}{WELL}"), "--fail", END]);
    command.args(WIRES.iter().flat_map(|wire| ["--jumper", wire])).stdin(Stdio::null()).stdout(Stdio::piped());
    let mut child = command.spawn().with_context(|| format!("starting {}", emulator.display()))?;
    let log = child.stdout.take().context("the emulator has no standard output")?;
    let mut end = None;
    for line in BufReader::new(log).lines() {
        let line = line.context("reading the emulator's output")?;
        output.line(&line)?;
        if let Some([what, expected, seen, verdict]) = row(&line) {
            output.object(&json!({"what": what, "expected": expected, "seen": seen, "verdict": verdict}))?;
        }
        if let Some(text) = line.strip_prefix(END) {
            end = Some(text.to_owned());
        }
    }
    child.wait().context("waiting for the emulator")?;
    match end {
        Some(text) if text.starts_with(WELL) => Ok(()),
        Some(text) => Err(Failure::failed(text)),
        // The emulator has written the reason to standard error, which is ours.
        None => Err(Failure::failed("the self-test did not end")),
    }
}

/// The cells of a row of the table; nothing for its head and for other lines.
fn row(line: &str) -> Option<[&str; 4]> {
    let cells: Vec<&str> = line.strip_prefix('|')?.strip_suffix('|')?.split('|').map(str::trim).collect();
    let row = <[&str; 4]>::try_from(cells).ok()?;
    (row[0] != "what" && !row[0].starts_with('-')).then_some(row)
}

#[cfg(test)]
mod tests {
    use super::row;

    #[test]
    fn rows_are_distinguished_from_other_lines() {
        let line = "| LSI    | 17 to 47 kHz  | 32.0 kHz | ok            |";
        assert_eq!(row(line), Some(["LSI", "17 to 47 kHz", "32.0 kHz", "ok"]));
        for other in
            ["| what | expected | seen | verdict |", "|---|---|---|---|", "selftest ended: all 17 checks ok", ""]
        {
            assert_eq!(row(other), None, "{other}");
        }
    }
}
