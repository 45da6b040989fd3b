//! `export`: a recorded log in other formats, and what is refused. Their own Python readers read the files in
//! `crates/tsa-python/tests/test_export.py`.

use crate::common::{desktop, error_of, file, lines, rigctl, text};
use rigctl::log::Log;

#[test]
fn a_recorded_log_is_exported_whole_in_every_format() {
    let (log, out) = (file("export.csv"), file("export.out"));
    let recorded = rigctl(&["record", "--seconds", "1s", "--out", text(&log)]);
    assert!(recorded.status.success(), "{}", error_of(&recorded));
    let rows = Log::load(&log).expect("a log").rows.len();
    for (format, begins) in [("mcap", &b"\x89MCAP0\r\n"[..]), ("csv", b"t_s,state,")] {
        let done = desktop(&["export", text(&log), "--to", format, "--out", text(&out), "--json"]);
        assert!(done.status.success(), "{format}: {}", error_of(&done));
        let content = std::fs::read(&out).expect("written");
        let said = &lines(&done)[0];
        println!("{format}: {said}");
        assert_eq!((said["rows"].as_u64(), said["bytes"].as_u64()), (Some(rows as u64), Some(content.len() as u64)));
        assert!(rows > 50 && content.starts_with(begins), "{format}: {rows} rows");
    }
    // The last one: the same cells, without a comment.
    let csv = std::fs::read_to_string(&out).expect("text");
    assert_eq!(csv.lines().count(), rows + 1);
    let whole = std::fs::read_to_string(&log).expect("the log");
    assert!(csv.lines().all(|line| !line.starts_with('#') && whole.contains(line)));
    // What a file held before is beside it.
    let kept = file("export.out~");
    assert!(std::fs::read(&kept).expect("kept").starts_with(b"\x89MCAP0\r\n"));
}

#[test]
fn what_cannot_be_exported_is_refused_by_name_and_nothing_is_written() {
    let (log, out) = (file("export-wrong.csv"), file("export.never"));
    let good =
        "# format = tsa-log 1\nt_s,state,position_m,twist_rad\n0.01,ready,,3.1\n0.02,ready,0.5,3.1\n# end rows = 2\n";
    let cut = &good[..good.find("0.5,3.1").expect("there") + 2];
    let to = |format: &'static str| ["export", "LOG", "--to", format, "--out", "OUT"];
    for (content, arguments, code, named) in [
        (good, &to("xlsx")[..], 2, "--to"),
        (good, &["export", "LOG", "--out", "OUT"], 2, "--to"),
        (good, &["export", "LOG", "--to", "csv"], 2, "--out"),
        (good, &["export", "--to", "csv", "--out", "OUT"], 2, "LOG"),
        (good, &["export", "LOG", "--to", "csv", "--out", "LOG"], 2, "--out"),
        (good, &["export", "LOG", "--to", "csv", "--out", "/no/such/folder/x"], 1, "/no/such/folder/x"),
        (good, &["export", "/no/such.csv", "--to", "csv", "--out", "OUT"], 1, "/no/such.csv"),
        (cut, &to("mcap"), 1, "cut short after 1 rows"),
    ] {
        std::fs::write(&log, content).expect("written");
        let place = |word: &&'static str| match *word {
            "LOG" => text(&log).to_owned(),
            "OUT" => text(&out).to_owned(),
            word => word.to_owned(),
        };
        let words: Vec<String> = arguments.iter().map(place).collect();
        let refused = desktop(&words.iter().map(String::as_str).collect::<Vec<_>>());
        let said = error_of(&refused);
        assert_eq!(refused.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(named) && !out.exists(), "{arguments:?}: {said}");
        assert!(code == 2 || said.contains(if named.starts_with('/') { named } else { text(&log) }), "{said}");
    }
    // The whole rows of a log that was cut.
    std::fs::write(&log, cut).expect("written");
    let out = file("export-partial.csv");
    let taken = desktop(&["export", text(&log), "--to", "csv", "--out", text(&out), "--partial"]);
    assert!(taken.status.success(), "{}", error_of(&taken));
    let held = std::fs::read_to_string(&out).expect("written");
    assert_eq!(held, "t_s,state,position_m,twist_rad\n0.01,ready,,3.1\n");
}
