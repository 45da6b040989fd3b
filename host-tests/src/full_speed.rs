//! How fast a load is moved as fast as it goes, held against what the motor's speed and acceleration alone would need for the
//! same turn of the strings.

use crate::ControlBench;
use crate::load_changes::{Outcome, as_the_sensor_has_it, brought, hang, motor_s};
use crate::rigs::subject::Subject;
use crate::study::each;
use rig_control::TICK_S;
use rig_link::messages::{LoadChoice, Request, State};

/// What hangs there (kg).
pub const LOADS_KG: [f64; 4] = [0.1, 0.5, 1.0, 1.5];
/// Where the way begins and ends (m).
pub const ENDS_M: [f32; 2] = [0.001, 0.013];
/// The same of moves on which the load changes between two weights (kg), how many there are on one rig, and after how many ticks
/// the load changes in one after the other.
const STEP_ENDS_M: [f32; 2] = [0.004, 0.012];
const STEP_LOADS_KG: [f64; 2] = [0.9, 1.2];
const STEP_MOVES: usize = 34;
const STEP_TICKS: [u32; 5] = [10, 40, 80, 120, 180];
/// A way that begins farther than this from its place is another one (m).
const AWAY_M: f64 = 1e-3;
/// Rest before each way (s), and how long the load is watched after it: it may have changed as late as the end of the move.
const REST_S: f64 = 2.0;
const WATCHED_S: f64 = 3.0;

/// Up and down under every load on one rig.
pub fn all(subject: &Subject, threads: usize) -> Vec<Outcome> {
    each(threads, &LOADS_KG, |load_kg| both_ways(subject, *load_kg)).into_iter().flatten().collect()
}

fn both_ways(subject: &Subject, load_kg: f64) -> [Outcome; 2] {
    let [low_m, high_m] = ENDS_M;
    let mut bench = brought(subject, load_kg, low_m);
    [[low_m, high_m], [high_m, low_m]].map(|[from_m, to_m]| {
        let what = format!("seed {} {load_kg} kg, {:2.0} mm -> {:2.0} mm", subject.seed, from_m * 1e3, to_m * 1e3);
        match &mut bench {
            // The way before has not ended where this one begins.
            Ok(bench) if (bench.true_position_m() - f64::from(from_m)).abs() > AWAY_M => {
                Outcome::failed(what, "it does not begin at its place".into())
            }
            Ok(bench) => go(bench, to_m, None, what),
            Err(why) => Outcome::failed(what, why.clone()),
        }
    })
}

/// Moves up and down on one rig, on each of which the load changes by a third at some time.
pub fn under_steps(subject: &Subject) -> Vec<Outcome> {
    let [lighter_kg, heavier_kg] = STEP_LOADS_KG;
    let mut bench = brought(subject, heavier_kg, STEP_ENDS_M[0]);
    let moves = (0..STEP_MOVES).map(|k| {
        let (to_m, to_kg) = (STEP_ENDS_M[(k + 1) % 2], if k / 2 % 2 == 0 { lighter_kg } else { heavier_kg });
        // The second of two moves takes the load back.
        let to_kg = if k % 2 == 0 { to_kg } else { lighter_kg + heavier_kg - to_kg };
        let what = format!("seed {} to {:2.0} mm, to {to_kg} kg", subject.seed, to_m * 1e3);
        match &mut bench {
            Ok(bench) => {
                let outcome = go(bench, to_m, Some((STEP_TICKS[k % STEP_TICKS.len()], to_kg)), what);
                // The motor's own time is not defined here: the turn that it needs changes with the load on the way.
                Outcome { motor_s: f64::NAN, ..outcome }
            }
            Err(why) => Outcome::failed(what, why.clone()),
        }
    });
    moves.collect()
}

/// One move to a target (m), on which the load changes after the given number of ticks to another weight (kg).
fn go(bench: &mut ControlBench, target_m: f32, step: Option<(u32, f64)>, what: String) -> Outcome {
    bench.run(REST_S);
    let before_rad = bench.truth().twist_rad;
    let request = Request::Move { target_m, speed_m_per_s: f32::INFINITY, load: LoadChoice::Auto };
    if let Err(why) = bench.ask(request) {
        return Outcome::failed(what, why);
    }
    let (mut errors_m, mut shown_m) = (Vec::new(), Vec::new());
    let mut watch = |bench: &mut ControlBench, limit_s: f64, while_it_moves: bool| {
        bench.until(limit_s, |bench| {
            let true_m = bench.true_position_m();
            errors_m.push(true_m - f64::from(target_m));
            let position_m = bench.last.as_ref().and_then(|last| last.telemetry.position_m);
            shown_m.extend(position_m.map(|m| f64::from(m) - true_m));
            while_it_moves && bench.control.state() != State::Moving
        });
    };
    if let Some((ticks, to_kg)) = step {
        watch(bench, f64::from(TICK_S) * f64::from(ticks), false);
        if let Err(why) = hang(bench, to_kg) {
            return Outcome::failed(what, why);
        }
    }
    watch(bench, 20.0, true);
    watch(bench, WATCHED_S, false);
    let failed = bench.control.state() != State::Holding;
    let failure = failed.then(|| format!("{:?} {}", bench.control.state(), bench.control.faults()));
    as_the_sensor_has_it(&mut errors_m, &shown_m);
    let motor_s = motor_s(bench.truth().twist_rad - before_rad);
    Outcome { motor_s, errors_m, failure, ..Outcome::failed(what, String::new()) }
}
