//! How the section about the page of `tsa-lab report` is measured; it also makes the copy of the page in `docs`.

use super::Measured;
use super::sections::{number, printed, rigctl, significant, text};
use crate::{Folders, browser, host};
use anyhow::{Context, Result, ensure};
use serde_json::Value;

/// The copy of the page.
const PAGE: &str = "docs/report.html";

pub(super) fn measure(folders: &Folders) -> Result<Measured> {
    host::tools_and_firmware(folders)?;
    let made = rigctl(folders, &["report", "--out", PAGE, "--charts", "docs/charts"])?;
    let missing =
        made.first().and_then(|made| made["missing"].as_array()).context("`tsa-lab report` printed nothing")?;
    ensure!(missing.is_empty(), "the page lacks {missing:?}");
    // The tool keeps what the file held before.
    let _ = std::fs::remove_file(folders.root.join(format!("{PAGE}~")));
    let bytes = std::fs::metadata(folders.root.join(PAGE))?.len();
    let found = printed(browser::driver(folders)?.args(["lab/web/tests/measure.py", PAGE]))?;
    let found: Value = serde_json::from_str(found.trim()).with_context(|| format!("no JSON: {found}"))?;
    let mut measured = Measured { table: vec![text(&["", ""])], ..Measured::default() };
    let mut add = |name: &str, shown: &str, value: f64, unit: &str| {
        measured.values.insert(name.to_owned(), value);
        measured.table.push(vec![shown.to_owned(), format!("{} {unit}", significant(value))]);
    };
    add("kilobytes", "the page", bytes as f64 * 1e-3, "kB");
    for (name, shown, unit) in [
        ("load_ms", "from the request to the loaded page", "ms"),
        ("map_ms", "until the map over load and twist is complete", "ms"),
        ("solve_us", "an equilibrium with the gap at its pre-twist, by `tsa.solve`", "µs"),
        ("frame_ms", "a redraw after a key, median", "ms"),
        ("frame_ms_95", "a redraw after a key, 95 of 100", "ms"),
    ] {
        add(name, shown, number(&found, &format!("/{name}"))?, unit);
    }
    let chromium = found["chromium"].as_str().unwrap_or("?");
    measured.notes.push(format!(
        "Headless Chromium {chromium} without a graphics processor. The page: [report.html](report.html)."
    ));
    Ok(measured)
}
