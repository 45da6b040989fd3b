//! The self-test on a real board: probe-rs flashes it and shows its log, whose last line gives the result.

use crate::Folders;
use crate::firmware::{self, PACKAGE, SELFTEST};
use crate::process::{exists, shown};
use crate::toolchain::Toolchain;
use anyhow::{Context, Result, bail, ensure};
use std::io::{BufRead, BufReader};
use std::process::Stdio;

/// Start of the last line (src/bin/selftest/table.rs); probe-rs may print a prefix.
const END: &str = "selftest ended: ";
/// Text that follows it if all checks passed.
const PASSED: &str = "all ";

/// Builds the image and starts it with the runner of `.cargo/config.toml`, until the test has ended.
pub fn run(folders: &Folders, toolchain: &Toolchain, rest: &[String]) -> Result<()> {
    firmware::build_selftest(folders, toolchain)?;
    ensure!(exists("probe-rs"), "probe-rs is missing; install it with: cargo install probe-rs-tools --locked");
    let mut cargo = toolchain.cargo(folders, "run");
    cargo.args(["--package", PACKAGE, "--profile", "firmware", "--bin", SELFTEST, "--"]).args(rest);
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
