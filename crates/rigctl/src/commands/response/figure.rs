//! `response --figure`: gain, phase and coherence of loop and mechanism over frequency.

use super::Line;
use crate::failure::Failure;
use crate::plot::{Axis, Figure, Item, Panel, Pen, Shape, colour, extent};

/// A response: its name, that of its gain, and gain, error of the gain, phase (degrees) and coherence of a row.
type Of = (&'static str, &'static str, fn(&Line) -> [f64; 4]);

const RESPONSES: [Of; 2] = [
    ("Set-point to position", "gain", |l| [l.loop_gain, l.loop_gain_error, l.loop_phase_deg, l.loop_coherence]),
    ("Twist to position", "gain (mm/rad)", |l| {
        let [gain, error] = [l.mechanism_gain_m_per_rad, l.mechanism_gain_error_m_per_rad].map(|gain| 1e3 * gain);
        [gain, error, l.mechanism_phase_deg, l.mechanism_coherence]
    }),
];

/// The picture as SVG; `heading` says where the load was led, `board` which board led it.
///
/// # Errors
/// If the drawing library fails.
pub fn figure(lines: &[Line], heading: String, board: String) -> Result<String, Failure> {
    let panel = |title: &str, label: &str, limits: &[f64], values: &dyn Fn(&Line) -> [f64; 2], pen: Pen| {
        let points = || lines.iter().map(|line| (line.frequency_hz, values(line)[0]));
        let mut items = vec![Item::line(points(), pen)];
        items.extend(points().map(|at| Item::mark(at, Shape::Dot, pen.colour)));
        items.extend(lines.iter().map(|line| {
            let (x, [value, error]) = (line.frequency_hz, values(line));
            Item::line([(x, value - error), (x, value + error)], pen)
        }));
        let all = || items.iter().flat_map(Item::points);
        let y = Axis::linear(label, extent(all().map(|at| at.1).chain(limits.iter().copied())));
        Panel::new(title, Axis::log("frequency (Hz)", extent(all().map(|at| at.0))), y, items)
    };
    let row = |kind: usize| {
        let of = |(k, (name, gain, of)): (usize, Of)| match kind {
            0 => panel(name, gain, &[], &|line| [of(line)[0], of(line)[1]], Pen::solid(colour(k, 2))),
            1 => panel("", "phase (°)", &[], &|line| [of(line)[2], 0.0], Pen::solid(colour(k, 2))),
            _ => panel("", "coherence", &[0.0, 1.0], &|line| [of(line)[3], 0.0], Pen::solid(colour(k, 2))),
        };
        RESPONSES.into_iter().enumerate().map(of).collect()
    };
    let figure = Figure {
        heading,
        rows: (0..3).map(row).collect(),
        panel_size: (560, 300),
        blocks: Vec::new(),
        notes: vec![board, "Vertical lines are the 90 % uncertainty of a gain.".into()],
    };
    figure.svg().map_err(|e| Failure::failed(format!("the figure: {e:#}")))
}
