//! The study of changed loads by this controller and by seven others, over the least time of any control.

use crate::baselines::Field;
use crate::load_changes::{self, Outcome};
use crate::rigs::subject::Subject;
use crate::speed::{key, panel};
use crate::study::{Rigs, Sorted, Study, draw, shown};
use anyhow::Result;
use rig_plant::RigPreset;
use rigctl::plot::Figure;

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
/// Panels of the figure side by side.
const COLUMNS: usize = 4;

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
        "over the limit: median; worst",
        "beyond twice the limit",
        "not settled, of all; failed",
        "time: median; worst",
        "time over that of a: median",
    ]);
    let (mut panels, mut back) = (Vec::new(), Vec::new());
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
        for (name, outcomes) in [(OURS, ours.clone())].into_iter().chain(baselines) {
            row(&mut study, name, on, &outcomes, &ours);
            panels.push(panel(format!("{rig}: {name}"), "time over the limit", &outcomes, |o| o.over_limit(within_m)));
        }
        back.push(format!("{:.0} µm on {rig} rigs", within_m * 1e6));
    }
    study.notes.push(NOTE.into());
    let figure = Figure {
        heading: "Time until a changed load is back at its place, over the physical limit (emulated)".into(),
        rows: panels.chunks(COLUMNS).map(<[_]>::to_vec).collect(),
        panel_size: (365, 220),
        blocks: key(),
        notes: vec![
            "The limit is the least time in which any control brings the load to rest there with this motor, its swing \
             included: a linear programme with the table's ratio and stiffness. Friction is not in it and calms a light \
             load, so that a ratio can be below 1. All controllers but a are told the true load at once."
                .into(),
            format!("A load is back within {}.", back.join(", ")),
        ],
    };
    draw(&figure, "limit")?;
    Ok(study)
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
