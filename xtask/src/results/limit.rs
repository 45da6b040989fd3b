//! The section on changed loads by several controllers, over the physical limit.

use super::Measured;
use super::sections::{drawn, text};
use crate::Folders;
use anyhow::{Context, Result};
use serde_json::Value;

/// Measures them on rigs of seeds that the firmware was not tuned on, and draws them.
pub(super) fn measure(folders: &Folders) -> Result<Measured> {
    table(&drawn(folders, "limit")?)
}

fn table(found: &[Value]) -> Result<Measured> {
    let mut measured = Measured {
        table: vec![text(&[
            "controller",
            "rigs",
            "over the limit: median; worst",
            "beyond twice the limit",
            "not settled, of all; failed",
            "time: median; worst",
            "time over that of a: median",
        ])],
        ..Measured::default()
    };
    for one in found {
        let word = |key: &str| one[key].as_str().map(str::to_owned).with_context(|| format!("no {key}"));
        let number = |key: &str| one[key].as_f64().with_context(|| format!("no {key}"));
        let shown = |key: &str, which: &str| one[key][which].as_f64().map_or("-".into(), |value| format!("{value:.2}"));
        let spread = |key: &str| format!("{}; {}", shown(key, "median"), shown(key, "most"));
        let (name, rig, within_um) = (word("controller")?, word("rig")?, 1e6 * number("within_m")?);
        let (cases, missed) = (number("cases")?, number("cases")? - number("settled")?);
        let beyond = one["beyond_twice"].as_array().context("no beyond_twice")?;
        measured.table.push(vec![
            name.clone(),
            format!("{} {rig}, to {within_um:.0} µm", number("rigs")?),
            spread("over_limit"),
            beyond.len().to_string(),
            format!("{missed}, of {cases}; {}", number("failed")?),
            format!("{} s", spread("time_s")),
            shown("over_ours", "median"),
        ]);
        let letter = name.split_whitespace().next().unwrap_or_default();
        let mut value = |what: &str, value: Option<f64>| {
            value.and_then(|value| measured.values.insert(format!("{rig}_{letter}_{what}"), value));
        };
        value("over_limit_median", one["over_limit"]["median"].as_f64());
        value("over_limit_most", one["over_limit"]["most"].as_f64());
        value("not_settled", Some(missed));
        value("over_ours_median", one["over_ours"]["median"].as_f64());
        if letter == "a" {
            let slow = beyond.iter().map(|case| {
                format!("{} ({:.1})", case[0].as_str().unwrap_or_default(), case[1].as_f64().unwrap_or(f64::NAN))
            });
            let missed = one["not_settled"].as_array().context("no not_settled")?;
            let missed = missed.iter().map(|case| format!("{} (not settled)", case.as_str().unwrap_or_default()));
            let named: Vec<String> = slow.chain(missed).collect();
            let named = if named.is_empty() { "none".to_owned() } else { named.join(", ") };
            measured.notes.push(format!("This controller beyond twice the limit on {rig} rigs: {named}."));
        }
    }
    measured.notes.push(
        "A step changes the load at rest at 2, 8 or 14 mm, between 0.2 and 1.2 kg. The limit is the least time of any \
         control, by a linear programme with the table's ratio and stiffness at the end; friction, which calms a light \
         load, is not in it. Medians are of all steps, and a step that has not settled within 8 s takes longer than any \
         other; the worst is of those that have settled. The loops of b, b' and e are tuned for a third of these very \
         steps on the first two of the rigs; all but a are told the true load at once. No move begins here, so that the \
         crossing of b\" has nothing to do; d and d' stand still until the next move."
            .into(),
    );
    Ok(measured)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_has_not_settled_is_counted_and_slow_steps_are_named() {
        let one = json!({"controller": "a  this controller", "rig": "hard", "rigs": 3, "within_m": 150e-6, "cases": 81,
            "settled": 79, "failed": 1, "time_s": {"median": 1.0, "most": 3.456}, "over_ours": {"median": 1.0, "most": 1.0},
            "over_limit": {"median": null, "most": 2.5}, "beyond_twice": [["seed 1 2 mm", 2.5]], "not_settled": ["x", "y"]});
        let measured = table(&[one]).unwrap();
        let row = ["a  this controller", "3 hard, to 150 µm", "-; 2.50", "1", "2, of 81; 1", "1.00; 3.46 s", "1.00"];
        assert_eq!(measured.table[1], row);
        assert!(
            measured.notes[0].contains("seed 1 2 mm (2.5), x (not settled), y (not settled)"),
            "{}",
            measured.notes[0]
        );
        assert_eq!(measured.values["hard_a_not_settled"], 2.0);
        assert!(!measured.values.contains_key("hard_a_over_limit_median"), "more than half have not settled");
        assert!(table(&[json!({})]).is_err());
    }
}
