//! Compiles the solver of the page that `rigctl report` writes (`web/`) to WebAssembly, which goes into the program.
//!
//! A machine whose compiler lacks the target still gets the tool; `rigctl report` then says what is missing.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

const TARGET: &str = "wasm32-unknown-unknown";
/// Variables that cargo and clippy set for this build, and that would mislead the one below.
const OF_THIS_BUILD: [&str; 5] =
    ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "RUSTC_WRAPPER", "RUSTC_WORKSPACE_WRAPPER", "CARGO_BUILD_TARGET"];

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let solver = match solver(&out) {
        Ok(file) => format!("Ok(include_bytes!({:?}))", file.display().to_string()),
        Err(why) => {
            println!("cargo:warning=`rigctl report` will be missing: {why}");
            format!("Err({why:?})")
        }
    };
    fs::write(out.join("solver.rs"), solver).expect("OUT_DIR can be written");
}

/// The compiled solver.
fn solver(out: &Path) -> Result<PathBuf, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for source in ["web/src", "web/Cargo.toml", "crates/tsa-model/src", "crates/tsa-model/Cargo.toml"] {
        println!("cargo:rerun-if-changed={}", root.join(source).display());
    }
    let rustc = env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let sysroot = Command::new(&rustc).args(["--print", "sysroot"]).output().map_err(|e| format!("{rustc}: {e}"))?;
    let library = Path::new(String::from_utf8_lossy(&sysroot.stdout).trim()).join("lib/rustlib").join(TARGET).join("lib");
    // While it is not there, cargo runs this script at each build.
    println!("cargo:rerun-if-changed={}", library.display());
    if !library.is_dir() {
        return Err(format!("the compiler has no target {TARGET}; `rustup target add {TARGET}` and build again"));
    }
    let mut command = Command::new(env::var("CARGO").unwrap_or_else(|_| "cargo".into()));
    OF_THIS_BUILD.iter().for_each(|name| {
        command.env_remove(name);
    });
    // A folder of its own: cargo has locked the other.
    let folder = out.join("web");
    command.current_dir(&root).args(["build", "--quiet", "--package", "tsa-web", "--profile", "web", "--target", TARGET]);
    let output = command.arg("--target-dir").arg(&folder).output().map_err(|e| format!("cargo does not start: {e}"))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        let first = text.lines().find(|line| line.starts_with("error")).unwrap_or("cargo failed");
        return Err(format!("the solver of the page does not compile for {TARGET}: {first}"));
    }
    Ok(folder.join(TARGET).join("web/tsa_web.wasm"))
}
