//! The packages that this project is built from, as cargo's metadata lists them, and those that are linked into a program.

use crate::Folders;
use crate::process::{cargo, output_of};
use crate::toolchain;
use anyhow::{Context, Result};
use serde::Deserialize;
use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;

/// A package of this workspace or of a registry.
#[derive(Debug, Deserialize)]
pub struct Package {
    id: String,
    /// Name in the registry.
    pub name: String,
    /// Version.
    pub version: String,
    /// SPDX expression.
    pub license: Option<String>,
    /// Address of its source.
    pub repository: Option<String>,
    /// Registry; `None` for a package of this workspace.
    pub source: Option<String>,
    /// Its `Cargo.toml`.
    pub manifest_path: PathBuf,
    targets: Vec<Target>,
}

#[derive(Debug, Deserialize)]
struct Target {
    kind: Vec<String>,
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    resolve: Resolve,
}

#[derive(Deserialize)]
struct Resolve {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<Dependency>,
}

#[derive(Deserialize)]
struct Dependency {
    pkg: String,
    dep_kinds: Vec<Kind>,
}

#[derive(Deserialize)]
struct Kind {
    /// `None` for a dependency of the code itself, not of its tests or build script.
    kind: Option<String>,
}

/// All packages, by name and version.
pub struct Packages {
    packages: Vec<Package>,
    /// Identifiers of the packages whose code a package uses, by its own identifier.
    uses: HashMap<String, Vec<String>>,
}

impl Packages {
    /// Those of this machine, the board and the page of `tsa-lab report`: what other systems need may not be downloaded.
    pub fn find(folders: &Folders) -> Result<Self> {
        let mut command = cargo(folders);
        command.args(["metadata", "--locked", "--format-version", "1"]);
        for target in [toolchain::host()?.as_str(), toolchain::TARGET, toolchain::PAGE_TARGET] {
            command.args(["--filter-platform", target]);
        }
        Self::from_json(&output_of(&mut command).context("cargo cannot list the packages")?)
    }

    pub(crate) fn from_json(metadata: &str) -> Result<Self> {
        let Metadata { mut packages, resolve } = serde_json::from_str(metadata).context("cargo's metadata")?;
        packages.sort_by(|a, b| (&a.name, &a.version).cmp(&(&b.name, &b.version)));
        let used = |node: Node| {
            let linked = |d: &Dependency| d.dep_kinds.iter().any(|kind| kind.kind.is_none());
            (node.id, node.deps.into_iter().filter(linked).map(|d| d.pkg).collect())
        };
        Ok(Self { packages, uses: resolve.nodes.into_iter().map(used).collect() })
    }

    /// All of them, those for tests and build scripts included.
    pub fn all(&self) -> &[Package] {
        &self.packages
    }

    /// The packages whose code is linked into one: itself and its dependencies, without macros, build scripts and tests.
    pub fn linked(&self, name: &str) -> Result<Vec<&Package>> {
        let by_id: HashMap<&str, &Package> = self.packages.iter().map(|p| (p.id.as_str(), p)).collect();
        let own = self.packages.iter().find(|package| package.name == name && package.source.is_none());
        let mut waiting = vec![own.with_context(|| format!("no package is called {name}"))?.id.as_str()];
        let mut found = BTreeSet::new();
        while let Some(id) = waiting.pop() {
            let package = by_id.get(id).with_context(|| format!("cargo's metadata has no package {id}"))?;
            let is_macro = package.targets.iter().any(|target| target.kind.iter().any(|kind| kind == "proc-macro"));
            if !is_macro && found.insert(id) {
                waiting.extend(self.uses.get(id).into_iter().flatten().map(String::as_str));
            }
        }
        Ok(self.packages.iter().filter(|package| found.contains(package.id.as_str())).collect())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::Packages;
    use serde_json::{Value, json};

    /// Name, licence, and dependencies, each with its kind.
    pub(crate) type Row<'a> = (&'a str, &'a str, &'a [(&'a str, Option<&'a str>)]);

    /// Packages of this workspace, and of a registry. `derive` is a macro.
    pub(crate) fn packages(own: &[Row<'_>], foreign: &[Row<'_>]) -> Packages {
        let package = |source: Option<&str>, (name, license, _): &Row<'_>| {
            let kind = if *name == "derive" { "proc-macro" } else { "lib" };
            json!({
                "id": name, "name": name, "version": "1.0.0", "license": license, "repository": null, "source": source,
                "manifest_path": "Cargo.toml", "targets": [{"kind": [kind]}],
            })
        };
        let node = |(name, _, dependencies): &Row<'_>| {
            let dependency = |(name, kind): &(&str, Option<&str>)| json!({"pkg": name, "dep_kinds": [{"kind": kind}]});
            json!({"id": name, "deps": dependencies.iter().map(dependency).collect::<Vec<_>>()})
        };
        let registry = Some("registry+https://github.com/rust-lang/crates.io-index");
        let all: Vec<Value> =
            own.iter().map(|row| package(None, row)).chain(foreign.iter().map(|row| package(registry, row))).collect();
        let nodes: Vec<Value> = own.iter().chain(foreign).map(node).collect();
        Packages::from_json(&json!({"packages": all, "resolve": {"nodes": nodes}}).to_string()).unwrap()
    }

    #[test]
    fn macros_tests_and_build_scripts_are_not_linked() {
        let tool: Row<'_> =
            ("tool", "MIT", &[("direct", None), ("derive", None), ("tester", Some("dev")), ("builder", Some("build"))]);
        let foreign: [Row<'_>; 6] = [
            ("direct", "MIT", &[("deep", None)]),
            ("deep", "MIT", &[("direct", None)]),
            ("derive", "MIT", &[("parser", None)]),
            ("parser", "MIT", &[]),
            ("tester", "MIT", &[]),
            ("builder", "MIT", &[]),
        ];
        let packages = packages(&[tool], &foreign);
        let names = packages.linked("tool").unwrap().iter().map(|p| p.name.as_str()).collect::<Vec<_>>();
        assert_eq!(names, ["deep", "direct", "tool"]);
        assert!(packages.linked("direct").is_err(), "not of this workspace");
        assert_eq!(packages.all().len(), 7);
    }
}
