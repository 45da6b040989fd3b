//! Sweeps that cannot be of one rig under the loads that were typed, or that something happened to.
//!
//! Before a fit: strings that slipped within a sweep. After it: a sweep that fits the others only with another load, or not
//! at all.

use super::compete::Competition;
use super::data::{Data, Quantity};
use super::hysteresis::slopes;
use super::linear::Linear;
use crate::statistics::{mean, median, rms};
use crate::units::{MM, N, TURNS_OF_RAD};
use tsa_model::PRETWIST_RAD;

/// The load on the way down hangs above that on the way up, by friction. So far below (m) it cannot, whatever the noise.
const BELOW_M: f64 = 0.3e-3;
/// A step between neighbouring rows counts from this size (m), and from so many times the usual unevenness of the sweep.
const STEP_M: f64 = 1e-3;
const UNEVEN: f64 = 8.0;
/// Rows on either side from which the slope at a row is taken.
const BESIDE: usize = 4;
/// Sweeps are examined for whether they belong together if the law misses this much (m).
const MISSED_M: f64 = 0.3e-3;
/// One sweep is the reason if what the law misses falls by this factor without it, or with another load.
const CLEARER: f64 = 2.5;
/// Minimum change of a load that is named, as a fraction: identified constants take up less.
const LOAD_FRACTION: f64 = 0.08;

/// Strings that slipped in a sweep, in words.
pub fn slipped(data: &Data) -> Option<String> {
    data.runs().iter().find_map(|run| {
        let file = data.file_of(*run.first()?);
        let what = hangs_below(data, run).or_else(|| steps(data, run))?;
        Some(format!(
            "sweep {file}: {what}: did a string or a clamp slip? Tighten them, home, and record the sweep again"
        ))
    })
}

/// Where the load hangs lower on the way down than on the way up.
fn hangs_below(data: &Data, run: &[usize]) -> Option<String> {
    // The mean of three neighbours: one bin alone may be disturbed.
    let halves: Vec<(f64, f64)> =
        run.iter().filter_map(|k| Some((data.rows[*k].twist_rad, data.rows[*k].half_difference_m?))).collect();
    let worst = halves.windows(3).map(|w| (w[1].0, w.iter().map(|h| h.1).sum::<f64>() / 3.0));
    let (twist_rad, half_m) = worst.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (half_m < -BELOW_M).then(|| {
        format!(
            "at {} the load hangs {} lower on the way down than on the way up, and friction makes it hang higher",
            TURNS_OF_RAD.show(twist_rad - PRETWIST_RAD),
            MM.show(-2.0 * half_m)
        )
    })
}

/// Where neighbouring rows of a sweep of one way are apart by much more than the slope about them. A single wild row has two
/// such steps beside each other, and is not meant. Under a light load a rail that sticks makes such steps too, so that sweeps
/// of both ways are judged by [`hangs_below`] alone.
fn steps(data: &Data, run: &[usize]) -> Option<String> {
    let lengths = |k: &usize| {
        let row = &data.rows[*k];
        matches!(row.quantity, Quantity::Gap | Quantity::Contraction) && row.half_difference_m.is_none()
    };
    if !run.iter().all(lengths) {
        return None;
    }
    let run = spread(data, run);
    if run.len() < 3 * BESIDE {
        return None;
    }
    let apart = |pair: &[usize]| {
        let [a, b] = [&data.rows[pair[0]], &data.rows[pair[1]]];
        (b.twist_rad - a.twist_rad, b.value - a.value)
    };
    let pairs: Vec<(f64, f64)> = run.windows(2).map(apart).collect();
    let uneven: Vec<f64> = (0..pairs.len())
        .map(|k| {
            let beside = (k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(pairs.len())).filter(|j| *j != k);
            let slope = median(&mut beside.map(|j| pairs[j].1 / pairs[j].0).collect::<Vec<_>>());
            pairs[k].1 - slope * pairs[k].0
        })
        .collect();
    let usual_m = median(&mut uneven.iter().map(|m| m.abs()).collect::<Vec<_>>());
    let beside = |k: usize| {
        let at = |j: Option<usize>| j.and_then(|j| uneven.get(j)).map_or(0.0, |m| m.abs());
        at(k.checked_sub(1)).max(at(Some(k + 1)))
    };
    let step = |k: &usize| {
        let size_m = uneven[*k].abs();
        size_m > STEP_M.max(UNEVEN * usual_m) && beside(*k) < 0.5 * size_m
    };
    let found = (0..uneven.len()).filter(step).max_by(|a, b| uneven[*a].abs().total_cmp(&uneven[*b].abs()))?;
    Some(format!(
        "at {} there is a step of {} between neighbouring rows",
        TURNS_OF_RAD.show(data.rows[run[found + 1]].twist_rad - PRETWIST_RAD),
        MM.show(uneven[found].abs())
    ))
}

/// Those rows of a run that are at least half the mean distance from the one before. Noise and friction between rows of almost the
/// same twist, as in several samples of one place or in both ways of a sweep, are no slope.
fn spread(data: &Data, run: &[usize]) -> Vec<usize> {
    let twist_rad = |k: usize| data.rows[k].twist_rad.abs();
    let ends = run.first().zip(run.last());
    let mean_rad = ends.map_or(0.0, |(first, last)| (twist_rad(*last) - twist_rad(*first)) / run.len() as f64);
    let mut kept: Vec<usize> = Vec::new();
    for &k in run {
        if kept.last().is_none_or(|last| twist_rad(k) - twist_rad(*last) > 0.5 * mean_rad) {
            kept.push(k);
        }
    }
    kept
}

/// A sweep that does not belong to the others by the chosen law, in words.
pub fn apart(competition: &Competition) -> Option<String> {
    let (data, fit) = (&competition.data, competition.scored[competition.chosen].fit.as_ref()?);
    let runs = data.runs();
    let missed_m = fit.fitted.rms;
    if missed_m < MISSED_M || runs.len() < 2 {
        return None;
    }
    let base = data.based_on(&fit.base);
    let linear = Linear::about(&base, fit);
    let slopes = slopes(&fit.unknowns, &base, &fit.x);
    // With another load of one sweep.
    let reload = |run: &Vec<usize>| {
        let load_n = data.rows[run[0]].load_n;
        let mut by = vec![0.0; data.rows.len()];
        run.iter().filter(|k| slopes[**k].is_finite()).for_each(|k| by[*k] = load_n * slopes[*k]);
        let (errors, change) = linear.with(&by)?;
        Some((rms(&errors), change, run[0]))
    };
    let best = runs.iter().filter_map(reload).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let (left_m, change, row) = best;
    if CLEARER * left_m < missed_m && change.abs() > LOAD_FRACTION {
        let (file, load_n) = (data.file_of(row), data.rows[row].load_n);
        return Some(format!(
            "sweep {file}: it fits the others with about {} instead of {} ({} instead of {} rms): what hung there? Weigh it \
             and record the sweep again, or leave it out",
            N.show(load_n * change.exp()),
            N.show(load_n),
            MM.show(left_m),
            MM.show(missed_m)
        ));
    }
    // Without one sweep.
    let rest = |at: usize| {
        let run = &runs[at];
        let errors = linear.without(run)?;
        let others = (0..errors.len()).filter(|k| !run.contains(k)).map(|k| &errors[k]);
        Some((rms(others), rms(run.iter().map(|k| &errors[*k])), at))
    };
    let (left_m, off_m, at) = (0..runs.len()).filter_map(rest).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let run = &runs[at];
    // Friction that is not alike on both ways moves the mean of them by as much as half the loop.
    let halves_m: Vec<f64> = run.iter().filter_map(|k| data.rows[*k].half_difference_m).collect();
    let loop_m = if halves_m.is_empty() { 0.0 } else { mean(&halves_m) };
    (CLEARER * left_m < missed_m && off_m > loop_m).then(|| {
        let who = match runs.len() {
            2 => format!("sweeps {} and {}: they do not fit each other", data.file_of(runs[0][0]), data.file_of(runs[1][0])),
            _ => format!("sweep {}: the others fit each other and not this one", data.file_of(run[0])),
        };
        format!(
            "{who} ({} off; the rest is within {} rms): is it of another actuator, or was the LVDT or a string moved in \
             between? Leave it out or record it again",
            MM.show(off_m),
            MM.show(left_m)
        )
    })
}
