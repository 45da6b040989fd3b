//! Measures the model beside an independent solver, scipy: `host-tests/peers/bench.py`.

use crate::process::{cargo, exists, run};
use crate::{Folders, python, system};
use anyhow::{Context, Result};

/// Measures everything, prints the table and writes `bench/model.json` under the target folder. Without valgrind the instructions are
/// not counted.
pub fn bench(folders: &Folders) -> Result<()> {
    let file = folders.target.join("bench/model.json");
    std::fs::create_dir_all(folders.target.join("bench")).with_context(|| format!("cannot make {}", file.display()))?;
    run(cargo(folders).args(["build", "--release", "--package", "lab"]))?;
    let by_hand = "Install valgrind by your system's package manager.";
    if let Err(why) = system::ensure(&[(exists("valgrind"), "valgrind")], "count instructions", by_hand) {
        eprintln!("left out: {why:#}");
    }
    let python = python::with(folders, &["--requirement", "host-tests/peers/requirements.txt"])?;
    run(python(&folders.root).arg("host-tests/peers/bench.py").arg(folders.target.join("release/tsa-lab")).arg(file))
}
