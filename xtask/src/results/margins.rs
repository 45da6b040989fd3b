//! The section on the margins of the position loop.

use super::Measured;
use super::sections::{json_lines, printed};
use crate::Folders;
use crate::process::cargo;
use anyhow::{Context, Result, ensure};
use serde_json::Value;

/// Measures them on rigs of seeds that the firmware was not tuned on.
pub(super) fn measure(folders: &Folders) -> Result<Measured> {
    let mut command = cargo(folders);
    command.args(["run", "--release", "--package", "host-tests", "--bin", "margins"]);
    table(&json_lines(&printed(&mut command)?)?)
}

/// A row for each kind of rig and load, a column for each position: gains first, then delays.
fn table(found: &[Value]) -> Result<Measured> {
    let mut measured = Measured::default();
    let row_of = |one: &Value| format!("{}, {} kg", one["rig"].as_str().unwrap_or_default(), one["load_kg"]);
    let (mut rows, mut places) = (Vec::<String>::new(), Vec::<f64>::new());
    for one in found {
        let place = one["at_mm"].as_f64().context("no at_mm")?;
        if !places.contains(&place) {
            places.push(place);
        }
        if !rows.contains(&row_of(one)) {
            rows.push(row_of(one));
        }
    }
    let head = |what: &str| places.iter().map(|mm| format!("{what} at {mm:.0} mm")).collect::<Vec<_>>();
    measured.table.push([vec!["rig, load".into()], head("gain"), head("delay")].concat());
    for name in rows {
        let mut row = vec![name.clone()];
        for (what, scale, unit, digits) in [("gain", 1.0, "", 2), ("delay_s", 1e3, " ms", 0)] {
            for place in &places {
                let here = |one: &&Value| row_of(one) == name && one["at_mm"].as_f64() == Some(*place);
                let margins: Vec<&Value> = found.iter().filter(here).map(|one| &one[what]).collect();
                let [computed, least, most] = spread(&margins)?.map(|value| value.map(|value| scale * value));
                let computed = computed.context("no computed margin")?;
                let shown = |value: Option<f64>| value.map_or("none".into(), |value| format!("{value:.digits$}"));
                let (least_shown, most_shown) = (shown(least), shown(most));
                let range = if least == most { least_shown } else { format!("{least_shown} to {most_shown}") };
                row.push(format!("{computed:.digits$}: {range}{unit}"));
                let key = format!("{}_{place:.0}mm_{what}", name.replace(", ", "_").replace(' ', "_"));
                measured.values.insert(format!("{key}_computed"), computed / scale);
                measured.values.extend(least.map(|least| (format!("{key}_least"), least / scale)));
            }
        }
        measured.table.push(row);
    }
    let most = |what: &str| found.iter().find_map(|one| one[what]["most"].as_f64()).context("no most");
    measured.notes.push(format!(
        "In front of the colon computed, without friction; after it measured: the last step of 10 % or of 4 ms with which a \
         load that loses a twentieth of its weight comes to rest, least and most of the rigs. No more than {:.1} and {:.0} ms were \
         tried. \"none\": the load swings without a change of the loop.",
        most("gain")?,
        1e3 * most("delay_s")?
    ));
    Ok(measured)
}

/// The computed margin, and the least and the greatest measured one.
fn spread(margins: &[&Value]) -> Result<[Option<f64>; 3]> {
    ensure!(!margins.is_empty(), "no margins");
    let mut measured = Vec::new();
    for margin in margins {
        ensure!(margin.get("measured").is_some(), "a rig has failed");
        measured.push(margin["measured"].as_f64());
    }
    measured.sort_by(|a, b| a.unwrap_or(0.0).total_cmp(&b.unwrap_or(0.0)));
    Ok([margins[0]["computed"].as_f64(), measured[0], measured[measured.len() - 1]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn rigs_of_a_kind_share_a_row_and_a_swing_without_a_change_says_so() {
        let one = |seed: u64, gain: Option<f64>| {
            json!({"rig": "hard", "seed": seed, "load_kg": 0.6, "at_mm": 8.0,
                "gain": {"computed": 1.96, "measured": gain, "most": 10.8},
                "delay_s": {"computed": 0.048, "measured": 0.1, "most": 0.1}})
        };
        let measured = table(&[one(1, Some(1.77)), one(2, Some(1.46))]).unwrap();
        assert_eq!(measured.table[0], ["rig, load", "gain at 8 mm", "delay at 8 mm"]);
        assert_eq!(measured.table[1], ["hard, 0.6 kg", "1.96: 1.46 to 1.77", "48: 100 ms"]);
        assert_eq!(measured.values["hard_0.6_kg_8mm_gain_least"], 1.46);
        assert_eq!(table(&[one(1, Some(1.5)), one(2, None)]).unwrap().table[1][1], "1.96: none to 1.50");
        assert!(table(&[json!({"rig": "hard", "load_kg": 0.6, "at_mm": 8.0, "failed": "it fell"})]).is_err());
    }
}
