//! The licences of all dependencies: which ones `deny.toml` allows, and what the programs under this project's licence
//! and the emulator under the GPL may link.

use crate::Folders;
use crate::packages::{Package, Packages};
use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use spdx::{Expression, Licensee, ParseMode};
use std::collections::BTreeMap;

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
pub fn check(folders: &Folders) -> Result<()> {
    let file = folders.root.join("deny.toml");
    let policy = std::fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
    let policy: Policy = toml::from_str(&policy).context("deny.toml")?;
    let packages = Packages::find(folders)?;
    let mut names: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for package in packages.all().iter().filter(|package| package.source.is_some()) {
        names.entry(package.license.as_deref().unwrap_or("none")).or_default().push(&package.name);
    }
    for (licence, names) in &mut names {
        names.dedup();
        println!("{licence}: {}", names.join(" "));
    }
    let refused = refused(&policy, &packages)?;
    ensure!(refused.is_empty(), "licences or sources that deny.toml does not allow:\n{}", refused.join("\n"));
    Ok(())
}

/// What is wrong, in sentences.
fn refused(policy: &Policy, packages: &Packages) -> Result<Vec<String>> {
    let allow = licensees(&policy.licenses.allow)?;
    let gpl_2 = licensees(policy.licenses.allow.iter().filter(|name| *name != NOT_WITH_GPL_2))?;
    let excepted = |package: &Package| -> Result<Vec<Licensee>> {
        licensees(policy.licenses.exceptions.iter().filter(|e| e.name == package.name).flat_map(|e| &e.allow))
    };
    let mut refused = Vec::new();
    for package in packages.all() {
        if !satisfied(package, &[allow.as_slice(), &excepted(package)?].concat())? {
            refused.push(shown(package));
        }
        let registry = |source: &str| policy.sources.allow_registry.iter().any(|r| source == format!("registry+{r}"));
        if let Some(source) = package.source.as_deref().filter(|source| !registry(source)) {
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
        if package.name != UNUSED && !satisfied(package, &[gpl_2.as_slice(), &excepted(package)?].concat())? {
            refused.push(format!("{EMULATOR}, under GPL-2.0-only, links {}", shown(package)));
        }
    }
    Ok(refused)
}

fn licensees<'a>(names: impl IntoIterator<Item = &'a String>) -> Result<Vec<Licensee>> {
    let parsed = |name: &'a String| {
        Licensee::parse_mode(name, ParseMode::LAX).with_context(|| format!("deny.toml: {name} is no SPDX licence"))
    };
    names.into_iter().map(parsed).collect()
}

/// Whether somebody who accepts only these licences may use the package.
fn satisfied(package: &Package, accepted: &[Licensee]) -> Result<bool> {
    let Some(licence) = &package.license else { return Ok(false) };
    let licence = Expression::parse_mode(licence, ParseMode::LAX).with_context(|| shown(package))?;
    Ok(licence.evaluate(|required| accepted.iter().any(|licensee| licensee.satisfies(required))))
}

fn shown(package: &Package) -> String {
    format!("{} {} ({})", package.name, package.version, package.license.as_deref().unwrap_or("no licence"))
}

#[cfg(test)]
mod tests {
    use super::{EMULATOR, PERMISSIVE, Policy, refused};
    use crate::packages::tests::{Row, packages};

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
    fn a_licence_that_is_not_listed_is_refused() {
        let refused = |licence| with_extra(&policy(), "none", licence, None);
        assert!(refused("MIT").is_empty());
        assert!(refused("Zlib/MIT").is_empty(), "the old way to write OR");
        assert!(refused("MIT OR GPL-3.0-only").is_empty(), "one of two is enough");
        for licence in ["MIT AND GPL-3.0-only", "AGPL-3.0-only", "GPL-2.0"] {
            assert_eq!(refused(licence), [format!("extra 1.0.0 ({licence})")]);
        }
    }

    #[test]
    fn a_program_under_mit_links_no_crate_that_needs_an_exception() {
        let mut policy = policy();
        policy.licenses.exceptions[0].name = "extra".into();
        for program in PERMISSIVE {
            let refused = |kind| with_extra(&policy, program, "GPL-2.0-only", kind);
            assert_eq!(refused(None), [format!("{program} links extra 1.0.0 (GPL-2.0-only)")]);
            assert!(refused(Some("dev")).is_empty(), "a test may");
        }
        assert!(with_extra(&policy, EMULATOR, "GPL-2.0-only", None).is_empty());
    }

    #[test]
    fn the_emulator_links_nothing_under_apache_alone() {
        let refused = |user, licence| with_extra(&policy(), user, licence, None);
        assert!(refused(EMULATOR, "Apache-2.0 OR MIT").is_empty() && refused("rigctl", "Apache-2.0").is_empty());
        let named = "rig-emulator, under GPL-2.0-only, links extra 1.0.0 (Apache-2.0)";
        assert_eq!(refused(EMULATOR, "Apache-2.0"), [named]);
    }

    #[test]
    fn another_source_is_refused() {
        let mut policy = policy();
        policy.sources.allow_registry.clear();
        let refused = with_extra(&policy, "none", "MIT", None);
        assert!(refused.len() == 1 && refused[0].starts_with("extra 1.0.0 (MIT) from registry+"), "{refused:?}");
    }
}
