//! The Python package: built as a complete wheel, installed in a virtual environment below `target`, its types checked and its
//! tests run; and the wheel alone in an empty environment.

use crate::Folders;
use crate::packages::Packages;
use crate::process::{empty, exists, files_in, foreign, output_of, program, run, step};
use crate::{licences, system};
use anyhow::{Context, Result, ensure};
use fs_err as fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folder of the package.
const PACKAGE: &str = "crates/tsa-python";

/// Where a complete wheel has programs, firmware, scenes and licences: `_places.py` looks there.
const DATA: &str = "python/tsa_rig/data";

/// What the wheel's user reads about the licences.
const LICENCES: &str = "\
The package and all programs but one are under MIT or Apache-2.0, at your choice (LICENSE-MIT, LICENSE-APACHE).

`bin/rig-emulator` is a program of its own, which the package starts. It is under GPL-2.0-only (LICENSE-GPL-2.0), because
it links unicorn. Its source, and that of everything that it links, is in `source/` of the release archive of the same
version, which also has this wheel in `python/`.

THIRD-PARTY.txt names the parts by others and their licences.
";

/// Homes and moves an emulated rig, with nothing but the wheel.
const TRIAL: &str = "\
import tsa_rig
with tsa_rig.Rig('sim', plant={'load': '0.5kg'}) as rig:
    rig.home()
    moved = rig.move(0.008)
assert abs(moved['error_m']) < 2e-4, moved
assert not tsa_rig.Bench(seeds=[1, 2]).home()['error'].any()
assert tsa_rig.published('scenes/default.toml') and tsa_rig.budget('scenes/default.toml')
solved = tsa_rig.Scene.load('scenes/default.toml').mechanism().solve(5.0, 3.0)
print(f\"{tsa_rig.__version__}: moved to {1e3 * moved['position_m']:.3f} mm, contraction {1e3 * solved.contraction_m:.3f} mm\")
";

/// The interpreter of the virtual environment, which is made if it is not there.
fn interpreter(folders: &Folders) -> Result<PathBuf> {
    environment(folders, "python")
}

fn environment(folders: &Folders, name: &str) -> Result<PathBuf> {
    let environment = folders.target.join(name);
    let python = environment.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    if python.exists() {
        return Ok(python);
    }
    let can = |module: &str| output_of(Command::new("python3").args(["-c", &format!("import {module}")])).is_some();
    system::ensure(
        &[(exists("python3"), "python3"), (can("ensurepip"), "python3-venv")],
        "test the Python package",
        "Install Python 3.10 or newer with venv and pip.",
    )?;
    run(foreign("python3", &folders.root).args(["-m", "venv"]).arg(&environment))?;
    ensure!(python.exists(), "{} is not there after `python3 -m venv`", python.display());
    Ok(python)
}

/// Installs packages into the virtual environment. Returns what makes a command of its interpreter, run in a folder.
pub fn with(folders: &Folders, packages: &[&str]) -> Result<impl Fn(&Path) -> Command + use<>> {
    let python = interpreter(folders)?.to_string_lossy().into_owned();
    let python = move |folder: &Path| foreign(&python, folder);
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    run(python(&folders.root).args(install).args(packages))?;
    Ok(python)
}

/// What a complete wheel carries besides the package. It is removed in the end: a build without it is not complete.
struct Data(PathBuf);

impl Data {
    /// Tools, emulator and firmware, which must be built, scenes and licences.
    fn fill(folders: &Folders) -> Result<Self> {
        let data = Self(folders.root.join(PACKAGE).join(DATA));
        empty(&data.0)?;
        let release = folders.target.join("release");
        let mut files = vec![
            (release.join(program("rigctl")), "bin"),
            (release.join(program("tsa-lab")), "bin"),
            (release.join(program("rig-emulator")), "bin"),
            (folders.target.join("firmware/tsa-firmware.elf"), "firmware"),
            (folders.root.join("LICENSE-MIT"), "licences"),
            (folders.root.join("LICENSE-APACHE"), "licences"),
            (folders.root.join("emulator/LICENSE-GPL-2.0"), "licences"),
        ];
        files.extend(files_in(&folders.root.join("scenes"))?.into_iter().map(|scene| (scene, "scenes")));
        for (from, to) in files {
            fs::create_dir_all(data.0.join(to))?;
            fs::copy(&from, data.0.join(to).join(from.file_name().context("a file has no name")?))?;
        }
        let licences = data.0.join("licences");
        fs::write(licences.join("README.md"), LICENCES)?;
        fs::write(licences.join("THIRD-PARTY.txt"), licences::third_party(&Packages::find(folders)?)?)?;
        Ok(data)
    }

    /// The oldest version of glibc that has all symbols which the programs need, as the end of a wheel's tag, where that is known.
    fn glibc(&self) -> Result<Option<String>> {
        if !cfg!(all(target_os = "linux", target_env = "gnu")) {
            return Ok(None);
        }
        let mut newest = None;
        for name in ["rigctl", "tsa-lab", "rig-emulator"] {
            newest = newest.max(glibc_of(&fs::read(self.0.join("bin").join(name))?));
        }
        Ok(newest.map(|minor| format!("2_{minor}")))
    }
}

impl Drop for Data {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The largest n of the symbol versions GLIBC_2.n that a program names.
fn glibc_of(program: &[u8]) -> Option<u32> {
    const VERSION: &[u8] = b"GLIBC_2.";
    let begins = program.windows(VERSION.len()).enumerate().filter(|(_, bytes)| *bytes == VERSION);
    let minor = |(at, _): (usize, &[u8])| {
        let rest = &program[at + VERSION.len()..];
        let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).take(3);
        digits.fold(None, |n: Option<u32>, digit| Some(10 * n.unwrap_or(0) + u32::from(digit - b'0')))
    };
    begins.filter_map(minor).max()
}

/// Builds the package as a complete wheel in a folder, which is empty before: with the tools, the emulator and the firmware, which
/// must be built, and the scenes. On Linux its tag names the glibc that the programs need.
pub fn wheel(folders: &Folders, into: &Path) -> Result<()> {
    let python = interpreter(folders)?;
    let data = Data::fill(folders)?;
    let mut build = foreign(&python.to_string_lossy(), &folders.root.join(PACKAGE));
    build.env("CARGO_TARGET_DIR", &folders.target);
    if let Some(glibc) = data.glibc()? {
        build.env("MATURIN_PEP517_ARGS", format!("--compatibility manylinux_{glibc}"));
    }
    run(build
        .args(["-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps", "--wheel-dir"])
        .arg(into)
        .arg("."))
}

/// Homes and moves an emulated rig with nothing but a wheel: in an environment of its own, and in an empty folder away from the
/// checkout.
fn alone(folders: &Folders, wheel: &Path) -> Result<()> {
    let own = "python-alone";
    empty(&folders.target.join(own))?;
    let python = environment(folders, own)?;
    let nowhere = std::env::temp_dir().join(format!("tsa-rig-{}", std::process::id()));
    empty(&nowhere)?;
    let python = || foreign(&python.to_string_lossy(), &nowhere);
    run(python().args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).arg(wheel))?;
    run(python().args(["-I", "-c", TRIAL]))?;
    fs::remove_dir_all(&nowhere)?;
    Ok(fs::remove_dir_all(folders.target.join(own))?)
}

/// Builds the complete wheel for its tests. Tools and firmware must be built.
pub fn wheel_to_test(folders: &Folders) -> Result<PathBuf> {
    let wheels = folders.target.join("python-wheel");
    empty(&wheels)?;
    wheel(folders, &wheels)?;
    let wheel = files_in(&wheels)?.pop().context("there is no wheel")?;
    println!("{} ({} kB)", wheel.display(), fs::metadata(&wheel)?.len() / 1000);
    Ok(wheel)
}

/// Tries the wheel alone; installs it with what its tests need, checks its types and its style, and runs its tests.
pub fn test(folders: &Folders, wheel: &Path) -> Result<()> {
    step("wheel of the Python package, alone in an empty environment");
    alone(folders, wheel)?;

    let python = interpreter(folders)?;
    let python = python.to_string_lossy();
    let python = || foreign(&python, &folders.root.join(PACKAGE));
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    run(python().args(install).arg(format!("{}[test]", wheel.display())))?;
    // One of the same version may be there.
    run(python().args(install).args(["--force-reinstall", "--no-deps"]).arg(wheel))?;
    run(python().args(["-m", "mypy", "--cache-dir"]).arg(folders.target.join("mypy")).args(["python", "tests"]))?;
    run(python().args(["-m", "ruff", "check", "--quiet", "--no-cache", "."]))?;
    let programs = folders.target.join("release");
    run(python().env("PYTHONDONTWRITEBYTECODE", "1").env("TSA_PROGRAMS", programs).args([
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "tests",
    ]))
}

#[cfg(test)]
mod tests {
    use super::glibc_of;

    #[test]
    fn the_newest_symbol_of_a_program_is_found() {
        assert_eq!(glibc_of(b"\0GLIBC_2.2.5\0GLIBC_2.34\0GLIBC_2.9\0"), Some(34));
        assert_eq!(glibc_of(b"GLIBC_2."), None);
        assert_eq!(glibc_of(b"MUSL_1.2"), None);
    }
}
