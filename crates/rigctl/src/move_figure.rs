//! Recorded moves as a picture: position, motor speed and TR over one time axis.

use crate::plot::{Axis, Block, Figure, GREY, Item, KeyRow, Panel, Pen, Sample, colour, extent};
use anyhow::Result;

/// One load's curves; time in seconds from the start of the move.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Name of the load in the key.
    pub label: String,
    /// True position of the load.
    pub position_mm: Vec<(f64, f64)>,
    /// The planner's set-point.
    pub set_point_mm: Vec<(f64, f64)>,
    /// Speed of the motor shaft.
    pub motor_rpm: Vec<(f64, f64)>,
    /// Transmission ratio at the estimated load.
    pub tr_rad_per_mm: Vec<(f64, f64)>,
}

const SET_POINT: Pen = Pen { colour: GREY, width: 1, dashed: true };

/// The picture as SVG.
///
/// # Errors
/// If the drawing library fails.
pub fn draw(curves: &[Curve]) -> Result<String> {
    let pen = |k| Pen::solid(colour(k, curves.len()));
    let mut key: Vec<KeyRow> =
        curves.iter().enumerate().map(|(k, c)| KeyRow::sample(Sample::Line(pen(k)), &c.label)).collect();
    key.push(KeyRow::sample(Sample::Line(SET_POINT), "set-point"));
    let panel = |title: &str, unit: &str, time: &str, data: fn(&Curve) -> &Vec<(f64, f64)>| {
        let points = || curves.iter().flat_map(|c| data(c).iter());
        let lines = curves.iter().enumerate();
        Panel {
            title: title.into(),
            x: Axis::linear(time, extent(points().map(|p| p.0).chain([0.0]))),
            y: Axis::linear(unit, extent(points().map(|p| p.1).chain([0.0]))),
            items: lines.map(|(k, c)| Item::Line { points: data(c).clone(), pen: pen(k) }).collect(),
        }
    };
    let mut position = panel("Position of the load", "mm", "", |c| &c.position_mm);
    if let Some(curve) = curves.first() {
        position.items.insert(0, Item::Line { points: curve.set_point_mm.clone(), pen: SET_POINT });
    }
    let time = "time from the start of the move, s";
    Figure {
        heading: match curves.len() {
            1 => "A load that the firmware does not know: 12 mm at 2 mm/s (emulated board and rig)".into(),
            _ => "One firmware, three loads that it does not know: 12 mm at 2 mm/s (emulated board and rig)".into(),
        },
        rows: vec![
            vec![position],
            vec![panel("Motor speed", "rpm", "", |c| &c.motor_rpm)],
            vec![panel("Transmission ratio at the estimated load", "rad/mm", time, |c| &c.tr_rad_per_mm)],
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

    #[test]
    fn three_panels_and_a_key() {
        let line = |slope: f64| (0..50).map(|k| (0.1 * f64::from(k), slope * f64::from(k))).collect::<Vec<_>>();
        let curve = |k: u32| Curve {
            label: format!("{k} kg"),
            position_mm: line(0.2),
            set_point_mm: line(0.21),
            motor_rpm: line(-10.0 * f64::from(k)),
            tr_rad_per_mm: line(0.1 * f64::from(k)),
        };
        let svg = draw(&[curve(1), curve(2), curve(3)]).unwrap();
        for text in ["1 kg", "2 kg", "3 kg", "set-point", "Position", "Motor speed", "rad/mm", "time from the start"] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
