//! `record`, `sweep` with `identify`, `replay`: what is kept of a run, and what can be made of it afterwards.

use crate::common::{error_of, file, folder, lines, rigctl, text};
use rigctl::log::{Log, Mark};
use std::path::Path;

#[test]
fn a_record_says_what_it_takes_to_run_it_again_and_is_replayed() {
    let (script, path, again) = (file("again.script"), file("again.csv"), file("rerun.csv"));
    // Homed at 30 s, a move by then.
    let events = "2.5 home\n36 move 8mm speed=3mm/s\n41 move 3mm speed=2mm/s load=0.5kg\n46 end\n";
    std::fs::write(&script, events).expect("the script is written");
    let record = |out: &Path, more: &[&str]| {
        let arguments = ["record", "--script", text(&script), "--out", text(out)];
        let output = rigctl(&[&arguments[..], more].concat());
        assert!(output.status.success(), "{}", error_of(&output));
    };
    record(&path, &["--seed", "3", "--plant", "load=0.7kg,friction=0.05N"]);
    let first = Log::load(&path).expect("a log").whole().expect("all of it");
    for key in
        ["scene", "scene_hash", "port", "rig", "seed", "firmware", "git", "protocol_hash", "table.crc", "host_time"]
    {
        assert!(first.header.get(key).is_some_and(|v| !v.is_empty()), "{key}");
    }
    assert_eq!(first.header.get("seed"), Some("3"));
    let load_n: f64 = first.header.get("plant.load").and_then(|l| l.parse().ok()).expect("a load");
    assert!((load_n - 0.7 * 9.80665).abs() < 1e-9);
    assert_eq!(first.header.get("table.contraction_error_m").map(|v| v.parse::<f32>().is_ok()), Some(true));
    // A row for each tick, requests and events among them.
    assert!(first.rows.windows(2).all(|r| (r[1].t_s - r[0].t_s - 0.01).abs() < 1e-3));
    let requests = first.marks.iter().filter(|m| matches!(m.mark, Mark::Request(_))).count();
    assert!(requests == 3 && first.marks.iter().any(|m| matches!(m.mark, Mark::Homed { .. })), "{:?}", first.marks);
    // Run again by what its head says.
    let head = |key: &str| first.header.get(key).expect("in the head").to_owned();
    let lines: Vec<String> = (1..=4).map(|k| head(&format!("script.{k}"))).collect();
    std::fs::write(&script, lines.join("\n")).expect("the script is written");
    let [load, friction] = ["load", "friction"].map(|key| format!("{key}={}", head(&format!("plant.{key}"))));
    record(&again, &["--scene", &head("scene"), "--seed", &head("seed"), "--plant", &load, "--plant", &friction]);
    assert_eq!(Log::load(&again).expect("a log").rows, first.rows);
    is_replayed_until_it_says_otherwise(&path);
}

#[test]
fn a_record_without_a_file_goes_to_standard_output_and_its_errors_name_what_is_wrong() {
    let output = rigctl(&["record", "--seconds", "0.2"]);
    let log = Log::parse(&String::from_utf8_lossy(&output.stdout)).and_then(Log::whole).expect("a log");
    assert!(log.rows.len() > 10 && log.header.get("scene_hash").is_some());
    let rows = lines(&rigctl(&["record", "--seconds", "0.2", "--json"]));
    assert_eq!(rows[0]["header"]["scene_hash"].as_str(), log.header.get("scene_hash"));
    assert!(rows[1]["t_s"].is_number() && rows.last().is_some_and(|r| r["summary"]["rows"].as_u64() > Some(10)));
    for (arguments, code, named) in [
        (&["record", "--out", "/no/such/folder/x.csv"][..], 1, "/no/such/folder/x.csv"),
        (&["record", "--seconds", "0"], 2, "--seconds"),
        (&["record", "--seconds", "nan"], 2, "--seconds"),
        (&["record", "--script", "no-such.script"], 1, "no-such.script"),
        (&["record", "--script", "a", "--seconds", "1"], 2, "--seconds"),
        (&["sweep", "--load", "0.5kg"], 2, "--out"),
        (&["sweep", "--load", "90kg", "--out", "/tmp/rigctl-never.csv"], 1, "load"),
        (&["sweep", "--load", "1kg", "--turns", "9", "--out", "/tmp/rigctl-never.csv"], 1, "--turns"),
        (&["sweep", "--load", "1kg", "--speed", "9", "--out", "/tmp/rigctl-never.csv"], 1, "--speed"),
    ] {
        let wrong = rigctl(arguments);
        assert_eq!(wrong.status.code(), Some(code), "{arguments:?}: {}", error_of(&wrong));
        assert!(error_of(&wrong).contains(named), "{arguments:?}: {}", error_of(&wrong));
    }
}

#[test]
fn a_record_whose_script_was_refused_is_whole_and_fails() {
    let (script, log) = (file("refused.script"), file("refused.csv"));
    std::fs::write(&script, "0 hold\n2.5 move 5mm\n3 end\n").expect("written");
    let output = rigctl(&["record", "--script", text(&script), "--out", text(&log)]);
    assert_eq!(output.status.code(), Some(1), "{}", error_of(&output));
    assert!(error_of(&output).contains("script line 2: refused: "), "{}", error_of(&output));
    assert!(
        error_of(&output).ends_with(" of the script were refused\n")
            || error_of(&output).ends_with(" of the script was refused\n")
    );
    Log::load(&log).and_then(|log| log.whole().map_err(|e| e.to_string())).expect("a whole log");
}

#[test]
fn a_file_that_is_there_is_not_lost_to_a_new_one() {
    let kept = file("kept.csv");
    let beside = kept.with_extension("csv~");
    std::fs::write(&kept, "precious").expect("written");
    for arguments in [
        &["record", "--port", "/dev/no-such-rig"][..],
        &["record", "--scene", "scenes/finger.toml"],
        &["sweep", "--load", "500N"],
        // Its homing fails.
        &["sweep", "--load", "5N", "--plant", "radius_scale=2"],
    ] {
        let failed = rigctl(&[arguments, &["--out", text(&kept)]].concat());
        assert_eq!(failed.status.code(), Some(1), "{arguments:?}: {}", error_of(&failed));
        assert_eq!(std::fs::read_to_string(&kept).expect("there"), "precious", "{arguments:?}");
    }
    let own = rigctl(&["identify", text(&kept), "--out", text(&kept)]);
    assert!(own.status.code() == Some(2) && error_of(&own).contains("--out"), "{}", error_of(&own));
    let recorded = rigctl(&["record", "--seconds", "100ms", "--out", text(&kept)]);
    assert!(recorded.status.success() && error_of(&recorded).contains(text(&beside)), "{}", error_of(&recorded));
    assert_eq!(std::fs::read_to_string(&beside).expect("kept"), "precious");
    Log::load(&kept).expect("a log").whole().expect("all of it");
    // Nothing is left where nothing was.
    let none = file("none.csv");
    assert_eq!(rigctl(&["sweep", "--load", "500N", "--out", text(&none)]).status.code(), Some(1));
    assert!(!none.exists());
}

/// A recorded homing with moves.
fn is_replayed_until_it_says_otherwise(path: &Path) {
    let replayed = |arguments: &[&str]| rigctl(&[&["replay", "--json"], arguments].concat());
    let output = replayed(&[text(path)]);
    assert!(output.status.success(), "{}", error_of(&output));
    let whole = &lines(&output)[0];
    println!("{whole:#}");
    let one = &whole["stretches"][0];
    assert!(whole["same_table"] == true && one["ticks"].as_u64() > Some(1000) && one["parted"].is_null(), "{one}");
    let largest = |what: &str| one[what]["largest"].as_f64().expect("a number");
    // The log rounds its numbers, and the set-point's path follows from the load estimate: a tenth of what counts as
    // parted is allowed.
    assert!(largest("load_n") < 0.01 && largest("setpoint_m") < 1e-6, "{one}");
    assert!(largest("twist_speed_rad_per_s") < 1.0 && one["ended_by"] == "the log's end", "{one}");
    // Another estimate from 36 s on: by 3 %.
    let log = std::fs::read_to_string(path).expect("the log");
    let header = log.lines().find(|l| l.starts_with("t_s,")).expect("the columns' names");
    let column = header.split(',').position(|name| name == "load_n").expect("a column");
    let changed = log.lines().map(|line| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if cells[0].parse::<f64>().is_ok_and(|t| t > 36.0) {
            cells[column] = (cells[column].parse::<f64>().expect("a load") * 1.03).to_string();
        }
        cells.join(",") + "\n"
    });
    let other = file("changed.csv");
    std::fs::write(&other, changed.collect::<String>()).expect("written");
    let output = replayed(&[text(&other)]);
    let one = lines(&output)[0]["stretches"][0].clone();
    let at_s = one["parted"]["t_s"].as_f64().unwrap_or_else(|| panic!("{one}"));
    assert!(one["parted"]["what"] == "load_n" && (at_s - 36.0).abs() < 0.02, "{one}");
    // A table that is not known to be the board's is said.
    let crc = log.lines().find(|line| line.starts_with("# table.crc")).expect("the table's checksum");
    for (line, said) in
        [("# table.crc = 00000000", "another one for the same scene"), ("#", "does not tell which table")]
    {
        std::fs::write(&other, log.replace(crc, line)).expect("written");
        let noted = replayed(&[text(&other)]);
        assert!(noted.status.success() && error_of(&noted).contains(said), "{}", error_of(&noted));
        assert!(lines(&noted)[0]["same_table"] != true);
    }
    // What is no such log is refused by name.
    let cut = &log[..log.len() / 2];
    for (content, named) in [
        (cut, "cut short"),
        (&log.replace(",moving,", ",mooving,"), "mooving"),
        (&log.replace("scene_hash = ", "scene_hash = 0"), "--scene"),
        (&log.replace("event homed", "event stopped"), "nothing that can be replayed"),
    ] {
        std::fs::write(&other, content).expect("written");
        let refused = replayed(&[text(&other)]);
        assert_eq!(refused.status.code(), Some(1), "{named}");
        assert!(
            error_of(&refused).contains(named) && error_of(&refused).contains("changed.csv"),
            "{}",
            error_of(&refused)
        );
        assert!(refused.stdout.is_empty());
    }
    std::fs::write(&other, cut).expect("written");
    assert_eq!(replayed(&[text(&other), "--partial"]).status.success(), cut.contains("event homed"));
    // Nor is half an experiment fitted to without a word.
    for (content, named) in [
        (cut, "cut short"),
        (&log.replace("# lost_frames", "# broken_off = fault drive-stall\n# lost_frames"), "drive-stall"),
    ] {
        std::fs::write(&other, content).expect("written");
        let refused = rigctl(&["identify", text(&other)]);
        assert!(refused.status.code() == Some(1) && error_of(&refused).contains(named), "{}", error_of(&refused));
        let taken = rigctl(&["identify", "--partial", text(&other)]);
        assert!(error_of(&taken).contains("not of `rigctl sweep`"), "{}", error_of(&taken));
    }
}

/// The second homing takes into account what the rods remember of the first load.
#[test]
fn a_homing_after_a_heavier_load_is_replayed_with_what_the_rods_remember() {
    let (script, log) = (file("lighter.script"), file("lighter.csv"));
    std::fs::write(&script, "2.5 home\n42 plant load=0.4kg\n47 home\n90 move 8mm speed=3mm/s\n95 end\n")
        .expect("written");
    let record = ["record", "--script", text(&script), "--out", text(&log), "--plant", "load=1kg"];
    let output = rigctl(&record);
    assert!(output.status.success(), "{}", error_of(&output));
    let output = rigctl(&["replay", "--json", text(&log)]);
    let stretches = lines(&output)[0]["stretches"].clone();
    assert!(stretches[1]["ticks"].as_u64() > Some(300) && stretches[1]["parted"].is_null(), "{stretches}");
}

#[test]
fn a_log_holds_the_calibration_and_is_replayed_and_restored_with_it() {
    let folder = folder("calibrated");
    let [flash, other, script, log] = ["one.bin", "two.bin", "script", "log.csv"].map(|name| folder.join(name));
    for (name, value) in [("position-zero", "2mm"), ("lvdt-gain", "1.004"), ("speed-max", "4mm/s")] {
        let set = rigctl(&["config", "set", name, value, "--flash", text(&flash)]);
        assert!(set.status.success(), "{}", error_of(&set));
    }
    // Below 0, where without its settings nothing could go. Then every position gets another number.
    let lines_of =
        "2.5 home\n36 move 5mm speed=3mm/s\n41 move -1mm speed=3mm/s\n45 config set position-zero 1mm\n46 end\n";
    std::fs::write(&script, lines_of).expect("written");
    let output = rigctl(&["record", "--script", text(&script), "--out", text(&log), "--flash", text(&flash)]);
    assert!(output.status.success(), "{}", error_of(&output));
    let first = std::fs::read_to_string(&log).expect("a log");
    for line in ["# settings_kept = kept", "# settings.position-zero = 0.002", "# settings.lvdt-gain = 1.004"] {
        assert!(first.lines().any(|l| l == line), "{line}");
    }
    let parted = || {
        let output = rigctl(&["replay", "--json", text(&log)]);
        assert!(output.status.success(), "{}", error_of(&output));
        lines(&output)[0]["stretches"][0]["parted"].clone()
    };
    assert!(parted().is_null(), "{}", parted());
    let without: String = first.lines().filter(|l| !l.contains("position-zero")).map(|l| format!("{l}\n")).collect();
    std::fs::write(&log, without).expect("written");
    // Without the setting every position stands for another gap: the set-points part in the first move.
    assert!(parted()["what"] == "setpoint_m" && parted()["t_s"].as_f64().is_some_and(|t_s| t_s > 36.0), "{}", parted());
    for (to, named) in [("gian = 1", "lvdt-gian"), ("gain = 3", "lvdt-gain is 3"), ("gain = x", "lvdt-gain")] {
        std::fs::write(&log, first.replace("settings.lvdt-gain = 1.004", &format!("settings.lvdt-{to}")))
            .expect("written");
        let refused = rigctl(&["replay", text(&log)]);
        assert!(refused.status.code() == Some(1) && error_of(&refused).contains(named), "{}", error_of(&refused));
    }
    // What a log tells of a board makes another one like it, or a plan without one. A whole head without points of the LVDT says
    // that there are none.
    std::fs::write(&log, &first).expect("written");
    let points = folder.join("points.csv");
    std::fs::write(&points, "gap_m,sensor_m\n0.09,0.0901\n0.1,0.1\n").expect("written");
    let calibrate = ["calibrate", "lvdt", "--points", text(&points), "--gauge-error", "10um", "--flash", text(&other)];
    let calibrated = rigctl(&calibrate);
    assert!(calibrated.status.success(), "{}", error_of(&calibrated));
    let restored = rigctl(&["config", "restore", text(&log), "--flash", text(&other), "--json"]);
    assert!(restored.status.success(), "{}", error_of(&restored));
    assert_eq!(lines(&restored)[0]["changed"], 4);
    let settings = rigctl(&["config", "get", "--flash", text(&other), "--json"]);
    assert!(lines(&settings).iter().all(|setting| setting["name"] != "lvdt-points"));
    let plan = ["move", "--to", "-1mm", "--dry-run", "--load", "0.5kg", "--settings", text(&log), "--json"];
    let planned = lines(&rigctl(&plan));
    assert!(planned[0]["setpoint_m"].as_f64().is_some_and(|p| (p + 0.002).abs() < 1e-7), "{:?}", planned.first());
    let last = planned.last().and_then(|row| row["setpoint_m"].as_f64());
    assert!(last.is_some_and(|p| (p + 0.001).abs() < 1e-7), "{planned:?}");
    for (arguments, named) in
        [(&plan[..6], "target is -0.001"), (&[&plan[..], &["--speed", "5mm/s"]].concat(), "0.004")]
    {
        let refused = rigctl(arguments);
        assert!(!refused.status.success() && error_of(&refused).contains(named), "{}", error_of(&refused));
    }
}
