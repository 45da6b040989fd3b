//! Gain and delay margin of the firmware's loop on emulated rigs, beside those of its linear analysis
//! (`tsa-lab chart --only margin`).
//!
//! The open loop is cut where the gap is measured: what the LVDT shows of a change is made larger, or comes later than its time
//! stamp says, until the load no longer comes to rest after a small change of its weight.

use crate::load_changes::{brought, hang};
use crate::rigs::subject::Subject;
use crate::study::{Rigs, Study, each};
use crate::{ControlBench, scene};
use anyhow::{Context, Result, anyhow};
use lab::chart::margin::{LinearLoop, OperatingPoint, with_constants_off};
use rig_control::{Inputs, LvdtBlock, TICK_S};
use rig_link::messages::State;
use rig_plant::units::STANDARD_GRAVITY;
use rig_plant::{PlantChange, PlantKey, RigPreset};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use tsa_model::{Mechanism, twist_from_turns};

/// Loads (kg) and positions (m) at which the margins are measured.
const LOADS_KG: [f64; 3] = [0.2, 0.6, 1.2];
const POSITIONS_M: [f32; 3] = [0.002, 0.008, 0.014];
/// Fraction of its weight that the load keeps.
const KEPT: f64 = 0.95;
/// How long the load may oscillate after that, and how long it is then watched (s).
const CALM_AFTER_S: f64 = 6.0;
const WATCHED_S: f64 = 2.0;
/// A load that still moves by so much (m) swings.
const OSCILLATIONS_M: f64 = 300e-6;
/// Factor from one gain that is tried to the next, and the step of the delay (s); how many of each are tried.
const GAIN_STEP: f64 = 1.1;
const DELAY_STEP_S: f64 = 0.004;
const TRIED: i32 = 25;
/// Longest delay that is computed (s).
const MAX_DELAY_S: f64 = 0.2;

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
pub fn hung_at(mechanism: &Mechanism, load_n: f64, height_m: f64) -> Result<OperatingPoint, String> {
    let gap = |twist: f64| mechanism.solve(load_n, twist).map(|e| e.gap_m).map_err(|e| e.to_string());
    let (mut low, mut high) = (twist_from_turns(0.0), twist_from_turns(7.5));
    let wanted = gap(low)? - height_m;
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if gap(middle)? > wanted { low = middle } else { high = middle }
    }
    OperatingPoint::at(mechanism, load_n, low).map_err(|e| e.to_string())
}

/// How far the load still oscillates (m), some time after it has kept only a fraction of its weight.
///
/// # Errors
/// In words, if the board no longer holds the load.
pub fn oscillation_m(mut bench: ControlBench, load_kg: f64, kept: f64, loosened: Loosened) -> Result<f64, String> {
    loosened.put_into(&mut bench);
    bench.run(0.5);
    hang(&mut bench, kept * load_kg)?;
    bench.run(CALM_AFTER_S);
    let mut range_m = [f64::INFINITY, f64::NEG_INFINITY];
    bench.watch(WATCHED_S, |bench| {
        let position_m = bench.true_position_m();
        range_m = [range_m[0].min(position_m), range_m[1].max(position_m)];
    });
    if bench.control.state() != State::Holding {
        return Err(format!("{}: {}", bench.control.state(), bench.control.faults()));
    }
    Ok(range_m[1] - range_m[0])
}

/// The mechanism in 64 states: loads and twists over the whole range.
///
/// # Errors
/// If it has no equilibrium in one of them.
pub fn states(mechanism: &Mechanism) -> Result<Vec<OperatingPoint>> {
    let envelope = scene().envelope.as_ref().context("the default scene has an envelope")?;
    let [min_n, max_n] = envelope.load_n;
    let part = |k: u32| f64::from(k) / 7.0;
    let load_n = |k: u32| min_n * (max_n / min_n).powf(part(k));
    let states = (0..8).flat_map(|i| (0..8).map(move |j| (load_n(i), twist_from_turns(7.5 * part(j)))));
    Ok(states.map(|(load_n, twist_rad)| OperatingPoint::at(mechanism, load_n, twist_rad)).collect::<Result<_, _>>()?)
}

/// The computed margins of the loop where each is worst: gain, peak of the sensitivity, and further delay (s), over the whole range
/// of the table and with the mechanism's constants a tenth off.
///
/// # Errors
/// If a mechanism cannot be made.
pub fn worst(loop_gain: f64) -> Result<[f64; 3]> {
    let table = states(&scene().mechanism()?)?;
    let mut worst = [f64::INFINITY, 0.0, f64::INFINITY];
    for mechanism in with_constants_off(scene())? {
        for (hung, believed) in states(&mechanism)?.iter().zip(&table) {
            let c = LinearLoop { loop_gain, ..LinearLoop::damped_for(believed) };
            let [gain, peak, delay_s] = worst;
            worst = [
                gain.min(hung.gain_margin(&c)),
                peak.max(hung.peak_sensitivity(&c)),
                delay_s.min(hung.delay_margin(&c, MAX_DELAY_S)),
            ];
        }
    }
    Ok(worst)
}

/// Rig, load and place.
#[derive(Clone, Debug)]
struct Place {
    /// The rig, and its kind in words.
    rig: (Subject, String),
    /// Load (kg).
    load_kg: f64,
    /// Position (m).
    at_m: f32,
}

/// Measures all of them.
///
/// # Errors
/// If a rig fails.
pub fn study(rigs: &Rigs) -> Result<Study> {
    let places = places(self::rigs(rigs));
    let margins = each(rigs.jobs, &places, Place::margins);
    let of = |(place, margins): (Place, Result<Margins, String>)| {
        let margins = margins.map_err(|why| anyhow!("{}, {} kg: {why}", place.rig.0, place.load_kg))?;
        Ok((format!("{}, {} kg", place.rig.1, place.load_kg), place.at_m, margins))
    };
    Ok(table(&places.into_iter().zip(margins).map(of).collect::<Result<Vec<_>>>()?))
}

/// Every load and position on every rig.
fn places(rigs: Vec<(Subject, String)>) -> Vec<Place> {
    let mut places = Vec::new();
    for rig in rigs {
        for load_kg in LOADS_KG {
            places.extend(POSITIONS_M.map(|at_m| Place { rig: rig.clone(), load_kg, at_m }));
        }
    }
    places
}

/// The measured gain margins of all loads and positions on these rigs, 0 where a load swings without a change of the loop.
///
/// # Errors
/// If a load cannot be brought to its place.
pub fn measured_gains(subjects: &[Subject], jobs: usize) -> Result<Vec<f64>> {
    let rigs = subjects.iter().map(|subject| (subject.clone(), subject.kind.to_string())).collect();
    let gain = |place: &Place| {
        let loosened = last(&place.brought()?, place.load_kg, by_gain);
        Ok(loosened.map_or(0.0, |loosened| loosened.gain))
    };
    each(jobs, &places(rigs), gain)
        .into_iter()
        .map(|gain: Result<_, String>| gain.map_err(|why| anyhow!(why)))
        .collect()
}

/// A row for each kind of rig and load, a column for each position: gains first, then delays.
fn table(found: &[(String, f32, Margins)]) -> Study {
    let head = |what: &str| POSITIONS_M.map(|at_m| format!("{what} at {:.0} mm", 1e3 * at_m)).to_vec();
    let mut study = Study::new([vec!["rig, load".into()], head("gain"), head("delay")].concat());
    for (k, (name, ..)) in found.iter().enumerate() {
        if found[..k].iter().any(|(before, ..)| before == name) {
            continue;
        }
        let mut cells = vec![name.clone()];
        for (k, (what, scale, unit, digits)) in
            [("gain", 1.0, "", 2), ("delay_s", 1e3, " ms", 0)].into_iter().enumerate()
        {
            for at_m in POSITIONS_M {
                let here = found.iter().filter(|(of, at, _)| of == name && *at == at_m);
                let margins = here.map(|(.., margins)| margins[k]).collect::<Vec<_>>();
                let Some((computed, _)) = margins.first() else { continue };
                // None is less than any.
                let measured = margins.iter().map(|(_, measured)| *measured);
                let by_value = |a: &Option<f64>, b: &Option<f64>| a.unwrap_or(0.0).total_cmp(&b.unwrap_or(0.0));
                let [min, max] = [measured.clone().min_by(by_value), measured.max_by(by_value)].map(Option::flatten);
                let shown = |value: Option<f64>| value.map_or("none".into(), |v| format!("{:.digits$}", scale * v));
                let range = if min == max { shown(min) } else { format!("{} to {}", shown(min), shown(max)) };
                cells.push(format!("{:.digits$}: {range}{unit}", scale * computed));
                let key = format!("{}_{:.0}mm_{what}", name.replace(", ", "_").replace(' ', "_"), 1e3 * at_m);
                study.value(format!("{key}_computed"), *computed);
                study.value(format!("{key}_least"), min);
            }
        }
        study.row(cells);
    }
    study.notes.push(format!(
        "In front of the colon computed, without friction; after it measured: the last step of 10 % or of 4 ms with which a \
         load that loses a twentieth of its weight comes to rest, least and most of the rigs. No more than {:.1} and {:.0} ms were \
         tried. \"none\": the load swings without a change of the loop.",
        max().gain,
        1e3 * max().delay_s
    ));
    study
}

/// The margins at a place: by how much the gain of the open loop may grow, and what further delay it tolerates (s). Each is computed,
/// with the table's mechanism and no friction, and measured: the last with which the load came to rest: the next step was too much,
/// unless it is the maximum that was tried. `None` if the load oscillates without a change of the loop.
type Margins = [(f64, Option<f64>); 2];

/// The maximum values that are tried.
fn max() -> Loosened {
    Loosened { gain: by_gain(TRIED).gain, ..by_delay(TRIED) }
}

/// The rigs on which the margins are measured: the linear analysis' own, which has no friction, and those of the presets; of the
/// ideal one there is only one.
fn rigs(rigs: &Rigs) -> Vec<(Subject, String)> {
    let mut smooth = Subject::new(RigPreset::Ideal, rigs.seeds(1).start);
    smooth.changes.push(PlantChange { key: PlantKey::Friction, value: 0.0 });
    let presets = RigPreset::ALL.into_iter().filter(|kind| rigs.wants(*kind)).flat_map(|kind| {
        let count = if kind == RigPreset::Ideal { 1 } else { usize::MAX };
        rigs.seeds(3).take(count).map(move |seed| (Subject::new(kind, seed), kind.to_string()))
    });
    [(smooth, "without friction".to_owned())].into_iter().chain(presets).collect()
}

impl Place {
    /// The load at rest there.
    ///
    /// # Errors
    /// In words, if it cannot be brought there.
    fn brought(&self) -> Result<ControlBench, String> {
        let mut bench = brought(&self.rig.0, self.load_kg, self.at_m)?;
        bench.run(1.0);
        Ok(bench)
    }

    /// Computes and measures them.
    ///
    /// # Errors
    /// In words, if the load cannot be brought to its place, or has no equilibrium there.
    fn margins(&self) -> Result<Margins, String> {
        let bench = self.brought()?;
        let last = |at| last(&bench, self.load_kg, at);
        let mechanism = scene().mechanism().map_err(|e| e.to_string())?;
        let hung = hung_at(&mechanism, KEPT * self.load_kg * STANDARD_GRAVITY, self.at_m.into())?;
        let firmware = LinearLoop::damped();
        Ok([
            (hung.gain_margin(&firmware), last(by_gain).map(|loosened| loosened.gain)),
            (hung.delay_margin(&firmware, max().delay_s), last(by_delay).map(|loosened| loosened.delay_s)),
        ])
    }
}

/// The last with which a load (kg) comes to rest before the first with which it does not.
fn last(bench: &ControlBench, load_kg: f64, at: fn(i32) -> Loosened) -> Option<Loosened> {
    let rests = |loosened: &Loosened| {
        oscillation_m(bench.clone(), load_kg, KEPT, *loosened).is_ok_and(|oscillation_m| oscillation_m < OSCILLATIONS_M)
    };
    (0..=TRIED).map(at).take_while(rests).last()
}

fn by_gain(step: i32) -> Loosened {
    Loosened { gain: GAIN_STEP.powi(step), delay_s: 0.0 }
}

fn by_delay(step: i32) -> Loosened {
    Loosened { gain: 1.0, delay_s: f64::from(step) * DELAY_STEP_S }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rigs_of_a_kind_share_a_row_and_a_swing_without_a_change_says_so() {
        let one = |gain| ("hard, 0.6 kg".to_owned(), 0.008, [(1.96, gain), (0.048, Some(0.1))]);
        let study = table(&[one(Some(1.77)), one(Some(1.46))]);
        assert_eq!(study.table[0][..3], ["rig, load", "gain at 2 mm", "gain at 8 mm"]);
        assert_eq!(study.table[1], ["hard, 0.6 kg", "1.96: 1.46 to 1.77", "48: 100 ms"]);
        assert_eq!(study.values["hard_0.6_kg_8mm_gain_least"], 1.46);
        assert_eq!(table(&[one(Some(1.5)), one(None)]).table[1][1], "1.96: none to 1.50");
    }
}
