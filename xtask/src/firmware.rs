//! The board's image.

use crate::process::run;
use crate::toolchain::{TARGET, Toolchain};
use crate::{Folders, image};
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};

/// Name of the root package and of its image.
const PACKAGE: &str = "tsa-firmware";

/// The image that only counts what each way of knowing the mechanism costs.
const COST: &str = "tsa-cost";

/// Builds the image, puts it where `rigctl` looks for it, and prints its size.
pub fn build(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    let image = built(folders, toolchain, PACKAGE, &[])?;
    println!("firmware: {}", image.display());
    image::report(&image)
}

/// Builds the image with a table of another model or accuracy (`TSA_STUDY`, see build.rs), beside the one that `rigctl`
/// boots.
pub fn build_study(folders: &Folders, toolchain: &Toolchain, study: &str, image: &Path) -> Result<()> {
    let arguments = ["--package", PACKAGE, "--profile", "firmware", "--bin", PACKAGE];
    run(toolchain.cargo(folders, "build").args(arguments).env("TSA_STUDY", study))?;
    let built = toolchain.target_folder(folders).join(TARGET).join("firmware").join(PACKAGE);
    std::fs::copy(&built, image).with_context(|| format!("cannot copy {} to {}", built.display(), image.display()))?;
    Ok(())
}

/// Builds the image that counts costs (`src/bin/cost.rs`).
pub fn build_cost(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    built(folders, toolchain, COST, &["--features", "cost"]).map(drop)
}

/// One of the package's images, copied to where the tools look for it.
fn built(folders: &Folders, toolchain: &Toolchain, name: &str, more: &[&str]) -> Result<PathBuf> {
    let arguments = ["--package", PACKAGE, "--profile", "firmware", "--bin", name];
    run(toolchain.cargo(folders, "build").args(arguments).args(more))?;
    let built = toolchain.target_folder(folders).join(TARGET).join("firmware").join(name);
    let folder = folders.target.join("firmware");
    let image = folder.join(format!("{name}.elf"));
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    std::fs::copy(&built, &image).with_context(|| format!("cannot copy {} to {}", built.display(), image.display()))?;
    Ok(image)
}

/// Lints the firmware; a toolchain without clippy still lets no warning through.
pub fn lint(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    if toolchain.has_clippy() {
        return run(toolchain.cargo(folders, "clippy").args([
            "--package",
            PACKAGE,
            "--features",
            "cost",
            "--",
            "-D",
            "warnings",
        ]));
    }
    // Added to the linker arguments of .cargo/config.toml, which RUSTFLAGS would replace.
    let deny = format!("target.{TARGET}.rustflags=[\"-Dwarnings\"]");
    run(toolchain.cargo(folders, "check").args(["--package", PACKAGE, "--features", "cost", "--config", &deny]))
}
