//! Every command of the pages at the root and in `docs/` is read by the tool's own parser, and the files of the project that it names exist and
//! can be read. Of each kind of command, a subcommand with the set of its options, one is run, unless another test runs that kind:
//! homing alone takes seven seconds of computing.

mod common;

use clap::parser::ValueSource;
use clap::{Arg, CommandFactory};
use common::root;
use rig_config::Scene;
use rigctl::script::Script;
use rigctl::trajectory::Trajectory;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Kinds of commands that are run elsewhere, and where. Options of every command (`--scene`, `--plant`, `--flash` …) do not count.
const RUN_ELSEWHERE: [(&str, &str); 32] = [
    ("rigctl calibrate lvdt", "crates/rigctl/tests/tool/board_settings.rs"),
    ("rigctl calibrate lvdt --points --gauge-error", "crates/rigctl/tests/tool/board_settings.rs"),
    ("rigctl config set", "crates/rigctl/tests/tool/board_settings.rs"),
    ("rigctl demo", "crates/rigctl/tests/tool/emulated.rs"),
    ("rigctl export --to --out", "crates/rigctl/tests/tool/export.rs"),
    ("rigctl home", "crates/rigctl/tests/serial/main.rs"),
    ("rigctl home --load", "crates/rigctl/tests/tool/emulated.rs"),
    ("rigctl identify --out --figure", "crates/rigctl/tests/tool/new_rig.rs"),
    ("rigctl identify --published --out", "crates/rigctl/tests/tool/hostile.rs"),
    ("rigctl lookup --load --turns", "crates/rigctl/tests/tool/desktop.rs"),
    ("rigctl monitor", "crates/rigctl/tests/tool/monitor.rs"),
    ("rigctl move --to", "crates/rigctl/tests/tool/new_rig.rs"),
    ("rigctl move --to --load --dry-run", "crates/rigctl/tests/tool/emulated.rs"),
    ("rigctl move --to --speed", "crates/rigctl/tests/tool/emulated.rs"),
    ("rigctl play", "crates/rigctl/tests/tool/emulated.rs"),
    ("rigctl record --out --seconds", "crates/rigctl/tests/tool/export.rs"),
    ("rigctl record --out --script", "crates/rigctl/tests/tool/logs.rs"),
    ("rigctl replay", "crates/rigctl/tests/tool/logs.rs"),
    ("rigctl serve --listen", "crates/rigctl/tests/tool/serve.rs"),
    ("rigctl solve --load --turns", "crates/rigctl/tests/tool/desktop.rs"),
    ("rigctl solve --load --turns --tier", "crates/rigctl/tests/tool/desktop.rs"),
    ("rigctl status", "crates/rigctl/tests/tool/plants.rs"),
    ("rigctl sweep --load --out", "crates/rigctl/tests/tool/new_rig.rs"),
    ("rigctl table", "crates/rigctl/tests/tool/scenes.rs"),
    ("rigctl table --board", "crates/rigctl/tests/tool/new_rig.rs"),
    ("tsa-lab budget", "lab/tests/budget.rs"),
    ("tsa-lab budget --all", "lab/tests/budget.rs"),
    ("tsa-lab chart --out", "host-tests/studies.toml"),
    ("tsa-lab published", "lab/tests/published.rs"),
    ("tsa-lab published --inferred-geometry --out", "lab/tests/published.rs"),
    ("tsa-lab report --out --log --charts", "lab/web/tests/test_page.py"),
    ("tsa-lab study --vary --out", "lab/tests/published.rs"),
];

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
    let mut pages = ["README.md", "CONTRIBUTING.md"].map(|page| root().join(page)).to_vec();
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

/// The subcommand with its own options, as the tool's parser reads the words.
fn kind(mut command: clap::Command, words: &[&str]) -> Result<String, clap::Error> {
    command.build();
    let matches = command.clone().try_get_matches_from([&[command.get_name()], words].concat())?;
    let everywhere: Vec<_> = command.get_arguments().map(Arg::get_id).collect();
    let (mut kind, mut command, mut matches) = (command.get_name().to_owned(), &command, &matches);
    while let Some((name, inner)) = matches.subcommand() {
        kind += &format!(" {name}");
        (command, matches) = (command.find_subcommand(name).unwrap(), inner);
    }
    let given = |arg: &&Arg| matches.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine);
    let own = command.get_arguments().filter(|arg| !everywhere.contains(&arg.get_id())).filter(given);
    own.filter_map(Arg::get_long).for_each(|name| kind += &format!(" --{name}"));
    Ok(kind)
}

/// Reads a file of the project that a command names.
fn read(file: &Path) -> Result<(), String> {
    let text = |e: rigctl::failure::Failure| format!("{e:?}");
    match file.extension().and_then(|end| end.to_str()) {
        Some("toml") => Scene::load(file).map(drop).map_err(|e| e.to_string()),
        Some("script") => Script::load(file).map(drop).map_err(text),
        Some("csv") if file.starts_with(root().join("scenarios")) => Trajectory::load(file).map(drop).map_err(text),
        _ if file.exists() => Ok(()),
        _ => Err("is not there".into()),
    }
}

fn run(program: &str, words: &[&str]) {
    let folder = std::env::temp_dir().join(format!("rigctl-pages-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    // What a command writes must not land in the project.
    for shared in ["docs", "scenes", "scenarios", "target"] {
        #[cfg(unix)]
        let _ = std::os::unix::fs::symlink(root().join(shared), folder.join(shared));
    }
    let built = Path::new(env!("CARGO_BIN_EXE_tsa-lab")).with_file_name(program);
    let done = Command::new(built).args(words).current_dir(&folder).output().unwrap();
    let _ = std::fs::remove_dir_all(&folder);
    assert!(done.status.success(), "{program} {words:?}: {}", String::from_utf8_lossy(&done.stderr));
}

#[test]
fn every_command_of_the_pages_works() {
    let tasks = std::fs::read_to_string(root().join("xtask/src/main.rs")).unwrap().to_lowercase();
    let (mut met, mut here) = (BTreeSet::new(), BTreeSet::new());
    for page in pages() {
        let name = page.strip_prefix(root()).unwrap().display().to_string();
        for line in commands(&std::fs::read_to_string(&page).unwrap()) {
            let words: Vec<&str> = line.split_whitespace().collect();
            let folders = ["docs/", "scenes/", "scenarios/"];
            for file in words.iter().filter(|word| folders.iter().any(|folder| word.starts_with(folder))) {
                read(&root().join(file)).unwrap_or_else(|e| panic!("{name}: {line}: {file}: {e}"));
            }
            let kind = match words[..] {
                // The second is the tool in a release archive.
                ["target/release/rigctl" | "bin/rigctl", ref rest @ ..] => kind(rigctl::cli::Cli::command(), rest),
                ["target/release/tsa-lab", ref rest @ ..] => kind(lab::cli::Cli::command(), rest),
                ["target/release/rig-emulator", ..] => Ok("rig-emulator".into()),
                ["cargo", "xtask", task, ..] | [_, "cargo", "xtask", task, ..] => {
                    assert!(tasks.contains(&format!("\n    {task}")), "{name}: no task {task}");
                    continue;
                }
                // `cargo xtask python` installs it and runs its tests.
                ["pip", "install", package] => {
                    // Without quotes and the name of an optional part.
                    let package = package.trim_matches('"').split('[').next().unwrap_or_default();
                    assert!(root().join(package).join("pyproject.toml").exists(), "{name}: no package {package}");
                    continue;
                }
                // Its own tests run it.
                ["python", "-m", module, ref rest @ ..] => {
                    let file = root().join("crates/tsa-python/python").join(module.replace('.', "/") + ".py");
                    let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{name}: {module}: {e}"));
                    for option in rest.iter().filter(|word| word.starts_with("--")) {
                        assert!(text.contains(&format!("add_argument(\"{option}\"")), "{name}: {line}: {option}");
                    }
                    continue;
                }
                // Other programs, named where they are first used.
                ["cargo", "install", ..] | ["probe-rs" | "colcon", ..] => continue,
                _ => panic!("{name}: what is {line:?}?"),
            };
            let kind = kind.unwrap_or_else(|e| panic!("{name}: {line}: {e}"));
            // A real board is not there.
            if line.contains("--port /dev/") || !met.insert(kind.clone()) {
                continue;
            }
            if RUN_ELSEWHERE.iter().all(|(run, _)| *run != kind) {
                run(words[0].rsplit('/').next().unwrap(), &words[1..]);
                here.insert(kind);
            }
        }
    }
    println!("run here: {here:?}");
    for (kind, file) in RUN_ELSEWHERE {
        assert!(met.contains(kind), "no page has `{kind}`");
        let subcommand = kind.split(' ').nth(1).unwrap();
        let text = std::fs::read_to_string(root().join(file)).unwrap();
        assert!(text.contains(subcommand), "{file} does not run `{kind}`");
    }
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
