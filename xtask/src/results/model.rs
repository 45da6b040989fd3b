//! How the sections about the model and its tables are measured: nothing moves in them.

use super::Measured;
use super::sections::{cell, copy, csv, number, rigctl, significant, text};
use crate::{Folders, bench, host};
use anyhow::{Context, Result};
use serde_json::Value;

pub(super) fn chosen_table(folders: &Folders) -> Result<Measured> {
    host::build(folders)?;
    let lines = rigctl(folders, &["table"])?;
    let report = lines.first().context("`rigctl table` printed nothing")?;
    let mut measured = Measured { table: vec![text(&["", ""])], ..Measured::default() };
    let mut add = |name: &str, at: &str, scale: f64, shown: &str, unit: &str| -> Result<()> {
        let value = scale * number(report, at)?;
        measured.values.insert(name.to_owned(), value);
        measured.table.push(vec![shown.to_owned(), format!("{} {unit}", significant(value))]);
        Ok(())
    };
    add("load_min_n", "/axes/0/min", 1.0, "least load", "N")?;
    add("load_max_n", "/axes/0/max", 1.0, "greatest load", "N")?;
    add("twist_max_rad", "/axes/1/max", 1.0, "greatest twist", "rad")?;
    add("bytes", "/bytes", 1.0, "numbers", "bytes")?;
    add("instructions_predicted", "/instructions", 1.0, "lookup, predicted", "instructions")?;
    add("contraction_error_um", "/errors/contraction_max_m", 1e6, "largest error of the contraction", "µm")?;
    add("tr_error_percent", "/errors/tr_max_relative", 1e2, "largest error of TR", "%")?;
    add("closure_um", "/closure_m", 1e6, "contraction less the sum of 1/TR", "µm")?;
    let turns = (measured.values["twist_max_rad"] - std::f64::consts::PI) / std::f64::consts::TAU;
    measured.values.insert("turns_max".into(), turns);
    measured.notes.push(report["why"].as_str().unwrap_or_default().to_owned());
    Ok(measured)
}

pub(super) fn cost(folders: &Folders) -> Result<Measured> {
    host::cost(folders)?;
    let rows = csv(&folders.root.join("out/cost.csv"))?;
    let (head, rows) = rows.split_first().context("out/cost.csv is empty")?;
    let mut measured = Measured {
        table: vec![text(&["way", "instructions, mean (most)", "bytes", "largest error"])],
        ..Measured::default()
    };
    for row in rows {
        let get = |column: &str| cell(head, row, column);
        let of = head.iter().position(|name| name == "error_of").and_then(|k| row.get(k)).map_or("", String::as_str);
        let error = get("error").context("a row without an error")?;
        let error = match of {
            "gap_m" => format!("{} µm", significant(1e6 * error)),
            _ => format!("{} %", significant(1e2 * error)),
        };
        let [mean, most] = ["instructions_mean", "instructions_max"].map(|c| get(c).unwrap_or_default());
        measured.table.push(vec![
            row[1].clone(),
            format!("{mean:.0} ({most:.0})"),
            get("bytes").map_or(String::new(), |b| format!("{b:.0}")),
            error,
        ]);
        if row[0] == "cost_lookup" {
            measured.values.insert("lookup_instructions".into(), mean);
        }
    }
    Ok(measured)
}

pub(super) fn model(folders: &Folders) -> Result<Measured> {
    bench::bench(folders)?;
    let file = folders.target.join("bench/model.json");
    let found: Value = serde_json::from_str(&std::fs::read_to_string(&file)?).context("bench/model.json")?;
    let rounds = found["rounds_by_ratio"].as_array().context("no rounds")?;
    let middle = rounds.get(rounds.len() / 2).context("no rounds")?;
    let mut measured = Measured { table: vec![text(&["", ""])], ..Measured::default() };
    let mut add = |name: &str, shown: &str, value: Option<f64>, unit: &str| {
        // Without valgrind or Python a row is missing, and is shown as missing.
        let cell = value.map_or_else(|| "not measured".to_owned(), |v| format!("{} {unit}", significant(v)));
        measured.table.push(vec![shown.to_owned(), cell]);
        value.map(|value| measured.values.insert(name.to_owned(), value));
    };
    let of = |value: &Value, at: &str| value.pointer(at).and_then(Value::as_f64);
    add("us_per_equilibrium", "an equilibrium with all derivatives", of(&found, "/model/scenes/0/us"), "µs");
    add("instructions", "its instructions", of(&found, "/instructions_per_equilibrium/0"), "");
    add("grid_s", "a 64 × 128 grid of the published range", of(&found, "/model/scenes/0/seconds"), "s");
    add("plateau_us", "an equilibrium on a near-flat plateau, mean", of(&found, "/model/scenes/1/us"), "µs");
    add("solve_bvp_ms", "SciPy `solve_bvp`, one rod", of(middle, "/peer/solve_bvp/ms_per_rod"), "ms");
    add("solve_bvp_times", "the same in equilibria of ours", of(middle, "/ratio/solve_bvp"), "");
    add("least_times", "least of the rounds", rounds.first().and_then(|r| of(r, "/ratio/solve_bvp")), "");
    add("most_times", "most of the rounds", rounds.last().and_then(|r| of(r, "/ratio/solve_bvp")), "");
    add("dop853_ms", "SciPy DOP853 shooting, one rod", of(middle, "/peer/shooting/ms_per_rod"), "ms");
    add("dop853_times", "the same in equilibria of ours", of(middle, "/ratio/shooting"), "");
    Ok(measured)
}

pub(super) fn charts(folders: &Folders) -> Result<Measured> {
    host::build(folders)?;
    rigctl(folders, &["chart", "--out", "docs/charts"])?;
    copy(folders, "docs/charts/mechanism.svg", "docs/mechanism.svg")?;
    let rows = csv(&folders.root.join("docs/charts/scenes.csv"))?;
    let (head, rows) = rows.split_first().context("scenes.csv is empty")?;
    let mut measured = Measured {
        table: vec![text(&["scene", "asked", "model needed", "table", "bytes", "instructions", "worst"])],
        ..Measured::default()
    };
    for row in rows {
        let get = |column: &str| cell(head, row, column).with_context(|| format!("scenes.csv: {column}"));
        let word = |column: &str| head.iter().position(|name| name == column).and_then(|k| row.get(k)).cloned();
        measured.table.push(vec![
            word("scene").unwrap_or_default(),
            format!(
                "{} µm, {} %",
                significant(1e6 * get("asked_contraction_m")?),
                significant(1e2 * get("asked_tr_relative")?)
            ),
            format!("{} ({})", word("tier").unwrap_or_default(), word("tier_shares").unwrap_or_default()),
            word("table_size").unwrap_or_default(),
            format!("{:.0}", get("bytes")?),
            format!("{:.0}", get("predicted_instructions")?),
            format!(
                "{} µm, {} %",
                significant(1e6 * get("contraction_error_m")?),
                significant(1e2 * get("tr_relative_error")?)
            ),
        ]);
    }
    measured.notes.push(
        "The model is the most expensive one that some state of the scene needs; in brackets, which model is enough for how much \
         of its load–twist plane."
            .into(),
    );
    Ok(measured)
}

pub(super) fn budget(folders: &Folders) -> Result<Measured> {
    host::build(folders)?;
    let mut measured = Measured {
        table: vec![text(&[
            "scene",
            "rig",
            "position",
            "load",
            "model enough",
            "table enough",
            "bytes, instructions",
            "table used",
        ])],
        ..Measured::default()
    };
    // An accuracy, and what its table takes.
    let table = |row: &Value, which: &str| -> Result<[String; 2]> {
        if row[which].is_null() {
            return Ok(["-".to_owned(), String::new()]);
        }
        let get = |key: &str| number(row, &format!("/{which}/{key}"));
        let asked =
            format!("{} µm, {} %", significant(1e6 * get("contraction_m")?), significant(1e2 * get("tr_relative")?));
        let size = match (get("table/bytes"), get("table/instructions")) {
            (Ok(bytes), Ok(instructions)) => format!("{bytes:.0}, {instructions:.0}"),
            _ => "no table".to_owned(),
        };
        Ok([asked, size])
    };
    for row in rigctl(folders, &["budget", "--all"])? {
        let word = |key: &str| row[key].as_str().unwrap_or_default().to_owned();
        let [[enough, size], [used, used_size]] = [table(&row, "enough")?, table(&row, "used")?];
        measured.table.push(vec![
            word("scene"),
            word("rig"),
            format!("{} µm", significant(1e6 * number(&row, "/position_m")?)),
            format!("{} %", significant(1e2 * number(&row, "/load_relative")?)),
            word("tier"),
            enough,
            size,
            format!("{used}: {used_size}"),
        ]);
    }
    Ok(measured)
}
