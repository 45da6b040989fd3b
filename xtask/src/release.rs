//! The release archive: tools, firmware, Python package, page, documents, sources and licences, with checksums.
//! `docs/release.md` says what is in it for whom.

use crate::packages::{Package, Packages};
use crate::process::{foreign, output_of, run, shown};
use crate::{Folders, host, licences, python, third_party, toolchain};
use anyhow::{Context, Result, bail, ensure};
use object::{Object, ObjectSymbol, SymbolKind};
use sha2::{Digest, Sha256};
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

/// Name of the file with the checksums.
const SUMS: &str = "SHA256SUMS";

/// The programs in the archive by their packages, and the names that `THIRD-PARTY.txt` gives them.
const PROGRAMS: [(&str, &str); 6] = [
    ("rigctl", "rigctl"),
    ("lab", "tsa-lab"),
    ("tsa-web", "docs/report.html"),
    (licences::EMULATOR, "rig-emulator"),
    ("tsa-firmware", "the firmware"),
    ("tsa-python", "the Python package"),
];

/// Builds the archive, unpacks it again, and tries what is in it.
pub fn make(folders: &Folders) -> Result<()> {
    let commit = commit(folders)?;
    licences::check(folders)?;
    host::tools_and_firmware(folders)?;
    let name = format!("tsa-rig-{VERSION}-{}", toolchain::host()?);
    let archives = folders.target.join(ARCHIVES);
    let stage = archives.join(&name);
    empty(&stage)?;
    fill(folders, &stage, &commit)?;
    ensure!(
        self::commit(folders)? == commit,
        "the repository has changed meanwhile: the archive would be of two commits"
    );
    write(&stage.join(SUMS), &sums(&stage)?)?;
    let archive = archives.join(format!("{name}.tar.gz"));
    run_tar(&archives, &["-czf".as_ref(), archive.as_ref(), name.as_ref()])?;
    let sum = sum_of(&archive)?;
    write(&archives.join(format!("{name}.tar.gz.sha256")), &format!("{sum}  {name}.tar.gz\n"))?;
    let unpacked = archives.join("unpacked");
    empty(&unpacked)?;
    run_tar(&unpacked, &["-xzf".as_ref(), archive.as_ref()])?;
    check(folders, &unpacked.join(&name), &commit)?;
    for folder in [&unpacked, &stage] {
        std::fs::remove_dir_all(folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    println!("release archive: {} ({} kB), sha256 {sum}", archive.display(), std::fs::metadata(&archive)?.len() / 1000);
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
fn fill(folders: &Folders, stage: &Path, commit: &str) -> Result<()> {
    let documents = stage.join("documents.tar");
    let git = |rest: &[&str], out: &Path| {
        run(foreign("git", &folders.root).args(["archive", "--output"]).arg(out).args(rest))
    };
    git(&[&[commit], &DOCUMENTS[..]].concat(), &documents)?;
    run_tar(stage, &["-xf".as_ref(), documents.as_ref()])?;
    std::fs::remove_file(&documents)?;

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
        copy(&from, &stage.join(to))?;
    }
    python::wheel(folders, &stage.join("python"))?;
    run(in_archive(stage, "tsa-lab").args(["report", "--charts", "docs/charts", "--out", PAGE]))?;
    let previous = stage.join(format!("{PAGE}~"));
    std::fs::remove_file(&previous).with_context(|| format!("no {}", previous.display()))?;

    let packages = Packages::find(folders)?;
    write(&stage.join("THIRD-PARTY.txt"), &third_party::list(&packages, &PROGRAMS)?)?;
    let sources = stage.join("source");
    std::fs::create_dir_all(&sources)?;
    let own = sources.join(format!("tsa-rig-{VERSION}.tar.gz"));
    git(&["--prefix", &format!("tsa-rig-{VERSION}/"), commit], &own)?;
    source_of(&packages.linked(licences::EMULATOR)?, &sources.join("rig-emulator-links.tar.gz"))
}

/// Packs the sources of packages of other authors: the licence of the emulator asks for those of everything that it links.
fn source_of(packages: &[&Package], archive: &Path) -> Result<()> {
    let mut tar: Vec<PathBuf> = vec!["-czf".into(), archive.into()];
    for package in packages.iter().filter(|package| package.source.is_some()) {
        let folder = package.manifest_path.parent().context("a manifest has no folder")?;
        let [registry, name] = [folder.parent().map(Path::as_os_str), folder.file_name()]
            .map(|part| part.map(PathBuf::from).context("a package has no folder"));
        tar.extend(["-C".into(), registry?, name?]);
    }
    run_tar(Path::new("."), &tar.iter().map(PathBuf::as_path).collect::<Vec<_>>())
}

/// Fails if code of [`licences::UNUSED`] is in a program.
fn without_unused_code(program: &Path) -> Result<()> {
    let bytes = std::fs::read(program).with_context(|| format!("cannot read {}", program.display()))?;
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
    let stated = std::fs::read_to_string(unpacked.join(SUMS)).context("the checksums")?;
    ensure!(stated == sums(unpacked)?, "the files of the unpacked archive do not have the checksums that it states");

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
    let [stated, again] = [&unpacked.join(PAGE), &page].map(|file| std::fs::read(file).context("the page"));
    ensure!(stated? == again?, "`tsa-lab report` of the archive does not write the archive's page");
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
    let wheel = only_file(&unpacked.join("python"))?;
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", "--target"];
    run(python(unpacked).args(install).arg(&package).arg(wheel))?;
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

fn program(name: &str) -> String {
    format!("{name}{}", std::env::consts::EXE_SUFFIX)
}

/// Lines of checksum and path, as `sha256sum --check` reads them, for every file but the one with the checksums.
fn sums(folder: &Path) -> Result<String> {
    let mut files = Vec::new();
    files_in(folder, &mut files)?;
    let mut lines = Vec::new();
    for file in files {
        let inside = file.strip_prefix(folder)?.to_string_lossy().replace('\\', "/");
        if inside != SUMS {
            lines.push((inside, sum_of(&file)?));
        }
    }
    lines.sort();
    Ok(lines.iter().map(|(file, sum)| format!("{sum}  {file}\n")).collect())
}

fn files_in(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        if path.is_dir() { files_in(&path, files)? } else { files.push(path) }
    }
    Ok(())
}

fn only_file(folder: &Path) -> Result<PathBuf> {
    let mut files = Vec::new();
    files_in(folder, &mut files)?;
    match files.as_slice() {
        [file] => Ok(file.clone()),
        _ => bail!("{} has {} files instead of one", folder.display(), files.len()),
    }
}

/// SHA-256 in hexadecimal digits.
fn sum_of(file: &Path) -> Result<String> {
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    Ok(Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Tar of the system: Linux, macOS and Windows have one.
fn run_tar(folder: &Path, arguments: &[&Path]) -> Result<()> {
    run(foreign("tar", folder).args(arguments))
}

fn empty(folder: &Path) -> Result<()> {
    if folder.exists() {
        std::fs::remove_dir_all(folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))
}

fn copy(file: &Path, into: &Path) -> Result<()> {
    std::fs::create_dir_all(into).with_context(|| format!("cannot make {}", into.display()))?;
    let to = into.join(file.file_name().context("a file has no name")?);
    std::fs::copy(file, &to).with_context(|| format!("cannot copy {} to {}", file.display(), to.display()))?;
    Ok(())
}

fn write(file: &Path, text: &str) -> Result<()> {
    std::fs::write(file, text).with_context(|| format!("cannot write {}", file.display()))
}

#[cfg(test)]
mod tests {
    use super::{SUMS, sums, write};

    #[test]
    fn checksums_are_those_of_the_standard_and_follow_every_file() {
        let folder = std::env::temp_dir().join(format!("xtask-sums-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("bin")).unwrap();
        write(&folder.join("bin/b"), "abc").unwrap();
        write(&folder.join("a"), "").unwrap();
        // FIPS 180-2, B.1, and the sum of no bytes.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let nothing = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
        let expected = format!("{nothing}  a\n{abc}  bin/b\n");
        assert_eq!(sums(&folder).unwrap(), expected);
        write(&folder.join(SUMS), &expected).unwrap();
        assert_eq!(sums(&folder).unwrap(), expected, "without itself");
        write(&folder.join("bin/b"), "abd").unwrap();
        assert_ne!(sums(&folder).unwrap(), expected);
        std::fs::remove_dir_all(&folder).unwrap();
    }

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
