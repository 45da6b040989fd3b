//! Chooses the compiler for the firmware: the present toolchain if it has the board's target, else with the target that
//! rustup fetches, else Debian's compiler and standard-library source, for machines where rustup cannot reach its
//! server.

use crate::Folders;
use crate::process::{exists, foreign, output_of, run};
use crate::system;
use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The board's target.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// The target of the solver in the page of `tsa-lab report`.
pub const PAGE_TARGET: &str = "wasm32-unknown-unknown";

/// The `rust-version` of this workspace, which Debian's compiler must have.
const OLDEST: &str = env!("CARGO_PKG_RUST_VERSION");

const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const DEBIAN_PACKAGES: [&str; 4] = ["rustc-web", "cargo-web", "rust-web-src", "lld"];

/// The toolchain that the user asks for.
#[derive(Clone, Copy, Default, PartialEq, ValueEnum)]
pub enum Choice {
    /// The first one that works
    #[default]
    Auto,
    /// The toolchain that runs this task; rustup adds the target if it is missing
    Rustup,
    /// Debian's compiler, which builds `core` from source
    Debian,
}

/// A toolchain that this machine has.
pub enum Toolchain {
    /// The cargo that runs this task, with the target installed.
    Installed,
    /// Debian's rustc-web, cargo-web and rust-web-src.
    Debian,
}

impl Toolchain {
    /// A cargo command for the firmware, up to and including the target.
    pub fn cargo(&self, folders: &Folders, subcommand: &str) -> Command {
        match self {
            Self::Installed => {
                let mut command = crate::process::cargo(folders);
                // RUSTFLAGS of the environment would replace the linker arguments of .cargo/config.toml.
                command.env_remove("RUSTFLAGS").env_remove("CARGO_ENCODED_RUSTFLAGS");
                command.args([subcommand, "--target", TARGET]);
                command
            }
            Self::Debian => {
                let mut command = foreign(DEBIAN_CARGO, &folders.root);
                command.env("RUSTC", DEBIAN_RUSTC).env("RUSTC_BOOTSTRAP", "1");
                command.env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", "ld.lld");
                command.env("CARGO_TARGET_DIR", self.target_folder(folders));
                command.args([subcommand, "--target", TARGET, "-Zbuild-std=core"]);
                command
            }
        }
    }

    /// Folder in which this toolchain builds. In a common folder two compilers would rebuild everything in turns.
    pub fn target_folder(&self, folders: &Folders) -> PathBuf {
        match self {
            Self::Installed => folders.target.clone(),
            Self::Debian => {
                let mut name = folders.target.as_os_str().to_owned();
                name.push("-debian");
                name.into()
            }
        }
    }

    /// Whether it has clippy.
    pub fn has_clippy(&self) -> bool {
        matches!(self, Self::Installed) && exists("cargo-clippy")
    }
}

/// Finds a toolchain for the firmware and prints which one it is.
pub fn choose(choice: Choice) -> Result<Toolchain> {
    if choice != Choice::Debian {
        if target_installed(TARGET) {
            eprintln!("firmware toolchain: the present one; {TARGET} is installed");
            return Ok(Toolchain::Installed);
        }
        if exists("rustup") {
            let added = run(Command::new("rustup").args(["target", "add", TARGET]));
            if added.is_ok() && target_installed(TARGET) {
                eprintln!("firmware toolchain: the present one; rustup added {TARGET}");
                return Ok(Toolchain::Installed);
            }
            eprintln!("rustup could not add {TARGET}");
        }
        if choice == Choice::Rustup {
            bail!("this toolchain has no {TARGET} and rustup could not add it");
        }
    }
    ensure_debian_pair()?;
    let version = output_of(Command::new(DEBIAN_RUSTC).arg("-V")).unwrap_or_default();
    eprintln!("firmware toolchain: Debian's {version}, which builds core from source");
    Ok(Toolchain::Debian)
}

/// Provides a compiler for the solver in the page of `tsa-lab report`, which the build script of `lab` then uses: the
/// present one with the target that rustup adds, else Debian's. Without one everything but the page works.
pub fn prepare_page_target() {
    if target_installed(PAGE_TARGET) || run(Command::new("rustup").args(["target", "add", PAGE_TARGET])).is_ok() {
        return;
    }
    if let Err(error) = ensure_debian_pair() {
        eprintln!("no compiler for {PAGE_TARGET}, so `tsa-lab report` will be missing: {error:#}");
    }
}

/// The target of the machine that runs this task.
pub fn host() -> Result<String> {
    let told = output_of(Command::new("rustc").arg("-vV")).context("rustc does not start")?;
    let host = told.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("rustc does not name its host")?.to_owned())
}

fn target_installed(target: &str) -> bool {
    // Through rustup's proxy, if there is one, this is the rustc that the cargo of this task uses.
    output_of(Command::new("rustc").args(["--print", "sysroot"]))
        .is_some_and(|sysroot| Path::new(&sysroot).join("lib/rustlib").join(target).join("lib").is_dir())
}

fn debian_pair_is_there() -> bool {
    let sysroot = output_of(foreign(DEBIAN_RUSTC, Path::new("/")).args(["--print", "sysroot"]));
    let has_source =
        sysroot.is_some_and(|s| Path::new(&s).join("lib/rustlib/src/rust/library/core/src/lib.rs").is_file());
    let version = output_of(foreign(DEBIAN_RUSTC, Path::new("/")).arg("-V"));
    let new_enough = version.and_then(|v| minor_version(&v)) >= minor_version(&format!("rustc {OLDEST}.0"));
    has_source && new_enough && exists(DEBIAN_CARGO) && exists("ld.lld")
}

/// `rustc 1.96.0 (…)` -> 96
fn minor_version(line: &str) -> Option<u32> {
    line.strip_prefix("rustc 1.")?.split('.').next()?.parse().ok()
}

fn ensure_debian_pair() -> Result<()> {
    if debian_pair_is_there() {
        return Ok(());
    }
    let elsewhere = format!("Install the target instead: rustup target add {TARGET}");
    system::install(&DEBIAN_PACKAGES, "build for the board and the page without rustup's server", &elsewhere)?;
    if !debian_pair_is_there() {
        bail!("{} are installed, but contain no rustc {OLDEST} or newer with its source", DEBIAN_PACKAGES.join(" "));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::minor_version;

    #[test]
    fn versions() {
        assert_eq!(minor_version("rustc 1.96.0 (ac68faa20 2026-05-25) (built from a source tarball)"), Some(96));
        assert_eq!(minor_version("rustc 1.89.0"), Some(89));
        assert_eq!(minor_version("gcc 12"), None);
        assert!(minor_version("") < minor_version("rustc 1.89.0"), "a missing compiler is too old");
    }
}
