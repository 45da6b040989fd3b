//! The study of changed loads by this controller and by seven others, over the least time of any control.

use crate::baselines::Field;
use crate::load_changes::{self, Outcome, WATCHED_S};
use crate::rigs::subject::Subject;
use crate::study::{Rigs, Sorted, Study, draw, shown};
use anyhow::Result;
use rig_plant::RigPreset;
use rigctl::plot::{Axis, Block, Figure, GREY, INK, Item, KeyRow, Panel, Pen, Shape, colour};

/// Kind of rig, how many, and the distance (m) within which a load counts as at its place.
const KINDS: [(RigPreset, u64, f64); 3] =
    [(RigPreset::Ideal, 1, 50e-6), (RigPreset::Nominal, 3, 50e-6), (RigPreset::Hard, 3, 150e-6)];
/// On how many of the rigs the loops are tuned, at most.
const TUNED_ON: usize = 2;
/// A tick (s): no time that is compared is shorter.
const TICK_S: f64 = 0.01;
/// A time this many times the limit is named.
const NAMED: f64 = 2.0;
/// This controller.
const OURS: &str = "a  this controller";
/// Ratios that are drawn, and where those that did not settle stand; what is beyond is drawn at the edge.
const DRAWN: [f64; 2] = [0.5, 14.0];
const NEVER: f64 = 20.0;

/// A kind of rig in words; each controller's recovery times over the theoretical minimum, `None` where a load did not settle.
type Kind = (String, Vec<(&'static str, Vec<Option<f64>>)>);

const NOTE: &str = "A step changes the load at rest at 2, 8 or 14 mm, between 0.2 and 1.2 kg. The limit is the least time of any \
    control, by a linear programme with the table's ratio and stiffness at the end; friction, which calms a light \
    load, is not in it. Medians are of all steps, and a step that has not settled within 8 s takes longer than any \
    other; the worst is of those that have settled. The loops of b, b' and e are tuned for a third of these very \
    steps on the first two of the rigs; all but a are told the true load at once. No move begins here, so that the \
    crossing of b\" has nothing to do; d and d' stand still until the next move.";

/// Measures and draws it.
///
/// # Errors
/// If the figure cannot be written.
pub fn study(rigs: &Rigs) -> Result<Study> {
    let mut study = Study::new([
        "controller",
        "rigs",
        "recovery time ÷ theoretical minimum: median; worst",
        "beyond twice the minimum",
        "not settled, of all; failed",
        "time: median; worst",
        "time over that of a: median",
    ]);
    let (mut names, mut kinds) = (Vec::new(), Vec::<Kind>::new());
    for (rig, count, within_m) in KINDS.into_iter().filter(|(rig, ..)| rigs.wants(*rig)) {
        let played = rigs.seeds(count).map(|seed| {
            let subject = Subject::new(rig, seed);
            let outcomes = load_changes::all(&subject, rigs.jobs);
            (subject, outcomes)
        });
        let played: Vec<(Subject, Vec<Outcome>)> = played.collect();
        let ours: Vec<Outcome> = played.iter().flat_map(|(_, outcomes)| outcomes.clone()).collect();
        let on = (rig, played.len(), within_m);
        let field = Field::new(played, rigs.jobs);
        let baselines = field.baselines(TUNED_ON, within_m).into_iter().map(|(name, law)| {
            eprintln!("{rig}: {name}: {law:?}");
            (name, field.play(law))
        });
        let mut reached = Vec::new();
        for (name, outcomes) in [(OURS, ours.clone())].into_iter().chain(baselines) {
            row(&mut study, name, on, &outcomes, &ours);
            let ratios: Vec<Option<f64>> = outcomes.iter().map(|o| o.over_limit(within_m)).collect();
            if ratios.iter().any(Option::is_some) && !names.contains(&name) {
                names.push(name);
            }
            reached.push((name, ratios));
        }
        kinds.push((format!("{rig} plants: back to within {:.0} µm", within_m * 1e6), reached));
    }
    study.notes.push(NOTE.into());
    draw(&figure(&names, &kinds), "limit")?;
    Ok(study)
}

/// A panel for each kind of rig, a row for each of these controllers.
fn figure(names: &[&str], kinds: &[Kind]) -> Figure {
    let last_row = 0.4 - names.len() as f64;
    let level = |ratio: f64, pen: Pen| Item::line([(ratio, 0.6), (ratio, last_row)], pen.wide(1));
    let panel = |(title, all): &Kind| {
        let mut items = vec![level(1.0, Pen::solid(INK)), level(2.0, Pen::dashed(INK))];
        for (name, ratios) in all {
            let Some(row) = names.iter().position(|shown| shown == name) else { continue };
            let colour = if *name == OURS { colour(0, 6) } else { GREY };
            let place = |ratio: f64| (ratio.clamp(DRAWN[0], DRAWN[1]), -(row as f64));
            items.extend(ratios.iter().flatten().map(|ratio| Item::mark(place(*ratio), Shape::Dot, colour)));
            let median = Sorted::new(ratios.iter().map(|ratio| ratio.unwrap_or(f64::INFINITY))).median();
            items.extend(median.map(|ratio| Item::mark(place(ratio), Shape::Diamond, INK)));
            let missed = ratios.iter().filter(|ratio| ratio.is_none()).count();
            if missed > 0 {
                let at = (NEVER, -(row as f64));
                let count = Item::label(at, format!("{missed} of {}", ratios.len()), INK);
                items.extend([Item::mark(at, Shape::Cross, colour), count]);
            }
        }
        let ticks = [0.5, 1.0, 2.0, 5.0, 10.0].map(|ratio| (ratio, ratio.to_string()));
        let x = Axis::log("recovery time ÷ theoretical minimum", [DRAWN[0], 60.0]).ticked(ticks);
        vec![Panel::new(title.clone(), x, Axis::names(names.iter().copied()), items)]
    };
    Figure {
        heading: "Recovery from a changed load (emulated)".into(),
        rows: kinds.iter().map(panel).collect(),
        panel_size: (800, 300),
        blocks: vec![
            Block::new([
                KeyRow::mark(Shape::Dot, colour(0, 6), "this controller, a dot for each change"),
                KeyRow::mark(Shape::Dot, GREY, "others, told the true load at once"),
            ]),
            Block::new([
                KeyRow::mark(Shape::Diamond, INK, "median"),
                KeyRow::mark(Shape::Cross, GREY, format!("not within {WATCHED_S:.0} s")),
            ]),
            Block::new([
                KeyRow::line(Pen::solid(INK), "the theoretical minimum"),
                KeyRow::line(Pen::dashed(INK), "twice that"),
            ]),
        ],
        notes: vec![
            "The minimum is that of any control with this motor. It leaves out friction, which damps a light load, so \
             that a ratio can be below 1. Controllers that bring no load back are left out."
                .into(),
        ],
    }
}

/// A controller's row and numbers. Medians are of all steps: one that has not settled takes longer than any other. The most is of
/// those that settled.
fn row(
    study: &mut Study,
    name: &str,
    (rig, rigs, within_m): (RigPreset, usize, f64),
    outcomes: &[Outcome],
    ours: &[Outcome],
) {
    let settled = |o: &Outcome| o.settled_s(within_m);
    let sorted =
        |of: &dyn Fn(&Outcome) -> Option<f64>| Sorted::new(outcomes.iter().map(|o| of(o).unwrap_or(f64::INFINITY)));
    let over_limit = sorted(&|o| o.over_limit(within_m));
    // Steps that neither brings back say nothing.
    let over_ours =
        Sorted::new(outcomes.iter().zip(ours).filter_map(|both| match (settled(both.0), settled(both.1)) {
            (None, None) => None,
            (theirs_s, ours_s) => Some(theirs_s.unwrap_or(f64::INFINITY) / ours_s.unwrap_or(f64::INFINITY).max(TICK_S)),
        }));
    let slow = outcomes.iter().filter_map(|o| Some((o, o.over_limit(within_m)?))).filter(|(_, ratio)| *ratio > NAMED);
    let slow: Vec<String> = slow.map(|(o, ratio)| format!("{} ({ratio:.1})", o.what)).collect();
    let missed = outcomes.iter().filter(|o| settled(o).is_none());
    let missed: Vec<String> = missed.map(|o| format!("{} (not settled)", o.what)).collect();
    study.row([
        name.into(),
        format!("{rigs} {rig}, to {:.0} µm", within_m * 1e6),
        over_limit.spread(),
        slow.len().to_string(),
        format!("{}, of {}; {}", missed.len(), outcomes.len(), outcomes.iter().filter(|o| o.failure.is_some()).count()),
        format!("{} s", sorted(&settled).spread()),
        shown(over_ours.median(), 2),
    ]);
    let key = format!("{rig}_{}", name.split_whitespace().next().unwrap_or_default());
    study.value(format!("{key}_over_limit_median"), over_limit.median());
    study.value(format!("{key}_over_limit_most"), over_limit.max());
    study.value(format!("{key}_not_settled"), missed.len() as f64);
    study.value(format!("{key}_over_ours_median"), over_ours.median());
    if name == OURS {
        let named = [slow, missed].concat();
        let named = if named.is_empty() { "none".to_owned() } else { named.join(", ") };
        study.notes.push(format!("This controller beyond twice the limit on {rig} rigs: {named}."));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physical_limit::Oscillation;

    #[test]
    fn what_has_not_settled_is_counted_and_slow_steps_are_named() {
        let oscillation =
            Oscillation { frequency: 20.0, damping_per_s: 2.0, speed_m_per_s: 0.005, acceleration_m_per_s2: 0.1 };
        let outcome = |what: &str, ticks: usize| Outcome {
            oscillation: Some(oscillation),
            away_m: -2e-3,
            errors_m: (0..800).map(|k| if k < ticks { -1e-3 } else { 0.0 }).collect(),
            failure: None,
            ..Outcome::failed(what.into(), String::new())
        };
        let outcomes = [outcome("slow", 250), outcome("x", 800), outcome("y", 800)];
        let mut study = Study::new([""]);
        row(&mut study, OURS, (RigPreset::Hard, 1, 150e-6), &outcomes, &outcomes);
        let ratio = outcomes[0].over_limit(150e-6).unwrap();
        let over = format!("-; {ratio:.2}");
        assert_eq!(study.table[1], [OURS, "1 hard, to 150 µm", &over, "1", "2, of 3; 0", "-; 2.50 s", "1.00"]);
        let named = format!("slow ({ratio:.1}), x (not settled), y (not settled)");
        assert!(study.notes[0].contains(&named), "{}", study.notes[0]);
        assert_eq!(study.values["hard_a_not_settled"], 2.0);
        assert!(!study.values.contains_key("hard_a_over_limit_median"), "more than half have not settled");
    }
}
