//! What a careless or hostile surrounding does to files and processes: FIFOs, links, full disks, interrupts, stuck children.
#![cfg(unix)]

use crate::common::{desktop, error_of, folder, lines, rigctl, root, text};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Longest wait for what takes a second or so on an idle machine, so that a test that hangs ends.
const PATIENCE: Duration = Duration::from_secs(120);

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder").flatten();
    let mut names: Vec<String> = entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn held(file: &Path) -> String {
    String::from_utf8_lossy(&std::fs::read(file).expect("there")).into_owned()
}

/// Waits for the end of a process; one that goes on is killed, and the test fails.
fn ended(mut child: Child, what: &str) -> Output {
    let end = Instant::now() + PATIENCE;
    while child.try_wait().expect("a child").is_none() {
        if Instant::now() > end {
            child.kill().expect("killed");
            panic!("{what} goes on");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().expect("its output")
}

fn tool(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigctl"));
    command.args(arguments).current_dir(root()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn signal(name: &str, process: u32) {
    assert!(Command::new("kill").args([name, &process.to_string()]).status().is_ok_and(|s| s.success()), "kill {name}");
}

/// Whether a process is there and has not ended.
fn runs(process: u32) -> bool {
    let said = Command::new("ps").args(["-o", "stat=", "-p", &process.to_string()]).output().expect("ps");
    let state = String::from_utf8_lossy(&said.stdout).trim().to_owned();
    !state.is_empty() && !state.starts_with('Z')
}

fn wait_until(what: &str, mut reached: impl FnMut() -> bool) {
    let end = Instant::now() + PATIENCE;
    while !reached() {
        assert!(Instant::now() < end, "{what} not within {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The emulator that a tool has started.
fn emulator_of(process: u32) -> u32 {
    let mut found = None;
    wait_until("the emulator's start", || {
        let said = Command::new("ps").args(["-o", "pid=,comm=", "--ppid", &process.to_string()]).output().expect("ps");
        let children = String::from_utf8_lossy(&said.stdout).into_owned();
        let emulator = children.lines().find(|line| line.contains("rig-emulator"));
        found = emulator.and_then(|line| line.split_whitespace().next()?.parse().ok());
        found.is_some()
    });
    found.expect("waited for")
}

#[test]
fn what_is_no_regular_file_is_refused_by_name_at_once() {
    let folder = folder("fifo");
    let fifo = folder.join("pipe");
    assert!(Command::new("mkfifo").arg(&fifo).status().is_ok_and(|s| s.success()));
    let fifo = text(&fifo);
    for arguments in [
        &["status", "--flash", fifo][..],
        &["status", "--scene", fifo],
        &["status", "--plant-scene", fifo],
        &["status", "--firmware", fifo],
        &["solve", "--load", "1N", "--turns", "1", "--scene", fifo],
        &["sim", "--script", fifo],
        &["play", fifo],
        &["record", "--script", fifo],
        &["record", "--seconds", "0.1", "--out", fifo],
        &["replay", fifo],
        &["identify", fifo],
        &["solve", "--batch", fifo],
        &["lookup", "--batch", fifo],
        &["config", "restore", fifo],
        &["export", fifo, "--to", "csv", "--out", text(&folder.join("never"))],
        &["export", "Cargo.toml", "--to", "csv", "--out", fifo],
        &["move", "--to", "1mm", "--load", "1N", "--dry-run", "--settings", fifo],
    ] {
        let output = ended(tool(arguments).spawn().expect("rigctl runs"), &format!("{arguments:?}"));
        let said = error_of(&output);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
        assert!(said.contains("is a FIFO, not a regular file") && said.contains(fifo), "{arguments:?}: {said}");
    }
    let output = rigctl(&["replay", text(&folder)]);
    assert!(error_of(&output).contains("is a directory, not a regular file"), "{}", error_of(&output));
    assert_eq!(names(&folder), ["pipe"]);
}

#[test]
fn flash_files_neither_delete_nor_share_nor_unlink_anything() {
    let folder = folder("flash");
    let beside = folder.join("board.new");
    std::fs::write(&beside, "of somebody else").expect("written");
    let (one, two, link) = (folder.join("board.any"), folder.join("board.bin"), folder.join("link"));
    std::os::unix::fs::symlink(&two, &link).expect("linked");
    let set = |flash: &Path, value: &str| {
        let set = rigctl(&["config", "set", "speed-max", value, "--flash", text(flash)]);
        assert!(set.status.success(), "{}", error_of(&set));
    };
    set(&one, "3mm/s");
    set(&two, "4mm/s");
    set(&link, "2mm/s");
    assert_eq!(held(&beside), "of somebody else");
    assert!(std::fs::symlink_metadata(&link).expect("there").is_symlink(), "the link was replaced");
    for (flash, value) in [(&one, 3e-3), (&two, 2e-3), (&folder.join("board.bin~"), 4e-3)] {
        let got = rigctl(&["config", "get", "speed-max", "--json", "--flash", text(flash)]);
        assert_eq!(lines(&got)[0]["value"], value, "{}", flash.display());
    }
    assert_eq!(names(&folder), ["board.any", "board.bin", "board.bin~", "board.new", "link"]);
}

/// Runs the tool in a process that can write no more than so many blocks of 512 bytes into a file.
fn on_a_full_disk(blocks: u32, arguments: &[&str]) -> Output {
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &script, "sh", env!("CARGO_BIN_EXE_rigctl")]).args(arguments);
    command.current_dir(root()).output().expect("sh runs")
}

#[test]
fn a_full_disk_loses_nothing_and_leaves_nothing() {
    let folder = folder("full");
    let (old, new, chart, flash) =
        (folder.join("old"), folder.join("new"), folder.join("chart"), folder.join("board.bin"));
    let fit: &[&str] = &["identify", "--published", "--out"];
    let record: &[&str] = &["record", "--seconds", "0.1", "--out"];
    for command in [fit, record, &["config", "backup"]] {
        for file in [&old, &new] {
            std::fs::write(&old, "precious").expect("written");
            let full = on_a_full_disk(0, &[command, &[text(file)]].concat());
            let said = error_of(&full);
            assert_eq!(full.status.code(), Some(1), "{command:?}: {said}");
            assert!(said.contains(&format!("cannot write {}", file.display())), "{command:?}: {said}");
            assert_eq!(names(&folder), ["old"], "{command:?} {}", file.display());
            assert_eq!(held(&old), "precious", "{command:?}");
        }
    }
    let full = on_a_full_disk(0, &["study", "--vary", "D0=0.015..0.02:2", "--turns", "0..1", "--out", text(&chart)]);
    assert_eq!(full.status.code(), Some(1), "{}", error_of(&full));
    assert!(names(&chart).is_empty(), "{:?}", names(&chart));
    // A board's flash, new and changed.
    let set = |blocks: Option<u32>, value: &str| {
        let arguments = ["config", "set", "speed-max", value, "--flash", text(&flash)];
        blocks.map_or_else(|| rigctl(&arguments), |blocks| on_a_full_disk(blocks, &arguments))
    };
    assert_eq!(set(Some(1), "3mm/s").status.code(), Some(1));
    assert_eq!(names(&folder), ["chart", "old"]);
    assert!(set(None, "3mm/s").status.success());
    let before = std::fs::read(&flash).expect("there");
    let full = set(Some(1), "4mm/s");
    assert!(full.status.code() == Some(1) && error_of(&full).contains("board.bin"), "{}", error_of(&full));
    assert!(std::fs::read(&flash).expect("there") == before, "the old flash is lost");
    assert_eq!(names(&folder), ["board.bin", "chart", "old"]);
}

#[test]
fn what_a_link_points_to_is_replaced_and_kept() {
    let folder = folder("links");
    std::fs::create_dir(folder.join("data")).expect("made");
    let (target, link) = (folder.join("data/target"), folder.join("link"));
    let kept = folder.join("data/target~");
    std::os::unix::fs::symlink("data/target", &link).expect("linked");
    for command in
        [&["identify", "--published", "--out"][..], &["record", "--seconds", "0.1", "--out"], &["config", "backup"]]
    {
        std::fs::write(&target, "precious").expect("written");
        let written = rigctl(&[command, &[text(&link)]].concat());
        assert!(written.status.success(), "{command:?}: {}", error_of(&written));
        assert!(std::fs::symlink_metadata(&link).expect("there").is_symlink(), "{command:?}");
        assert_eq!(held(&kept), "precious", "{command:?}");
        assert!(held(&target).starts_with('#'), "{command:?}: {}", held(&target));
        std::fs::remove_file(&kept).expect("was there");
    }
    let other = folder.join("study.csv");
    std::os::unix::fs::symlink("data/target", &other).expect("linked");
    std::fs::write(&target, "precious").expect("written");
    let study = rigctl(&["study", "--vary", "D0=0.015..0.02:2", "--turns", "0..1", "--out", text(&folder)]);
    assert!(study.status.success(), "{}", error_of(&study));
    assert!(held(&kept) == "precious" && held(&other) != "precious");
}

#[test]
fn an_interrupt_ends_the_tool_and_its_emulated_board_whatever_they_do() {
    let folder = folder("interrupt");
    let script = folder.join("long.script");
    std::fs::write(&script, "100000 end\n").expect("written");
    let sim = ["sim", "--json", "--script", text(&script)];
    // Strings that the board makes a table for in seconds.
    let scene = folder.join("other.toml");
    let default = std::fs::read_to_string(root().join("scenes/default.toml")).expect("the default scene");
    assert!(default.contains("\nk2 = 0.127\n"));
    std::fs::write(&scene, default.replace("\nk2 = 0.127\n", "\nk2 = 0.13\n")).expect("written");
    let table = ["table", "--board", "--scene", text(&scene), "--plant-scene", "scenes/default.toml"];
    for (arguments, name, stuck) in
        [(&sim[..], "-INT", false), (&sim, "-TERM", true), (&table, "-INT", false), (&table, "-TERM", true)]
    {
        let what = format!("{arguments:?} after {name}, stuck: {stuck}");
        // What it prints is read by nobody.
        let child = tool(arguments).stdout(Stdio::null()).spawn().expect("rigctl runs");
        let emulator = emulator_of(child.id());
        if stuck {
            signal("-STOP", emulator);
        }
        // Before the tool watches for them an interrupt ends it at once, which is as good.
        signal(name, child.id());
        let told = Instant::now();
        let output = ended(child, &what);
        let said = error_of(&output);
        println!("{what}: {:?}, {:?} {said}", told.elapsed(), output.status);
        // Killed by the signal itself, or ended for its sake; the stuck board's end may be told first.
        let for_its_sake = said.contains("interrupted") || stuck && said.contains("emulator has stopped");
        assert!(!output.status.success() && (output.status.code().is_none() || for_its_sake), "{what}: {said}");
        wait_until(&format!("{what}: the emulator's end"), || !runs(emulator));
    }
}

/// As under `nohup`.
#[test]
fn a_tool_whose_terminal_may_end_goes_on_when_it_does() {
    let folder = folder("nohup");
    let script = folder.join("short.script");
    std::fs::write(&script, "60 end\n").expect("written");
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' HUP; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_rigctl")]);
    shell.args(["sim", "--json", "--script", text(&script)]).current_dir(root());
    let child = shell.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("sh runs");
    emulator_of(child.id());
    signal("-HUP", child.id());
    let output = ended(child, "sim");
    assert!(output.status.success(), "{}", error_of(&output));
}

#[test]
fn a_backup_may_have_a_name_that_is_no_text() {
    use std::os::unix::ffi::OsStrExt;
    let folder = folder("no-text");
    let file = folder.join(std::ffi::OsStr::from_bytes(b"b\xffckup.toml"));
    for act in ["backup", "restore"] {
        let output = tool(&["config", act]).arg(&file).output().expect("rigctl runs");
        assert!(output.status.success(), "{act}: {}", error_of(&output));
    }
}

#[test]
fn an_emulated_board_ends_with_who_started_it_in_the_middle_of_a_run() {
    use std::io::Write;
    let built = Path::new(env!("CARGO_BIN_EXE_rigctl")).parent().expect("a folder");
    let elf = built.join("../firmware/tsa-firmware.elf");
    // Its parent is a shell, which can be killed while the run goes on.
    let mut shell = Command::new("sh");
    shell.args(["-c", "exec 3<&0; \"$@\" <&3 & exec 3<&-; echo $!; wait", "sh"]);
    shell.arg(built.join("rig-emulator")).args(["--elf", text(&elf), "--scene", "scenes/default.toml"]);
    let mut shell = shell.current_dir(root()).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("sh runs");
    let mut said = std::io::BufReader::new(shell.stdout.take().expect("piped"));
    let mut line = String::new();
    std::io::BufRead::read_line(&mut said, &mut line).expect("its number");
    let emulator: u32 = line.trim().parse().expect("a number");
    let mut input = shell.stdin.take().expect("piped");
    // Its answer says that it has started.
    writeln!(input, "\"stats\"").expect("it reads");
    std::io::BufRead::read_line(&mut said, &mut line).expect("its answer");
    writeln!(input, "{{\"run\":{{\"until_s\":3000}}}}").expect("it reads");
    shell.kill().expect("killed");
    shell.wait().expect("ended");
    drop(input);
    wait_until("the emulator's end", || !runs(emulator));
}

#[test]
fn a_scene_is_found_from_any_folder_and_one_that_is_nowhere_is_told_with_what_to_do() {
    let folder = folder("elsewhere");
    let elsewhere = |program: &Path, arguments: &[&str]| {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(&folder).output().expect("it runs")
    };
    // The layout of an archive.
    let archived = folder.join("archive/bin/rigctl");
    for place in ["archive/bin", "archive/scenes"] {
        std::fs::create_dir_all(folder.join(place)).expect("made");
    }
    std::fs::copy(env!("CARGO_BIN_EXE_rigctl"), &archived).expect("copied");
    std::fs::copy(root().join("scenes/finger.toml"), folder.join("archive/scenes/default.toml")).expect("copied");
    let built = Path::new(env!("CARGO_BIN_EXE_rigctl"));
    let solve = ["--json", "solve", "--load", "1N", "--turns", "1"];
    let of = |scene| desktop(&[&solve[..], &["--scene", scene]].concat()).stdout;
    let (own, archives) = (of("scenes/default.toml"), of("scenes/finger.toml"));
    assert_ne!(own, archives);
    for (program, expected) in [(built, own), (&archived, archives)] {
        let output = elsewhere(program, &solve);
        assert_eq!(output.stdout, expected, "{}: {}", program.display(), error_of(&output));
    }
    // The emulator is told where the scenes are, too.
    let output = elsewhere(built, &["status", "--plant-scene", "scenes/default.toml"]);
    assert!(output.status.success(), "{}", error_of(&output));
    for arguments in [&["solve", "--load", "1N", "--turns", "1"][..], &["status"], &["sim"]] {
        let output = elsewhere(built, &[arguments, &["--scene", "scenes/none.toml"]].concat());
        let said = error_of(&output);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
        assert!(said.contains("scenes/none.toml") && said.contains("--scene FILE"), "{arguments:?}: {said}");
    }
}

#[test]
fn a_script_for_the_emulated_board_never_goes_to_the_port_of_the_environment() {
    let folder = folder("never");
    let script = folder.join("short.script");
    std::fs::write(&script, "1 fault lvdt-swapped\n2 end\n").expect("written");
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigctl"));
    command.args(["sim", text(&script)]).current_dir(root()).env("RIGCTL_PORT", folder.join("no-device"));
    let output = command.output().expect("it runs");
    assert!(output.status.success(), "{}", error_of(&output));
    // The same script by `play` goes there.
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigctl"));
    command.args(["play", text(&script)]).current_dir(root()).env("RIGCTL_PORT", folder.join("no-device"));
    let refused = error_of(&command.output().expect("it runs"));
    assert!(refused.contains("no-device"), "{refused}");
}

#[test]
fn a_script_that_is_refused_leaves_a_recording_as_it_was() {
    let folder = folder("refused-script");
    let (script, out) = (folder.join("bad.script"), folder.join("exp.csv"));
    std::fs::write(&script, "1 plant load=250N\n2 end\n").expect("written");
    std::fs::write(&out, "an experiment").expect("written");
    let output = rigctl(&["record", "--script", text(&script), "--out", text(&out)]);
    assert!(error_of(&output).contains("line 1") && error_of(&output).contains("load"), "{}", error_of(&output));
    assert_eq!((held(&out).as_str(), names(&folder)), ("an experiment", vec!["bad.script".into(), "exp.csv".into()]));
}

#[test]
fn a_load_or_a_gap_below_zero_is_refused_by_the_name_of_its_option() {
    for (arguments, named) in [
        (&["move", "--to", "8mm", "--load", "-5N"][..], "--load"),
        (&["home", "--load", "-5N"], "--load"),
        (&["calibrate", "lvdt", "--gap", "-5mm"], "--gap"),
    ] {
        let output = rigctl(arguments);
        let said = error_of(&output);
        assert!(!output.status.success() && !said.contains("unexpected argument"), "{arguments:?}: {said}");
        assert!(said.contains(named) || said.contains(&named[2..]), "{arguments:?}: {said}");
    }
}
