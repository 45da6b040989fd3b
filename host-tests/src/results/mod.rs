//! docs/results.md and the README's table of specifications, from what studies have measured.
//!
//! `studies.toml` lists the studies and says how each is measured ([`tools`]). Their numbers are kept with date, commit and machine
//! in docs/results.json, so that one study can be measured again without the others. Nothing in either page is typed by hand; a
//! test here compares both with the file.

pub mod tools;

use crate::root;
use crate::study::{Study, markdown};
use anyhow::{Context, Result, anyhow};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::process::Command;
use tools::{Tools, filled};

/// What encloses the table in the README.
const BEGIN: &str = "<!-- written by `cargo xtask results` -->\n";
const END: &str = "<!-- end -->\n";

const HEAD: &str = "# Results\n\n\
    `cargo xtask results` measures everything on this page and writes it; `cargo xtask results NAME` measures one section again.\n\
    **Nothing here has met hardware**: \"emulated\" means the firmware's own ELF on the emulated board and rig, or its control code on \
    the emulated rig.\n\
    Emulated numbers and instruction counts are the same on every machine; times are not.\n";

/// `studies.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct List {
    /// In the order of the page.
    #[serde(rename = "study")]
    pub sections: Vec<Section>,
    /// Rows of the README's table.
    readme: Vec<[String; 2]>,
}

/// One study, as it stands on the page.
#[derive(Debug, Deserialize)]
pub struct Section {
    /// As on the command line.
    pub name: String,
    title: String,
    /// What is measured, in a sentence or two.
    about: String,
    /// The command that measures it, for the reader.
    pub command: String,
    /// Pictures below `docs`, with their captions.
    #[serde(default)]
    figures: Vec<[String; 2]>,
    /// Command lines of this package's studies.
    #[serde(default)]
    pub study: Vec<String>,
    /// How tools measure it, if no study does, or draw it.
    #[serde(flatten)]
    pub tools: Tools,
}

/// A measurement with its circumstances.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
pub struct Record {
    date: String,
    commit: String,
    machine: String,
    // Not flattened: serde buffers the contents of a flattened field, and then loses numbers where another crate turns on
    // serde_json's arbitrary precision.
    measured: Study,
}

/// All records, by the study's name.
type Records = BTreeMap<String, Record>;

impl List {
    /// Reads `studies.toml`.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read() -> Result<Self> {
        Ok(toml::from_str(&std::fs::read_to_string(root().join("host-tests/studies.toml"))?)?)
    }

    /// Keeps what a study has measured, and writes the pages.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub fn keep(&self, name: &str, measured: Study) -> Result<()> {
        // Read again each time: others may have been measured meanwhile, and one that fails later takes nothing away.
        let mut records = records().unwrap_or_default();
        let record =
            Record { date: output("date", &["-u", "+%Y-%m-%d"])?, commit: commit()?, machine: machine(), measured };
        records.insert(name.to_owned(), record);
        let write = |name: &str, text: String| std::fs::write(root().join(name), text).with_context(|| name.to_owned());
        write("docs/results.json", serde_json::to_string_pretty(&records)? + "\n")?;
        write("docs/results.md", self.page(&records))?;
        match self.readme(&read("README.md")?, &records) {
            Ok(text) => write("README.md", text),
            // The README's table needs several studies, of which some may still be missing.
            Err(missing) => {
                eprintln!("README.md is unchanged: {missing:#}");
                Ok(())
            }
        }
    }

    /// docs/results.md.
    fn page(&self, records: &Records) -> String {
        let mut text = String::from(HEAD);
        for Section { name, title, about, command, figures, .. } in &self.sections {
            let Some(Record { date, commit, machine, measured }) = records.get(name) else { continue };
            let _ = write!(
                text,
                "\n## {title}\n\n{about}\n\n`{command}`, section `{name}`, measured on {date} at commit {commit} ({machine}).\n\n\
                 {measured}"
            );
            figures.iter().for_each(|[file, caption]| text += &format!("\n![{caption}]({file})\n"));
        }
        text
    }

    /// The README with its table of specifications written again.
    fn readme(&self, readme: &str, records: &Records) -> Result<String> {
        let parts = readme.split_once(BEGIN).and_then(|(before, rest)| Some((before, rest.split_once(END)?.1)));
        let (before, after) = parts.with_context(|| format!("README.md has no lines {BEGIN:?} and {END:?}"))?;
        let values: BTreeMap<_, _> = records.iter().map(|(name, record)| (name, &record.measured.values)).collect();
        let values = serde_json::to_value(values)?;
        let row = |[what, template]: &[String; 2]| {
            let text =
                filled(&values, template).map_err(|missing| anyhow!("{missing} is not measured: cargo xtask results"));
            Ok(vec![what.clone(), text?])
        };
        let rows = self.readme.iter().map(row).collect::<Result<Vec<_>>>()?;
        Ok(format!("{before}{BEGIN}{}{END}{after}", markdown(&rows)))
    }
}

fn read(name: &str) -> Result<String> {
    std::fs::read_to_string(root().join(name)).with_context(|| name.to_owned())
}

fn records() -> Result<Records> {
    serde_json::from_str(&read("docs/results.json")?).context("docs/results.json")
}

/// What a command prints.
fn output(program: &str, words: &[&str]) -> Result<String> {
    let output = Command::new(program).args(words).current_dir(root()).output().with_context(|| program.to_owned())?;
    anyhow::ensure!(output.status.success(), "{program} failed");
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Short commit; `+` behind it where source files differ from it.
fn commit() -> Result<String> {
    let commit = output("git", &["rev-parse", "--short=10", "HEAD"])?;
    let changed = ["status", "--porcelain", "--untracked-files=no", "--", ".", ":!docs", ":!README.md"];
    Ok(if output("git", &changed)?.is_empty() { commit } else { commit + "+" })
}

/// Processor, cores and system: times depend on them, emulated numbers do not.
fn machine() -> String {
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpu.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": ").map(|(_, name)| name));
    let cores = rigctl::parallel::cores();
    format!("{}, {cores} cores, {}", model.unwrap_or(std::env::consts::ARCH), std::env::consts::OS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails when a number in either page was changed by hand, or the measurements were replaced without writing the pages.
    #[test]
    fn both_pages_state_what_was_measured() {
        let (list, records) = (List::read().unwrap(), records().unwrap());
        assert_eq!(read("docs/results.md").unwrap(), list.page(&records), "docs/results.md: run `cargo xtask results`");
        let readme = read("README.md").unwrap();
        assert_eq!(readme, list.readme(&readme, &records).unwrap(), "README.md: run `cargo xtask results`");
    }

    #[test]
    fn every_study_has_been_measured() {
        let (list, records) = (List::read().unwrap(), records().unwrap());
        for section in &list.sections {
            assert!(records.contains_key(&section.name), "{}: run `cargo xtask results {0}`", section.name);
            for [figure, _] in &section.figures {
                assert!(root().join("docs").join(figure).is_file(), "docs/{figure} is not there");
            }
        }
        assert_eq!(records.len(), list.sections.len(), "results.json holds a study that no longer exists");
    }

    #[test]
    fn a_readme_without_marks_and_a_value_that_was_not_measured_are_named() {
        let list = List::read().unwrap();
        let refused = |text: &str| list.readme(text, &Records::new()).unwrap_err().to_string();
        assert!(refused("# Title\n").contains("README.md has no line"));
        let missing = refused(&format!("x\n{BEGIN}{END}"));
        assert!(
            missing.contains("/demo/tr_start_light_rad_per_mm") && missing.contains("cargo xtask results"),
            "{missing}"
        );
    }
}
