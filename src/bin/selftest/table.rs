//! The table of checks, and lines on the log.

use core::fmt::{self, Write};
use embassy_time::Timer;
use heapless::{String, Vec};

/// Longest line; more is cut off.
const LINE: usize = 220;
/// Checks that there are room for.
const ROWS: usize = 16;
/// Pause after each line (ms): the log has room for 1 KiB and the host fetches it some ten times a second.
const PAUSE_MS: u64 = 30;

/// How a check ended.
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

/// All checks so far.
#[derive(Default)]
pub struct Table {
    rows: Vec<Row, ROWS>,
}

/// Text with what fits.
fn text<const N: usize>(of: fmt::Arguments<'_>) -> String<N> {
    let mut text = String::new();
    // What does not fit is cut off.
    let _ = Cut(&mut text).write_fmt(of);
    text
}

/// Takes characters as long as there is room.
struct Cut<'a, const N: usize>(&'a mut String<N>);

impl<const N: usize> Write for Cut<'_, N> {
    fn write_str(&mut self, s: &str) -> fmt::Result {
        s.chars().try_for_each(|c| self.0.push(c).map_err(|_| fmt::Error))
    }
}

/// A line on the log, and time for the host to fetch it.
pub async fn line(of: fmt::Arguments<'_>) {
    let line: String<LINE> = text(of);
    defmt::println!("{=str}", line.as_str());
    Timer::after_millis(PAUSE_MS).await;
}

impl Table {
    /// A check has ended.
    pub fn row(
        &mut self,
        what: &'static str,
        expected: fmt::Arguments<'_>,
        seen: fmt::Arguments<'_>,
        verdict: Verdict,
    ) {
        let row = Row { what, expected: text(expected), seen: text(seen), verdict };
        if self.rows.push(row).is_err() {
            defmt::error!("no room for a row");
        }
    }

    /// A check has failed.
    pub fn failed(&mut self, what: &'static str, expected: &str, seen: fmt::Arguments<'_>) {
        self.row(what, format_args!("{expected}"), seen, Verdict::Failed);
    }

    /// All rows, as a table that can be pasted into a report.
    pub async fn print(&self) {
        line(format_args!(
            "tsa-selftest {} ({}), STM32 device {:#05x} revision {:#06x}, unique id {}{}",
            env!("CARGO_PKG_VERSION"),
            env!("TSA_GIT"),
            crate::chip::device().0,
            crate::chip::device().1,
            embassy_stm32::uid::uid_hex(),
            if crate::chip::emulated() { ", the emulated board" } else { "" }
        ))
        .await;
        line(format_args!("| {:<20} | {:<34} | {:<62} | {:<13} |", "what", "expected", "seen", "verdict")).await;
        line(format_args!("|{:-<22}|{:-<36}|{:-<64}|{:-<15}|", "", "", "", "")).await;
        for row in &self.rows {
            let verdict = row.verdict.name();
            line(format_args!("| {:<20} | {:<34} | {:<62} | {verdict:<13} |", row.what, row.expected, row.seen)).await;
        }
    }

    /// The last line, in words that `cargo xtask selftest` and `rigctl selftest` wait for, and then nothing more.
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
