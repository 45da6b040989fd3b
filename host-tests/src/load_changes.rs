//! How fast a load that is changed at rest is back at its place, held against what the motor's speed and acceleration alone
//! would need for the same turn of the strings.

use crate::physical_limit::Oscillation;
use crate::rigs::subject::Subject;
use crate::study::each;
use crate::{ControlBench, ControlLaw, booted, constants, table};
use lab::chart::margin::DAMPING;
use rig_control::TICK_S;
use rig_link::messages::{LoadChoice, Request, Setting, State};
use rig_plant::rig::effects::stribeck::coulomb_n;
use rig_plant::units::STANDARD_GRAVITY;
use std::fmt;

/// Positions (m) at which the load is changed.
pub const POSITIONS_M: [f32; 3] = [0.002, 0.008, 0.014];
/// What hangs there before and after (kg).
pub const CHANGES_KG: [[f64; 2]; 9] =
    [[0.2, 0.4], [0.4, 0.2], [0.2, 0.6], [0.6, 0.2], [0.6, 1.2], [1.2, 0.6], [1.0, 1.2], [1.2, 0.8], [0.8, 1.0]];

/// Speed of the way to a position (m/s), rest there (s), and how long the changed load is watched (s).
pub const SPEED_M_PER_S: f32 = 0.004;
/// See above.
pub const REST_S: f64 = 2.0;
/// See above.
pub const WATCHED_S: f64 = 8.0;

/// One change of the load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Seed of the rig.
    pub seed: u64,
    /// Where (m).
    pub at_m: f32,
    /// From what to what (kg).
    pub change_kg: [f64; 2],
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [from, to] = self.change_kg;
        write!(f, "seed {} {:2.0} mm {from} -> {to} kg", self.seed, self.at_m * 1e3)
    }
}

/// What came of a step of the load, or of a move at full speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Rig, place and load, in words.
    pub what: String,
    /// Time that the motor's speed and acceleration alone need (s).
    pub motor_s: f64,
    /// The change; `None` for a move.
    pub step: Option<Step>,
    /// What the load's oscillation and the motor allow; `None` for a move.
    pub oscillation: Option<Oscillation>,
    /// Where the strings stood when the load had changed, from its place (m).
    pub away_m: f64,
    /// Half of the jump with which the load breaks loose from stiction (m): a load that stands nearer is no nearer after a jump.
    pub half_jump_m: f64,
    /// Distance from the target over time (m), every tick, as the sensor has it without its noise.
    pub errors_m: Vec<f64>,
    /// How it failed, if it did.
    pub failure: Option<String>,
}

impl Outcome {
    /// One that did not come about.
    pub fn failed(what: String, why: String) -> Self {
        Self {
            what,
            motor_s: f64::NAN,
            step: None,
            oscillation: None,
            away_m: 0.0,
            half_jump_m: 0.0,
            errors_m: Vec::new(),
            failure: Some(why),
        }
    }

    /// Minimum time (s) that motor and oscillation allow to come within a distance (m) of the place.
    pub fn limit_s(&self, within_m: f64) -> Option<f64> {
        self.oscillation?.min_time_s(self.away_m, within_m)
    }

    /// Time to come back over the least that motor and oscillation allow; `None` if the load did not come back, or if the limit is not
    /// known.
    pub fn over_limit(&self, within_m: f64) -> Option<f64> {
        Some(self.settled_s(within_m)? / self.limit_s(within_m)?)
    }

    /// Time after which the load stays within a distance (m) of its target (s); `None` if it does not.
    pub fn settled_s(&self, within_m: f64) -> Option<f64> {
        let outside = self.errors_m.iter().rposition(|error_m| error_m.abs() > within_m).map_or(0, |tick| tick + 1);
        (self.failure.is_none() && outside + 100 < self.errors_m.len()).then_some(0.01 * outside as f64)
    }
}

/// Adds what the sensor shows too much in the last second (m), without its noise.
pub fn as_the_sensor_has_it(errors_m: &mut [f64], shown_m: &[f64]) {
    let last = &shown_m[shown_m.len().saturating_sub(100)..];
    let beside_m = last.iter().sum::<f64>() / last.len().max(1) as f64;
    errors_m.iter_mut().for_each(|error_m| *error_m += beside_m);
}

/// A load (kg) on strings of a stiffness (N/m).
fn oscillation(stiffness_n_per_m: f64, load_kg: f64, tr_rad_per_m: f64) -> Option<Oscillation> {
    let limits = constants().twist_limits();
    Some(Oscillation {
        frequency: (stiffness_n_per_m / load_kg).sqrt(),
        damping_per_s: (DAMPING[0] + DAMPING[1] * stiffness_n_per_m) / load_kg,
        speed_m_per_s: f64::from(limits.speed) / tr_rad_per_m,
        acceleration_m_per_s2: f64::from(limits.acceleration) / tr_rad_per_m,
    })
    .filter(|oscillation| oscillation.frequency.is_finite() && oscillation.speed_m_per_s.is_finite())
}

/// Shortest time (s) for a turn of the strings (rad) from rest to rest.
pub fn motor_s(turn_rad: f64) -> f64 {
    let limits = constants().twist_limits();
    let (speed, acceleration) = (f64::from(limits.speed), f64::from(limits.acceleration));
    let turn_rad = turn_rad.abs();
    if turn_rad > speed * speed / acceleration {
        turn_rad / speed + speed / acceleration
    } else {
        2.0 * (turn_rad / acceleration).sqrt()
    }
}

/// Load (kg) under which the rig is homed for a step, so that both can reach the position: the lighter one far down, the heavier one
/// far up.
pub fn homed_under_kg(step: &Step) -> f64 {
    let [from, to] = step.change_kg;
    if step.at_m < 0.01 { from.min(to) } else { from.max(to) }
}

/// Every change at every position on the rig of a seed.
pub fn steps(seed: u64) -> Vec<Step> {
    let at = |at_m: &f32| CHANGES_KG.map(|change_kg| Step { seed, at_m: *at_m, change_kg });
    POSITIONS_M.iter().flat_map(at).collect()
}

/// Every load (kg) of [`CHANGES_KG`] once, ascending.
pub fn loads_kg() -> Vec<f64> {
    let mut loads_kg: Vec<f64> = CHANGES_KG.iter().flatten().copied().collect();
    loads_kg.sort_by(f64::total_cmp);
    loads_kg.dedup();
    loads_kg
}

/// Every change at every position on one rig.
pub fn all(subject: &Subject, threads: usize) -> Vec<Outcome> {
    let loads_kg = loads_kg();
    let homed = each(threads, &loads_kg, |load_kg| homed_under(subject, *load_kg));
    each(threads, &steps(subject.seed), |step| {
        let load_kg = homed_under_kg(step);
        let on = loads_kg.iter().position(|kg| *kg == load_kg).expect("listed");
        play(homed[on].clone(), *step)
    })
}

/// A rig homed under a load (kg).
///
/// # Errors
/// In words, if it cannot be homed.
pub fn homed_under(subject: &Subject, load_kg: f64) -> Result<ControlBench, String> {
    let rig = subject.switched_on(load_kg * STANDARD_GRAVITY).map_err(|e| e.to_string())?;
    let mut bench = ControlBench::on(rig, booted());
    bench.home()?;
    bench.ask(Request::SetSetting { setting: Setting::LoopGain, value: subject.loop_gain })?;
    bench.run(0.5);
    Ok(bench)
}

/// A rig homed under a load (kg) and brought to a position (m).
///
/// # Errors
/// In words, if it cannot be homed or does not get there.
pub fn brought(subject: &Subject, load_kg: f64, to_m: f32) -> Result<ControlBench, String> {
    let mut bench = homed_under(subject, load_kg)?;
    bench.move_to(to_m, SPEED_M_PER_S, LoadChoice::Auto)?;
    Ok(bench)
}

fn play(bench: Result<ControlBench, String>, step: Step) -> Outcome {
    match bench.and_then(|mut bench| begin(&mut bench, step).map(|()| bench)) {
        Ok(bench) => watch(bench, step),
        Err(why) => Outcome { step: Some(step), ..Outcome::failed(step.to_string(), why) },
    }
}

/// To rest at the position under the first load.
fn begin(bench: &mut ControlBench, step: Step) -> Result<(), String> {
    hang(bench, step.change_kg[0])?;
    bench.run(REST_S);
    bench.move_to(step.at_m, SPEED_M_PER_S, LoadChoice::Auto)?;
    bench.run(REST_S);
    Ok(())
}

/// Hangs another load (kg) on.
///
/// # Errors
/// In words, if the rig cannot carry it.
pub fn hang<C: ControlLaw>(bench: &mut ControlBench<C>, load_kg: f64) -> Result<(), String> {
    bench.rig.set_plant("load", &format!("{load_kg}kg")).map_err(|e| e.to_string())
}

/// Changes the load by hand, 2 N a second: at once it would swing, and what is taken off would look like a broken string.
///
/// # Errors
/// As [`hang`].
pub fn lay_on(bench: &mut ControlBench, mut from_kg: f64, to_kg: f64) -> Result<(), String> {
    while from_kg != to_kg {
        from_kg += (to_kg - from_kg).clamp(-0.01, 0.01);
        hang(bench, from_kg)?;
        bench.run(0.05);
    }
    Ok(())
}

/// Watches a load for a time (s): its distances from its target (m), every tick, as the sensor has them. `tick` moves the bench on
/// and tells the position (m) that the sensor shows.
pub fn errors_m<C: ControlLaw>(
    bench: &mut ControlBench<C>,
    (target_m, seconds): (f32, f64),
    mut tick: impl FnMut(&mut ControlBench<C>) -> Option<f32>,
) -> Vec<f64> {
    let (mut errors_m, mut shown_m) = (Vec::new(), Vec::new());
    for _ in 0..(seconds / f64::from(TICK_S)).round() as usize {
        let shown = tick(bench);
        let true_m = bench.true_position_m();
        errors_m.push(true_m - f64::from(target_m));
        shown_m.extend(shown.map(|m| f64::from(m) - true_m));
    }
    as_the_sensor_has_it(&mut errors_m, &shown_m);
    errors_m
}

fn watch(mut bench: ControlBench, step: Step) -> Outcome {
    let before_rad = bench.truth().twist_rad;
    let mut failure = hang(&mut bench, step.change_kg[1]).err();
    let errors_m = errors_m(&mut bench, (step.at_m, WATCHED_S), |bench| bench.tick(None).telemetry.position_m);
    if bench.control.state() != State::Holding {
        failure = Some(format!("{:?} {}", bench.control.state(), bench.control.faults()));
    }
    let turned_rad = bench.truth().twist_rad - before_rad;
    let tr_rad_per_m = bench.last.as_ref().and_then(|last| last.telemetry.tr_rad_per_m).map_or(f64::NAN, f64::from);
    let load_kg = step.change_kg[1];
    let point = table().point_inside((load_kg * STANDARD_GRAVITY) as f32, bench.truth().twist_rad as f32);
    let stiffness_n_per_m = 1.0 / f64::from(point.dgap_dload_m_per_n);
    let rig = bench.rig.settings();
    Outcome {
        what: step.to_string(),
        motor_s: motor_s(turned_rad),
        step: Some(step),
        oscillation: oscillation(stiffness_n_per_m, load_kg, tr_rad_per_m),
        away_m: -turned_rad / tr_rad_per_m,
        // A jump is twice as long as what stiction holds more than friction stretches the strings.
        half_jump_m: (rig.stiction_ratio - 1.0) * coulomb_n(rig) / stiffness_n_per_m,
        errors_m,
        failure,
    }
}
