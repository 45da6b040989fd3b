//! The figure of how fast a changed load is back at its place by each controller, over the least time of any control.

use crate::load_changes::{Outcome, POSITIONS_M, WATCHED_S};
use rig_plant::RigPreset;
use rigctl::plot::{Axis, Block, Figure, GREY, INK, Item, KeyRow, Panel, Pen, Sample, Shape, colour};

/// Ratios that are drawn; what is beyond them stands at the edge.
const RATIOS: [f64; 2] = [0.5, 14.0];
/// Height of those that did not settle.
const NEVER: f64 = 18.0;
/// Panels side by side.
const COLUMNS: usize = 4;

/// What one controller did on one kind of rig.
pub struct Played {
    /// The controller, as a letter and in words.
    pub name: String,
    /// Kind of rig.
    pub rig: RigPreset,
    /// Within which distance (m) a load counts as back.
    pub within_m: f64,
    /// The steps.
    pub outcomes: Vec<Outcome>,
}

/// Time to come back over the least that motor and swing allow; `None` if the load did not come back, or if the limit is
/// not known.
pub fn over_limit(outcome: &Outcome, within_m: f64) -> Option<f64> {
    Some(outcome.settled_s(within_m)? / outcome.limit_s(within_m)?)
}

/// A panel for each controller and kind of rig: the ratio against the load that hangs there in the end, by place.
pub fn figure(played: &[Played]) -> Figure {
    let panels: Vec<Panel> = played.iter().map(panel).collect();
    let places = POSITIONS_M.iter().enumerate().map(|(k, at_m)| {
        KeyRow::sample(Sample::Mark(Shape::Dot, colour(k, POSITIONS_M.len())), format!("at {:.0} mm", at_m * 1e3))
    });
    let never = KeyRow::sample(Sample::Mark(Shape::Cross, GREY), format!("not within {WATCHED_S:.0} s"));
    let mut within: Vec<String> =
        played.iter().map(|one| format!("{:.0} µm on {} rigs", one.within_m * 1e6, one.rig)).collect();
    within.dedup();
    let limits = [("the limit", Pen::solid(INK)), ("twice the limit", Pen::dashed(INK))]
        .map(|(name, pen)| KeyRow::sample(Sample::Line(pen), name));
    Figure {
        heading: "Time until a changed load is back at its place, over the physical limit (emulated)".into(),
        rows: panels.chunks(COLUMNS).map(<[Panel]>::to_vec).collect(),
        panel_size: (365, 220),
        blocks: vec![Block { rows: places.chain([never]).collect() }, Block { rows: limits.to_vec() }],
        notes: vec![
            "The limit is the least time in which any control brings the load to rest there with this motor, its swing \
             included: a linear programme with the table's ratio and stiffness. Friction is not in it and calms a light \
             load, so that a ratio can be below 1. All controllers but a are told the true load at once."
                .into(),
            format!("A load is back within {}.", within.join(", ")),
        ],
    }
}

fn panel(played: &Played) -> Panel {
    let level = |ratio: f64, pen: Pen| Item::Line { points: vec![(0.1, ratio), (1.3, ratio)], pen };
    let mut items = vec![level(1.0, Pen::solid(INK).wide(1)), level(2.0, Pen::dashed(INK).wide(1))];
    for outcome in &played.outcomes {
        let Some(step) = outcome.step else { continue };
        let place = POSITIONS_M.iter().position(|at_m| *at_m == step.at_m).unwrap_or(0);
        let ratio = over_limit(outcome, played.within_m);
        items.push(Item::Mark {
            // Beside each other, not on top of each other.
            at: (
                step.change_kg[1] + 0.03 * (place as f64 - 1.0),
                ratio.map_or(NEVER, |ratio| ratio.clamp(RATIOS[0], RATIOS[1])),
            ),
            shape: if ratio.is_some() { Shape::Dot } else { Shape::Cross },
            colour: colour(place, POSITIONS_M.len()),
        });
    }
    Panel {
        title: format!("{}: {}", played.rig, played.name),
        x: Axis::linear("load after the change, kg", [0.1, 1.3]),
        y: Axis::log("time over the limit", [RATIOS[0], 1.1 * NEVER]),
        items,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_changes::Step;
    use crate::physical_limit::Swing;

    #[test]
    fn what_does_not_settle_is_drawn_as_a_cross_and_nothing_is_left_out() {
        let swing = Swing { frequency: 20.0, damping_per_s: 2.0, speed_m_per_s: 0.005, acceleration_m_per_s2: 0.1 };
        let outcome = |errors_m: Vec<f64>| Outcome {
            step: Some(Step { seed: 1, at_m: POSITIONS_M[0], change_kg: [0.2, 0.4] }),
            swing: Some(swing),
            away_m: -2e-3,
            errors_m,
            failure: None,
            ..Outcome::failed(String::new(), String::new())
        };
        // Back after 2 s of 8, never back, and failed.
        let back = outcome((0..800).map(|k| if k < 200 { -1e-3 } else { 0.0 }).collect());
        let failed = Outcome { failure: Some("fault".into()), ..back.clone() };
        let outcomes = vec![back.clone(), outcome(vec![-1e-3; 800]), failed];
        let played = Played { name: "a".into(), rig: RigPreset::Ideal, within_m: 50e-6, outcomes };
        let ratio = over_limit(&back, 50e-6).unwrap();
        assert!((ratio - 2.0 / swing.least_time_s(-2e-3, 50e-6).unwrap()).abs() < 1e-9 && ratio > 1.0, "{ratio}");
        let marks: Vec<(f64, Shape)> = panel(&played)
            .items
            .iter()
            .filter_map(|item| if let Item::Mark { at, shape, .. } = item { Some((at.1, *shape)) } else { None })
            .collect();
        assert_eq!(marks, [(ratio, Shape::Dot), (NEVER, Shape::Cross), (NEVER, Shape::Cross)]);
        assert_eq!(figure(&[played]).rows.len(), 1);
    }
}
