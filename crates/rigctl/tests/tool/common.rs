//! The tool as a user calls it, with the firmware made first if it is not there.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Once;

/// The folder of the project.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the project's folder")
}

/// A path of this name in a folder of the tests' own; names are as different as the tests.
pub fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// The same for a folder, which is empty.
pub fn folder(name: &str) -> PathBuf {
    let folder = file(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// A path in Unicode.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("a name in Unicode")
}

/// An image of `cargo xtask firmware` with these arguments, which is built if it is not there.
fn image(name: &str, arguments: &[&str]) -> PathBuf {
    let own = Path::new(env!("CARGO_BIN_EXE_rigctl"));
    let elf = own.parent().expect("a folder").join("../firmware").join(name);
    if !elf.exists() {
        let build = [&["xtask", "firmware"], arguments].concat();
        let status = Command::new("cargo").args(build).current_dir(root()).status();
        assert!(status.is_ok_and(|s| s.success()), "`cargo xtask firmware` failed");
    }
    elf
}

/// The firmware for a rig with another LVDT and a lower current limit, and its scene.
pub fn other_rig() -> [String; 2] {
    let elf = image("other-rig/tsa-firmware.elf", &["--variant", "other-rig"]);
    let scene = elf.with_file_name("scene.toml");
    [elf, scene].map(|path| path.to_string_lossy().into_owned())
}

/// Runs the tool, for a command that needs no firmware.
pub fn desktop(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rigctl")).args(arguments).current_dir(root()).output().expect("rigctl runs")
}

/// Runs the tool, for a command on the emulated board: with the ideal rig unless the arguments name one, because these tests
/// are about what the tool does and not about the rig.
pub fn rigctl(arguments: &[&str]) -> Output {
    static FIRMWARE: Once = Once::new();
    FIRMWARE.call_once(|| drop(image("tsa-firmware.elf", &[])));
    let named = ["--rig", "--port"].iter().any(|option| arguments.contains(option));
    desktop(&[arguments, if named { &[] } else { &["--rig", "ideal"] }].concat())
}

/// Its standard output, a JSON value a line.
pub fn lines(output: &Output) -> Vec<Value> {
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{line}: {e}"))).collect()
}

/// Its standard error.
pub fn error_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
