//! The list of what others wrote in the programs of the release archive, with the texts of their licences.

use crate::packages::{Package, Packages};
use anyhow::{Context, Result};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// How the files that state a licence begin, in capitals.
const BEGINNINGS: [&str; 6] = ["LICENSE", "LICENCE", "COPYING", "COPYRIGHT", "NOTICE", "UNLICENSE"];

/// What the list says about a package, and the texts in its folder.
struct Entry {
    line: String,
    texts: Vec<String>,
}

/// The list for these programs, each with the name that a reader knows.
pub fn list(packages: &Packages, programs: &[(&str, &str)]) -> Result<String> {
    let mut users: BTreeMap<(&str, &str), (&Package, Vec<&str>)> = BTreeMap::new();
    for (program, shown) in programs {
        for package in packages.linked(program)?.into_iter().filter(|package| package.source.is_some()) {
            users.entry((&package.name, &package.version)).or_insert((package, Vec::new())).1.push(shown);
        }
    }
    let entry = |(package, users): &(&Package, Vec<&str>)| -> Result<Entry> {
        let folder = package.manifest_path.parent().context("a manifest has no folder")?;
        let line = format!(
            "{} {}: {}; in {}; {}",
            package.name,
            package.version,
            package.license.as_deref().unwrap_or("no licence stated"),
            users.join(", "),
            package.repository.as_deref().unwrap_or("no address stated")
        );
        Ok(Entry { line, texts: texts(folder)? })
    };
    Ok(written(&users.values().map(entry).collect::<Result<Vec<Entry>>>()?))
}

/// The texts of the files that state a licence, in this folder.
fn texts(folder: &Path) -> Result<Vec<String>> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut files = entries.collect::<std::io::Result<Vec<_>>>()?.iter().map(|e| e.path()).collect::<Vec<_>>();
    files.sort();
    let states = |file: &Path| {
        let name = file.file_name().map(|name| name.to_string_lossy().to_uppercase()).unwrap_or_default();
        file.is_file() && BEGINNINGS.iter().any(|beginning| name.starts_with(beginning))
    };
    let read = |file: &Path| -> Result<String> {
        let text = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
        Ok(String::from_utf8_lossy(&text).replace("\r\n", "\n").trim().to_owned())
    };
    files.iter().filter(|file| states(file)).map(|file| read(file)).collect()
}

/// The list, then each text once, below the names of the packages that have it.
fn written(entries: &[Entry]) -> String {
    let mut list = String::from(
        "Packages of other authors whose code is in the programs of this archive, with the licences that they state. The\n\
         programs also contain Rust's standard library (MIT OR Apache-2.0; https://github.com/rust-lang/rust). The texts\n\
         that the packages come with follow the list. A package without one there comes without one: see LICENSE-MIT and\n\
         LICENSE-APACHE for the usual texts.\n\n",
    );
    let mut texts: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for entry in entries {
        let _ = writeln!(list, "- {}", entry.line);
        let name = entry.line.split(':').next().unwrap_or_default();
        entry.texts.iter().for_each(|text| texts.entry(text).or_default().push(name));
    }
    let mut texts: Vec<_> = texts.into_iter().map(|(text, names)| (names, text)).collect();
    texts.sort();
    for (names, text) in texts {
        let _ = write!(list, "\n{}\n{}\n\n{text}\n", "=".repeat(100), names.join(", "));
    }
    list
}

#[cfg(test)]
mod tests {
    use super::{Entry, texts, written};

    #[test]
    fn a_text_that_two_packages_share_stands_once_below_both_names() {
        let entry = |name: &str, texts: &[&str]| Entry {
            line: format!("{name} 1.0.0: MIT; in rigctl; https://example.org"),
            texts: texts.iter().map(|text| (*text).to_owned()).collect(),
        };
        let list = written(&[entry("a", &["shared", "own"]), entry("b", &["shared"]), entry("c", &[])]);
        assert_eq!(list.matches("shared").count(), 1);
        assert!(list.contains("a 1.0.0, b 1.0.0\n\nshared\n") && list.contains("\na 1.0.0\n\nown\n"), "{list}");
        assert!(list.contains("\n- c 1.0.0: MIT; in rigctl; https://example.org\n"));
    }

    #[test]
    fn the_texts_of_a_folder_are_its_licence_files() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let found = texts(&root).unwrap();
        let begins = |text: &str, words: &str| text.trim_start().starts_with(words);
        assert!(found.len() == 2 && begins(&found[0], "Apache License") && begins(&found[1], "MIT License"));
    }
}
