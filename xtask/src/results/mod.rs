//! `cargo xtask results`: measures every number that the README and `docs/results.md` state, and writes both pages.
//!
//! Each section of the page is one measurement with a command of its own ([`sections`]). Its numbers are kept with date,
//! commit and machine in `docs/results.json`, so that one section can be measured again without the others. [`page`]
//! turns that file into `docs/results.md`, [`readme`] into the table of the README. Nothing in either is typed by hand;
//! a test here compares both with the file.

mod calibration;
mod comparison;
mod following;
mod limit;
mod margins;
mod model;
mod page;
mod readme;
mod report;
mod rigs;
mod sections;
mod speed;

use crate::Folders;
use crate::process::{foreign, output_of};
use anyhow::{Context, Result, ensure};
use sections::{SECTIONS, Section};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What one section measured.
#[derive(Clone, Debug, Default, Serialize, Deserialize, PartialEq)]
struct Measured {
    /// The numbers that pages quote, by name, in the unit that ends the name.
    values: BTreeMap<String, f64>,
    /// Head and rows of the section's table.
    table: Vec<Vec<String>>,
    /// Lines of text below the table.
    notes: Vec<String>,
}

/// A measurement with its circumstances.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
struct Record {
    date: String,
    commit: String,
    machine: String,
    // Not flattened: serde buffers the contents of a flattened field, and then loses numbers where another crate turns on
    // serde_json's arbitrary precision.
    measured: Measured,
}

/// All records, by the section's name.
type Records = BTreeMap<String, Record>;

/// Measures the named sections (all of them where none is named) and writes the pages.
pub fn run(folders: &Folders, only: &[String]) -> Result<()> {
    let known = || SECTIONS.iter().map(|s| s.name).collect::<Vec<_>>().join(", ");
    if let Some(wrong) = only.iter().find(|name| SECTIONS.iter().all(|s| s.name != name.as_str())) {
        anyhow::bail!("no section is called {wrong:?}; there are {}", known());
    }
    for section in SECTIONS.iter().filter(|s| only.is_empty() || only.iter().any(|name| name == s.name)) {
        eprintln!("measuring {}: {}", section.name, section.command);
        let record = measure(folders, section).with_context(|| format!("section {}", section.name))?;
        // Read again: other sections may have been measured meanwhile.
        let mut records = read(&file(&folders.root)).unwrap_or_default();
        records.insert(section.name.to_owned(), record);
        // Written after each: a later section that fails takes nothing away.
        write_all(folders, &records)?;
    }
    println!("docs/results.md, docs/results.json, README.md");
    Ok(())
}

fn measure(folders: &Folders, section: &Section) -> Result<Record> {
    let measured = (section.measure)(folders)?;
    ensure!(!measured.table.is_empty(), "nothing was measured");
    Ok(Record { date: date()?, commit: commit(folders)?, machine: machine(), measured })
}

fn write_all(folders: &Folders, records: &Records) -> Result<()> {
    let write = |path: PathBuf, text: String| {
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    };
    write(file(&folders.root), serde_json::to_string_pretty(records)? + "\n")?;
    write(folders.root.join("docs/results.md"), page::page(records))?;
    let readme = folders.root.join("README.md");
    let text = std::fs::read_to_string(&readme).context("README.md")?;
    match readme::replaced(&text, records) {
        Ok(text) => write(readme, text),
        // The README's table needs several sections, of which some may still be missing.
        Err(missing) => {
            eprintln!("README.md is unchanged: {missing:#}");
            Ok(())
        }
    }
}

fn file(root: &Path) -> PathBuf {
    root.join("docs/results.json")
}

fn read(file: &Path) -> Result<Records> {
    let text = std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{} holds no results", file.display()))
}

fn date() -> Result<String> {
    output_of(foreign("date", Path::new("/")).args(["-u", "+%Y-%m-%d"])).context("the program `date` gave no date")
}

/// Short commit; `+` behind it where source files differ from it.
fn commit(folders: &Folders) -> Result<String> {
    let git = |words: &[&str]| output_of(foreign("git", &folders.root).args(words));
    let commit = git(&["rev-parse", "--short=10", "HEAD"]).context("git gave no commit")?;
    let changed = git(&["status", "--porcelain", "--untracked-files=no", "--", ".", ":!docs", ":!README.md"]);
    Ok(if changed.is_none_or(|changed| changed.is_empty()) { commit } else { commit + "+" })
}

/// Processor, cores and system: times depend on them, emulated numbers do not.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpu.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": ").map(|(_, name)| name));
    format!("{}, {cores} cores, {}", model.unwrap_or(std::env::consts::ARCH), std::env::consts::OS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
    }

    /// Fails when a number in either page was changed by hand, or the measurements were replaced without writing the pages.
    #[test]
    fn both_pages_state_what_was_measured() {
        let records = read(&file(&root())).unwrap();
        let results = std::fs::read_to_string(root().join("docs/results.md")).unwrap();
        assert_eq!(results, page::page(&records), "docs/results.md: run `cargo xtask results`");
        let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
        let expected = readme::replaced(&readme, &records).unwrap();
        assert_eq!(readme, expected, "README.md: run `cargo xtask results`");
    }

    #[test]
    fn every_section_has_been_measured() {
        let records = read(&file(&root())).unwrap();
        for section in SECTIONS {
            assert!(records.contains_key(section.name), "{}: run `cargo xtask results {0}`", section.name);
            for (figure, _) in section.figures {
                assert!(root().join("docs").join(figure).is_file(), "docs/{figure} is not there");
            }
        }
        assert_eq!(records.len(), SECTIONS.len(), "results.json holds a section that no longer exists");
    }
}
