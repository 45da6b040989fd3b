//! Plants from outside, as a user gives them to the tool.
#![cfg(unix)]

use crate::common::{desktop, error_of, file, lines, rigctl};
use std::path::PathBuf;

/// A file of this name and text.
fn written(name: &str, text: &str) -> PathBuf {
    let path = file(&format!("plants-{name}"));
    std::fs::write(&path, text).expect("a file");
    path
}

fn refused(arguments: &[&str], said: &[&str]) {
    let output = rigctl(arguments);
    assert!(!output.status.success(), "{arguments:?}");
    for words in said {
        assert!(error_of(&output).contains(words), "{arguments:?}: {}", error_of(&output));
    }
}

#[test]
fn the_examples_move_the_lvdt() {
    let gap_m = |option: &str, example: &str| {
        let output = rigctl(&["status", "--json", option, example, "--plant", "load=5N,twist_at_boot=4"]);
        assert!(output.status.success(), "{}", error_of(&output));
        lines(&output)[0]["sensors"]["gap_m"].as_f64().expect("a gap")
    };
    let spring = gap_m("--plant-program", "python3 docs/plants/linear_spring.py");
    assert!((spring - 0.0983).abs() < 2e-3, "{spring}: 95 mm and 5 N on 1500 N/m");
    let leaves = gap_m("--plant-program", "python3 docs/plants/leaf_springs.py");
    assert!((leaves - 0.0945).abs() < 2e-3, "{leaves}: about the default scene's gap");
    let surface = gap_m("--plant-surface", "docs/plants/surface.csv");
    let solved = &lines(&desktop(&["solve", "--load", "5N", "--turns", "0.13662", "--json"]))[0];
    let solved = ["X_m", "w_m"].map(|key| solved[key].as_f64().expect("a length"));
    let expected = solved[0] + 2.0 * solved[1];
    assert!((surface - expected).abs() < 2e-3, "{surface}, and the default scene has {expected} at 4 rad");
}

#[test]
fn an_outside_plant_with_strings_is_homed() {
    let program = "python3 docs/plants/leaf_springs.py";
    let plant = ["--plant-program", program, "--plant", "load=5N,twist_at_boot=9"];
    let output = rigctl(&[&["home", "--load", "5N", "--json"][..], &plant].concat());
    assert!(output.status.success(), "{}", error_of(&output));
    let homed = lines(&output).pop().expect("a result");
    let of = |key: &str| homed[key].as_f64().unwrap_or_else(|| panic!("no `{key}` in {homed}"));
    assert!((of("load_n") - 5.0).abs() < 0.2 && of("zero_error_rad") < 0.05, "{homed}");
    // The program's own friction, and the part that its play looks like.
    assert!((0.02..0.3).contains(&of("friction_n")) && (0.0..1.0).contains(&of("load_error_n")), "{homed}");
}

#[test]
fn a_program_that_ends_ends_the_run_with_its_name_and_line() {
    let script = "n=0\nwhile read -r word rest; do case $word in start|set) echo ok ;; quit) exit ;;\n\
                  step) n=$((n + 1)); [ $n -gt 4000 ] && exit; echo 0.1 0 5 ;; esac; done";
    let command = format!("sh {}", written("ends.sh", script).display());
    refused(&["status", "--plant-program", &command], &[&command, "ended instead of answering `step "]);
    refused(&["status", "--plant-program", "no-such-plant"], &["`no-such-plant`"]);
    let key = ["status", "--plant-program", "python3 docs/plants/linear_spring.py", "--plant", "k2_scale=1.1"];
    refused(&key, &["linear_spring.py", "`k2_scale`"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_program_that_heeds_nothing_does_not_outlive_the_tool() {
    let id = written("deaf.id", "");
    let script = format!(
        "trap '' TERM INT HUP\necho $$ >{}\nwhile :; do\n\
         if read -r word rest; then case $word in step) echo 0.1 0 5 ;; *) echo ok ;; esac; else sleep 0.1; fi\ndone",
        id.display()
    );
    let command = format!("sh {}", written("deaf.sh", &script).display());
    let output = rigctl(&["status", "--plant-program", &command]);
    assert!(output.status.success(), "{}", error_of(&output));
    let id = std::fs::read_to_string(id).expect("its process");
    // Empty for a process that has ended and that nobody has asked about yet: who does so, and when, is the machine's business.
    let words = PathBuf::from(format!("/proc/{}/cmdline", id.trim()));
    let ended = (0..600).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(100));
        std::fs::read(&words).is_ok_and(|words| words.is_empty()) || !words.exists()
    });
    assert!(ended, "process {id} still runs");
}

#[test]
fn files_and_options_that_make_no_plant_are_named() {
    let bad = written("bad.csv", "load_n,twist_rad,gap_m\n1,0,0.1\n1,five,0.1\n");
    let bad = bad.to_str().expect("a path");
    refused(&["status", "--plant-surface", bad], &[bad, "line 3, column `twist_rad`: `five`"]);
    refused(&["status", "--plant-surface", "no-such.csv"], &["no-such.csv"]);
    let example = "docs/plants/surface.csv";
    refused(&["status", "--plant-surface", example, "--plant-surface", bad], &[bad, "line 3"]);
    refused(&["status", "--plant-surface", example, "--plant", "k2_scale=2"], &["`k2_scale`", "measured gaps"]);
    refused(&["status", "--plant-surface", example, "--plant-program", "cat"], &["--plant-program"]);
    refused(&["status", "--port", "/dev/ttyACM9", "--plant-surface", example], &["--plant-surface", "emulated board"]);
}
