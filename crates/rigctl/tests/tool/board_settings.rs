//! `config` and `calibrate` as a user calls them, on the emulated board with its flash in a file.

use crate::common::{error_of, folder, lines, other_rig, rigctl};
use rig_link::messages::Setting;
use serde_json::{Value, json};
use std::path::Path;

/// Runs with `--json` on a board whose flash is this file; the objects that it prints.
fn on(flash: &Path, arguments: &[&str]) -> Vec<Value> {
    let flash = flash.to_str().expect("a path");
    let output = rigctl(&[arguments, &["--flash", flash, "--json"]].concat());
    assert!(output.status.success(), "{arguments:?}: {}", error_of(&output));
    lines(&output)
}

/// The same for what must fail: its exit code and what it says.
fn fails(flash: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = rigctl(&[arguments, &["--flash", flash.to_str().expect("a path")]].concat());
    assert!(!output.status.success() && output.stdout.is_empty(), "{arguments:?}");
    (output.status.code(), error_of(&output))
}

fn setting(flash: &Path, name: &str) -> f64 {
    on(flash, &["config", "get", name])[0]["value"].as_f64().expect("a number")
}

#[test]
fn settings_are_kept_from_one_call_to_the_next_and_shown_by_status() {
    let flash = folder("kept").join("flash.bin");
    let all = on(&flash, &["config", "get"]);
    assert_eq!(all.len(), Setting::ALL.len());
    assert!(all.iter().all(|s| s["value"] == s["default"] && s["kept"] == false), "{all:?}");
    assert!(!flash.exists(), "asking writes nothing");
    let set = &on(&flash, &["config", "set", "speed-max", "3mm/s"])[0];
    assert_eq!((&set["name"], &set["value"], &set["before"]), (&"speed-max".into(), &0.003.into(), &0.05.into()));
    assert_eq!((&set["kept"], &set["unhomed"]), (&true.into(), &false.into()));
    on(&flash, &["config", "set", "lvdt-offset", "-1.5mm"]);
    assert_eq!((setting(&flash, "speed-max"), setting(&flash, "lvdt-offset")), (0.003, -0.0015));
    let status = &on(&flash, &["status"])[0];
    assert_eq!((&status["settings"]["speed-max"], &status["settings_kept"]), (&0.003.into(), &"kept".into()));
    let text = rigctl(&["status", "--flash", flash.to_str().expect("a path")]);
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(text.contains("speed-max 0.003 m/s (default 0.05 m/s)") && !text.contains("lvdt-gain"), "{text}");
    let (code, error) = fails(&flash, &["move", "--to", "5mm", "--speed", "4mm/s", "--json"]);
    assert!(code == Some(1) && error.contains("speed is 0.004 m/s"), "{error}");
    // Another call without the file has a new board.
    assert_eq!(lines(&rigctl(&["config", "get", "speed-max", "--json"]))[0]["value"], 0.05);
}

#[test]
fn wrong_names_values_and_files_are_refused_and_nothing_is_written() {
    let folder = folder("wrong");
    let flash = folder.join("flash.bin");
    for (arguments, code, named) in [
        (&["config", "set", "lvdt-gian", "1"][..], 2, &["lvdt-gian", "lvdt-gain", "twist-scale"][..]),
        (&["config", "get", "gain"], 2, &["gain", "lvdt-gain"]),
        (&["config", "set", "lvdt-gain"], 2, &["VALUE"]),
        (&["config", "set", "lvdt-offset", "1kg"], 2, &["lvdt-offset", "mm"]),
        (&["config", "set", "speed-max", "learned"], 2, &["speed-max"]),
        (&["config", "set", "lvdt-offset", "60mm"], 1, &["lvdt-offset is 0.06 m", "-0.05 to 0.05 m"]),
        (&["config", "set", "current-limit", "0.6A"], 1, &["current-limit", "0.5 A"]),
        (&["config", "set", "twist-scale", "learned"], 1, &["twist-scale", "homed"]),
        (&["config", "restore", "no-such.toml"], 1, &["no-such.toml"]),
        (&["calibrate", "lvdt", "--gap", "1kg"], 2, &["gap", "mm"]),
        (&["calibrate", "lvdt", "--gap", "140mm", "--point", "140mm"], 2, &["GAP:SENSOR"]),
        (&["calibrate", "lvdt", "--point", "140mm:141mm"], 2, &["--gap"]),
        (&["calibrate", "lvdt", "--gap", "140mm", "--point", "139mm:0.1"], 1, &["--point", "apart"]),
        (&["calibrate", "lvdt", "--gap", "1m"], 1, &["lvdt-offset"]),
        (&["calibrate", "lvdt", "--points", "no-such.csv"], 1, &["points file no-such.csv"]),
        (&["calibrate", "lvdt", "--points", "scenes/default.toml"], 1, &["scenes/default.toml", "no column `gap_m`"]),
        (&["calibrate", "lvdt", "--points", "p.csv", "--gap", "0.1"], 2, &["--points", "--gap"]),
        (&["calibrate", "lvdt", "--gauge-error", "10um"], 2, &["--points"]),
        (&["calibrate", "lvdt", "--points", "p.csv", "--gauge-error", "1kg"], 2, &["gauge-error", "mm"]),
        (&["calibrate", "lvdt", "--points", "p.csv", "--gauge-error", "2mm"], 2, &["gauge-error", "0 to 1 mm"]),
    ] {
        let (given, error) = fails(&flash, arguments);
        assert_eq!(given, Some(code), "{arguments:?}: {error}");
        assert!(named.iter().all(|part| error.contains(part)), "{arguments:?}: {error}");
    }
    assert!(!flash.exists(), "none of this may have been kept");
    std::fs::write(&flash, "short").expect("a file");
    let (code, error) = fails(&flash, &["config", "get"]);
    assert!(code == Some(1) && error.contains("flash.bin"), "{error}");
}

/// A fault of the start itself is there to be cleared.
#[test]
fn damaged_settings_are_cleared_by_the_tool() {
    let flash = folder("damaged").join("flash.bin");
    on(&flash, &["config", "set", "speed-max", "3mm/s"]);
    let mut image = std::fs::read(&flash).expect("kept");
    image[0x4000..0x1_0000].fill(0x5A);
    std::fs::write(&flash, image).expect("written");
    assert_eq!(on(&flash, &["status"])[0]["telemetry"]["fault"], "settings-corrupt");
    let cleared = on(&flash, &["clear"]);
    assert!(cleared.last().is_some_and(|row| row["fault"].is_null()), "{cleared:?}");
    for changes in [&["config", "set", "speed-max", "3mm/s"][..], &["calibrate", "zero"]] {
        let told = rigctl(changes);
        let said = String::from_utf8_lossy(&told.stdout).into_owned();
        assert!(said.contains("nothing of this lasts"), "an emulated board without --flash: {said}");
    }
}

#[test]
fn a_backup_brings_a_new_board_to_the_same_settings() {
    let folder = folder("backup");
    let (flash, other, file) = (folder.join("flash.bin"), folder.join("other.bin"), folder.join("board.toml"));
    let path = file.to_str().expect("a path");
    on(&flash, &["config", "set", "lvdt-gain", "1.0123456"]);
    on(&flash, &["config", "set", "twist-sign", "-1"]);
    on(&flash, &["config", "backup", path]);
    let text = std::fs::read_to_string(&file).expect("it was written");
    let restored = &on(&other, &["config", "restore", path])[0];
    assert_eq!((&restored["changed"], &restored["kept"]), (&2.into(), &true.into()), "{text}");
    assert_eq!(on(&flash, &["config", "get"]), on(&other, &["config", "get"]));
    // For another rig, by a file without its constants: only when told to. What a file does not have stays as it is on the
    // board, and is named.
    let hash = text.lines().find(|line| line.starts_with("rig_hash")).expect("a hash");
    let constants = &text[text.find("[constants]").expect("constants")..text.find("[settings]").expect("settings")];
    let foreign =
        text.replace(hash, "rig_hash = \"00000001\"").replace(constants, "").replace("twist-sign = -1.0\n", "");
    std::fs::write(&file, foreign).expect("a file");
    let (code, error) = fails(&other, &["config", "restore", path]);
    assert!(code == Some(1) && error.contains("00000001") && error.contains("--force"), "{error}");
    assert_eq!(setting(&other, "twist-sign"), -1.0);
    let flash = other.to_str().expect("a path");
    let forced = rigctl(&["config", "restore", path, "--force", "--flash", flash]);
    assert!(forced.status.success() && error_of(&forced).contains("twist-sign"), "{}", error_of(&forced));
    assert_eq!((setting(&other, "twist-sign"), setting(&other, "lvdt-gain")), (-1.0, 1.0123456));
}

#[test]
fn a_file_that_was_cut_takes_no_setting_from_the_board() {
    let folder = folder("cut");
    let (flash, file) = (folder.join("flash.bin"), folder.join("file"));
    let path = file.to_str().expect("a path");
    on(&flash, &["config", "set", "current-limit", "0.3A"]);
    on(&flash, &["config", "set", "lvdt-gain", "1.01"]);
    let kept = on(&flash, &["config", "get"]);
    on(&flash, &["record", "--seconds", "0.1", "--out", path]);
    let log = std::fs::read_to_string(&file).expect("a log");
    let head = log.find("t_s,state").expect("its columns");
    let settings = log.find("# settings.").expect("its settings");
    for text in [&log[..settings], &log[..head], "[settings]\nlvdt-gain = 1.02\n"] {
        std::fs::write(&file, text).expect("a file");
        let (code, error) = fails(&flash, &["config", "restore", path]);
        assert!(code == Some(1) && error.contains("cut short"), "{error}");
    }
    assert_eq!(on(&flash, &["config", "get"]), kept);
    // One that has its head is whole enough.
    std::fs::write(&file, &log[..log.len() - 20]).expect("a file");
    assert_eq!(on(&flash, &["config", "restore", path])[0]["changed"], 0);
}

/// The firmware for another LVDT and a lower current limit, on the flash of the default one.
#[test]
fn an_update_that_drops_settings_names_them_wherever_the_board_is_asked() {
    let folder = folder("update");
    let (flash, file) = (folder.join("flash.bin"), folder.join("board.toml"));
    let backup = file.to_str().expect("a path");
    for (name, value) in [("lvdt-gain", "1.01"), ("gear-scale", "1.02"), ("position-zero", "2mm")] {
        on(&flash, &["config", "set", name, value]);
    }
    on(&flash, &["config", "backup", backup]);
    let [elf, scene] = other_rig();
    let updated = |arguments: &[&str]| {
        let board = ["--firmware", &elf, "--scene", &scene, "--flash", flash.to_str().expect("a path")];
        rigctl(&[arguments, &board].concat())
    };
    let status = updated(&["status", "--json"]);
    assert!(
        error_of(&status).contains("warning: settings") && error_of(&status).contains("lvdt-gain"),
        "{}",
        error_of(&status)
    );
    let status = &lines(&status)[0];
    assert_eq!((&status["settings_kept"], &status["settings_dropped"]), (&"partly kept".into(), &json!(["lvdt-gain"])));
    assert_eq!(status["telemetry"]["fault"], "settings-corrupt");
    let values = &status["settings"];
    assert_eq!((&values["lvdt-gain"], &values["gear-scale"]), (&1.0.into(), &1.02.into()));
    let listed = String::from_utf8_lossy(&updated(&["config", "get"]).stdout).into_owned();
    assert!(listed.contains("DROPPED\n") && listed.contains("at their defaults are lvdt-gain,"), "{listed}");
    let all = lines(&updated(&["config", "get", "--json"]));
    let marks: Vec<_> = all.iter().filter(|s| s["dropped"] == true).map(|s| (&s["name"], &s["kept"])).collect();
    assert_eq!(marks, [(&"lvdt-gain".into(), &false.into())]);
    let doctor = &lines(&updated(&["doctor", "--json"]))[0];
    let check = doctor["checks"].as_array().and_then(|checks| checks.iter().find(|c| c["name"] == "settings"));
    let check = check.expect("a check of the settings");
    assert!(check["ok"] == false && check["seen"].to_string().contains("lvdt-gain"), "{check}");
    let home = updated(&["home"]);
    assert!(home.status.code() == Some(1) && error_of(&home).contains("lvdt-gain"), "{}", error_of(&home));
    assert!(error_of(&home).contains("settings-corrupt"), "{}", error_of(&home));
    // A backup for the LVDT before: the rest is restored, and a script does not go on as if all were.
    let restored = updated(&["config", "restore", backup, "--json"]);
    assert!(restored.status.code() == Some(1) && error_of(&restored).contains("NOT taken"), "{}", error_of(&restored));
    assert_eq!(lines(&restored)[0]["dropped"], json!(["lvdt-gain"]));
    let status = &lines(&updated(&["status", "--json"]))[0];
    assert_eq!((&status["settings_kept"], &status["telemetry"]["fault"]), (&"kept".into(), &Value::Null));
    assert_eq!((&status["settings"]["lvdt-gain"], &status["settings"]["position-zero"]), (&1.0.into(), &0.002.into()));
}

/// Two calls with the load at two gaps, as a person would do it with callipers.
#[test]
fn the_lvdt_is_calibrated_point_by_point() {
    let flash = folder("calibrate").join("flash.bin");
    let off = ["--plant", "lvdt_offset=1mm", "--plant", "lvdt_gain_error=1%"];
    let at = |twist: &str, arguments: &[&str]| {
        let twist = format!("twist_at_boot={twist}");
        on(&flash, &[&["calibrate", "lvdt"], arguments, &off, &["--plant", &twist]].concat())[0].clone()
    };
    let number = |object: &Value, key: &str| object[key].as_f64().unwrap_or_else(|| panic!("{key} in {object}"));
    // To the 20 um of callipers.
    let callipers = |look: &Value| (number(look, "true_gap_m") / 20e-6).round() * 20e-6;
    let look = at("1", &[]);
    let first_m = callipers(&look);
    let before_m = number(&look, "gap_m") - number(&look, "true_gap_m");
    let one = at("1", &["--gap", &first_m.to_string()]);
    assert!(number(&one, "error_after_m").abs() < 10e-6 && number(&one, "lvdt_gain") == 1.0, "{one}");
    let look = at("40", &[]);
    let second_m = callipers(&look);
    let between_m = number(&look, "gap_m") - number(&look, "true_gap_m");
    let point = format!("{first_m}:{}", number(&one, "sensor_m"));
    let two = at("40", &["--gap", &second_m.to_string(), "--point", &point]);
    let errors = ["1", "20", "40"].map(|twist| {
        let look = at(twist, &[]);
        number(&look, "gap_m") - number(&look, "true_gap_m")
    });
    println!(
        "off by {:+.3} mm; after one point by {:+.3} mm at another gap; after two by {:?} um (gain {}, offset {} m)",
        before_m * 1e3,
        between_m * 1e3,
        errors.map(|e| (e * 1e7).round() / 10.0),
        two["lvdt_gain"],
        two["lvdt_offset_m"]
    );
    assert!(before_m > 1e-3 && between_m.abs() > 100e-6);
    assert!(errors.iter().all(|error| error.abs() < 40e-6), "{errors:?}");
    assert!((number(&two, "lvdt_gain") - 1.0 / 1.01).abs() < 2e-3, "{two}");
}

/// A sensor that bends by 0.5 % of its stroke, calibrated by gauges at 11 places as the documentation says.
#[test]
fn a_bent_sensor_is_calibrated_at_11_points_and_the_points_go_with_the_board() {
    let folder = folder("points");
    let (flash, other) = (folder.join("flash.bin"), folder.join("other.bin"));
    let (file, backup) = (folder.join("points.csv"), folder.join("board.toml"));
    let [file_text, backup_text] = [&file, &backup].map(|path| path.to_str().expect("a path"));
    let at = |flash: &Path, twist: f64, more: &[&str]| {
        let plant = format!("twist_at_boot={twist},load=0.15kg,lvdt_nonlinearity=0.005,motor_friction=0.3mNm");
        on(flash, &[&["calibrate", "lvdt", "--plant", &plant], more].concat()).pop().expect("a result")
    };
    let number = |object: &Value, key: &str| object[key].as_f64().unwrap_or_else(|| panic!("{key} in {object}"));
    let error = |look: &Value| number(look, "gap_m") - number(look, "true_gap_m");
    // Twists at which the gap is 1.3 to 3.5 mm apart from one to the next.
    let twists = [4.0, 10.0, 14.0, 18.0, 22.0, 26.0, 30.0, 34.0, 38.0, 42.0, 46.0];
    let looks = twists.map(|twist| at(&flash, twist, &[]));
    let rows = looks.iter().map(|look| format!("{},{}\n", number(look, "true_gap_m"), number(look, "sensor_m")));
    std::fs::write(&file, format!("gap_m,sensor_m\n{}", rows.collect::<String>())).expect("a file");
    let set = at(&flash, 4.0, &["--points", file_text, "--gauge-error", "10um"]);
    assert_eq!((set["points"].as_array().map(Vec::len), &set["kept"]), (Some(11), &true.into()), "{set}");
    let stated_m = number(&set, "lvdt_error_m");
    assert!((10e-6..40e-6).contains(&stated_m), "{stated_m} m");
    let between = [7.0, 32.0, 44.0];
    let after = between.map(|twist| error(&at(&flash, twist, &[])));
    on(&flash, &["config", "backup", backup_text]);
    assert_eq!(on(&other, &["config", "restore", backup_text])[0]["changed"], 1);
    assert_eq!(on(&flash, &["config", "get"]), on(&other, &["config", "get"]));
    assert_eq!(error(&at(&other, 32.0, &[])), after[1], "the same board");
    let status = &on(&flash, &["status"])[0];
    assert_eq!(status["settings"]["lvdt-points"]["points"], set["points"]);
    // The offset goes on top of it, and the points go without it.
    at(&flash, 32.0, &["--gap", "80mm"]);
    assert!((number(&at(&flash, 32.0, &[]), "gap_m") - 0.080).abs() < 20e-6);
    at(&flash, 32.0, &["--no-points"]);
    assert!(on(&flash, &["config", "get"]).iter().all(|s| s["name"] != "lvdt-points"));
    let fresh = folder.join("fresh.bin");
    let before = between.map(|twist| error(&at(&fresh, twist, &[])));
    println!("um off before {:?}, after {:?}", before.map(|e| (e * 1e6).round()), after.map(|e| (e * 1e6).round()));
    assert!(before.iter().any(|e| e.abs() > 100e-6), "{before:?}");
    assert!(after.iter().all(|e| e.abs() < 40e-6), "{after:?}");
}

#[test]
fn the_present_position_becomes_zero() {
    let flash = folder("zero").join("flash.bin");
    on(&flash, &["config", "set", "position-zero", "4mm"]);
    let zero = on(&flash, &["calibrate", "zero"]);
    let zero = zero.last().expect("a result");
    assert!((zero["position_before_m"].as_f64().expect("homed") + 0.004).abs() < 50e-6, "{zero}");
    assert!(zero["position_m"].as_f64().expect("homed").abs() < 20e-6, "{zero}");
    assert!(setting(&flash, "position-zero").abs() < 50e-6);
    // Positions and their truth are both told from there.
    on(&flash, &["config", "set", "position-zero", "-2mm"]);
    let moved = on(&flash, &["move", "--to", "6mm"]);
    let moved = moved.last().expect("a result");
    assert!(moved["true_error_m"].as_f64().expect("emulated").abs() < 50e-6, "{moved}");
}

#[test]
fn scripts_set_and_show_settings_across_a_power_cycle() {
    let folder = folder("script");
    let script = folder.join("settings.script");
    let text = "0.1 config set speed-max 4mm/s # waits for the drive's start\n2.5 config set speed-max 3mm/s\n\
                3 fault power-cycle\n5.8 config set lvdt-gain 1.5\n5.9 home\n6.4 config set lvdt-gain 1.01\n7 end\n";
    std::fs::write(&script, text).expect("a file");
    let play = |json: bool| {
        let json: &[&str] = if json { &["--json"] } else { &[] };
        let output = rigctl(&[&["sim", "--script", script.to_str().expect("a path")], json].concat());
        let last = "error: 2 commands of the script were refused\n";
        assert!(output.status.code() == Some(1) && error_of(&output).ends_with(last), "{}", error_of(&output));
        output
    };
    let people = play(false);
    let shown = String::from_utf8_lossy(&people.stdout).into_owned();
    let settings: Vec<&str> = shown.lines().filter(|line| line.contains(" settings ")).collect();
    let kept: Vec<bool> = settings.iter().map(|line| line.contains("\"speed-max\":0.003")).collect();
    assert_eq!(kept, [false, false, true, true], "{settings:?}");
    for message in [
        "line 1: config waits until the board has started",
        "line 4: refused: lvdt-gain is 1.5",
        "line 6: refused: not possible while homing",
    ] {
        assert!(error_of(&people).contains(message), "{message}: {}", error_of(&people));
    }
    let rows = lines(&play(true));
    let summary = &rows.last().expect("a summary")["summary"];
    assert_eq!(summary["settings"]["speed-max"], 0.003, "{summary}");
    assert!(rows[..rows.len() - 1].iter().all(|row| row["t_s"].is_number()), "telemetry alone");
}
