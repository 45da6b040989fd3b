//! `doctor`, `monitor`, `completions`: what a newcomer meets.

use crate::common::{error_of, file, lines, rigctl, text};
use serde_json::Value;

fn looked(arguments: &[&str]) -> (Value, i32) {
    let output = rigctl(&[&["doctor", "--json"], arguments].concat());
    let found = lines(&output);
    assert_eq!(found.len(), 1, "{}", error_of(&output));
    (found[0].clone(), output.status.code().unwrap_or(-1))
}

/// Names of what is not well; each says what to do, and what is well does not.
fn bad(report: &Value) -> Vec<&str> {
    let checks = report["checks"].as_array().expect("checks");
    for c in checks {
        assert_eq!(c["ok"] == true, c["advice"].is_null(), "{c}");
    }
    checks.iter().filter(|c| c["ok"] == false).filter_map(|c| c["name"].as_str()).collect()
}

#[test]
fn a_healthy_rig_is_well_homed_or_not() {
    for arguments in [&[][..], &["--home"]] {
        let (report, code) = looked(arguments);
        assert!(bad(&report).is_empty() && report["ok"] == true && code == 0, "{report:#}");
        let checks = report["checks"].as_array().expect("checks");
        assert!(checks.len() >= 13);
        // What was measured has beside it what is allowed.
        for name in ["drive", "LVDT", "supply", "ticks", "link"] {
            let seen = checks.iter().find(|c| c["name"] == name).and_then(|c| c["seen"].as_str());
            assert!(seen.is_some_and(|seen| seen.contains("allowed")), "{name}: {seen:?}");
        }
    }
}

#[test]
fn what_is_wrong_is_named_with_what_to_do() {
    let plant = |setting: &'static str| ["--plant", setting];
    for (arguments, named) in [
        (&plant("supply_voltage=15V")[..], &["state", "supply"][..]),
        (&plant("lvdt_noise=3mm"), &["state", "LVDT"]),
        (&["--scene", "scenes/long-string.toml", "--firmware", "no-such.elf"], &["link"]),
        (&["--port", "/dev/no-such-port"], &["link"]),
    ] {
        let (report, code) = looked(arguments);
        assert_eq!((bad(&report), code), (named.to_vec(), 1), "{report:#}");
    }
    // A noise that is no fault yet shows on a homed rig; so does the hum of the mains.
    for setting in ["lvdt_noise=500um", "hum=50um"] {
        let (report, code) = looked(&["--home", "--plant", setting]);
        assert!(bad(&report).contains(&"LVDT") && code == 1, "{report:#}");
    }
    let words = rigctl(&["doctor", "--port", "/dev/no-such-port"]);
    let text = String::from_utf8_lossy(&words.stdout).into_owned();
    assert!(text.lines().any(|l| l.starts_with("CHECK link") && l.contains("no-such-port")), "{text}");
}

#[test]
fn a_board_of_another_scene_is_looked_at_all_the_same() {
    // Another scene with the same firmware: the default's text with one number changed.
    let scene = std::fs::read_to_string("../../scenes/default.toml").expect("the default scene");
    let path = file("doctor.toml");
    std::fs::write(&path, scene.replace("k2 = 0.127", "k2 = 0.128")).expect("written");
    let (report, code) = looked(&["--scene", text(&path)]);
    assert_eq!((bad(&report), code), (vec!["scene"], 1), "{report:#}");
}

#[test]
fn monitor_refuses_quietly_without_a_terminal() {
    let refused = rigctl(&["monitor"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(refused.stdout.is_empty() && error_of(&refused).contains("terminal"), "{}", error_of(&refused));
    assert_eq!(rigctl(&["monitor", "--json"]).status.code(), Some(2));
}

#[test]
fn completions_know_the_commands() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = rigctl(&["completions", shell]);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success() && ["record", "sweep", "doctor"].iter().all(|c| text.contains(c)), "{shell}");
    }
    assert_eq!(rigctl(&["completions", "cash"]).status.code(), Some(2));
}
