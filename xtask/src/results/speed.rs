//! The section on speed: changed loads and moves at full speed, over what is physically possible.

use super::Measured;
use super::sections::{drawn, text};
use crate::Folders;
use anyhow::{Context, Result};
use serde_json::Value;

/// Measures them on rigs of seeds that nothing was tuned on, and draws them.
pub(super) fn measure(folders: &Folders) -> Result<Measured> {
    table(&drawn(folders, "speed")?)
}

fn table(found: &[Value]) -> Result<Measured> {
    let mut measured = Measured {
        table: vec![text(&[
            "",
            "rigs",
            "settled, of all; failed",
            "time: median; worst",
            "over the motor's time",
            "over motor and swing",
        ])],
        ..Measured::default()
    };
    for one in found {
        let word = |key: &str| one[key].as_str().map(str::to_owned).with_context(|| format!("no {key}"));
        let number = |key: &str| one[key].as_f64().with_context(|| format!("no {key}"));
        let spread = |key: &str, unit: &str| {
            let [median, most] = ["median", "most"].map(|which| one[key][which].as_f64());
            median.zip(most).map_or("-".into(), |(median, most)| format!("{median:.2}; {most:.2}{unit}"))
        };
        let (test, rig, within_um) = (word("test")?, word("rig")?, 1e6 * number("within_m")?);
        measured.table.push(vec![
            format!("{test}, to {within_um:.0} µm"),
            format!("{} {rig}", number("rigs")?),
            format!("{}, of {}; {}", number("settled")?, number("cases")?, number("faults")?),
            spread("time_s", " s"),
            spread("over_motor", ""),
            spread("over_limit", ""),
        ]);
        for key in ["time_s", "over_motor", "over_limit"] {
            for which in ["median", "most"] {
                if let Some(value) = one[key][which].as_f64() {
                    let name = format!("{rig}_{}_{within_um:.0}um_{key}_{which}", test.replace(' ', "_"));
                    measured.values.insert(name, value);
                }
            }
        }
    }
    measured.notes.push(
        "A step changes the load at rest at 2, 8 or 14 mm, between 0.2 and 1.2 kg. A move at full speed goes 12 mm up or down, under \
         0.1 to 1.5 kg; on one with a load step it goes 8 mm, and the load changes between 0.9 and 1.2 kg on the way. The motor's time is that in which its speed and acceleration alone turn the strings as far; that of motor \
         and swing is the least of any control, by a linear programme with the table's ratio and stiffness at the end. One that has \
         failed did not begin, because homing or a move was refused or the load was more than 1 mm off the place where it begins, or \
         ended in a fault."
            .into(),
    );
    Ok(measured)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_kind_of_rig_is_a_row_and_what_is_missing_is_shown() {
        let one = json!({"test": "load step", "rig": "hard", "rigs": 6, "within_m": 150e-6, "cases": 162, "settled": 120,
            "faults": 1, "time_s": {"median": 1.0, "most": 3.456}, "over_motor": {"median": 1.5, "most": 9.0},
            "over_limit": {"median": null, "most": null}});
        let measured = table(&[one]).unwrap();
        assert_eq!(
            measured.table[1],
            ["load step, to 150 µm", "6 hard", "120, of 162; 1", "1.00; 3.46 s", "1.50; 9.00", "-"]
        );
        assert_eq!(measured.values["hard_load_step_150um_over_motor_most"], 9.0);
        assert!(table(&[json!({})]).is_err());
    }
}
