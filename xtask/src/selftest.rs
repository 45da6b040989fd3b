//! The self-test on a real board: probe-rs flashes it and shows its log, which ends with a line that says how it went.

use crate::Folders;
use crate::firmware::{self, PACKAGE, SELFTEST};
use crate::process::{exists, shown};
use crate::toolchain::Toolchain;
use anyhow::{Context, Result, bail, ensure};
use std::io::{BufRead, BufReader};
use std::process::Stdio;

/// With this the last line begins, whatever probe-rs puts before it (src/bin/selftest/table.rs).
const END: &str = "selftest ended: ";
/// What follows it if all is well.
const WELL: &str = "all ";

/// Builds the image and hands it to the runner of `.cargo/config.toml`, until it has ended.
pub fn run(folders: &Folders, toolchain: &Toolchain, rest: &[String]) -> Result<()> {
    firmware::build_selftest(folders, toolchain)?;
    ensure!(exists("probe-rs"), "probe-rs is not there: cargo install probe-rs-tools --locked");
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
    // The board sleeps; probe-rs would wait for more.
    let _ = child.kill();
    child.wait().context("waiting for probe-rs")?;
    match end {
        Some(end) if end.starts_with(WELL) => Ok(()),
        Some(end) => bail!("{end}"),
        None => bail!("the self-test did not end: probe-rs stopped first"),
    }
}

/// What a line of the log says of the end, if it is the last.
fn ending(line: &str) -> Option<&str> {
    line.split_once(END).map(|(_, end)| end)
}

#[cfg(test)]
mod tests {
    use super::{WELL, ending};

    #[test]
    fn the_end_is_found_behind_what_probe_rs_puts_before_it() {
        assert_eq!(ending("2.104 [INFO ] selftest ended: all 13 checks ok"), Some("all 13 checks ok"));
        assert_eq!(ending("selftest ended: FAILED: LSI"), Some("FAILED: LSI"));
        assert!(!ending("selftest ended: FAILED: LSI").is_some_and(|end| end.starts_with(WELL)));
        assert_eq!(ending("selftest 3 of 3: everything else"), None);
    }
}
