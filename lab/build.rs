//! Compiles the solver of the page that `tsa-lab report` writes (`web/`) to WebAssembly, which goes into the program.
//!
//! The compiler of this build does it if it has the target; else Debian's, which builds `core` from source, as for the
//! board (xtask/src/toolchain.rs). A machine with neither still gets the tool; `tsa-lab report` then says what is missing.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

const TARGET: &str = "wasm32-unknown-unknown";
/// Variables that cargo and clippy set for this build, and that would mislead the one below.
const OF_THIS_BUILD: [&str; 5] =
    ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "RUSTC_WRAPPER", "RUSTC_WORKSPACE_WRAPPER", "CARGO_BUILD_TARGET"];
/// Debian's packages rustc-web and cargo-web; rust-web-src has the source.
const DEBIAN: [&str; 2] = ["/usr/bin/cargo", "/usr/bin/rustc"];

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let solver = match solver(&out) {
        Ok(file) => format!("Ok(include_bytes!({:?}))", file.display().to_string()),
        Err(why) => {
            println!("cargo:warning=`tsa-lab report` will be missing: {why}");
            format!("Err({why:?})")
        }
    };
    fs::write(out.join("solver.rs"), solver).expect("OUT_DIR can be written");
}

/// The compiled solver.
fn solver(out: &Path) -> Result<PathBuf, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for source in ["lab/web/src", "lab/web/Cargo.toml", "crates/tsa-model/src", "crates/tsa-model/Cargo.toml"] {
        println!("cargo:rerun-if-changed={}", root.join(source).display());
    }
    // A folder of its own: cargo has locked the other.
    let folder = out.join("web");
    let mut command = compiler()?;
    OF_THIS_BUILD.iter().for_each(|name| {
        command.env_remove(name);
    });
    command.current_dir(&root).args(["--quiet", "--package", "tsa-web", "--profile", "web", "--target", TARGET]);
    let output = command.arg("--target-dir").arg(&folder).output().map_err(|e| format!("cargo does not start: {e}"))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        let first = text.lines().find(|line| line.starts_with("error")).unwrap_or("cargo failed");
        return Err(format!("the solver of the page does not compile for {TARGET}: {first}"));
    }
    Ok(folder.join(TARGET).join("web/tsa_web.wasm"))
}

/// The command that builds for the target.
fn compiler() -> Result<Command, String> {
    let present = env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let missing = format!("the compiler has no target {TARGET}; run `rustup target add {TARGET}` and build again");
    let library = self::library(&present).ok_or_else(|| missing.clone())?.join(TARGET).join("lib");
    // While it is not there, cargo runs this script at each build.
    println!("cargo:rerun-if-changed={}", library.display());
    if library.is_dir() {
        let mut command = Command::new(env::var("CARGO").unwrap_or_else(|_| "cargo".into()));
        command.arg("build");
        return Ok(command);
    }
    let [cargo, rustc] = DEBIAN;
    let source = self::library(rustc).map(|library| library.join("src/rust/library/core/src/lib.rs"));
    if !source.is_some_and(|source| source.is_file()) || !Path::new(cargo).exists() {
        return Err(missing);
    }
    let mut command = Command::new(cargo);
    command
        .env_remove("RUSTUP_TOOLCHAIN")
        .env_remove("LD_LIBRARY_PATH")
        .env("RUSTC", rustc)
        .env("RUSTC_BOOTSTRAP", "1");
    command.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", "wasm-ld").args(["build", "-Zbuild-std=core"]);
    Ok(command)
}

/// Folder of a compiler's libraries, if it can be started.
fn library(rustc: &str) -> Option<PathBuf> {
    let output = Command::new(rustc).args(["--print", "sysroot"]).output().ok().filter(|o| o.status.success())?;
    Some(Path::new(String::from_utf8_lossy(&output.stdout).trim()).join("lib/rustlib"))
}
