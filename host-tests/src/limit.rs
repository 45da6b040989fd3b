//! The study of changed loads by this controller and by seven others, over the least time of any control.
//!
//! The load steps of [`crate::load_changes`] are played by the controllers that the firmware's is held against ([`crate::compare`]): on
//! the same rigs, from rest at the same places, watched as long. Their loops are tuned for these very steps, on some of the rigs that
//! are reported. All of them are told the true load at once.

use crate::ControlBench;
use crate::compare::baseline::{self, Baseline, Law, Loop, OTHERS};
use crate::compare::{tune, untuned};
use crate::load_changes::{
    self, Outcome, REST_S, SPEED_M_PER_S, Step, WATCHED_S, errors_m, hang, homed_under_kg, loads_kg,
};
use crate::rigs::commission::Firmware;
use crate::rigs::subject::Subject;
use crate::study::{Rigs, Sorted, Study, draw, each, shown};
use anyhow::Result;
use rig_control::TICK_S;
use rig_plant::RigPreset;
use rig_plant::units::STANDARD_GRAVITY;
use rigctl::plot::{Axis, Block, Figure, GREY, INK, Item, KeyRow, Panel, Pen, Shape, colour};
use std::f32::consts::PI;

/// Kind of rig, how many, and the distance (m) within which a load counts as at its place.
pub(crate) const KINDS: [(RigPreset, u64, f64); 3] =
    [(RigPreset::Ideal, 1, 50e-6), (RigPreset::Nominal, 3, 50e-6), (RigPreset::Hard, 3, 150e-6)];
/// On how many of the rigs the loops are tuned, at most.
const TUNED_ON: usize = 2;
/// A tick (s): no time that is compared is shorter.
const SHORTEST_S: f64 = 0.01;
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
            (theirs_s, ours_s) => {
                Some(theirs_s.unwrap_or(f64::INFINITY) / ours_s.unwrap_or(f64::INFINITY).max(SHORTEST_S))
            }
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

/// Longest way at a constant speed to the place of a step (s).
const ARRIVES_S: f64 = 30.0;
/// How near the place (m) a constant speed has arrived.
const ARRIVED_M: f32 = 100e-6;
/// How long a step is watched while a loop is tuned (s), and one of how many steps is tuned on: each change at one place.
const TUNED_S: f64 = 5.0;
const TUNED_EVERY: usize = 3;
/// What a step that does not settle costs (s): with the most settled steps wanted, and with the least time.
const MAX_SETTLED_S: f64 = 1000.0;
const MIN_TIME_S: f64 = TUNED_S;
/// Crossing of friction (rad) where a move begins. No move begins at a load step, so that its size does not matter.
const BREAKAWAY_RAD: f32 = 0.3;

/// A rig, and the baseline at its reference under each load (kg), or why it did not come there.
type Ready = Vec<(f64, Result<ControlBench<Baseline>, String>)>;

/// A kind of rig for the baseline, and what the firmware did on each.
struct Field {
    rigs: Vec<(Ready, Vec<Outcome>)>,
    threads: usize,
}

impl Field {
    /// Rigs with the firmware's outcomes of every step.
    fn new(rigs: Vec<(Subject, Vec<Outcome>)>, threads: usize) -> Self {
        let loads_kg = loads_kg();
        let of = |(subject, ours): (Subject, Vec<Outcome>)| {
            let firmware = Firmware::as_built();
            let ready = each(threads, &loads_kg, |load_kg| {
                baseline::at_reference(&subject, &firmware, [load_kg * STANDARD_GRAVITY, f64::from(PI)])
            });
            (loads_kg.iter().copied().zip(ready).collect(), ours)
        };
        Self { rigs: rigs.into_iter().map(of).collect(), threads }
    }

    /// All seven by name, tuned on the first N of the rigs for loads that are back within a distance (m).
    fn baselines(&self, tuned_on: usize, within_m: f64) -> Vec<(&'static str, Law)> {
        // Begins near what earlier searches found, which only saves time: its first steps are wide.
        let fixed = Loop { gain_per_s: 6.0, corner_rad_per_s: 30.0, ..untuned() };
        let tune = |start: Loop, unsettled_s: f64| self.tuned(start, unsettled_s, tuned_on, within_m);
        let (settled, min) = (tune(fixed, MAX_SETTLED_S), tune(fixed, MIN_TIME_S));
        let by_table = tune(Loop { tr_rad_per_m: None, ..fixed }, MIN_TIME_S);
        let tuned = [
            ("b  fixed ratio, most settled", Law::Loop(settled)),
            ("b' fixed ratio, least time", Law::Loop(min)),
            ("b\" fixed ratio and crossing", Law::Loop(Loop { breakaway_rad: BREAKAWAY_RAD, ..min })),
            ("e  b' by the table's ratio", Law::Loop(by_table)),
        ];
        tuned.into_iter().chain(OTHERS).collect()
    }

    /// Every step of every rig by a law, beside the limits of the firmware's.
    fn play(&self, law: Law) -> Vec<Outcome> {
        let all: Vec<(&Ready, &Outcome)> =
            self.rigs.iter().flat_map(|(ready, ours)| ours.iter().map(move |one| (ready, one))).collect();
        each(self.threads, &all, |(ready, ours)| {
            let Some(step) = ours.step else { return Outcome::failed(ours.what.clone(), "no step".into()) };
            match standing(ready, law, &step) {
                Ok(mut bench) => watch(&mut bench, step, ours, WATCHED_S),
                Err(why) => Outcome { failure: Some(why), errors_m: Vec::new(), ..(*ours).clone() },
            }
        })
    }

    fn tuned(&self, start: Loop, unsettled_s: f64, tuned_on: usize, within_m: f64) -> Loop {
        let chosen = self.rigs.iter().take(tuned_on).enumerate().flat_map(|(rig, (ready, ours))| {
            ours.iter()
                .enumerate()
                .filter(move |(k, _)| (k + k / 9 + rig) % TUNED_EVERY == 0)
                .map(move |(_, o)| (ready, o))
        });
        let chosen: Vec<(&Ready, &Outcome, Step)> =
            chosen.filter_map(|(ready, ours)| Some((ready, ours, ours.step?))).collect();
        // All candidates begin where the same loop has brought the load.
        let standing = each(self.threads, &chosen, |(ready, ours, step)| {
            standing(ready, Law::Loop(start), step).ok().map(|bench| (bench, *ours, *step))
        });
        let standing: Vec<_> = standing.into_iter().flatten().collect();
        let play = |(bench, ours, step): &(ControlBench<Baseline>, &Outcome, Step), candidate: Loop| {
            let mut bench = bench.clone();
            bench.control.law = Law::Loop(candidate);
            watch(&mut bench, *step, ours, TUNED_S).settled_s(within_m).unwrap_or(unsettled_s)
        };
        let chunks = standing.chunks(6);
        tune::search_in((self.threads, start), chunks, play, |cost: &mut f64, _, more| *cost += more, |cost| *cost)
    }
}

/// One tick with a set-point; the position that the sensor shows (m).
fn tick(bench: &mut ControlBench<Baseline>, set_point_m: f32, target_m: f32) -> Option<f32> {
    baseline::follow(bench, set_point_m, target_m, SPEED_M_PER_S);
    bench.control.shown_m
}

/// At rest at the place of a step, under its first load.
fn standing(ready: &Ready, law: Law, step: &Step) -> Result<ControlBench<Baseline>, String> {
    let homed_kg = homed_under_kg(step);
    let homed = ready.iter().find(|(load_kg, _)| *load_kg == homed_kg).ok_or("not homed under this load")?;
    let mut bench = homed.1.clone()?;
    let rest = (REST_S / f64::from(TICK_S)) as usize;
    bench.control.law = law;
    hang(&mut bench, step.change_kg[0])?;
    for _ in 0..rest {
        tick(&mut bench, 0.0, 0.0);
    }
    let ramp = (1..).map(|k| k as f32 * SPEED_M_PER_S * TICK_S).take_while(|set_point_m| *set_point_m < step.at_m);
    for set_point_m in ramp {
        tick(&mut bench, set_point_m, step.at_m);
    }
    if matches!(law, Law::ConstantSpeed(_) | Law::MatchedSpeed) {
        let ticks = (ARRIVES_S / f64::from(TICK_S)) as usize;
        let far = |shown_m: Option<f32>| shown_m.is_none_or(|shown_m| (shown_m - step.at_m).abs() > ARRIVED_M);
        (0..ticks).take_while(|_| far(tick(&mut bench, step.at_m, step.at_m))).for_each(drop);
    }
    for _ in 0..rest {
        tick(&mut bench, step.at_m, step.at_m);
    }
    Ok(bench)
}

/// What comes of a step; its limits are those of the firmware's.
fn watch(bench: &mut ControlBench<Baseline>, step: Step, ours: &Outcome, seconds: f64) -> Outcome {
    let failure = hang(bench, step.change_kg[1]).err();
    let errors_m = errors_m(bench, (step.at_m, seconds), |bench| tick(bench, step.at_m, step.at_m));
    Outcome { errors_m, failure, ..ours.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_changes::steps;
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

    /// The firmware's outcomes are not needed but for their steps.
    fn field(pick: fn(&Step) -> bool) -> Field {
        let subject = Subject::new(RigPreset::Ideal, 1);
        let ours = steps(1).into_iter().filter(pick);
        let ours = ours.map(|step| Outcome {
            step: Some(step),
            failure: None,
            ..Outcome::failed(step.to_string(), String::new())
        });
        Field::new(vec![(subject, ours.collect())], 1)
    }

    #[test]
    fn a_loop_brings_a_changed_load_back_and_a_constant_speed_does_not() {
        let field = field(|step| step.at_m == 0.008 && step.change_kg == [0.2, 0.6]);
        let slow = Loop { gain_per_s: 3.0, corner_rad_per_s: 9.0, ..untuned() };
        let [looped, constant] = [Law::Loop(slow), Law::MatchedSpeed].map(|law| field.play(law).remove(0));
        assert_eq!((looped.failure.clone(), looped.errors_m.len()), (None, 800));
        // The load was at its place. In the first 10 ms it falls with two thirds of g at most, then by millimetres.
        assert!(looped.errors_m[0].abs() < 0.4e-3, "{}", looped.errors_m[0]);
        assert!(looped.errors_m.iter().any(|error_m| *error_m < -2e-3));
        assert!(looped.settled_s(50e-6).is_some_and(|s| s > 0.3), "{:?}", looped.settled_s(50e-6));
        assert_eq!(constant.settled_s(50e-6), None);
        assert!(
            constant.errors_m.last().is_some_and(|error_m| *error_m < -2e-3),
            "it stays where the load has fallen to"
        );
    }

    #[test]
    fn a_tuned_loop_is_at_least_as_fast_as_the_one_that_the_search_began_with() {
        let field = field(|step| step.change_kg == [0.6, 1.2]);
        let start = Loop { gain_per_s: 1.5, corner_rad_per_s: 9.0, ..untuned() };
        let tuned = field.tuned(start, MIN_TIME_S, 1, 50e-6);
        let total_s = |law: Loop| {
            let played = field.play(Law::Loop(law));
            played.iter().map(|o| o.settled_s(50e-6).unwrap_or(WATCHED_S)).sum::<f64>()
        };
        let [before_s, after_s] = [start, tuned].map(total_s);
        assert!(tuned != start && after_s < before_s, "{before_s} s, {after_s} s with {tuned:?}");
    }
}
