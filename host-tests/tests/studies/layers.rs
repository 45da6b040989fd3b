//! Which packages may know which.

use serde_json::Value;
use std::process::Command;

/// The core is the firmware and `crates/`; whoever wants only these needs neither the emulated chip nor the laboratory.
#[test]
fn nothing_in_the_core_depends_on_emulator_or_laboratory() {
    let root = host_tests::root().canonicalize().expect("the project's folder");
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    let metadata = cargo.args(["metadata", "--no-deps", "--offline", "--format-version", "1"]).current_dir(&root);
    let metadata = metadata.output().expect("cargo starts");
    let metadata: Value = serde_json::from_slice(&metadata.stdout).expect("cargo's metadata");
    let mut core = 0;
    for package in metadata["packages"].as_array().expect("packages") {
        let place = |path: &Value| path.as_str().map(|path| path.replace(&root.display().to_string(), ""));
        let manifest = place(&package["manifest_path"]).expect("a manifest");
        if manifest != "/Cargo.toml" && !manifest.starts_with("/crates/") {
            continue;
        }
        core += 1;
        for folder in package["dependencies"].as_array().expect("dependencies").iter().filter_map(|d| place(&d["path"]))
        {
            let outside = ["/emulator", "/lab", "/host-tests"].iter().any(|outside| folder.starts_with(outside));
            assert!(!outside, "{manifest} depends on {folder}");
        }
    }
    assert!(core >= 10, "{core} packages are the core");
}
