//! The licences of all dependencies: which ones `deny.toml` allows, and what the programs under this project's licence
//! and the emulator under the GPL may link; and the list of what others wrote in the programs of the release archive.

use crate::Folders;
use crate::packages::Packages;
use anyhow::{Context, Result, ensure};
use cargo_metadata::Package;
use fs_err as fs;
use serde::Deserialize;
use spdx::{Expression, Licensee, ParseMode};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

/// What is handed out under this project's MIT or Apache-2.0 licence, and must link no crate that needs an exception.
pub const PERMISSIVE: [&str; 5] = ["rigctl", "lab", "tsa-python", "tsa-firmware", "tsa-web"];

/// The program under GPL-2.0-only.
pub const EMULATOR: &str = "rig-emulator";

/// Allowed, but not in a program under GPL-2.0-only: its terms on patents are further restrictions
/// (<https://www.gnu.org/licenses/license-list.html#apache2>).
const NOT_WITH_GPL_2: &str = "Apache-2.0";

/// A dependency of the emulator's under Apache-2.0 alone, none of whose code is in the program: only the log formatter of
/// `defmt-decoder` calls it, and the emulator does not. `cargo xtask release` looks for it in the program.
pub const UNUSED: &str = "dissimilar";

/// The parts of `deny.toml` that are checked here.
#[derive(Deserialize)]
struct Policy {
    licenses: Licenses,
    sources: Sources,
}

#[derive(Deserialize)]
struct Licenses {
    allow: Vec<String>,
    exceptions: Vec<Exception>,
}

#[derive(Deserialize)]
struct Exception {
    #[serde(rename = "crate")]
    name: String,
    allow: Vec<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
struct Sources {
    allow_registry: Vec<String>,
}

/// Lists the licences of all dependencies, and fails by the names of those that are not allowed.
pub fn check(folders: &Folders, packages: &Packages) -> Result<()> {
    let policy = toml::from_str(&fs::read_to_string(folders.root.join("deny.toml"))?).context("deny.toml")?;
    let mut names: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for package in packages.all().iter().filter(|package| package.source.is_some()) {
        names.entry(package.license.as_deref().unwrap_or("none")).or_default().insert(&package.name);
    }
    for (licence, names) in names {
        println!("{licence}: {}", names.into_iter().collect::<Vec<_>>().join(" "));
    }
    let refused = refused(&policy, packages)?;
    ensure!(refused.is_empty(), "licences or sources that deny.toml does not allow:\n{}", refused.join("\n"));
    Ok(())
}

/// What is wrong, in sentences.
fn refused(policy: &Policy, packages: &Packages) -> Result<Vec<String>> {
    let allow: Vec<&String> = policy.licenses.allow.iter().collect();
    let with_gpl_2: Vec<&String> = policy.licenses.allow.iter().filter(|name| *name != NOT_WITH_GPL_2).collect();
    let exceptions = |package: &Package| {
        let own = policy.licenses.exceptions.iter().filter(|exception| exception.name == *package.name);
        own.flat_map(|exception| &exception.allow).collect::<Vec<_>>()
    };
    let mut refused = Vec::new();
    for package in packages.all() {
        if !satisfied(package, &[allow.as_slice(), &exceptions(package)].concat())? {
            refused.push(shown(package));
        }
        let registry = |source: &str| policy.sources.allow_registry.iter().any(|r| source == format!("registry+{r}"));
        if let Some(source) = package.source.as_ref().filter(|source| !registry(&source.repr)) {
            refused.push(format!("{} from {source}", shown(package)));
        }
    }
    for program in PERMISSIVE {
        for package in packages.linked(program)? {
            if !satisfied(package, &allow)? {
                refused.push(format!("{program} links {}", shown(package)));
            }
        }
    }
    for package in packages.linked(EMULATOR)? {
        if *package.name != UNUSED && !satisfied(package, &[with_gpl_2.as_slice(), &exceptions(package)].concat())? {
            refused.push(format!("{EMULATOR}, under GPL-2.0-only, links {}", shown(package)));
        }
    }
    Ok(refused)
}

/// Whether somebody who accepts only these licences may use the package.
fn satisfied(package: &Package, accepted: &[&String]) -> Result<bool> {
    let Some(licence) = &package.license else { return Ok(false) };
    let licence = Expression::parse_mode(licence, ParseMode::LAX).with_context(|| shown(package))?;
    let parsed =
        |name: &&String| Licensee::parse_mode(name, ParseMode::LAX).with_context(|| format!("deny.toml: {name}"));
    let accepted = accepted.iter().map(parsed).collect::<Result<Vec<_>>>()?;
    Ok(licence.evaluate(|required| accepted.iter().any(|licensee| licensee.satisfies(required))))
}

fn shown(package: &Package) -> String {
    format!("{} {} ({})", package.name, package.version, package.license.as_deref().unwrap_or("no licence"))
}

/// How the files that state a licence begin, in capitals.
const BEGINNINGS: [&str; 6] = ["LICENSE", "LICENCE", "COPYING", "COPYRIGHT", "NOTICE", "UNLICENSE"];

const THIRD_PARTY: &str = "\
Packages of other authors whose code is in the programs of this archive, with the licences that they state. The
programs also contain Rust's standard library (MIT OR Apache-2.0; https://github.com/rust-lang/rust). The texts
that the packages come with follow the list. A package without one there comes without one: see LICENSE-MIT and
LICENSE-APACHE for the usual texts.

";

/// What others wrote in the packages that are handed out: a list, then each text of a licence once, below the names of the
/// packages that have it.
pub fn third_party(packages: &Packages) -> Result<String> {
    let mut users: BTreeMap<_, (&Package, Vec<&str>)> = BTreeMap::new();
    for program in PERMISSIVE.into_iter().chain([EMULATOR]) {
        for package in packages.linked(program)?.into_iter().filter(|package| package.source.is_some()) {
            users.entry((&package.name, &package.version)).or_insert((package, Vec::new())).1.push(program);
        }
    }
    let (mut list, mut names) = (String::from(THIRD_PARTY), BTreeMap::<String, Vec<String>>::new());
    for ((name, version), (package, users)) in &users {
        let licence = package.license.as_deref().unwrap_or("no licence stated");
        let address = package.repository.as_deref().unwrap_or("no address stated");
        let _ = writeln!(list, "- {name} {version}: {licence}; in {}; {address}", users.join(", "));
        for text in texts(package.manifest_path.parent().context("a manifest has no folder")?.as_ref())? {
            names.entry(text).or_default().push(format!("{name} {version}"));
        }
    }
    let texts: BTreeSet<(Vec<String>, String)> = names.into_iter().map(|(text, names)| (names, text)).collect();
    for (names, text) in texts {
        let _ = write!(list, "\n{}\n{}\n\n{text}\n", "=".repeat(100), names.join(", "));
    }
    Ok(list)
}

/// The texts of the files that state a licence, in this folder.
fn texts(folder: &Path) -> Result<Vec<String>> {
    let mut files = fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>>>()?;
    files.sort();
    files.retain(|file| {
        let name = file.file_name().map(|name| name.to_string_lossy().to_uppercase()).unwrap_or_default();
        file.is_file() && BEGINNINGS.iter().any(|beginning| name.starts_with(beginning))
    });
    let read = |file| Ok(String::from_utf8_lossy(&fs::read(file)?).replace("\r\n", "\n").trim().to_owned());
    files.iter().map(read).collect()
}

#[cfg(test)]
mod tests {
    use super::{EMULATOR, PERMISSIVE, Policy, refused, texts, third_party};
    use crate::packages::tests::{Row, packages, packages_in};

    fn policy() -> Policy {
        toml::from_str(include_str!("../../deny.toml")).unwrap()
    }

    /// What is refused if one of the programs, or none, has a dependency `extra` of this licence and kind.
    fn with_extra(policy: &Policy, user: &str, licence: &str, kind: Option<&str>) -> Vec<String> {
        let extra = [("extra", kind)];
        let uses = |program: &str| if user == program { extra.as_slice() } else { &[] };
        let own: Vec<Row<'_>> =
            PERMISSIVE.iter().chain([&EMULATOR]).map(|program| (*program, "MIT", uses(program))).collect();
        refused(policy, &packages(&own, &[("extra", licence, &[])])).unwrap()
    }

    #[test]
    fn a_licence_or_source_that_is_not_listed_is_refused() {
        let mut policy = policy();
        // The old way to write OR; one of two is enough.
        for licence in ["MIT", "Zlib/MIT", "MIT OR GPL-3.0-only"] {
            assert!(with_extra(&policy, "none", licence, None).is_empty(), "{licence}");
        }
        for licence in ["MIT AND GPL-3.0-only", "AGPL-3.0-only", "GPL-2.0"] {
            assert_eq!(with_extra(&policy, "none", licence, None), [format!("extra 1.0.0 ({licence})")]);
        }
        policy.sources.allow_registry.clear();
        let refused = with_extra(&policy, "none", "MIT", None);
        assert!(refused.len() == 1 && refused[0].starts_with("extra 1.0.0 (MIT) from registry+"), "{refused:?}");
    }

    #[test]
    fn programs_under_mit_link_no_crate_that_needs_an_exception_and_the_emulator_none_under_apache_alone() {
        let mut policy = policy();
        policy.licenses.exceptions[0].name = "extra".into();
        for program in PERMISSIVE {
            let refused = |kind| with_extra(&policy, program, "GPL-2.0-only", kind);
            assert_eq!(refused(None), [format!("{program} links extra 1.0.0 (GPL-2.0-only)")]);
            assert!(refused(Some("dev")).is_empty(), "a test may");
        }
        assert!(with_extra(&policy, EMULATOR, "GPL-2.0-only", None).is_empty());
        let refused = |user, licence| with_extra(&policy, user, licence, None);
        assert!(refused(EMULATOR, "Apache-2.0 OR MIT").is_empty() && refused("rigctl", "Apache-2.0").is_empty());
        let named = "rig-emulator, under GPL-2.0-only, links extra 1.0.0 (Apache-2.0)";
        assert_eq!(refused(EMULATOR, "Apache-2.0"), [named]);
    }

    /// All packages are in the root, which has two texts.
    #[test]
    fn a_text_that_two_packages_share_stands_once_below_both_names() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let found = texts(root).unwrap();
        let begins = |text: &str, words: &str| text.trim_start().starts_with(words);
        assert!(found.len() == 2 && begins(&found[0], "Apache License") && begins(&found[1], "MIT License"));

        let uses = [("a", None), ("b", None)];
        let own: Vec<Row<'_>> = PERMISSIVE
            .iter()
            .chain([&EMULATOR])
            .map(|&name| (name, "MIT", &uses[..usize::from(name == "rigctl") * 2]))
            .collect();
        let all = packages_in(&root.display().to_string(), &own, &[("a", "MIT", &[]), ("b", "MIT", &[])]);
        let list = third_party(&all).unwrap();
        assert!(list.contains("\n- b 1.0.0: MIT; in rigctl; no address stated\n"), "{list}");
        for text in found {
            assert!(list.contains(&format!("\na 1.0.0, b 1.0.0\n\n{text}\n")), "{list}");
            assert_eq!(list.matches(&text).count(), 1);
        }
    }
}
