//! `rig-emulator --bare`: how a program's run ends, by its exit status and what it says.

use crate::program::*;
use std::process::Command;

/// Exit status and standard error of a run.
fn run(name: &str, code: &[Vec<u16>], options: &[&str]) -> (Option<i32>, String) {
    let mut program = Program::default();
    program.function("main", code);
    let elf = std::env::temp_dir().join(format!("rig-emulator-bare-{}-{name}.elf", std::process::id()));
    std::fs::write(&elf, program.elf()).expect("a temporary file");
    let mut command = Command::new(env!("CARGO_BIN_EXE_rig-emulator"));
    let done = command.arg("--bare").arg("--elf").arg(&elf).args(options).output().expect("it starts");
    std::fs::remove_file(&elf).expect("it is there");
    (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
}

#[test]
fn the_exit_status_says_how_a_run_has_ended() {
    let unclocked = || poke(0x4002_0000, 1);
    let end = || vec![0xBE00];
    for (name, code, options, status, says) in [
        ("passed", vec![end()], &[][..], 0, ""),
        ("no-line", vec![end()], &["--ok", "Test OK"], 1, "failed"),
        ("undefined", vec![vec![UDF]], &[], 1, "undefined instruction"),
        ("nothing-there", vec![load(0, 0x3000_0000), vec![fetch(1, 0)]], &[], 1, "0x30000000"),
        ("refused", vec![unclocked(), end()], &[], 2, "`unclocked`"),
        ("another-allowed", vec![unclocked(), end()], &["--allow", "width"], 2, "`unclocked`"),
        ("allowed", vec![unclocked(), unclocked(), end()], &["--allow", "unclocked"], 0, "allowed, 2 times"),
        ("lenient", vec![unclocked(), end()], &["--lenient"], 0, "(unclocked)"),
        ("endless", vec![vec![PARK]], &["--limit", "0.01"], 3, "0.01 s"),
        ("semihosting", vec![load(0, 4), vec![0xBEAB]], &[], 2, "semihosting"),
        ("unknown-lint", vec![end()], &["--allow", "clock"], 2, "hse-crystal"),
    ] {
        let (found, said) = run(name, &code, options);
        assert_eq!(found, Some(status), "{name}: {said}");
        assert!(said.contains(says) && (!says.is_empty() || said.is_empty()), "{name}: {said}");
    }
}
