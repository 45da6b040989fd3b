//! Programs that must be installed beside cargo. On Debian and its derivatives they are installed if the user is root;
//! otherwise the error gives the command.

use crate::process::{exists, foreign, output_of, run};
use anyhow::{Context, Result, bail};
use std::path::Path;
use std::process::Command;

/// Installs Debian packages, or fails with the command that installs them.
///
/// `purpose` completes the sentence "… is needed to"; `elsewhere` is the instruction for other systems.
pub fn install(packages: &[&str], purpose: &str, elsewhere: &str) -> Result<()> {
    let list = packages.join(" ");
    let line = format!("apt-get update && apt-get install -y --no-install-recommends {list}");
    if !Path::new("/etc/debian_version").exists() || !exists("apt-get") {
        bail!("{list}: needed to {purpose}, but missing. {elsewhere}");
    }
    if output_of(Command::new("id").arg("-u")).as_deref() != Some("0") {
        bail!("{list}: needed to {purpose}, but missing. Run as root: {line}");
    }
    eprintln!("{list}: needed to {purpose}, but missing; installing");
    let apt = |arguments: &[&str]| {
        run(foreign("apt-get", Path::new("/")).env("DEBIAN_FRONTEND", "noninteractive").args(arguments))
    };
    let install = ["install", "-y", "--no-install-recommends"];
    apt(&["update"])
        .and_then(|()| apt(&[&install, packages].concat()))
        .with_context(|| format!("could not install what is needed to {purpose}; run it by hand: {line}"))
}

/// Installs the packages of `wanted` that are missing; see [`install`]. Each has a flag that tells whether it is
/// present.
pub fn ensure(wanted: &[(bool, &str)], purpose: &str, elsewhere: &str) -> Result<()> {
    let missing: Vec<&str> = wanted.iter().filter(|(there, _)| !there).map(|(_, package)| *package).collect();
    if missing.is_empty() { Ok(()) } else { install(&missing, purpose, elsewhere) }
}

/// Installs what the emulator's C code needs: cmake for unicorn, and libclang for bindgen.
pub fn ensure_emulator_tools() -> Result<()> {
    let wanted = [
        (exists("cmake"), "cmake"),
        (exists("cc") && exists("make"), "build-essential"),
        (has_libclang(), "libclang-dev"),
    ];
    ensure(
        &wanted,
        "build the emulator",
        "Install cmake, a C compiler with make, and libclang with your system's package manager \
         (Fedora: cmake gcc make clang-devel; macOS: the command-line tools and cmake).",
    )
}

/// Whether bindgen can be expected to find libclang. Systems without `ldconfig` have it with their compiler.
fn has_libclang() -> bool {
    let told = std::env::var_os("LIBCLANG_PATH").is_some() || exists("llvm-config");
    let libraries = || output_of(Command::new("/sbin/ldconfig").arg("-p"));
    // libclang-cpp is another library.
    let is_libclang = |line: &str| line.trim().starts_with("libclang") && !line.trim().starts_with("libclang-cpp");
    told || libraries().is_none_or(|list| list.lines().any(is_libclang))
}
