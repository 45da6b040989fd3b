//! The figure of how fast changed loads are back at their places, over what is physically possible.

use crate::load_changes::{Outcome, POSITIONS_M};
use rig_plant::RigPreset;
use rigctl::plot::{Axis, Block, Figure, Item, KeyRow, Panel, Sample, Shape, colour};

/// Ratios that are drawn; what is beyond them stands at the edge.
const RATIOS: [f64; 2] = [0.5, 10.0];
/// Those that did not settle.
const NEVER: f64 = 12.0;

/// Least time (s) to come within a distance (m).
type Limit = fn(&Outcome, f64) -> Option<f64>;

/// All steps of one kind of rig, and the distance (m) within which a load counts as back.
pub struct Group {
    /// Kind of rig.
    pub rig: RigPreset,
    /// Within which distance (m).
    pub within_m: f64,
    /// The steps.
    pub outcomes: Vec<Outcome>,
}

/// Time over the motor's own, and over that of motor and swing, against the load that hangs there in the end.
pub fn figure(groups: &[Group]) -> Figure {
    let rows: [(&str, Limit); 2] = [("motor alone", |o, _| Some(o.motor_s)), ("motor and swing", Outcome::limit_s)];
    let panels = |(limit_name, limit): (&str, Limit)| {
        groups
            .iter()
            .map(|group| {
                let label = format!("time over the limit: {limit_name}");
                let mut items = Vec::new();
                for o in &group.outcomes {
                    let Some(step) = o.step else { continue };
                    let place = POSITIONS_M.iter().position(|at_m| *at_m == step.at_m).unwrap_or(0);
                    let ratio = o.settled_s(group.within_m).zip(limit(o, group.within_m)).map(|(s, least)| s / least);
                    let y = ratio.map_or(NEVER, |ratio| ratio.clamp(RATIOS[0], RATIOS[1]));
                    items.push(Item::Mark {
                        // Beside each other, not on top of each other.
                        at: (step.change_kg[1] + 0.02 * (place as f64 - 1.0), y),
                        shape: if ratio.is_some() { Shape::Dot } else { Shape::Cross },
                        colour: colour(place, POSITIONS_M.len()),
                    });
                }
                Panel {
                    title: format!("{}, to {:.0} µm", group.rig, group.within_m * 1e6),
                    x: Axis::linear("load after the change, kg", [0.1, 1.3]),
                    y: Axis::log(label, [RATIOS[0], 1.1 * NEVER]),
                    items,
                }
            })
            .collect::<Vec<_>>()
    };
    let places = POSITIONS_M.iter().enumerate().map(|(k, at_m)| {
        KeyRow::sample(Sample::Mark(Shape::Dot, colour(k, POSITIONS_M.len())), format!("at {:.0} mm", at_m * 1e3))
    });
    let never = KeyRow::sample(Sample::Mark(Shape::Cross, colour(0, 1)), "not within 8 s");
    Figure {
        heading: "How fast a changed load is back at its place, over what is physically possible (emulated)".into(),
        rows: rows.into_iter().map(panels).collect(),
        panel_size: (380, 300),
        blocks: vec![Block { rows: places.chain([never]).collect() }],
        notes: vec![
            "Upper row: over the time in which the motor's speed and acceleration alone turn the strings as far. Lower row: over the \
             least time in which any control brings the load to rest there, its swing included (a linear programme with the \
             table's ratio and stiffness at the end; friction calms a light load faster)."
                .into(),
        ],
    }
}
