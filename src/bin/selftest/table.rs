//! The table of checks, and the lines of the log.

use core::fmt::{self, Write};
use embassy_time::Timer;
use heapless::{String, Vec};

/// Longest line (bytes); the rest is cut off.
const LINE: usize = 220;
/// Room for this many checks.
const ROWS: usize = 17;
/// Pause after each line (ms): the log holds 1 KiB, and the host reads it about ten times a second.
const PAUSE_MS: u64 = 30;

/// Result of a check.
#[derive(Clone, Copy, PartialEq)]
pub enum Verdict {
    Ok,
    Failed,
    NotConnected,
}

impl Verdict {
    pub fn of(good: bool) -> Self {
        if good { Self::Ok } else { Self::Failed }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Failed => "FAILED",
            Self::NotConnected => "not connected",
        }
    }
}

struct Row {
    what: &'static str,
    expected: String<48>,
    seen: String<96>,
    verdict: Verdict,
}

/// The checks so far.
#[derive(Default)]
pub struct Table {
    rows: Vec<Row, ROWS>,
}

/// Formats a text of at most `N` bytes.
fn text<const N: usize>(of: fmt::Arguments<'_>) -> String<N> {
    let mut text = String::new();
    // The error only means that the text was cut off.
    let _ = Cut(&mut text).write_fmt(of);
    text
}

/// Writes characters while there is room.
struct Cut<'a, const N: usize>(&'a mut String<N>);

impl<const N: usize> Write for Cut<'_, N> {
    fn write_str(&mut self, s: &str) -> fmt::Result {
        s.chars().try_for_each(|c| self.0.push(c).map_err(|_| fmt::Error))
    }
}

/// Prints a line on the log and gives the host time to read it.
pub async fn line(of: fmt::Arguments<'_>) {
    let line: String<LINE> = text(of);
    defmt::println!("{=str}", line.as_str());
    Timer::after_millis(PAUSE_MS).await;
}

impl Table {
    /// Adds the row of a check.
    pub fn row(
        &mut self,
        what: &'static str,
        expected: fmt::Arguments<'_>,
        seen: fmt::Arguments<'_>,
        verdict: Verdict,
    ) {
        let row = Row { what, expected: text(expected), seen: text(seen), verdict };
        if self.rows.push(row).is_err() {
            defmt::error!("the table has no room for another row");
        }
    }

    /// Adds the row of a failed check.
    pub fn failed(&mut self, what: &'static str, expected: &str, seen: fmt::Arguments<'_>) {
        self.row(what, format_args!("{expected}"), seen, Verdict::Failed);
    }

    /// Prints all rows as a table that can be pasted into a report.
    pub async fn print(&self) {
        line(format_args!(
            "tsa-selftest {} ({}), STM32 device {:#05x} revision {:#06x}, unique id {}{}",
            env!("CARGO_PKG_VERSION"),
            env!("TSA_GIT"),
            crate::registers::device().0,
            crate::registers::device().1,
            embassy_stm32::uid::uid_hex(),
            if crate::registers::emulated() { ", the emulated board" } else { "" }
        ))
        .await;
        line(format_args!("| {:<20} | {:<34} | {:<62} | {:<13} |", "what", "expected", "seen", "verdict")).await;
        line(format_args!("|{:-<22}|{:-<36}|{:-<64}|{:-<15}|", "", "", "", "")).await;
        for row in &self.rows {
            let verdict = row.verdict.name();
            line(format_args!("| {:<20} | {:<34} | {:<62} | {verdict:<13} |", row.what, row.expected, row.seen)).await;
        }
    }

    /// Prints the last line, which `cargo xtask selftest` and `rigctl selftest` wait for.
    pub async fn end(&self) {
        let mut bad: String<LINE> = String::new();
        for verdict in [Verdict::Failed, Verdict::NotConnected] {
            let before = bad.len();
            for row in self.rows.iter().filter(|row| row.verdict == verdict) {
                let (start, comma) = if bad.len() == before { (verdict.name(), ": ") } else { ("", ", ") };
                let semicolon = if bad.len() == before && before > 0 { "; " } else { "" };
                let _ = write!(Cut(&mut bad), "{semicolon}{start}{comma}{}", row.what);
            }
        }
        if bad.is_empty() {
            line(format_args!("selftest ended: all {} checks ok", self.rows.len())).await;
        } else {
            line(format_args!("selftest ended: {bad}")).await;
        }
    }
}
