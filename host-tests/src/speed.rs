//! The study of speed: how fast changed loads are back at their places and moves at full speed take, on rigs of all kinds, over what
//! is physically possible.

use crate::full_speed;
use crate::load_changes::{self, Outcome, POSITIONS_M, WATCHED_S};
use crate::rigs::subject::Subject;
use crate::study::{Rigs, Sorted, Study, draw, each};
use anyhow::Result;
use rig_plant::RigPreset;
use rigctl::plot::{Axis, Block, Figure, GREY, INK, Item, KeyRow, Panel, Pen, Shape, colour};

/// Kind of rig, how many, and the distances (m) within which a load counts as at its place.
const KINDS: [(RigPreset, u64, &[f64]); 3] =
    [(RigPreset::Ideal, 4, &[50e-6]), (RigPreset::Nominal, 12, &[50e-6]), (RigPreset::Hard, 24, &[150e-6, 250e-6])];

const NOTE: &str = "A step changes the load at rest at 2, 8 or 14 mm, between 0.2 and 1.2 kg. A move at full speed goes 12 mm up or \
    down, under 0.1 to 1.5 kg; on one with a load step it goes 8 mm, and the load changes between 0.9 and 1.2 kg on the way. The \
    motor's time is that in which its speed and acceleration alone turn the strings as far; that of motor and swing is the least of \
    any control, by a linear programme with the table's ratio and stiffness at the end. One that has failed did not begin, because \
    homing or a move was refused or the load was more than 1 mm off the place where it begins, or ended in a fault. A load that \
    stands nearer to its place than half of the jump with which it breaks loose is not brought nearer by another jump.";

/// Measures and draws it.
///
/// # Errors
/// If the figure cannot be written.
pub fn study(rigs: &Rigs) -> Result<Study> {
    let mut study = Study::new([
        "",
        "rigs",
        "settled, of all; failed",
        "time: median; worst",
        "time ÷ the motor's minimum",
        "time ÷ theoretical minimum",
    ]);
    let mut panels = Vec::new();
    for (rig, count, within) in KINDS.into_iter().filter(|(rig, ..)| rigs.wants(*rig)) {
        let subjects: Vec<Subject> = rigs.seeds(count).map(|seed| Subject::new(rig, seed)).collect();
        let steps: Vec<Outcome> = subjects.iter().flat_map(|subject| load_changes::all(subject, rigs.jobs)).collect();
        let ways: Vec<Outcome> = subjects.iter().flat_map(|subject| full_speed::all(subject, rigs.jobs)).collect();
        let on_the_way = each(rigs.jobs, &subjects, full_speed::under_steps).concat();
        let tests = [("load step", &steps), ("full speed", &ways), ("load step at full speed", &on_the_way)];
        for (test, outcomes) in tests {
            let failed = outcomes.iter().filter_map(|o| Some(format!("{}: {}", o.what, o.failure.as_ref()?)));
            study.notes.extend(failed.map(|failed| format!("Failed: {test} on a {rig} plant, {failed}.")));
        }
        for within_m in within {
            for (test, outcomes) in tests {
                row(&mut study, (test, rig, subjects.len()), *within_m, outcomes);
            }
            study.notes.extend(by_stiction(rig, &steps, *within_m));
        }
        panels.push(panel(format!("{rig}, to {:.0} µm", within[0] * 1e6), &steps, |o| o.over_limit(within[0])));
    }
    study.notes.push(NOTE.into());
    let figure = Figure {
        heading: "Recovery of this controller from a changed load (emulated)".into(),
        rows: vec![Panel::side_by_side(panels)],
        panel_size: (340, 330),
        blocks: key(),
        notes: vec![
            "The minimum is that of any control with this motor. It leaves out friction, which damps a light load, so \
             that a ratio can be below 1."
                .into(),
        ],
    };
    draw(&figure, "speed")?;
    Ok(study)
}

/// A row, and its numbers.
fn row(study: &mut Study, (test, rig, rigs): (&str, RigPreset, usize), within_m: f64, outcomes: &[Outcome]) {
    let settled: Vec<(&Outcome, f64)> = outcomes.iter().filter_map(|o| o.settled_s(within_m).map(|s| (o, s))).collect();
    let sorted = |value: &dyn Fn(&Outcome, f64) -> Option<f64>| {
        Sorted::new(settled.iter().filter_map(|(o, s)| value(o, *s)).filter(|x| x.is_finite()))
    };
    let over_limit = |o: &Outcome, s: f64| o.limit_s(within_m).map(|min_s| s / min_s);
    let within_um = format!("{:.0}", within_m * 1e6);
    let mut cells = vec![
        format!("{test}, to {within_um} µm"),
        format!("{rigs} {rig}"),
        format!(
            "{}, of {}; {}",
            settled.len(),
            outcomes.len(),
            outcomes.iter().filter(|o| o.failure.is_some()).count()
        ),
    ];
    for (what, unit, sorted) in [
        ("time_s", " s", sorted(&|_, s| Some(s))),
        ("over_motor", "", sorted(&|o, s| Some(s / o.motor_s))),
        ("over_limit", "", sorted(&over_limit)),
    ] {
        cells.push(sorted.median().map_or("-".into(), |_| sorted.spread() + unit));
        let name = format!("{rig}_{}_{within_um}um_{what}", test.replace(' ', "_"));
        study.value(format!("{name}_median"), sorted.median());
        study.value(format!("{name}_most"), sorted.max());
    }
    study.row(cells);
}

/// How many load steps settle within a distance (m) where stiction lets a load rest nearer, and where it does not; `None` if it always
/// does.
fn by_stiction(rig: RigPreset, steps: &[Outcome], within_m: f64) -> Option<String> {
    let (far, near): (Vec<&Outcome>, Vec<&Outcome>) = steps.iter().partition(|o| o.half_jump_m > within_m);
    let settled = |steps: &[&Outcome]| {
        format!("{} of {}", steps.iter().filter(|o| o.settled_s(within_m).is_some()).count(), steps.len())
    };
    (!far.is_empty()).then(|| {
        format!(
            "Load steps on {rig} plants: where a load that breaks loose from stiction jumps by {:.0} µm at most, {} settle to {:.0} µm; \
             where it jumps farther, {}.",
            2e6 * within_m,
            settled(&near),
            1e6 * within_m,
            settled(&far)
        )
    })
}

/// Ratios that are drawn; what is beyond them stands at the edge.
const RATIOS: [f64; 2] = [0.5, 14.0];
/// Height of those that did not settle.
const NEVER: f64 = 18.0;

/// A ratio of times against the load that hangs there in the end, by place.
fn panel(title: String, outcomes: &[Outcome], ratio: impl Fn(&Outcome) -> Option<f64>) -> Panel {
    let level = |ratio: f64, pen: Pen| Item::line([(0.1, ratio), (1.3, ratio)], pen.wide(1));
    let mut items = vec![level(1.0, Pen::solid(INK)), level(2.0, Pen::dashed(INK))];
    for outcome in outcomes {
        let Some(step) = outcome.step else { continue };
        let place = POSITIONS_M.iter().position(|at_m| *at_m == step.at_m).unwrap_or(0);
        let ratio = ratio(outcome);
        // Beside each other, not on top of each other.
        let load_kg = step.change_kg[1] + 0.03 * (place as f64 - 1.0);
        let at = (load_kg, ratio.map_or(NEVER, |ratio| ratio.clamp(RATIOS[0], RATIOS[1])));
        let shape = if ratio.is_some() { Shape::Dot } else { Shape::Cross };
        items.push(Item::mark(at, shape, colour(place, POSITIONS_M.len())));
    }
    let y = Axis::log("recovery time ÷ theoretical minimum", [RATIOS[0], 1.1 * NEVER]);
    Panel::new(title, Axis::linear("load after the change, kg", [0.1, 1.3]), y, items)
}

/// What the marks and lines of a panel are.
fn key() -> Vec<Block> {
    let place = |(k, at_m): (usize, &f32)| {
        KeyRow::mark(Shape::Dot, colour(k, POSITIONS_M.len()), format!("at {:.0} mm", at_m * 1e3))
    };
    vec![
        Block::new(POSITIONS_M.iter().enumerate().map(place)),
        Block::new([
            KeyRow::mark(Shape::Cross, GREY, format!("not within {WATCHED_S:.0} s")),
            KeyRow::line(Pen::solid(INK), "the theoretical minimum"),
            KeyRow::line(Pen::dashed(INK), "twice that"),
        ]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_changes::Step;
    use crate::physical_limit::Oscillation;

    /// Back after 2 s of 8, never back, and failed.
    fn outcomes() -> (Oscillation, [Outcome; 3]) {
        let oscillation =
            Oscillation { frequency: 20.0, damping_per_s: 2.0, speed_m_per_s: 0.005, acceleration_m_per_s2: 0.1 };
        let outcome = |errors_m: Vec<f64>| Outcome {
            step: Some(Step { seed: 1, at_m: POSITIONS_M[0], change_kg: [0.2, 0.4] }),
            oscillation: Some(oscillation),
            away_m: -2e-3,
            motor_s: 1.0,
            errors_m,
            failure: None,
            ..Outcome::failed(String::new(), String::new())
        };
        let back = outcome((0..800).map(|k| if k < 200 { -1e-3 } else { 0.0 }).collect());
        let failed = Outcome { failure: Some("fault".into()), ..back.clone() };
        (oscillation, [back, outcome(vec![-1e-3; 800]), failed])
    }

    #[test]
    fn what_does_not_settle_is_drawn_as_a_cross_and_nothing_is_left_out() {
        let (oscillation, outcomes) = outcomes();
        let ratio = outcomes[0].over_limit(50e-6).unwrap();
        assert!((ratio - 2.0 / oscillation.min_time_s(-2e-3, 50e-6).unwrap()).abs() < 1e-9 && ratio > 1.0, "{ratio}");
        let panel = panel("a".into(), &outcomes, |outcome| outcome.over_limit(50e-6));
        let mark = |item: &Item| if let Item::Mark { at, shape, .. } = item { Some((at.1, *shape)) } else { None };
        let marks: Vec<(f64, Shape)> = panel.items.iter().filter_map(mark).collect();
        assert_eq!(marks, [(ratio, Shape::Dot), (NEVER, Shape::Cross), (NEVER, Shape::Cross)]);
    }

    #[test]
    fn load_steps_are_counted_by_what_stiction_leaves() {
        let (_, [back, never, failed]) = outcomes();
        let jumps = |half_jump_m, outcome: &Outcome| Outcome { half_jump_m, ..outcome.clone() };
        let steps = [jumps(0.1e-3, &back), jumps(0.1e-3, &failed), jumps(0.2e-3, &never)];
        let note = by_stiction(RigPreset::Hard, &steps, 150e-6).expect("one jumps far");
        assert!(note.contains("by 300 µm at most, 1 of 2 settle to 150 µm; where it jumps farther, 0 of 1."), "{note}");
        assert_eq!(by_stiction(RigPreset::Hard, &steps[..2], 150e-6), None);
    }

    #[test]
    fn a_row_counts_what_settled_and_what_failed_and_shows_what_is_missing() {
        let (_, outcomes) = outcomes();
        let mut study = Study::new([""]);
        row(&mut study, ("load step", RigPreset::Hard, 1), 150e-6, &outcomes);
        assert_eq!(study.table[1][..4], ["load step, to 150 µm", "1 hard", "1, of 3; 1", "2.00; 2.00 s"]);
        assert_eq!(study.values["hard_load_step_150um_over_motor_most"], 2.0);
        row(&mut study, ("full speed", RigPreset::Hard, 1), 150e-6, &outcomes[1..]);
        assert_eq!(study.table[2][2..], ["0, of 2; 1", "-", "-", "-"]);
    }
}
