//! The tool with the real firmware on the emulated board, as a user calls it.

use crate::common::{desktop, error_of, file, folder, lines, rigctl, root, text};
use serde_json::Value;
use std::io::Write;
use std::process::{Command, Output, Stdio};

const KEYS: &str = "t_s state fault limit doubts target_m setpoint_m position_m twist_rad load_n load_error_n \
                    position_error_m tr_rad_per_m drive_current_a drive_speed_rad_per_s true_position_m true_twist_rad \
                    true_load_n string_tension_n gap_m encoder_rad supply_v load_at_range_end";

#[test]
fn a_script_plays() {
    let first = rigctl(&["sim", "--script", "scenarios/example.script", "--json", "--seed", "5"]);
    assert!(first.status.success(), "{}", error_of(&first));
    let rows = lines(&first);
    let (summary, rows) = rows.split_last().expect("rows");
    for key in ["instructions_per_tick_mean", "instructions_per_tick_max", "core_busy", "realtime_factor", "seed"] {
        assert!(summary["summary"][key].is_number(), "{key} in {summary}");
    }
    assert!(summary["summary"]["core_busy"].as_f64().expect("a number") < 0.10);
    // The first row is that of the first tick, a little after the start.
    let mut last_s = 0.003;
    for row in rows {
        let object = row.as_object().expect("an object");
        for key in KEYS.split(' ') {
            assert!(object.contains_key(key), "{key} in {row}");
        }
        let t_s = row["t_s"].as_f64().expect("a time");
        assert!(t_s - last_s < 0.0115, "nothing between {last_s} and {t_s} s");
        last_s = t_s;
    }
    let states: Vec<&str> = rows.iter().filter_map(|r| r["state"].as_str()).collect();
    for state in ["boot", "unhomed", "homing", "ready", "moving", "holding", "fault"] {
        assert!(states.contains(&state), "{state} never seen");
    }
    assert!(rows.iter().any(|r| r["fault"] == "lvdt-open"));
    // At rest after the first move: 12 mm, by the plant's own gap.
    let rest = rows.iter().find(|r| r["t_s"].as_f64().is_some_and(|t| t > 41.9)).expect("42 s");
    let error = rest["true_position_m"].as_f64().expect("homed") - 0.012;
    assert!(error.abs() < 50e-6, "{error} m");
}

#[test]
fn a_move_ends_with_its_error_as_the_dry_run_plans_it() {
    let travel = ["move", "--to", "8mm", "--speed", "3mm/s", "--plant", "load=1kg", "--json"];
    let planned = rigctl(&[&travel[..], &["--dry-run", "--load", "1kg"]].concat());
    assert!(planned.status.success(), "{}", error_of(&planned));
    let rows = lines(&planned);
    let last = rows.last().expect("rows");
    let number = |row: &Value, key: &str| row[key].as_f64().unwrap_or_else(|| panic!("no {key} in {row}"));
    assert!((number(last, "setpoint_m") - 0.008).abs() < 1e-8 && rows.len() > 5);
    let output = rigctl(&travel);
    assert!(output.status.success() && error_of(&output).contains("homing first"), "{}", error_of(&output));
    let moved = lines(&output).pop().expect("a result");
    assert!(number(&moved, "true_error_m").abs() < 50e-6, "{moved}");
    assert!((number(&moved, "load_n") / 9.80665 - 1.0).abs() < 0.08, "{moved}");
    assert!((number(last, "turns") - number(&moved, "turns")).abs() < 0.02 * number(last, "turns"), "{last} {moved}");
    // The board first turns until friction is taken up, and at the end looks whether it is at rest.
    let longer_s = number(&moved, "duration_s") - number(last, "t_s");
    assert!((0.0..1.0).contains(&longer_s), "{last} {moved}");
    assert_eq!(rigctl(&["move", "--to", "1mm", "--settings", "x.toml"]).status.code(), Some(2));
}

#[test]
fn the_rig_is_named_drawn_from_the_seed_and_nominal_where_none_is_named() {
    let play = |rig: &str, seed: &str| {
        let played = rigctl(&["play", "--seconds", "3s", "--json", "--rig", rig, "--seed", seed]);
        assert!(played.status.success(), "{}", error_of(&played));
        let first = format!("emulated board, {rig} rig, seed {seed}");
        assert_eq!(error_of(&played).lines().next(), Some(first.as_str()));
        let mut rows = lines(&played);
        let summary = rows.pop().expect("a summary");
        assert_eq!(summary["summary"]["rig"], rig);
        rows
    };
    let rigs = [("ideal", "1"), ("nominal", "1"), ("hard", "1"), ("hard", "2")].map(|(rig, seed)| play(rig, seed));
    assert_eq!(play("hard", "2"), rigs[3], "the same seed gives the same bytes");
    // The noise of an ideal rig as well.
    let gap = |seed: &str| lines(&rigctl(&["sensors", "--json", "--seed", seed]))[0]["gap_m"].clone();
    assert!(gap("1").is_number() && gap("1") != gap("2"));
    for (k, one) in rigs.iter().enumerate() {
        assert!(rigs[..k].iter().all(|other| other != one), "{k}");
    }
    let default = desktop(&["play", "--seconds", "3s", "--json"]);
    assert!(error_of(&default).starts_with("emulated board, nominal rig, seed 1\n"), "{}", error_of(&default));
    assert_eq!(lines(&default)[..rigs[1].len()], rigs[1]);
    for (arguments, named) in [
        (&["status", "--rig", "real"][..], "ideal, nominal, hard"),
        (&["status", "--rig", "hard", "--port", "/dev/no-such-port"], "--rig is for the emulated board"),
    ] {
        let wrong = desktop(arguments);
        assert_eq!(wrong.status.code(), Some(2), "{arguments:?}: {}", error_of(&wrong));
        assert!(error_of(&wrong).contains(named), "{arguments:?}: {}", error_of(&wrong));
    }
}

#[test]
fn a_trajectory_may_come_from_standard_input() {
    let mut tool = Command::new(env!("CARGO_BIN_EXE_rigctl"));
    let mut tool = tool.args(["track", "-"]).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    tool.stdin.take().expect("piped").write_all(b"t_s,position_m\n0,0.001\n1,x\n").expect("written");
    let refused = tool.wait_with_output().expect("it ends");
    assert_eq!(refused.status.code(), Some(1));
    assert!(error_of(&refused).contains("standard input: line 3: position_m `x`"), "{}", error_of(&refused));
}

#[test]
fn wrong_usage_is_2_and_names_the_parameter() {
    for (arguments, named) in [
        (&["move"][..], "--to"),
        (&["move", "--to", "8kg"], "to"),
        (&["move", "--to", "nan"], "to"),
        (&["move", "--to", "8mm", "--load", "soft"], "load"),
        (&["home", "--load", "5mm"], "load"),
        (&["move", "--to", "8mm", "--dry-run"], "--load"),
        (&["home", "--plant", "weight=3"], "weight"),
        (&["sim", "--seconds", "-1"], "--seconds"),
        (&["sim", "--port", "/dev/ttyACM0"], "--port"),
        (&["demo", "--plant", "load=1kg"], "--plant load"),
        (&["selftest", "--port", "/dev/ttyACM0"], "cargo xtask selftest"),
        (&["serve", "--listen", "/tmp/rigctl-never", "--fast", "--port", "/dev/no-such-rig"], "--fast"),
        (&["serve", "--listen", "127.0.0.1:7000"], "--listen"),
        (&["dance"], "dance"),
    ] {
        let wrong = rigctl(arguments);
        assert_eq!(wrong.status.code(), Some(2), "{arguments:?}: {}", error_of(&wrong));
        assert!(error_of(&wrong).contains(named), "{arguments:?}: {}", error_of(&wrong));
        assert!(wrong.stdout.is_empty());
    }
    for (arguments, named) in [
        (&["home", "--plant", "load=2000kg"][..], "load"),
        (&["home", "--load", "30N"], "load is 30 N, allowed are 0.75 to 18 N"),
        (&["status", "--port", "/dev/no-such-port"], "/dev/no-such-port"),
        (&["status", "--firmware", "no-such.elf"], "no-such.elf"),
        (&["sim", "--script", "no-such.script"], "no-such.script"),
        (&["serve", "--listen", "/tmp/rigctl-never", "--scene", "no-such.toml"], "no-such.toml"),
        (&["solve", "--load", "1N", "--turns", "1", "--scene", "no-such.toml"], "no-such.toml"),
    ] {
        let failed = rigctl(arguments);
        assert_eq!(failed.status.code(), Some(1), "{arguments:?}: {}", error_of(&failed));
        assert!(error_of(&failed).contains(named), "{arguments:?}: {}", error_of(&failed));
    }
}

#[test]
fn a_stop_without_a_port_says_that_it_reaches_no_rig() {
    let stop = rigctl(&["stop"]);
    let said = String::from_utf8_lossy(&stop.stdout).into_owned();
    assert!(stop.status.success() && said.contains("NO rig"), "{said} {}", error_of(&stop));
}

#[test]
fn an_emulated_board_is_sent_the_table_of_the_scene() {
    let [scene, script] = ["thicker.toml", "thicker.script"].map(|name| text(&file(name)).to_owned());
    let text = std::fs::read_to_string(root().join("scenes/default.toml")).expect("a scene");
    // Other strings, and a smaller range of the load.
    let changed = text
        .replace("\nk2 = 0.127\n", "\nk2 = 0.15\n")
        .replace("\nload_n = [0.75, 18.0]\n", "\nload_n = [1.0, 12.0]\n");
    std::fs::write(&scene, &changed).expect("written");
    assert_eq!(text.lines().zip(changed.lines()).filter(|(a, b)| a != b).count(), 2);
    std::fs::write(&script, "0 plant load=0.5kg\n2.5 home\n40 end\n").expect("written");
    let other = ["--scene", &scene];
    // Who it is, it says all the same; and it stops whatever anybody believes of it.
    let status = rigctl(&[&["status", "--json"][..], &other].concat());
    assert_eq!((status.status.code(), &lines(&status)[0]["scene_matches"]), (Some(1), &Value::Bool(false)));
    assert!(error_of(&status).contains("another scene"), "{}", error_of(&status));
    for command in ["stop", "clear"] {
        let taken = rigctl(&[&[command][..], &other].concat());
        assert!(taken.status.success(), "{command}: {}", error_of(&taken));
    }
    for command in [&["config", "set", "speed-max", "3mm/s"][..], &["sim", "--seconds", "1s"]] {
        let told = rigctl(&[command, &other].concat());
        assert!(told.status.success() && error_of(&told).contains("was sent the table"), "{}", error_of(&told));
    }
    // It weighs by the scene's law, from the script's first instant on.
    let played = rigctl(&[&["--json", "play", &script][..], &other].concat());
    assert!(played.status.success(), "{}", error_of(&played));
    let rows = lines(&played);
    let last = rows.iter().rev().find(|row| row["load_n"].is_number()).expect("it is homed");
    let [found, truth] = ["load_n", "true_load_n"].map(|key| last[key].as_f64().expect("a number"));
    assert!((found / truth - 1.0).abs() < 0.05, "{found} N of {truth}");
}

#[test]
fn a_jog_that_ends_in_a_fault_says_so_and_fails() {
    let output = rigctl(&["jog", "--speed", "4", "--seconds", "60"]);
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stdout));
    assert!(error_of(&output).contains("fault") && error_of(&output).contains("turning"), "{}", error_of(&output));
}

#[test]
fn a_table_for_another_rig_is_not_sent() {
    let text = std::fs::read_to_string(root().join("scenes/default.toml")).expect("a scene");
    for (from, to, sent) in [
        ("gear_ratio = [62, 1]", "gear_ratio = [100, 1]", false),
        ("contraction_m = 5e-6", "contraction_m = 6e-6", true),
    ] {
        assert!(text.contains(from), "{from}");
        let scene = file("other-table.toml");
        std::fs::write(&scene, text.replace(from, to)).expect("written");
        let path = scene.to_str().expect("a path");
        let said = rigctl(&["table", "--board", "--scene", path, "--plant-scene", "scenes/default.toml"]);
        assert_eq!(said.status.success(), sent, "{}", error_of(&said));
        assert!(sent || error_of(&said).contains("[rig]") && error_of(&said).contains(path), "{}", error_of(&said));
    }
}

/// Friction keeps a board from the last part of a light load's travel, and a plan must not promise it.
#[test]
fn the_dry_run_refuses_what_the_board_refuses() {
    let travel = ["move", "--to", "34.8mm", "--load", "1N", "--plant", "load=1N"];
    for plan in [&["--dry-run"][..], &[]] {
        let refused = rigctl(&[&travel[..], plan].concat());
        assert_eq!(refused.status.code(), Some(1), "{plan:?}");
        assert!(error_of(&refused).contains("target is 0.0348 m, allowed are 0"), "{plan:?}: {}", error_of(&refused));
    }
    // Without homing, where it is sure.
    let far = file("far.csv");
    std::fs::write(&far, "t_s,position_m\n0,0.001\n5,0.002\n90,0.1\n").expect("written");
    for (arguments, named) in [
        (&["move", "--to", "100mm"][..], "target is 0.1 m, allowed are 0"),
        (&["track", text(&far)], "far.csv: line 4: target is 0.1 m"),
    ] {
        let refused = rigctl(arguments);
        assert_eq!(refused.status.code(), Some(1), "{arguments:?}");
        let said = error_of(&refused);
        assert!(said.contains(named) && !said.contains("homing first"), "{arguments:?}: {said}");
    }
    let possible = rigctl(&["move", "--to", "34mm", "--load", "1N", "--dry-run"]);
    assert!(possible.status.success(), "{}", error_of(&possible));
}

#[test]
fn raw_sensors_are_told_before_anything_is_homed() {
    let arguments = ["sensors", "--seconds", "1", "--plant", "twist_at_boot=4", "--json"];
    let readings = lines(&rigctl(&arguments));
    assert!((4..=6).contains(&readings.len()), "{readings:?}");
    for reading in &readings {
        let near = |key: &str, value: f64, within: f64| {
            let found = reading[key].as_f64().unwrap_or_else(|| panic!("no {key} in {reading}"));
            assert!((found - value).abs() < within, "{key} is {found}, not {value}");
        };
        // At 4 rad the motor's friction holds the load even before the drive does.
        near("gap_m", 0.0950, 0.0005);
        near("shaft_rad", 0.0, 0.05);
        near("drive_rad", 0.0, 0.05);
        near("supply_v", 24.0, 0.5);
        assert!(["estop_open", "upper_limit_open", "lower_limit_open"].iter().all(|key| reading[key] == false));
        assert!(reading["rest_tolerance_m"].is_null(), "nothing is held");
    }
    // In a fault, when they are wanted most.
    let low = lines(&rigctl(&["sensors", "--plant", "supply_voltage=15V", "--json"]));
    assert!(low[0]["supply_v"].as_f64().is_some_and(|v| (v - 15.0).abs() < 0.5), "{low:?}");
    let status = lines(&rigctl(&["status", "--plant", "supply_voltage=15V", "--json"]));
    assert!(status[0]["telemetry"]["state"] == "fault" && status[0]["sensors"]["gap_m"].is_number(), "{status:?}");
    assert_eq!(rigctl(&["sensors", "--seconds", "-1"]).status.code(), Some(2));
}

/// Plays a script of these lines.
fn play(name: &str, script: &str, more: &[&str]) -> Output {
    let path = file(&format!("emulated-{name}.script"));
    std::fs::write(&path, script).expect("written");
    rigctl(&[&["play", text(&path)], more].concat())
}

#[test]
fn a_script_with_a_refused_command_fails_and_counts_it() {
    let output = play("refused", "2.5 move 5mm\n3 move 6mm\n3.5 stop\n4 end\n", &["--json"]);
    let said = error_of(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("script line 1: refused: ") && said.contains("script line 2: refused: "), "{said}");
    assert_eq!(said.lines().last(), Some("error: 2 commands of the script were refused"));
    // It was played to its end all the same.
    assert!(lines(&output).last().is_some_and(|last| last["summary"].is_object()));
    let output = play("taken", "2.5 stop\n3 end\n", &[]);
    assert!(output.status.success(), "{}", error_of(&output));
}

#[test]
fn commands_of_a_script_wait_for_the_boards_start() {
    for (name, script, from_s) in
        [("early", "0 home\n6 end\n", 0.0), ("cycle", "4 fault power-cycle\n4 home\n10 end\n", 4.0)]
    {
        let output = play(name, script, &["--json"]);
        assert!(output.status.success(), "{}", error_of(&output));
        assert!(error_of(&output).contains("home waits until the board has started"), "{}", error_of(&output));
        let rows = lines(&output);
        let homing = rows.iter().find(|row| row["state"] == "homing").unwrap_or_else(|| panic!("{name}: no homing"));
        assert!(homing["t_s"].as_f64().is_some_and(|t_s| t_s > from_s + 1.0), "{homing}");
    }
    // Every command waits, in the order of the script.
    let output = play("both", "0 home\n0.1 config set speed-max 3mm/s\n0.2 move 1mm\n6 end\n", &["--json"]);
    let said = error_of(&output);
    for (line, command) in [(1, "home"), (2, "config"), (3, "move")] {
        assert!(said.contains(&format!("line {line}: {command} waits until the board has started")), "{said}");
    }
    assert!(!said.contains("line 1: refused") && said.contains("line 2: refused: not possible while homing"), "{said}");
    assert!(said.ends_with("error: 2 commands of the script were refused\n"), "{said}");
    // A stop cancels what waits, and a command that never was sent counts as refused.
    let output = play("stopped", "0 home\n0.5 stop\n6 end\n", &["--json"]);
    assert!(lines(&output).iter().all(|row| row["state"] != "homing"));
    let output = play("never", "0 home\n1 end\n", &["--json"]);
    assert!(output.status.code() == Some(1) && error_of(&output).contains("did not start"), "{}", error_of(&output));
}

#[test]
fn what_a_script_cannot_do_is_found_before_anything_is_played() {
    let output = play("unplayable", "0.1 stop\n900 plant k2_scale=1.1\n901 end\n", &["--json"]);
    let said = error_of(&output);
    assert!(output.status.code() == Some(1) && said.contains("line 2") && said.contains("k2_scale"), "{said}");
    assert!(output.stdout.is_empty(), "something was played");
}

#[test]
fn a_homing_that_fails_says_why_by_its_documented_name() {
    // Far below the range of the table.
    let plant = ["--plant", "load=0.02kg"];
    let output = rigctl(&[&["home", "--json"][..], &plant].concat());
    assert_eq!(output.status.code(), Some(1), "{}", error_of(&output));
    let told = lines(&output).pop().unwrap_or_else(|| panic!("nothing: {}", error_of(&output)));
    let why = told["homing_failure"].as_str().unwrap_or_else(|| panic!("{told}")).to_owned();
    assert_eq!(told["error"]["kind"], "homing-failed");
    let page = std::fs::read_to_string(root().join("docs/reference/faults.md")).expect("the page");
    assert!(page.contains(&format!("\n| `{why}` |")), "{why} is not in docs/reference/faults.md");
    assert!(error_of(&output).contains(&format!("homing failed: {why}")), "{}", error_of(&output));
    let rows = lines(&play("why", "2.5 home\n40 end\n", &[&plant[..], &["--json"]].concat()));
    let homing = rows.iter().filter(|row| row["state"] == "homing");
    assert!(homing.clone().count() > 10 && homing.into_iter().all(|row| row["homing_failure"].is_null()));
    let after = rows.iter().rev().find(|row| row["t_s"].is_number()).expect("rows");
    assert_eq!(after["homing_failure"], why.as_str(), "{after}");
}

/// What a newcomer runs first ends well, and says how well it knows what it says.
#[test]
fn the_demo_stays_within_what_it_states() {
    let folder = folder("demo");
    let output = rigctl(&["--json", "demo", "--out", text(&folder)]);
    assert!(output.status.success() && folder.join("demo.svg").exists(), "{}", error_of(&output));
    let runs = lines(&output);
    assert_eq!(runs.len(), 3);
    for run in runs {
        let [load_n, stated_n] = ["load_n", "load_error_n"].map(|key| run["move"][key].as_f64().expect("a number"));
        let true_n = run["load_true_n"].as_f64().expect("a number");
        assert!((load_n - true_n).abs() <= 2.0 * stated_n && stated_n < 0.4 * true_n, "{run}");
    }
}

#[test]
fn the_frequency_response_of_an_ideal_rig_is_that_of_a_loop_that_follows() {
    let out = file("response.csv");
    let path = out.to_str().expect("a path");
    let asked = ["response", "--from", "1Hz", "--to", "3Hz", "--periods", "2", "--amplitude", "0.2mm", "--out", path];
    let svg = file("response.svg");
    let figure = ["--figure", svg.to_str().expect("a path")];
    let plant = ["--json", "--rig", "ideal", "--plant", "load=0.5kg,friction=0"];
    let output = rigctl(&[&asked[..], &figure, &plant].concat());
    assert!(output.status.success(), "{}", error_of(&output));
    let drawn = std::fs::read_to_string(&svg).expect("a picture");
    for text in ["Frequency response at 8 mm ± 0.2 mm", "gain (mm/rad)", "phase (°)", "coherence", "emulated board"] {
        assert!(drawn.contains(text), "{text}");
    }
    let measured = lines(&output).pop().expect("a result");
    let text = std::fs::read_to_string(&out).expect("a file");
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect())
        .collect();
    assert_eq!(text.lines().next().map(|head| head.split(',').count()), Some(9));
    assert_eq!(measured["lines"].as_array().map(Vec::len), Some(rows.len()));
    for row in &rows {
        let [frequency_hz, gain, _, phase_deg, coherence, by_twist, ..] = row[..] else { panic!("{row:?}") };
        // The set-point is fed forward, and the mechanism is its transmission ratio below its resonance.
        assert!((0.95..1.25).contains(&gain) && coherence > 0.99, "{frequency_hz} Hz: {gain}, {coherence}");
        assert!((-10.0..5.0).contains(&phase_deg) && (4e-4..7e-4).contains(&by_twist), "{phase_deg}, {by_twist}");
    }
    // A dot for each frequency in six panels.
    assert_eq!(drawn.matches("<circle").count(), 6 * rows.len());
    for wrong in
        [["--from", "3Hz"], ["--to", "9Hz"], ["--amplitude", "50mm"], ["--amplitude", "0mm"], ["--figure", path]]
    {
        let refused = rigctl(&[&["response", "--out", path, "--to", "2Hz"][..], &wrong].concat());
        assert!(
            !refused.status.success() && error_of(&refused).contains(wrong[0]),
            "{wrong:?}: {}",
            error_of(&refused)
        );
    }
}
