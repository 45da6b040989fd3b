//! Gain and delay margin of the firmware's loop on emulated rigs, beside those of its linear analysis
//! (`tsa-lab chart --only margin`).
//!
//! The open loop is cut where the gap is measured: what the LVDT shows of a change is made larger, or comes later than its time
//! stamp says, until the load no longer comes to rest after a small change of its weight.

use crate::load_changes::{hang, homed_under};
use crate::rigs::subject::Subject;
use crate::{ControlBench, scene};
use lab::chart::margin::{Controller, Hung};
use rig_control::{Inputs, LvdtBlock, TICK_S};
use rig_link::messages::{LoadChoice, State};
use rig_plant::RigPreset;
use rig_plant::units::STANDARD_GRAVITY;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use tsa_model::{Mechanism, twist_from_turns};

/// Loads (kg) and positions (m) at which the margins are measured.
pub const LOADS_KG: [f64; 3] = [0.2, 0.6, 1.2];
/// See above.
pub const POSITIONS_M: [f32; 3] = [0.002, 0.008, 0.014];
/// Share of its weight that the load keeps.
const KEPT: f64 = 0.95;
/// How long the load may swing after that, and how long it is then watched (s).
const CALM_AFTER_S: f64 = 6.0;
const WATCHED_S: f64 = 2.0;
/// A load that still moves by so much (m) swings.
const SWINGS_M: f64 = 300e-6;
/// Factor from one gain that is tried to the next, and the step of the delay (s); how many of each are tried.
const GAIN_STEP: f64 = 1.1;
const DELAY_STEP_S: f64 = 0.004;
const TRIED: i32 = 25;
/// Speed of the way to a position (m/s).
const SPEED_M_PER_S: f32 = 0.004;

/// What is put into the open loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loosened {
    /// Factor of what the LVDT shows, about its first reading.
    pub gain: f64,
    /// Delay (s) that the time stamps do not tell.
    pub delay_s: f64,
}

impl Loosened {
    /// Puts it into a bench.
    pub fn put_into(self, bench: &mut ControlBench) {
        let ticks = self.delay_s / f64::from(TICK_S);
        let (whole, part) = (ticks as usize, ticks.fract() as f32);
        let seen = Mutex::new((None::<f32>, VecDeque::new()));
        bench.tamper = Some(Arc::new(move |inputs: &mut Inputs| {
            let Some(block) = inputs.lvdt else { return };
            let mut seen = seen.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let centre = *seen.0.get_or_insert(block.mean_code);
            let past = &mut seen.1;
            past.push_front(block.mean_code);
            past.truncate(whole + 2);
            let at = |age: usize| past.get(age).or(past.back()).copied().unwrap_or(centre);
            let mean_code = (1.0 - part) * at(whole) + part * at(whole + 1);
            inputs.lvdt = Some(LvdtBlock { mean_code: centre + self.gain as f32 * (mean_code - centre), ..block });
        }));
    }
}

/// The mechanism under a load (N) at a height (m) above the half-turn pre-twist.
///
/// # Errors
/// In words, where the mechanism has no equilibrium.
pub fn hung_at(mechanism: &Mechanism, load_n: f64, height_m: f64) -> Result<Hung, String> {
    let gap = |twist: f64| mechanism.solve(load_n, twist).map(|e| e.gap_m).map_err(|e| e.to_string());
    let (mut low, mut high) = (twist_from_turns(0.0), twist_from_turns(7.5));
    let wanted = gap(low)? - height_m;
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if gap(middle)? > wanted { low = middle } else { high = middle }
    }
    Hung::at(mechanism, load_n, low).map_err(|e| e.to_string())
}

/// How far the load still swings (m), some time after it has kept only a share of its weight.
///
/// # Errors
/// In words, if the board no longer holds the load.
pub fn swing_m(mut bench: ControlBench, load_kg: f64, kept: f64, loosened: Loosened) -> Result<f64, String> {
    loosened.put_into(&mut bench);
    bench.run(0.5);
    hang(&mut bench, kept * load_kg)?;
    bench.run(CALM_AFTER_S);
    let mut range_m = [f64::INFINITY, f64::NEG_INFINITY];
    bench.until(WATCHED_S, |bench| {
        let position_m = bench.true_position_m();
        range_m = [range_m[0].min(position_m), range_m[1].max(position_m)];
        false
    });
    if bench.control.state() != State::Holding {
        return Err(format!("{}: {}", bench.control.state(), bench.control.faults()));
    }
    Ok(range_m[1] - range_m[0])
}

/// Rig, load and place.
#[derive(Clone, Debug)]
pub struct Place {
    /// The rig, and its kind in words.
    pub rig: (Subject, String),
    /// Load (kg).
    pub load_kg: f64,
    /// Position (m).
    pub at_m: f32,
}

/// The margins at a place: computed, with the table's mechanism and no friction, and measured. Of those measured the last with
/// which the load came to rest: the next step was too much, unless it is the greatest that was tried. `None` if the load swings
/// without a change of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// By how much the gain of the open loop may grow.
    pub gain: (f64, Option<f64>),
    /// What further delay it tolerates (s).
    pub delay_s: (f64, Option<f64>),
}

/// The greatest values that are tried.
pub fn most() -> Loosened {
    Loosened { gain: by_gain(TRIED).gain, ..by_delay(TRIED) }
}

/// The rigs on which the margins are measured: the linear analysis' own, which has no friction, and those of the presets, so many
/// of each kind from a seed on; of the ideal one there is only one.
pub fn rigs(seed: u64, count: u64) -> Vec<(Subject, String)> {
    let mut smooth = Subject::new(RigPreset::Ideal, seed);
    smooth.changes.push("friction=0N".parse().expect("a plant key"));
    let presets = RigPreset::ALL.into_iter().flat_map(|kind| {
        let count = if kind == RigPreset::Ideal { 1 } else { count };
        (seed..seed + count).map(move |seed| (Subject::new(kind, seed), kind.to_string()))
    });
    [(smooth, "without friction".to_owned())].into_iter().chain(presets).collect()
}

impl Place {
    /// Computes and measures them.
    ///
    /// # Errors
    /// In words, if the load cannot be brought to its place, or has no equilibrium there.
    pub fn margins(&self) -> Result<Margins, String> {
        let mut bench = homed_under(&self.rig.0, self.load_kg)?;
        bench.move_to(self.at_m, SPEED_M_PER_S, LoadChoice::Auto)?;
        bench.run(1.0);
        let rests = |loosened: Loosened| {
            swing_m(bench.clone(), self.load_kg, KEPT, loosened).is_ok_and(|swing_m| swing_m < SWINGS_M)
        };
        // The last with which it comes to rest before the first with which it does not.
        let last = |at: fn(i32) -> Loosened| (0..=TRIED).map(at).take_while(|loosened| rests(*loosened)).last();
        let mechanism = scene().mechanism().map_err(|e| e.to_string())?;
        let hung = hung_at(&mechanism, KEPT * self.load_kg * STANDARD_GRAVITY, self.at_m.into())?;
        let firmware = Controller::damped();
        Ok(Margins {
            gain: (hung.gain_margin(&firmware), last(by_gain).map(|loosened| loosened.gain)),
            delay_s: (hung.delay_margin(&firmware, most().delay_s), last(by_delay).map(|loosened| loosened.delay_s)),
        })
    }
}

fn by_gain(step: i32) -> Loosened {
    Loosened { gain: GAIN_STEP.powi(step), delay_s: 0.0 }
}

fn by_delay(step: i32) -> Loosened {
    Loosened { gain: 1.0, delay_s: f64::from(step) * DELAY_STEP_S }
}
