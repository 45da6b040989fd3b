//! What has to stand beside cargo. On Debian and its kin, as root, it is installed; elsewhere we say the one line.

use crate::process::{exists, foreign, output_of, run};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Installs Debian packages, or says how to.
///
/// `purpose` ends the sentence "… is needed to"; `elsewhere` is what to do on another system.
pub fn install(packages: &[&str], purpose: &str, elsewhere: &str) -> Result<()> {
    let list = packages.join(" ");
    let line = format!("apt-get update && apt-get install -y --no-install-recommends {list}");
    if !Path::new("/etc/debian_version").exists() || !exists("apt-get") {
        bail!("{list}: needed to {purpose}, and missing. {elsewhere}");
    }
    if output_of(Command::new("id").arg("-u")).as_deref() != Some("0") {
        bail!("{list}: needed to {purpose}, and missing. Run as root: {line}");
    }
    eprintln!("{list}: needed to {purpose}, and missing; installing");
    let apt = |arguments: &[&str]| {
        run(foreign("apt-get", Path::new("/")).env("DEBIAN_FRONTEND", "noninteractive").args(arguments))
    };
    let install = ["install", "-y", "--no-install-recommends"];
    apt(&["update"])
        .and_then(|()| apt(&[&install, packages].concat()))
        .with_context(|| format!("could not install what is needed to {purpose}. By hand: {line}"))
}

/// Installs the packages among `wanted` that are not there, or says how to: see [`install`].
pub fn ensure(wanted: &[(bool, &str)], purpose: &str, elsewhere: &str) -> Result<()> {
    let missing: Vec<&str> = wanted.iter().filter(|(there, _)| !there).map(|(_, package)| *package).collect();
    if missing.is_empty() { Ok(()) } else { install(&missing, purpose, elsewhere) }
}

/// Makes sure that the emulator's C code can be built: unicorn needs cmake, and bindgen needs libclang.
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

/// Looks where bindgen looks.
fn has_libclang() -> bool {
    if std::env::var_os("LIBCLANG_PATH").is_some() {
        return true;
    }
    let mut folders: Vec<PathBuf> = ["/usr/lib", "/usr/lib64", "/usr/local/lib", "/opt/homebrew/opt/llvm/lib"]
        .into_iter()
        .chain(["/Library/Developer/CommandLineTools/usr/lib"])
        .map(PathBuf::from)
        .collect();
    folders.extend(output_of(Command::new("llvm-config").arg("--libdir")).map(PathBuf::from));
    // Debian keeps it in /usr/lib/llvm-*/lib and in /usr/lib/<triple>.
    for inside in entries(Path::new("/usr/lib")) {
        folders.push(inside.join("lib"));
        folders.push(inside);
    }
    folders.iter().flat_map(|folder| entries(folder)).any(|file| {
        let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        // Not libclang-cpp, which is another library.
        name.starts_with("libclang")
            && !name.starts_with("libclang-cpp")
            && (name.contains(".so") || name.ends_with(".dylib"))
    })
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder).map(|dir| dir.flatten().map(|e| e.path()).collect()).unwrap_or_default()
}
