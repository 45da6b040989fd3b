//! The board's image.

use crate::process::run;
use crate::toolchain::{TARGET, Toolchain};
use crate::{Folders, image};
use anyhow::{Context, Result};

/// Name of the root package and of its image.
const PACKAGE: &str = "tsa-firmware";

/// Builds the image, puts it where `rigctl` looks for it, and prints its size.
pub fn build(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    run(toolchain.cargo(folders, "build").args(["--package", PACKAGE, "--profile", "firmware"]))?;
    let built = toolchain.target_folder(folders).join(TARGET).join("firmware").join(PACKAGE);
    let folder = folders.target.join("firmware");
    let image = folder.join(format!("{PACKAGE}.elf"));
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    std::fs::copy(&built, &image).with_context(|| format!("cannot copy {} to {}", built.display(), image.display()))?;
    println!("firmware: {}", image.display());
    image::report(&image)
}

/// Lints the firmware; a toolchain without clippy still lets no warning through.
pub fn lint(folders: &Folders, toolchain: &Toolchain) -> Result<()> {
    if toolchain.has_clippy() {
        return run(toolchain.cargo(folders, "clippy").args(["--package", PACKAGE, "--", "-D", "warnings"]));
    }
    // Added to the linker arguments of .cargo/config.toml, which RUSTFLAGS would replace.
    let deny = format!("target.{TARGET}.rustflags=[\"-Dwarnings\"]");
    run(toolchain.cargo(folders, "check").args(["--package", PACKAGE, "--config", &deny]))
}
