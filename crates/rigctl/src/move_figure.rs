//! Recorded moves as a picture: position, motor speed and TR over one time axis.

use crate::plot::{Axis, Block, Figure, GREY, Item, KeyRow, Panel, Pen, Sample, colour, extent};
use crate::session::row::Row;
use anyhow::Result;
use std::f64::consts::TAU;

const SET_POINT: Pen = Pen { colour: GREY, width: 1, dashed: true };

/// Moves, each with its load (kg), as a picture: SVG.
///
/// # Errors
/// If the drawing library fails.
pub fn draw(moves: &[(f64, &[Row])]) -> Result<String> {
    let pen = |k| Pen::solid(colour(k, moves.len()));
    let load =
        |(k, (load_kg, _)): (usize, &(f64, &[Row]))| KeyRow::sample(Sample::Line(pen(k)), format!("{load_kg} kg"));
    let mut key: Vec<KeyRow> = moves.iter().enumerate().map(load).collect();
    key.push(KeyRow::sample(Sample::Line(SET_POINT), "set-point"));
    // Time from the start of the move.
    let curve = |rows: &[Row], value: fn(&Row) -> Option<f64>| -> Vec<(f64, f64)> {
        let start_s = rows.first().map_or(0.0, |row| row.t_s);
        rows.iter().filter_map(|row| Some((row.t_s - start_s, value(row)?))).collect()
    };
    let panel = |title: &str, unit: &str, time: &str, value: fn(&Row) -> Option<f64>| {
        let curves: Vec<_> = moves.iter().map(|(_, rows)| curve(rows, value)).collect();
        let points = || curves.iter().flatten();
        Panel {
            title: title.into(),
            x: Axis::linear(time, extent(points().map(|p| p.0).chain([0.0]))),
            y: Axis::linear(unit, extent(points().map(|p| p.1).chain([0.0]))),
            items: curves.into_iter().enumerate().map(|(k, points)| Item::Line { points, pen: pen(k) }).collect(),
        }
    };
    let mut position = panel("Position of the load", "mm", "", |row| Some(row.true_position_m? * 1e3));
    if let Some((_, rows)) = moves.first() {
        let points = curve(rows, |row| Some(f64::from(row.setpoint_m?) * 1e3));
        position.items.insert(0, Item::Line { points, pen: SET_POINT });
    }
    let time = "time from the start of the move, s";
    Figure {
        heading: match moves.len() {
            1 => "A load that the firmware does not know: 12 mm at 2 mm/s (emulated board and rig)".into(),
            _ => "One firmware, three loads that it does not know: 12 mm at 2 mm/s (emulated board and rig)".into(),
        },
        rows: vec![
            vec![position],
            vec![panel("Motor speed", "rpm", "", |row| Some(f64::from(row.drive_speed_rad_per_s) * 60.0 / TAU))],
            vec![panel("Transmission ratio at the estimated load", "rad/mm", time, |row| {
                Some(f64::from(row.tr_rad_per_m?) * 1e-3)
            })],
        ],
        panel_size: (1000, 300),
        // Side by side: one line of the picture.
        blocks: key.into_iter().map(|row| Block { rows: vec![row] }).collect(),
        notes: Vec::new(),
    }
    .svg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::telemetry;

    #[test]
    fn three_panels_and_a_key() {
        let row = |k: u32| Row {
            true_position_m: Some(0.01),
            setpoint_m: Some(0.01),
            tr_rad_per_m: Some(2000.0),
            ..Row::new(0.1 * f64::from(k), &telemetry(0), None, None)
        };
        let rows: Vec<Row> = (0..50).map(row).collect();
        let svg = draw(&[1.0, 2.0, 3.0].map(|load_kg| (load_kg, &rows[..]))).unwrap();
        for text in ["1 kg", "2 kg", "3 kg", "set-point", "Position", "Motor speed", "rad/mm", "time from the start"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
