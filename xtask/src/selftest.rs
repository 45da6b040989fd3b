//! The self-test on a real board: probe-rs flashes it and shows its log, whose last line gives the result.

use crate::firmware::{self, SELFTEST};
use crate::process::shown;
use crate::toolchain::{Choice, choose};
use crate::{Folders, host};
use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader};
use std::process::Stdio;

/// Start of the last line (src/bin/selftest/table.rs); probe-rs may print a prefix.
const END: &str = "selftest ended: ";
/// Text that follows it if all checks passed.
const PASSED: &str = "all ";

/// Arguments of `cargo xtask selftest`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Use the emulated board instead of a real one
    #[arg(long)]
    emulated: bool,
    /// Arguments for `probe-rs run`: --probe, --connect-under-reset
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, conflicts_with = "emulated")]
    rest: Vec<String>,
}

impl Arguments {
    /// Builds the image and starts it on the board that they name, until the test has ended.
    pub fn run(self, folders: &Folders) -> Result<()> {
        if self.emulated { host::selftest(folders) } else { on_board(folders, &self.rest) }
    }
}

fn on_board(folders: &Folders, rest: &[String]) -> Result<()> {
    let toolchain = choose(Choice::Auto)?;
    firmware::build_selftest(folders, &toolchain)?;
    let mut cargo = firmware::flashing(folders, &toolchain, SELFTEST)?;
    cargo.args(rest);
    eprintln!("> {}", shown(&cargo));
    let mut child =
        cargo.stdout(Stdio::piped()).spawn().with_context(|| format!("could not start: {}", shown(&cargo)))?;
    let output = child.stdout.take().context("probe-rs has no output")?;
    let mut end = None;
    for line in BufReader::new(output).lines() {
        let line = line.context("reading the log")?;
        println!("{line}");
        end = ending(&line).map(str::to_owned);
        if end.is_some() {
            break;
        }
    }
    // The test has ended, but probe-rs would wait for more.
    let _ = child.kill();
    child.wait().context("waiting for probe-rs")?;
    match end {
        Some(end) if end.starts_with(PASSED) => Ok(()),
        Some(end) => bail!("{end}"),
        None => bail!("the self-test did not end: probe-rs stopped first"),
    }
}

/// The result, if this is the last line of the log.
fn ending(line: &str) -> Option<&str> {
    line.split_once(END).map(|(_, end)| end)
}

#[cfg(test)]
mod tests {
    use super::{PASSED, ending};

    #[test]
    fn the_result_is_found_after_a_prefix_of_probe_rs() {
        assert_eq!(ending("2.104 [INFO ] selftest ended: all 13 checks ok"), Some("all 13 checks ok"));
        assert_eq!(ending("selftest ended: FAILED: LSI"), Some("FAILED: LSI"));
        assert!(!ending("selftest ended: FAILED: LSI").is_some_and(|end| end.starts_with(PASSED)));
        assert_eq!(ending("selftest 3 of 3: everything else"), None);
    }
}
