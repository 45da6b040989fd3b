//! The load steps of [`crate::load_changes`] by the controllers that the firmware's is held against
//! ([`crate::compare`]): on the same rigs, from rest at the same places, watched as long.
//!
//! Their loops are tuned for these very steps, on some of the rigs that are reported. All of them are told the true
//! load at once.

use crate::ControlBench;
use crate::compare::baseline::{self, Baseline, Law, Loop, OTHERS};
use crate::compare::{tune, untuned};
use crate::load_changes::{Outcome, REST_S, SPEED_M_PER_S, Step, WATCHED_S, errors_m, hang, homed_under_kg, loads_kg};
use crate::rigs::commission::Firmware;
use crate::rigs::subject::Subject;
use crate::study::each;
use rig_control::TICK_S;
use rig_plant::units::STANDARD_GRAVITY;
use std::f32::consts::PI;

/// Longest way at a constant speed to the place of a step (s).
const ARRIVES_S: f64 = 30.0;
/// How near the place (m) a constant speed has arrived.
const ARRIVED_M: f32 = 100e-6;
/// How long a step is watched while a loop is tuned (s), and one of how many steps is tuned on: each change at one place.
const TUNED_S: f64 = 5.0;
const TUNED_ON: usize = 3;
/// What a step that does not settle costs (s): with the most settled steps wanted, and with the least time.
const MAX_SETTLED_S: f64 = 1000.0;
const MIN_TIME_S: f64 = TUNED_S;
/// Crossing of friction (rad) where a move begins. No move begins at a load step, so that its size does not matter.
const BREAKAWAY_RAD: f32 = 0.3;

/// A rig, and the baseline at its reference under each load (kg), or why it did not come there.
type Ready = Vec<(f64, Result<ControlBench<Baseline>, String>)>;

/// A kind of rig for the baseline, and what the firmware did on each.
pub struct Field {
    rigs: Vec<(Ready, Vec<Outcome>)>,
    threads: usize,
}

impl Field {
    /// Rigs with the firmware's outcomes of every step.
    pub fn new(rigs: Vec<(Subject, Vec<Outcome>)>, threads: usize) -> Self {
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
    pub fn baselines(&self, tuned_on: usize, within_m: f64) -> Vec<(&'static str, Law)> {
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
    pub fn play(&self, law: Law) -> Vec<Outcome> {
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
                .filter(move |(k, _)| (k + k / 9 + rig) % TUNED_ON == 0)
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
    use rig_plant::RigPreset;

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
