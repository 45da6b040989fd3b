//! Every command of the README and of `docs/`: run on the emulated board where it can be, read by the tool's own parser
//! where it needs a real one or minutes.

use clap::Parser;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Commands that only have to be understood here: they have tests of their own, and take minutes, a terminal or
/// an interrupt.
const LONG: [&str; 7] = ["chart", "report", "demo", "monitor", "study", "play", "serve"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap()
}

/// Lines of the fenced shell blocks, without their comments.
fn commands(page: &str) -> Vec<String> {
    let mut inside = false;
    let mut found = Vec::new();
    // A command may go on in the next line.
    let page = page.replace(" \\\n", " ");
    for line in page.lines() {
        match line.trim() {
            "```sh" => inside = true,
            "```" => inside = false,
            line if inside => found.push(line.split(" #").next().unwrap_or_default().trim().to_owned()),
            _ => {}
        }
    }
    found.retain(|line| !line.is_empty() && !line.starts_with('#'));
    found
}

fn pages() -> Vec<PathBuf> {
    let mut pages = vec![root().join("README.md")];
    for folder in ["", "tutorial", "how-to", "reference", "explanation"] {
        for entry in std::fs::read_dir(root().join("docs").join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "md") {
                pages.push(path);
            }
        }
    }
    pages.extend(["emulator/own-program.md", "emulator/debugger.md", "lab/paper.md"].map(|page| root().join(page)));
    pages.sort();
    pages
}

#[test]
fn every_command_of_the_pages_works() {
    let tasks = std::fs::read_to_string(root().join("xtask/src/main.rs")).unwrap().to_lowercase();
    // The commands of a page in their order, the pages beside each other.
    std::thread::scope(|scope| {
        for page in pages() {
            let tasks = &tasks;
            scope.spawn(move || works(&page, tasks));
        }
    });
}

fn works(page: &Path, tasks: &str) {
    let name = page.strip_prefix(root()).unwrap().display().to_string();
    // What one command writes the next may read; nothing lands in the project.
    let folder = std::env::temp_dir().join(format!("rigctl-pages-{}-{}", std::process::id(), name.replace('/', "-")));
    std::fs::create_dir_all(&folder).unwrap();
    for shared in ["docs", "scenes", "scenarios", "target"] {
        #[cfg(unix)]
        let _ = std::os::unix::fs::symlink(root().join(shared), folder.join(shared));
    }
    for line in commands(&std::fs::read_to_string(page).unwrap()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            // The second is the tool in a release archive.
            ["target/release/rigctl" | "bin/rigctl", ref rest @ ..] => {
                let cli = rigctl::cli::Cli::try_parse_from(std::iter::once(&"rigctl").chain(rest));
                assert!(cli.is_ok(), "{name}: {line}: {}", cli.err().map_or(String::new(), |e| e.to_string()));
                let real = line.contains("--port /dev/");
                if real || rest.iter().any(|word| LONG.contains(word)) {
                    continue;
                }
                let built = Path::new(env!("CARGO_BIN_EXE_tsa-lab")).with_file_name("rigctl");
                let done = Command::new(built).args(rest).current_dir(&folder).output().unwrap();
                let said = String::from_utf8_lossy(&done.stderr);
                assert!(done.status.success(), "{name}: {line}: {said}");
            }
            ["target/release/tsa-lab", ref rest @ ..] => {
                let cli = lab::cli::Cli::try_parse_from(std::iter::once(&"tsa-lab").chain(rest));
                assert!(cli.is_ok(), "{name}: {line}: {}", cli.err().map_or(String::new(), |e| e.to_string()));
                if rest.iter().any(|word| LONG.contains(word)) {
                    continue;
                }
                let done =
                    Command::new(env!("CARGO_BIN_EXE_tsa-lab")).args(rest).current_dir(&folder).output().unwrap();
                assert!(done.status.success(), "{name}: {line}: {}", String::from_utf8_lossy(&done.stderr));
            }
            ["target/release/rig-emulator", ref rest @ ..] => {
                let built = Path::new(env!("CARGO_BIN_EXE_tsa-lab")).with_file_name("rig-emulator");
                let done = Command::new(built).args(rest).current_dir(&folder).output().unwrap();
                assert!(done.status.success(), "{name}: {line}: {}", String::from_utf8_lossy(&done.stderr));
            }
            ["cargo", "xtask", task, ..] | [_, "cargo", "xtask", task, ..] => {
                assert!(tasks.contains(&format!("\n    {task}")), "{name}: no task {task}");
            }
            // `cargo xtask python` installs it and runs its tests.
            ["pip", "install", package] => {
                // Without quotes and the name of an optional part.
                let package = package.trim_matches('"').split('[').next().unwrap_or_default();
                assert!(root().join(package).join("pyproject.toml").exists(), "{name}: no package {package}");
            }
            // Other programs, named where they are first used.
            ["cargo", "install", ..] | ["probe-rs", ..] => {}
            _ => panic!("{name}: what is {line:?}?"),
        }
    }
    let _ = std::fs::remove_dir_all(&folder);
}

#[test]
fn every_link_of_the_pages_leads_somewhere() {
    for page in pages() {
        let text = std::fs::read_to_string(&page).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split('#').next().unwrap_or_default();
            if link.contains("://") || file.is_empty() {
                continue;
            }
            let target = page.parent().unwrap().join(file);
            assert!(target.exists(), "{}: {link} leads nowhere", page.display());
        }
    }
}
