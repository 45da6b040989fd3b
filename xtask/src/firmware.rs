//! The board's images: the firmware, its variants for tests, the self-test and the cost measurement.

use crate::process::{exists, run};
use crate::toolchain::{TARGET, Toolchain};
use crate::{Folders, image};
use anyhow::{Context, Result, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Name of the root package and of its main image.
pub const PACKAGE: &str = "tsa-firmware";

/// The package and image that measures the cost of each method of evaluating the mechanism.
const COST: &str = "tsa-cost";

/// Name of the image that tests a board without a rig.
pub const SELFTEST: &str = "tsa-selftest";

/// Folder below the target folder in which tools and tests expect the images.
const IMAGES: &str = "firmware";

/// Builds the firmware, puts it where `rigctl` expects it, and prints its size.
pub fn build(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    let image = built(&mut cargo(folders, toolchain, PACKAGE, PACKAGE), folders, toolchain, PACKAGE, IMAGES)?;
    println!("firmware: {}", image.display());
    let binary = image.with_extension("bin");
    std::fs::write(&binary, image::binary(&image)?).with_context(|| format!("cannot write {}", binary.display()))?;
    println!("firmware to drop onto the board's drive: {}", binary.display());
    image::report(&image)
}

/// Builds the firmware and starts it with the runner of `.cargo/config.toml`: probe-rs, with the chip's name.
pub fn flash(folders: &Folders, toolchain: &Toolchain, rest: &[String]) -> Result<()> {
    build(folders, toolchain)?;
    ensure!(exists("probe-rs"), "probe-rs is missing; install it with: cargo install probe-rs-tools --locked");
    let mut cargo = toolchain.cargo(folders, "run");
    run(cargo.args(["--package", PACKAGE, "--profile", "firmware", "--"]).args(rest))
}

/// A firmware of the default scene with other numbers in its `[rig]`, for tests.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Variant {
    /// The drive on the serial line.
    Uart,
    /// Another LVDT, and a lower current limit: what becomes of settings after such an update.
    OtherRig,
}

impl Variant {
    /// Folder of its image and its scene, below that of all images.
    fn folder(self) -> &'static str {
        match self {
            Self::Uart => "uart",
            Self::OtherRig => "other-rig",
        }
    }

    /// Text in the default scene, and what replaces it.
    fn changes(self) -> &'static [[&'static str; 2]] {
        match self {
            Self::Uart => &[["drive_transport = \"can\"", "drive_transport = \"uart\""]],
            Self::OtherRig => &[
                ["lvdt_volts_at_stroke = 3.0", "lvdt_volts_at_stroke = 2.8"],
                ["drive_current_limit_a = 0.5", "drive_current_limit_a = 0.4"],
            ],
        }
    }
}

/// Builds a variant of the firmware, in a folder of its own with the scene that it was built for.
pub fn build_variant(folders: &Folders, toolchain: &Toolchain, variant: Variant) -> Result<()> {
    let images = Path::new(IMAGES).join(variant.folder());
    let mut text = std::fs::read_to_string(folders.root.join("scenes/default.toml")).context("the default scene")?;
    for [from, to] in variant.changes() {
        ensure!(text.contains(from), "the default scene no longer has {from}");
        text = text.replace(from, to);
    }
    let folder = folders.target.join(&images);
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let scene = folder.join("scene.toml");
    // Written only when it changes, because cargo compares its time.
    if std::fs::read_to_string(&scene).ok().as_deref() != Some(&text) {
        std::fs::write(&scene, &text).with_context(|| format!("cannot write {}", scene.display()))?;
    }
    let mut cargo = cargo(folders, toolchain, PACKAGE, PACKAGE);
    let image = built(cargo.env("TSA_SCENE", &scene), folders, toolchain, PACKAGE, images)?;
    println!("firmware, variant {}: {}", variant.folder(), image.display());
    image::report(&image)
}

/// Builds the image that measures costs (`lab/cost-image`), with the row of `interpn` or without it.
pub fn build_cost(folders: &Folders, toolchain: &Toolchain, interpn: bool) -> Result<()> {
    let mut cargo = cargo(folders, toolchain, COST, COST);
    if interpn {
        cargo.args(["--features", "interpn"]);
    }
    built(&mut cargo, folders, toolchain, COST, IMAGES).map(drop)
}

/// Builds the image that tests a board without a rig (`src/bin/selftest`).
pub fn build_selftest(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    built(&mut cargo(folders, toolchain, PACKAGE, SELFTEST), folders, toolchain, SELFTEST, IMAGES).map(drop)
}

/// The command that builds one image of a package.
fn cargo(folders: &Folders, toolchain: &Toolchain, package: &str, name: &str) -> Command {
    let mut cargo = toolchain.cargo(folders, "build");
    cargo.args(["--package", package, "--profile", "firmware", "--bin", name]);
    cargo
}

/// Runs `cargo` and copies the image that it builds into a folder below the target folder.
fn built(
    cargo: &mut Command,
    folders: &Folders,
    toolchain: &Toolchain,
    name: &str,
    images: impl AsRef<Path>,
) -> Result<PathBuf> {
    run(cargo)?;
    let built = toolchain.target_folder(folders).join(TARGET).join("firmware").join(name);
    let folder = folders.target.join(images);
    let image = folder.join(format!("{name}.elf"));
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    std::fs::copy(&built, &image).with_context(|| format!("cannot copy {} to {}", built.display(), image.display()))?;
    Ok(image)
}

/// Lints the images. With a toolchain without clippy, warnings of the compiler are errors.
pub fn lint(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    // In the images' profile, so that their build scripts are built once.
    let what = ["--package", PACKAGE, "--package", COST, "--profile", "firmware"];
    if toolchain.has_clippy() {
        return run(toolchain.cargo(folders, "clippy").args(what).args(["--", "-D", "warnings"]));
    }
    // This adds to the linker arguments of .cargo/config.toml, which RUSTFLAGS would replace.
    let deny = format!("target.{TARGET}.rustflags=[\"-Dwarnings\"]");
    run(toolchain.cargo(folders, "check").args(what).args(["--config", &deny]))
}

#[cfg(test)]
mod tests {
    /// Without these options `probe-rs run` (0.32.0) halts the board at every reset and hard fault.
    #[test]
    fn the_runner_lets_the_board_reset_by_itself() {
        let runner = include_str!("../../.cargo/config.toml").lines().find(|line| line.starts_with("runner = "));
        let runner = runner.unwrap_or_default();
        for option in ["probe-rs run", "--no-catch-reset", "--no-catch-hardfault"] {
            assert!(runner.contains(option), "{option}: {runner}");
        }
    }
}
