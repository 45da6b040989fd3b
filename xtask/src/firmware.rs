//! The board's images: the firmware, its variants for tests, the self-test and the cost measurement.

use crate::process::{exists, run};
use crate::toolchain::{Choice, TARGET, Toolchain, choose};
use crate::{Folders, image};
use anyhow::{Result, ensure};
use clap::ValueEnum;
use fs_err as fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Name of the root package and of its main image.
const PACKAGE: &str = "tsa-firmware";

/// The package and image that measures the cost of each method of evaluating the mechanism.
const COST: &str = "tsa-cost";

/// Name of the image that tests a board without a rig.
pub const SELFTEST: &str = "tsa-selftest";

/// Folder below the target folder in which tools and tests expect the images.
const IMAGES: &str = "firmware";

/// Arguments of `cargo xtask firmware`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Compiler to use; `auto` tries the others in this order
    #[arg(long, value_enum, default_value_t)]
    toolchain: Choice,
    /// Build a variant of the default scene's firmware for tests (target/firmware/VARIANT/tsa-firmware.elf)
    #[arg(long, value_enum)]
    variant: Option<Variant>,
}

impl Arguments {
    /// Builds what they ask for.
    pub fn run(self, folders: &Folders) -> Result<()> {
        let toolchain = choose(self.toolchain)?;
        match self.variant {
            None => build(folders, &toolchain),
            Some(variant) => build_variant(folders, &toolchain, variant),
        }
    }
}

/// Arguments of `cargo xtask flash`.
#[derive(clap::Args)]
pub struct Flash {
    /// Arguments for `probe-rs run`: --probe, --connect-under-reset
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    rest: Vec<String>,
}

impl Flash {
    /// Builds the firmware and starts it with the runner of `.cargo/config.toml`: probe-rs, with the chip's name.
    pub fn run(self, folders: &Folders) -> Result<()> {
        let toolchain = choose(Choice::Auto)?;
        build(folders, &toolchain)?;
        run(flashing(folders, &toolchain, PACKAGE)?.args(self.rest))
    }
}

/// The command that starts an image on a board, to which arguments for probe-rs can be added.
pub fn flashing(folders: &Folders, toolchain: &Toolchain, image: &str) -> Result<Command> {
    ensure!(exists("probe-rs"), "probe-rs is missing; install it with: cargo install probe-rs-tools --locked");
    let mut cargo = toolchain.cargo(folders, "run");
    cargo.args(["--package", PACKAGE, "--profile", "firmware", "--bin", image, "--"]);
    Ok(cargo)
}

/// Builds the firmware, puts it where `rigctl` expects it, and prints its size.
pub fn build(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    let image = built(&mut cargo(folders, toolchain, PACKAGE, PACKAGE), folders, toolchain, PACKAGE, IMAGES)?;
    println!("firmware: {}", image.display());
    let binary = image.with_extension("bin");
    fs::write(&binary, image::binary(&image)?)?;
    println!("firmware to drop onto the board's drive: {}", binary.display());
    image::report(&image)
}

/// A firmware of the default scene with other numbers in its `[rig]`, for tests.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Variant {
    /// The drive on the serial line.
    Uart,
    /// Another LVDT, and a lower current limit: what becomes of settings after such an update.
    OtherRig,
}

/// Builds a variant of the firmware, in a folder of its own with the scene that it was built for.
pub fn build_variant(folders: &Folders, toolchain: &Toolchain, variant: Variant) -> Result<()> {
    let (name, changes): (_, &[[&str; 2]]) = match variant {
        Variant::Uart => ("uart", &[["drive_transport = \"can\"", "drive_transport = \"uart\""]]),
        Variant::OtherRig => (
            "other-rig",
            &[
                ["lvdt_volts_at_stroke = 3.0", "lvdt_volts_at_stroke = 2.8"],
                ["drive_current_limit_a = 0.5", "drive_current_limit_a = 0.4"],
            ],
        ),
    };
    let mut text = fs::read_to_string(folders.root.join("scenes/default.toml"))?;
    for [from, to] in changes {
        ensure!(text.contains(from), "the default scene no longer has {from}");
        text = text.replace(from, to);
    }
    let images = Path::new(IMAGES).join(name);
    let scene = folders.target.join(&images).join("scene.toml");
    fs::create_dir_all(folders.target.join(&images))?;
    // Written only when it changes, because cargo compares its time.
    if fs::read_to_string(&scene).ok().as_deref() != Some(&text) {
        fs::write(&scene, &text)?;
    }
    let mut cargo = cargo(folders, toolchain, PACKAGE, PACKAGE);
    let image = built(cargo.env("TSA_SCENE", &scene), folders, toolchain, PACKAGE, images)?;
    println!("firmware, variant {name}: {}", image.display());
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
    let folder = folders.target.join(images);
    let image = folder.join(format!("{name}.elf"));
    fs::create_dir_all(&folder)?;
    fs::copy(toolchain.target_folder(folders).join(TARGET).join("firmware").join(name), &image)?;
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
