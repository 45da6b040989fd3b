//! `cargo xtask results`: measures every number that the README and `docs/results.md` state, and writes both pages.
//!
//! `host-tests/studies.toml` lists the studies; the program `study` of that package measures them and keeps what they found. Here is
//! only what it needs built or measured by other tasks.

use crate::process::{cargo, run};
use crate::{Folders, bench, browser, firmware, host, image, toolchain};
use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use std::fs::{self, File};
use std::process::Command;

#[derive(Deserialize)]
struct List {
    study: Vec<Section>,
}

#[derive(Deserialize)]
struct Section {
    name: String,
}

/// Measures the named studies (all of them where none is named) and writes the pages.
pub fn results(folders: &Folders, only: &[String]) -> Result<()> {
    let list = fs::read_to_string(folders.root.join("host-tests/studies.toml")).context("host-tests/studies.toml")?;
    let names: Vec<String> = toml::from_str::<List>(&list)?.study.into_iter().map(|section| section.name).collect();
    if let Some(wrong) = only.iter().find(|name| !names.contains(name)) {
        anyhow::bail!("no section is called {wrong:?}; there are {}", names.join(", "));
    }
    host::tools_and_firmware(folders)?;
    fs::create_dir_all(folders.root.join("out"))?;
    for name in names.iter().filter(|name| only.is_empty() || only.contains(name)) {
        match name.as_str() {
            "image" => sizes(folders)?,
            "cost" => host::cost(folders)?,
            "bench" => bench::bench(folders)?,
            "loop" => host::closed_loop(folders)?,
            "report" => page(folders)?,
            _ => {}
        }
        study(folders, &["record".into(), name.clone()])?;
    }
    Ok(())
}

/// Runs the program of the studies.
pub fn study(folders: &Folders, words: &[String]) -> Result<()> {
    run(cargo(folders).args(["run", "--release", "--package", "host-tests", "--bin", "study", "--"]).args(words))
}

/// Sizes of both images: `out/image.json`.
fn sizes(folders: &Folders) -> Result<()> {
    firmware::build_variant(folders, &toolchain::choose(toolchain::Choice::Auto)?, firmware::Variant::Uart)?;
    let mut rows = String::new();
    for (name, file) in [("drive on CAN (default)", ""), ("drive on the serial line", "uart/")] {
        let size = image::size(&folders.target.join(format!("firmware/{file}tsa-firmware.elf")))?;
        let [flash, ram] = [size.flash, size.ram].map(|bytes| bytes as f64 / 1024.0);
        rows += &format!("{}\n", serde_json::json!({"image": name, "flash_kib": flash, "ram_kib": ram}));
    }
    fs::write(folders.root.join("out/image.json"), rows).context("out/image.json")
}

/// The copy of the page of `tsa-lab report` in `docs`, and its times in a browser: `out/page.json`.
fn page(folders: &Folders) -> Result<()> {
    const PAGE: &str = "docs/report.html";
    let [made, times] = ["out/report.json", "out/page.json"].map(|name| folders.root.join(name));
    let words = ["--json", "report", "--out", PAGE, "--charts", "docs/charts"];
    let mut lab = Command::new(folders.target.join("release/tsa-lab"));
    run(lab.current_dir(&folders.root).args(words).stdout(File::create(&made)?))?;
    let made: serde_json::Value = serde_json::from_str(&fs::read_to_string(made)?)?;
    ensure!(made["missing"].as_array().is_some_and(Vec::is_empty), "the page lacks {}", made["missing"]);
    // The tool keeps what the file held before.
    let _ = fs::remove_file(folders.root.join(format!("{PAGE}~")));
    run(browser::driver(folders)?.args(["lab/web/tests/measure.py", PAGE]).stdout(File::create(times)?))
}
