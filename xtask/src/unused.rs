//! Finds dependencies that a manifest names and no source file uses.

use crate::Folders;
use crate::process::{cargo, output_of};
use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::collections::HashSet;
use std::path::Path;

/// Fails by the names of unused dependencies, in every package of the workspace and in `fuzz/`.
///
/// A dependency is used if its identifier stands in a source file of the package, outside comments.
/// `[package.metadata.cargo-machete] ignored` in a manifest lists exceptions.
pub fn check(folders: &Folders) -> Result<()> {
    let mut unused = Vec::new();
    for manifest in ["Cargo.toml", "fuzz/Cargo.toml"] {
        let mut command = cargo(folders);
        command.args(["metadata", "--no-deps", "--offline", "--format-version", "1", "--manifest-path", manifest]);
        let metadata = output_of(&mut command).with_context(|| format!("cargo cannot read {manifest}"))?;
        let metadata: Value = serde_json::from_str(&metadata).context("cargo's metadata")?;
        for package in metadata["packages"].as_array().context("cargo's metadata has no packages")? {
            let path = package["manifest_path"].as_str().context("a package has no manifest")?;
            let mut source = String::new();
            read(Path::new(path).parent().context("a manifest has no folder")?, &mut source)?;
            unused.extend(in_package(package, &source).into_iter().map(|name| format!("{path}: {name}")));
        }
    }
    ensure!(unused.is_empty(), "dependencies that no source file uses:\n{}", unused.join("\n"));
    Ok(())
}

/// The dependencies of a package in cargo's metadata that its sources do not use.
fn in_package<'a>(package: &'a Value, source: &str) -> Vec<&'a str> {
    let code = source.lines().filter_map(|line| line.split("//").next());
    let words: HashSet<&str> = code.flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && c != '_')).collect();
    let ignored = package.pointer("/metadata/cargo-machete/ignored").and_then(Value::as_array);
    let is_ignored = |name: &str| ignored.is_some_and(|list| list.iter().any(|ignored| ignored == name));
    let dependencies = package["dependencies"].as_array().into_iter().flatten();
    let names = dependencies.filter_map(|d| d["rename"].as_str().or(d["name"].as_str()));
    names.filter(|name| !words.contains(name.replace('-', "_").as_str()) && !is_ignored(name)).collect()
}

/// Appends every source file of the package in this folder. A subfolder with a manifest is another package.
fn read(folder: &Path, source: &mut String) -> Result<()> {
    for entry in std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        let hidden = path.file_name().is_none_or(|name| name.to_string_lossy().starts_with(['.']));
        if path.is_dir() && !hidden && !path.join("Cargo.toml").exists() && !path.join("CACHEDIR.TAG").exists() {
            read(&path, source)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            *source += &std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::in_package;
    use serde_json::json;

    #[test]
    fn only_a_dependency_without_its_identifier_is_unused() {
        let names = ["rig-link", "serde", "cobs", "heapless"].map(|name| json!({"name": name, "rename": null}));
        let mut package = json!({"dependencies": names, "metadata": null});
        let source =
            "use rig_link::Decoder;\n// serde is only named here\nlet a = cobs_like + serde_json;\nheapless::Vec";
        assert_eq!(in_package(&package, source), ["serde", "cobs"]);
        package["metadata"] = json!({"cargo-machete": {"ignored": ["serde"]}});
        assert_eq!(in_package(&package, source), ["cobs"]);
        package["dependencies"][0]["rename"] = "other".into();
        assert_eq!(in_package(&package, source), ["other", "cobs"]);
    }
}
