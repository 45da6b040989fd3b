//! The section on rigs that are not their own model: the study's floors beside what was measured.

use super::Measured;
use super::sections::{printed, rigctl, text};
use crate::process::cargo;
use crate::{Folders, host};
use anyhow::{Context, Result};
use serde_json::Value;

/// Seeds of the rigs that are reported, nominal and hard, which nothing was tuned on: all of them identified, some of them
/// as built, and one with single effects.
const SEEDS: &str = "1001..1021";
const SOME: &str = "1001..1006";
const TWO: &str = "1001..1003";
const ONE: &str = "1001..1002";
/// The check of the comparison with a fixed ratio, which takes several times as long as all others.
const FIXED_RATIO: &str = "times_better_than_fixed_ratio";

/// The study's runs: name of the files, and its other arguments. Single effects are shown under one load on rigs as built: the
/// study of all of them under all loads takes an hour.
const RUNS: [(&str, &[&str]); 6] = [
    ("rigs", &["--no-fixed-ratio", "--seeds", SEEDS, "--rigs", "both"]),
    ("rigs-as-built", &["--no-fixed-ratio", "--seeds", SOME, "--rigs", "both", "--as-built"]),
    ("fixed-ratio", &["--seeds", TWO, "--rigs", "both"]),
    ("ideal", &["--no-fixed-ratio", "--seeds", ONE, "--rigs", "ideal"]),
    ("each", &["--no-fixed-ratio", "--seeds", ONE, "--rigs", "both", "--each", "--as-built", "--loads", "0.5"]),
    ("effects", &["--no-fixed-ratio", "--seeds", ONE, "--ramp", "--as-built", "--loads", "0.5"]),
];

/// Runs the study and draws it.
pub(super) fn measure(folders: &Folders) -> Result<Measured> {
    for (name, arguments) in RUNS {
        let mut command = cargo(folders);
        command.args(["run", "--release", "--package", "host-tests", "--bin", "rigs", "--", "--name", name]);
        printed(command.args(arguments))?;
    }
    host::build(folders)?;
    rigctl(folders, &["chart", "--only", "rigs,effects", "--out", "docs/charts"])?;
    let [identified, as_built, ratio] = ["rigs", "rigs-as-built", "fixed-ratio"].map(|name| -> Result<Vec<Value>> {
        let file = folders.root.join("out").join(name).with_extension("json");
        let text = std::fs::read_to_string(&file).with_context(|| format!("{}", file.display()))?;
        serde_json::from_str(&text).with_context(|| format!("{}", file.display()))
    });
    table(&identified?, &as_built?, &ratio?)
}

/// Floors and measured values of both kinds of rigs, identified and as built.
fn table(identified: &[Value], as_built: &[Value], ratio: &[Value]) -> Result<Measured> {
    let mut measured = Measured {
        table: vec![text(&["", "rigs", "floor", "identified: median; 95 %; worst", "met", "as built", "met"])],
        ..Measured::default()
    };
    for kind in ["nominal", "hard"] {
        let group = |groups: &[Value]| groups.iter().find(|g| g["rig"] == kind).cloned();
        let ours = group(identified).with_context(|| format!("the study has no {kind} rigs"))?;
        let theirs = group(as_built).with_context(|| format!("the study has no {kind} rigs as built"))?;
        let compared = group(ratio).with_context(|| format!("no {kind} rigs were compared with a fixed ratio"))?;
        let rows = |group: &Value| group["rows"].as_array().cloned().context("no rows");
        let mut shown = rows(&ours)?;
        shown.retain(|row| row["check"] != FIXED_RATIO);
        shown.extend(rows(&compared)?.into_iter().filter(|row| row["check"] == FIXED_RATIO));
        for row in &shown {
            let same = |other: &&Value| other["check"] == row["check"];
            let other = theirs["rows"].as_array().and_then(|rows| rows.iter().find(same)).unwrap_or(&Value::Null);
            let word = |value: &Value| value.as_str().unwrap_or("-").to_owned();
            let [spread, built] = [row, other].map(spread);
            let met = |row: &Value| {
                format!("{}{}", word(&row["shown"][3]), if row["holds"] == false { ", missed" } else { "" })
            };
            let name = word(&row["row"]);
            measured.table.push(vec![name, kind.into(), word(&row["floor"]), spread, met(row), built, met(other)]);
            for (how, row) in [("identified", row), ("as_built", other)] {
                for what in ["met", "median", "p95", "worst"] {
                    if let (Some(value), Some(check)) = (row[what].as_f64(), row["check"].as_str()) {
                        measured.values.insert(format!("{kind}_{how}_{check}_{what}"), value);
                    }
                }
            }
        }
        for (how, group) in [("identified", &ours), ("as built", &theirs), ("compared with a fixed ratio", &compared)] {
            let failed = group["failed"].as_array().map_or(0, Vec::len);
            measured
                .notes
                .push(format!("{kind} rigs, {how}: {} rigs, {failed} cases miss their floor.", group["rigs"]));
        }
    }
    measured.notes.push(
        "A case without a value (homing or a move refused, or a fault) misses its floor; its number stands in brackets. `out/rigs.json` \
         and `out/rigs-as-built.json` list every case that misses its floor, by seed, load and check."
            .into(),
    );
    Ok(measured)
}

/// Median, 95th percentile and worst, and how many cases have no value.
fn spread(row: &Value) -> String {
    let shown = |k: usize| row["shown"][k].as_str().unwrap_or("-");
    let missing = row["missing"].as_u64().unwrap_or(0);
    let all = missing + row["cases"].as_u64().unwrap_or(0);
    let without = if missing > 0 { format!(" ({missing} of {all} without a value)") } else { String::new() };
    if all == 0 { "-".into() } else { format!("{}; {}; {}{without}", shown(0), shown(1), shown(2)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_missed_floor_and_missing_cases_are_said() {
        let row = json!({"check": "zero_error_rad", "row": "homing", "floor": "0.05 rad", "cases": 3, "missing": 1,
            "shown": ["0.1 rad", "0.2 rad", "0.3 rad", "75.0 %"], "median": 0.1, "p95": 0.2, "worst": 0.3, "met": 0.75,
            "holds": false});
        let group = |kind: &str| json!({"rig": kind, "rigs": 1, "rows": [row], "failed": [{}]});
        let groups = [group("nominal"), group("hard")];
        let measured = table(&groups, &groups, &groups).unwrap();
        assert_eq!(measured.table[1][3], "0.1 rad; 0.2 rad; 0.3 rad (1 of 4 without a value)");
        assert_eq!(measured.table[1][4], "75.0 %, missed");
        assert_eq!(measured.values["hard_as_built_zero_error_rad_worst"], 0.3);
        assert!(measured.notes[0].contains("1 cases miss"));
        assert!(table(&groups[..1], &groups, &groups).is_err(), "hard rigs are missing");
    }
}
