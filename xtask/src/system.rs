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

/// Whether bindgen finds libclang: where `LIBCLANG_PATH` says, among the linker's libraries, or in the folder that `llvm-config`
/// names, which may be installed without it. Systems without `ldconfig` have it with their compiler.
fn has_libclang() -> bool {
    if std::env::var_os("LIBCLANG_PATH").is_some() {
        return true;
    }
    let of_llvm = || {
        let folder = output_of(Command::new("llvm-config").arg("--libdir"))?;
        let files = std::fs::read_dir(folder.trim()).ok()?;
        Some(files.flatten().any(|file| is_libclang(&file.file_name().to_string_lossy())))
    };
    let libraries = output_of(Command::new("/sbin/ldconfig").arg("-p"));
    libraries.is_none_or(|list| list.lines().any(is_libclang)) || of_llvm().unwrap_or(false)
}

/// Whether a line of `ldconfig -p` or the name of a file is that of libclang. libclang-cpp is another library.
fn is_libclang(line: &str) -> bool {
    let name = line.trim().split(' ').next().unwrap_or_default();
    name.starts_with("libclang") && name.contains(".so") && !name.starts_with("libclang-cpp")
}

#[cfg(test)]
mod tests {
    use super::is_libclang;

    #[test]
    fn libclang_is_not_mistaken_for_its_neighbours() {
        for (line, is) in [
            ("\tlibclang-14.so.1 (libc6,x86-64) => /lib/x86_64-linux-gnu/libclang-14.so.1", true),
            ("libclang.so.1", true),
            ("\tlibclang-cpp.so.14 (libc6,x86-64) => /lib/x86_64-linux-gnu/libclang-cpp.so.14", false),
            ("libclang_rt.builtins.a", false),
            ("\tlibLLVM-14.so.1 (libc6,x86-64) => /lib/x86_64-linux-gnu/libLLVM-14.so.1", false),
        ] {
            assert_eq!(is_libclang(line), is, "{line}");
        }
    }
}
