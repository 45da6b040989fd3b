//! The packages that this project is built from, as cargo's metadata lists them: those that are linked into a program, and
//! those that a manifest names and no source file uses.

use crate::process::files_in;
use crate::{Folders, toolchain};
use anyhow::{Context, Result, ensure};
use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, NodeDep, Package, PackageId, Target};
use fs_err as fs;
use std::collections::{BTreeSet, HashMap, HashSet};

/// All packages, by name and version.
pub struct Packages(Metadata);

impl Packages {
    /// Those of this machine, the board and the page of `tsa-lab report`: what other systems need may not be downloaded.
    pub fn find(folders: &Folders) -> Result<Self> {
        let mut options = vec!["--locked".to_owned()];
        for target in [toolchain::host()?.as_str(), toolchain::TARGET, toolchain::PAGE_TARGET] {
            options.extend(["--filter-platform".to_owned(), target.to_owned()]);
        }
        let found = MetadataCommand::new().current_dir(&folders.root).other_options(options).exec();
        Ok(Self::sorted(found.context("cargo cannot list the packages")?))
    }

    fn sorted(mut metadata: Metadata) -> Self {
        metadata.packages.sort_by(|a, b| (&a.name, &a.version).cmp(&(&b.name, &b.version)));
        Self(metadata)
    }

    /// All of them, those for tests and build scripts included.
    pub fn all(&self) -> &[Package] {
        &self.0.packages
    }

    /// The packages whose code is linked into one: itself and its dependencies, without macros, build scripts and tests.
    pub fn linked(&self, name: &str) -> Result<Vec<&Package>> {
        let nodes = &self.0.resolve.as_ref().context("cargo's metadata has no dependencies")?.nodes;
        let uses: HashMap<&PackageId, &[NodeDep]> = nodes.iter().map(|node| (&node.id, node.deps.as_slice())).collect();
        let own = self.all().iter().find(|package| *package.name == name && package.source.is_none());
        let mut waiting = vec![&own.with_context(|| format!("no package is called {name}"))?.id];
        let mut found = BTreeSet::new();
        while let Some(id) = waiting.pop() {
            if !self.0[id].targets.iter().any(Target::is_proc_macro) && found.insert(id) {
                let linked =
                    |dependency: &&NodeDep| dependency.dep_kinds.iter().any(|kind| kind.kind == DependencyKind::Normal);
                waiting.extend(uses[id].iter().filter(linked).map(|dependency| &dependency.pkg));
            }
        }
        Ok(self.all().iter().filter(|package| found.contains(&package.id)).collect())
    }
}

/// Fails by the names of dependencies whose identifier stands in no source file of their package, outside comments.
/// `[package.metadata.cargo-machete] ignored` in a manifest lists exceptions.
pub fn check_used(packages: &Packages) -> Result<()> {
    let mut all = Vec::new();
    for package in packages.all().iter().filter(|package| package.source.is_none()) {
        let mut sources = String::new();
        for target in &package.targets {
            // A build script is a file beside other packages.
            let folder = target.src_path.parent().filter(|_| !target.is_custom_build());
            let files =
                folder.map_or_else(|| Ok(vec![target.src_path.clone().into()]), |folder| files_in(folder.as_ref()))?;
            for file in files.iter().filter(|file| file.extension().is_some_and(|extension| extension == "rs")) {
                sources += &fs::read_to_string(file)?;
            }
        }
        all.extend(unused(package, &sources).into_iter().map(|name| format!("{}: {name}", package.manifest_path)));
    }
    ensure!(all.is_empty(), "dependencies that no source file uses:\n{}", all.join("\n"));
    Ok(())
}

/// The dependencies of a package that these sources do not use.
fn unused<'a>(package: &'a Package, sources: &str) -> Vec<&'a str> {
    let code = sources.lines().filter_map(|line| line.split("//").next());
    let words: HashSet<&str> = code.flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && c != '_')).collect();
    let ignored = package.metadata.pointer("/cargo-machete/ignored").and_then(|names| names.as_array());
    let is_ignored = |name: &str| ignored.is_some_and(|names| names.iter().any(|ignored| ignored == name));
    let names = package.dependencies.iter().map(|dependency| dependency.rename.as_ref().unwrap_or(&dependency.name));
    names
        .map(String::as_str)
        .filter(|name| !words.contains(name.replace('-', "_").as_str()) && !is_ignored(name))
        .collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::{Packages, unused};
    use cargo_metadata::Metadata;
    use serde_json::{Value, json};

    /// Name, licence, and dependencies, each with its kind.
    pub(crate) type Row<'a> = (&'a str, &'a str, &'a [(&'a str, Option<&'a str>)]);

    /// Packages of this workspace, and of a registry. `derive` is a macro. All are in `folder`.
    pub(crate) fn packages_in(folder: &str, own: &[Row<'_>], foreign: &[Row<'_>]) -> Packages {
        let package = |source: Option<&str>, (name, license, _): &Row<'_>| {
            let kind = if *name == "derive" { "proc-macro" } else { "lib" };
            json!({
                "id": name, "name": name, "version": "1.0.0", "license": license, "source": source, "features": {},
                "manifest_path": format!("{folder}/Cargo.toml"), "dependencies": [],
                "targets": [{"name": name, "kind": [kind], "src_path": ""}],
            })
        };
        let node = |(name, _, dependencies): &Row<'_>| {
            let dependency =
                |(name, kind): &(&str, Option<&str>)| json!({"name": name, "pkg": name, "dep_kinds": [{"kind": kind}]});
            json!({"id": name, "dependencies": [], "deps": dependencies.iter().map(dependency).collect::<Vec<_>>()})
        };
        let registry = Some("registry+https://github.com/rust-lang/crates.io-index");
        let all: Vec<Value> =
            own.iter().map(|row| package(None, row)).chain(foreign.iter().map(|row| package(registry, row))).collect();
        let nodes: Vec<Value> = own.iter().chain(foreign).map(node).collect();
        let metadata = json!({
            "packages": all, "resolve": {"nodes": nodes}, "workspace_members": [], "workspace_root": "",
            "target_directory": "", "version": 1,
        });
        Packages::sorted(serde_json::from_value::<Metadata>(metadata).unwrap())
    }

    pub(crate) fn packages(own: &[Row<'_>], foreign: &[Row<'_>]) -> Packages {
        packages_in("", own, foreign)
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

    #[test]
    fn only_a_dependency_without_its_identifier_is_unused() {
        let mut package = packages(&[("tool", "MIT", &[])], &[]).0.packages.remove(0);
        let names = [("rig-link", None), ("serde", None), ("cobs", None), ("heapless", Some("other"))];
        let named = names.map(|(name, rename)| {
            json!({"name": name, "rename": rename, "req": "*", "kind": null, "optional": false,
                   "uses_default_features": true, "features": [], "target": null})
        });
        package.dependencies = serde_json::from_value(named.into_iter().collect()).unwrap();
        let source =
            "use rig_link::Decoder;\n// serde is only named here\nlet a = cobs_like + serde_json;\nheapless::Vec";
        assert_eq!(unused(&package, source), ["serde", "cobs", "other"]);
        package.metadata = json!({"cargo-machete": {"ignored": ["serde"]}});
        assert_eq!(unused(&package, source), ["cobs", "other"]);
    }
}
