//! The release archive: tools, firmware, Python package, page, documents, sources and licences, with checksums.
//! `docs/how-to/release.md` says what is in it for whom.

use crate::packages::Packages;
use crate::process::{empty, files_in, foreign, output_of, program, run, shown};
use crate::{Folders, host, licences, python, toolchain};
use anyhow::{Context, Result, ensure};
use cargo_metadata::Package;
use fs_err as fs;
use object::{Object, ObjectSymbol, SymbolKind};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Version of the workspace.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Folder of the archives below the target folder.
const ARCHIVES: &str = "release-archive";

/// Files and folders of the repository that the archive contains as they are.
const DOCUMENTS: [&str; 8] =
    ["CHANGELOG.md", "CITATION.cff", "LICENSE-APACHE", "LICENSE-MIT", "README.md", "docs", "scenarios", "scenes"];

/// Where the page of `tsa-lab report` is in the archive.
const PAGE: &str = "docs/report.html";

/// Writes the checksum of every other file.
const WRITE_SUMS: &str = "find * -type f -exec $sum {} + | sort -k 2 > ../SHA256SUMS; mv ../SHA256SUMS .";

/// Builds the archive, unpacks it again, and tries what is in it.
pub fn make(folders: &Folders) -> Result<()> {
    let commit = commit(folders)?;
    let packages = Packages::find(folders)?;
    licences::check(folders, &packages)?;
    host::tools_and_firmware(folders)?;
    let name = format!("tsa-rig-{VERSION}-{}", toolchain::host()?);
    let archives = folders.target.join(ARCHIVES);
    let stage = archives.join(&name);
    empty(&stage)?;
    fill(folders, &packages, &stage, &commit)?;
    ensure!(
        self::commit(folders)? == commit,
        "the repository has changed meanwhile: the archive would be of two commits"
    );
    sum(&stage, WRITE_SUMS)?;
    let archive = archives.join(format!("{name}.tar.gz"));
    run_tar(&archives, &["-czf".as_ref(), archive.as_ref(), name.as_ref()])?;
    sum(&archives, &format!("$sum {name}.tar.gz | tee {name}.tar.gz.sha256"))?;
    let unpacked = archives.join("unpacked");
    empty(&unpacked)?;
    run_tar(&unpacked, &["-xzf".as_ref(), archive.as_ref()])?;
    check(folders, &unpacked.join(&name), &commit)?;
    fs::remove_dir_all(&unpacked)?;
    fs::remove_dir_all(&stage)?;
    println!("release archive: {} ({} kB)", archive.display(), fs::metadata(&archive)?.len() / 1000);
    Ok(())
}

/// The commit that is checked out, if nothing is changed.
fn commit(folders: &Folders) -> Result<String> {
    let git = |words: &[&str]| output_of(foreign("git", &folders.root).args(words)).context("git does not work here");
    let changed = git(&["status", "--porcelain"])?;
    ensure!(changed.is_empty(), "the archive contains the source of a commit: commit these changes first:\n{changed}");
    git(&["rev-parse", "HEAD"])
}

/// Puts everything but the checksums into the folder.
fn fill(folders: &Folders, packages: &Packages, stage: &Path, commit: &str) -> Result<()> {
    let documents = stage.join("documents.tar");
    let git = |rest: &[&str], out: &Path| {
        run(foreign("git", &folders.root).args(["archive", "--output"]).arg(out).args(rest))
    };
    git(&[&[commit], &DOCUMENTS[..]].concat(), &documents)?;
    run_tar(stage, &["-xf".as_ref(), documents.as_ref()])?;
    fs::remove_file(&documents)?;

    let built = |name: &str| folders.target.join("release").join(program(name));
    let emulator = built("rig-emulator");
    without_unused_code(&emulator)?;
    let licence = folders.root.join("emulator/LICENSE-GPL-2.0");
    let firmware = folders.target.join("firmware/tsa-firmware.elf");
    for (from, to) in [
        (built("rigctl"), "bin"),
        (built("tsa-lab"), "bin"),
        (emulator, "bin"),
        (licence, "bin"),
        (firmware.with_extension("bin"), "firmware"),
        (firmware, "firmware"),
    ] {
        fs::create_dir_all(stage.join(to))?;
        fs::copy(&from, stage.join(to).join(from.file_name().context("a file has no name")?))?;
    }
    python::wheel(folders, &stage.join("python"))?;
    run(in_archive(stage, "tsa-lab").args(["report", "--charts", "docs/charts", "--out", PAGE]))?;
    fs::remove_file(stage.join(format!("{PAGE}~")))?;

    fs::write(stage.join("THIRD-PARTY.txt"), licences::third_party(packages)?)?;
    let sources = stage.join("source");
    fs::create_dir_all(&sources)?;
    let own = sources.join(format!("tsa-rig-{VERSION}.tar.gz"));
    git(&["--prefix", &format!("tsa-rig-{VERSION}/"), commit], &own)?;
    source_of(&packages.linked(licences::EMULATOR)?, &sources.join("rig-emulator-links.tar.gz"))
}

/// Packs the sources of packages of other authors: the licence of the emulator asks for those of everything that it links.
fn source_of(packages: &[&Package], archive: &Path) -> Result<()> {
    let mut tar: Vec<PathBuf> = vec!["-czf".into(), archive.into()];
    for package in packages.iter().filter(|package| package.source.is_some()) {
        let folder = package.manifest_path.parent().context("a manifest has no folder")?;
        let registry = folder.parent().context("a package has no folder")?;
        tar.extend(["-C".into(), registry.into(), folder.file_name().unwrap_or_default().into()]);
    }
    run_tar(Path::new("."), &tar.iter().map(PathBuf::as_path).collect::<Vec<_>>())
}

/// Fails if code of [`licences::UNUSED`] is in a program.
fn without_unused_code(program: &Path) -> Result<()> {
    let bytes = fs::read(program)?;
    let file = object::File::parse(&*bytes).with_context(|| format!("{}", program.display()))?;
    // Functions only: the names of its source files stay in the program.
    let functions = file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text);
    let names: Vec<&str> = functions.filter_map(|symbol| symbol.name().ok()).collect();
    ensure!(names.iter().any(|name| name.contains("defmt_decoder")), "{} has no symbols", program.display());
    let unwanted = names.iter().find(|name| name.contains(licences::UNUSED));
    ensure!(unwanted.is_none(), "{} contains {}, see xtask/src/licences.rs", program.display(), licences::UNUSED);
    Ok(())
}

/// Compares every checksum, and starts the programs of an unpacked archive.
fn check(folders: &Folders, unpacked: &Path, commit: &str) -> Result<()> {
    sum(unpacked, "$sum --check --quiet SHA256SUMS")?;

    let said = |command: &mut Command| -> Result<String> {
        output_of(command).with_context(|| format!("failed in the unpacked archive: {}", shown(command)))
    };
    for name in ["rigctl", "rig-emulator", "tsa-lab"] {
        let version = said(in_archive(unpacked, name).arg("--version"))?;
        ensure!(version.contains(VERSION), "{name} of the archive says that it is {version}, not {VERSION}");
    }
    let json = ["--json", "solve", "--load", "5N", "--turns", "3"];
    let solved = said(in_archive(unpacked, "rigctl").args(json))?;
    let solved: serde_json::Value = serde_json::from_str(&solved).with_context(|| format!("`solve` says {solved}"))?;
    let page = unpacked.join("page.html");
    said(in_archive(unpacked, "tsa-lab").args(["report", "--charts", "docs/charts", "--out"]).arg(&page))?;
    ensure!(
        fs::read(unpacked.join(PAGE))? == fs::read(&page)?,
        "`tsa-lab report` of the archive does not write the archive's page"
    );
    // Tool, emulator and firmware find and understand each other, and the firmware is built from this commit as it is.
    let status = said(in_archive(unpacked, "rigctl").arg("status"))?;
    let firmware = status.lines().find(|line| line.starts_with("firmware")).unwrap_or_default();
    let built_from = commit.get(..10).is_some_and(|commit| firmware.contains(commit)) && !firmware.contains("-dirty");
    ensure!(
        built_from,
        "the firmware is not of commit {commit} (change the time of build.rs to build it again): {firmware}"
    );

    let python = python::with(folders, &["numpy>=1.24"])?;
    let package = unpacked.join("package");
    let wheels = files_in(&unpacked.join("python"))?;
    ensure!(wheels.len() == 1, "the archive has these Python packages instead of one: {wheels:?}");
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", "--target"];
    run(python(unpacked).args(install).arg(&package).args(wheels))?;
    let script = "import tsa_rig; scene = tsa_rig.Scene.load('scenes/default.toml'); \
                  print(float(scene.mechanism().solve(5.0, 3.0).contraction_m))";
    let contraction_m: f64 = said(python(unpacked).env("PYTHONPATH", &package).args(["-c", script]))?.parse()?;
    let by_tool = solved["contraction_m"].as_f64().context("`solve` states no contraction")?;
    ensure!(contraction_m == by_tool, "the package solves {contraction_m} m, the tool {by_tool} m");
    println!("unpacked and tried: checksums, rigctl, rig-emulator with the firmware, page, Python package");
    Ok(())
}

/// A program of the archive, started in the archive's folder.
fn in_archive(folder: &Path, name: &str) -> Command {
    foreign(&folder.join("bin").join(program(name)).to_string_lossy(), folder)
}

/// Runs a line of shell in which `$sum` is the program that makes and checks SHA-256 sums on this system.
fn sum(folder: &Path, line: &str) -> Result<()> {
    let line = format!("sum=sha256sum; command -v $sum > /dev/null || sum='shasum -a 256'; {line}");
    run(foreign("sh", folder).args(["-e", "-c", &line]))
}

/// Tar of the system: Linux, macOS and Windows have one.
fn run_tar(folder: &Path, arguments: &[&Path]) -> Result<()> {
    run(foreign("tar", folder).args(arguments))
}

#[cfg(test)]
mod tests {
    /// `cff-version` 1.2.0 (<https://github.com/citation-file-format/citation-file-format>) has these required keys.
    #[test]
    fn the_citation_file_is_of_this_version() {
        let file = include_str!("../../CITATION.cff");
        let value = |key: &str| {
            let line = file.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(':'));
            line.map(|value| value.trim().trim_matches('"')).unwrap_or_else(|| panic!("no {key}"))
        };
        assert_eq!(value("cff-version"), "1.2.0");
        assert_eq!(value("version"), super::VERSION);
        assert!(!value("message").is_empty() && !value("title").is_empty());
        assert!(file.contains("\nauthors:\n  - "));
    }
}
