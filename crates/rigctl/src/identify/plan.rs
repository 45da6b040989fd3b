//! Which further sweep would tell most, and whether any is worth its time.
//!
//! To first order a sweep adds its information to that of the sweeps there are, with the noise that these have left. What it
//! is worth is how far the largest error of a predicted contraction over the envelope falls (a G-optimal design; Atkinson,
//! Donev and Tobias, "Optimum Experimental Designs", 2007). What the law misses and ageing strings stay, however many sweeps
//! there are.

use super::fit::Fit;
use super::hysteresis::load_fraction;
use super::predict::{Known, variance};
use super::{Identified, data::SIGMA_M};
use crate::statistics::half_width;
use crate::units::{MM, UM};
use nalgebra::{DMatrix, DVector};
use rig_config::Scene;
use rig_control::hysteresis::MEMORY_COMPLETE_N;
use serde::Serialize;
use tsa_model::twist_from_turns;

/// Loads and turns of the sweeps that are considered, and of the states whose error counts.
const LOADS: usize = 8;
const STATES: usize = 5;
/// Rows of a considered sweep: neighbours tell nearly the same.
const ROWS: usize = 16;
/// A sweep that takes less than this fraction off the largest error buys nothing.
const WORTH: f64 = 0.05;
/// How many are named.
const NAMED: usize = 4;

/// A sweep that could be recorded.
#[derive(Debug, Clone, Serialize)]
pub struct Next {
    /// Load (N).
    pub load_n: f64,
    /// Turns past the half-turn pre-twist.
    pub turns: f64,
    /// Largest half-width over the envelope after it (m).
    pub largest_half_width_m: f64,
}

/// The answer.
#[derive(Debug, Clone, Serialize)]
pub struct Plan {
    /// Largest half-width of a predicted contraction over the envelope now (m).
    pub largest_half_width_m: f64,
    /// Where: load (N) and turns.
    pub at: [f64; 2],
    /// The same if the constants were known exactly (m).
    pub floor_m: f64,
    /// Whether more sweeps buy nothing.
    pub enough: bool,
    /// Why.
    pub why: String,
    /// What could be recorded, the best first.
    pub sweeps: Vec<Next>,
    /// A load, and a heavier one to hang before a second sweep of it (N), while nothing shows what the rods remember.
    pub memory: Option<[f64; 2]>,
}

/// A state of the envelope: its contraction's derivatives, and the variance that stays beside what the law misses (m2).
struct State {
    load_n: f64,
    turns: f64,
    by: DVector<f64>,
    floor_m2: f64,
}

/// Loads between two, in equal ratios.
fn loads([min, max]: [f64; 2], count: usize) -> Vec<f64> {
    (0..count).map(|k| min * (max / min).powf(k as f64 / (count - 1) as f64)).collect()
}

/// The largest half-width over the states (m), and where; of the constants' variance the fraction that the residuals told now
/// is taken for that of any covariance.
fn largest(known: &Known, states: &[State], covariance: &DMatrix<f64>) -> (f64, [f64; 2]) {
    let half = |s: &State| {
        let by = |part: &DMatrix<f64>| variance(&s.by, part);
        let (all_m2, fit) = (by(covariance), &known.fit);
        let estimated_m2 = all_m2 * by(&fit.estimated) / by(&fit.covariance).max(f64::MIN_POSITIVE);
        half_width(estimated_m2 + 2.0 * known.missed_m2(), all_m2 - estimated_m2 + s.floor_m2, fit.noise.freedom)
    };
    let widths = states.iter().map(|s| (half(s), [s.load_n, s.turns]));
    widths.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, [0.0; 2]))
}

/// Information of a sweep about the unknowns: rows of independent noise, and one load for all of them.
fn information(fit: &Fit, per_sweep: f64, load_n: f64, turns: f64) -> Option<DMatrix<f64>> {
    let variance = SIGMA_M.powi(2) * fit.noise.inflation * ROWS as f64 / per_sweep;
    let (mut rows, mut by_load) = (DMatrix::zeros(ROWS, fit.x.len()), DVector::zeros(ROWS));
    for k in 0..ROWS {
        let (gap, slope) = fit.gap(load_n, twist_from_turns(turns * k as f64 / (ROWS - 1) as f64)).ok()?;
        rows.set_row(k, &fit.by_unknowns(&gap).transpose());
        by_load[k] = slope * load_n * load_fraction(&fit.loops, load_n);
    }
    let block = DMatrix::identity(ROWS, ROWS) * variance + &by_load * by_load.transpose();
    Some(rows.transpose() * block.try_inverse()? * rows)
}

/// What to record next; none for a scene without an envelope, or where the law has no equilibria in it.
pub fn plan(scene: &Scene, found: &Identified) -> Option<Plan> {
    let (envelope, known) = (scene.envelope?, &found.known);
    let max_turns = envelope.turns[1];
    let state = |(load_n, turns): (f64, f64)| {
        let by = known.fit.by_unknowns(&known.fit.contraction(load_n, turns).ok()?);
        Some(State { load_n, turns, by, floor_m2: known.floor_m2(load_n, turns).ok()? })
    };
    let places = |count: usize| {
        let turns = [0.5 * max_turns, max_turns];
        loads(envelope.load_n, count).into_iter().flat_map(move |load_n| turns.map(|turns| (load_n, turns)))
    };
    let states: Vec<State> = places(STATES).filter_map(state).collect();
    let (now_m, at) = largest(known, &states, &known.fit.covariance);
    let (floor_m, _) = largest(known, &states, &(0.0 * &known.fit.covariance));
    let inverse = known.fit.covariance.clone().try_inverse()?;
    let per_sweep = found.fit.fitted.count as f64 / found.competition.data.runs().len().max(1) as f64;
    let after = |(load_n, turns): (f64, f64)| {
        let more = information(&known.fit, per_sweep, load_n, turns)?;
        let covariance = (&inverse + more).try_inverse()?;
        Some(Next { load_n, turns, largest_half_width_m: largest(known, &states, &covariance).0 })
    };
    let mut sweeps: Vec<Next> = places(LOADS).filter_map(after).collect();
    sweeps.sort_by(|a, b| a.largest_half_width_m.total_cmp(&b.largest_half_width_m));
    sweeps.truncate(NAMED);
    let best_m = sweeps.first().map_or(now_m, |next| next.largest_half_width_m);
    let wanted_m = scene.accuracy.map_or(0.0, |accuracy| accuracy.contraction_m);
    let (enough, why) = if now_m <= wanted_m {
        (true, format!("the scene asks for {}", UM.exact(wanted_m)))
    } else if best_m > (1.0 - WORTH) * now_m {
        let floor = format!("{} is what the model's residual and ageing leave", MM.error(floor_m));
        (true, format!("the best further sweep leaves {}; {floor}", MM.error(best_m)))
    } else {
        (false, format!("the best further sweep leaves {}", MM.error(best_m)))
    };
    // The middle load of those that were swept, and the heaviest.
    let mut swept_n: Vec<f64> =
        found.competition.data.runs().iter().map(|run| found.competition.data.rows[run[0]].load_n).collect();
    swept_n.sort_by(f64::total_cmp);
    let pair = [swept_n.get(swept_n.len() / 2), swept_n.last()].map(|load_n| load_n.copied().unwrap_or(0.0));
    let memory = (found.rod_memory.is_empty() && pair[0] + f64::from(MEMORY_COMPLETE_N) <= pair[1]).then_some(pair);
    Some(Plan { largest_half_width_m: now_m, at, floor_m, enough, why, sweeps, memory })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loads_are_in_equal_ratios_between_the_ends() {
        let all = loads([1.0, 16.0], 5);
        assert!(all.iter().zip([1.0, 2.0, 4.0, 8.0, 16.0]).all(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{all:?}");
    }
}
