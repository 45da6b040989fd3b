//! The section on streamed sines.

use super::Measured;
use super::sections::drawn;
use crate::Folders;
use anyhow::{Context, Result};
use serde_json::Value;

/// Measures and draws them.
pub(super) fn measure(folders: &Folders) -> Result<Measured> {
    table(&drawn(folders, "following")?)
}

fn table(found: &[Value]) -> Result<Measured> {
    let mut measured = Measured::default();
    for one in found {
        let number = |key: &str| one[key].as_f64().with_context(|| format!("no {key}"));
        let rig = one["rig"].as_str().context("no rig")?;
        let answers = one["answers"].as_array().context("no answers")?;
        let hz = |answer: &Value| answer["frequency_hz"].as_f64().context("no frequency_hz");
        if measured.table.is_empty() {
            let frequencies: Vec<f64> = answers.iter().map(hz).collect::<Result<_>>()?;
            let frequencies = frequencies.iter().map(|hz| format!("{hz:.2} Hz"));
            measured.table.push(["rig, load, amplitude".to_owned()].into_iter().chain(frequencies).collect());
        }
        let (load_kg, amplitude_mm) = (number("load_kg")?, 1e3 * number("amplitude_m")?);
        let mut row = vec![format!("{rig}, {load_kg} kg, {amplitude_mm} mm")];
        for answer in answers {
            let both = answer["ratio"].as_f64().zip(answer["phase_deg"].as_f64());
            row.push(both.map_or("ended".into(), |(ratio, phase_deg)| format!("{ratio:.2}; {phase_deg:.0}°")));
            if let Some((ratio, _)) = both {
                measured.values.insert(format!("{rig}_{load_kg}kg_{amplitude_mm}mm_{:.2}hz_ratio", hz(answer)?), ratio);
            }
        }
        measured.table.push(row);
    }
    measured.notes.push(
        "Amplitude of the load's true position over that of the set-points; phase. \"ended\": the board has refused a \
         set-point of the stream, or has ended it, because the load was too far behind."
            .into(),
    );
    Ok(measured)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_series_is_a_row_and_a_stream_that_ended_says_so() {
        let answers = json!([{"frequency_hz": 0.1, "ratio": 0.99, "phase_deg": -2.4}, {"frequency_hz": 4.0, "ended": "too fast"}]);
        let measured =
            table(&[json!({"rig": "ideal", "load_kg": 0.5, "amplitude_m": 1e-3, "answers": answers})]).unwrap();
        assert_eq!(measured.table[0], ["rig, load, amplitude", "0.10 Hz", "4.00 Hz"]);
        assert_eq!(measured.table[1], ["ideal, 0.5 kg, 1 mm", "0.99; -2°", "ended"]);
        assert_eq!(measured.values["ideal_0.5kg_1mm_0.10hz_ratio"], 0.99);
        assert!(table(&[json!({})]).is_err());
    }
}
