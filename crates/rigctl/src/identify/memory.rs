//! What rods remember of a heavier load: no sweep shows it by itself, but two of the same load do, one before the rods have
//! carried the heavier load and one after it.

use super::data::LOOP_SHARE;
use super::data::{Data, SIGMA_M};
use super::fit::IdentifyError;
use super::predict::Known;
use crate::log::sweep::Sweep;
use rig_control::hysteresis::{MEMORY_COMPLETE_N, memory_shape};
use serde::Serialize;

/// Twists of two sweeps (rad) within which their equilibria are compared: both are means over the same bins.
const SAME_RAD: f64 = 0.1;
/// Loads of two sweeps, as a share, that count as the same.
const SAME_LOAD: f64 = 0.005;
/// Least and greatest share that a scene may state.
const SHARES: [f64; 2] = [0.01, 0.5];

/// What one pair of sweeps shows.
#[derive(Debug, Clone, Serialize)]
pub struct Memory {
    /// File of the sweep after the heavier load.
    pub sweep: String,
    /// Load of both sweeps (N).
    pub load_n: f64,
    /// The heavier load between them (N).
    pub after_n: f64,
    /// How much heavier the load seems to be afterwards, mean over the sweep, as a share of it.
    pub share: f64,
    /// Half the width of the interval that holds that share in 90 of 100 cases.
    pub half_width_90: f64,
}

impl Memory {
    /// Of a pair; `slope` is ∂G/∂F (m/N) at a load and twist.
    fn of(
        sweep: &str,
        [before, after]: [&[(f64, f64, f64)]; 2],
        [load_n, after_n]: [f64; 2],
        slope: impl Fn(f64) -> Option<f64>,
    ) -> Option<Self> {
        let mut found = Vec::new();
        for &(twist_rad, gap_m, half_m) in after {
            let Some(&(_, before_m, before_half_m)) = before.iter().find(|b| (b.0 - twist_rad).abs() < SAME_RAD) else {
                continue;
            };
            let Some(by_share_m) = slope(twist_rad).map(|slope| slope * load_n) else { continue };
            // Noise averages out over a sweep; what friction leaves in the mean of both ways does not.
            let left_m = SIGMA_M.hypot(LOOP_SHARE * half_m.hypot(before_half_m));
            found.push(((gap_m - before_m) / by_share_m, left_m / by_share_m));
        }
        let count = found.len() as f64;
        let mean = |part: fn(&(f64, f64)) -> f64| found.iter().map(part).sum::<f64>() / count;
        (!found.is_empty()).then(|| Self {
            sweep: sweep.to_owned(),
            load_n,
            after_n,
            share: mean(|f| f.0),
            half_width_90: rig_control::homing::NINETY_PERCENT as f64 * mean(|f| f.1),
        })
    }

    /// The share that a light load would have after a much heavier one, by the firmware's rule.
    fn of_a_light_load(&self) -> f64 {
        self.share.abs() / f64::from(memory_shape(self.load_n as f32, self.after_n as f32))
    }
}

/// Every pair of sweeps, in the order of the files.
///
/// # Errors
/// If a sweep after a heavier load has no partner, its zero is not known, or that load was hardly heavier.
pub fn memories(data: &Data, known: &Known) -> Result<Vec<Memory>, IdentifyError> {
    data.after.iter().map(|(name, sweep)| memory(data, known, name, sweep)).collect()
}

fn memory(data: &Data, known: &Known, name: &str, sweep: &Sweep) -> Result<Memory, IdentifyError> {
    let Sweep { load_n, after_n: Some(after_n), zero_gap_m: Some(zero_gap_m), stops } = sweep else {
        return Err(IdentifyError::Apart(format!("sweep {name}: its log does not hold the gap at position zero")));
    };
    let least_n = load_n + f64::from(MEMORY_COMPLETE_N);
    if *after_n < least_n {
        return Err(IdentifyError::Apart(format!(
            "sweep {name}: {after_n:.2} N before {load_n:.2} N show too little of what the rods remember: at least {least_n:.2} N do"
        )));
    }
    let lonely = || {
        IdentifyError::Apart(format!(
            "sweep {name}: what {after_n:.2} N have left in the rods shows beside a sweep of {load_n:.2} N before it: record \
             one without --after"
        ))
    };
    let runs = data.runs();
    let same = |k: usize| {
        let row = &data.rows[k];
        row.zero.is_none() && (row.load_n / load_n - 1.0).abs() < SAME_LOAD
    };
    let run = runs.iter().find(|run| run.first().is_some_and(|k| same(*k))).ok_or_else(lonely)?;
    let row = |k: &usize| {
        let row = &data.rows[*k];
        (row.twist_rad, row.value, row.half_difference_m.unwrap_or(0.0))
    };
    let before: Vec<(f64, f64, f64)> = run.iter().map(row).collect();
    let stop = |s: &crate::log::sweep::Stop| (s.twist_rad, zero_gap_m - s.position_m, s.half_difference_m);
    let after: Vec<(f64, f64, f64)> = stops.iter().map(stop).collect();
    let slope = |twist_rad: f64| known.chosen.gap(*load_n, twist_rad).ok().map(|(_, slope)| slope);
    Memory::of(name, [&before, &after], [*load_n, *after_n], slope).ok_or_else(lonely)
}

/// Standard error of a light load on rods that have carried a much heavier one, as the scene states it: the greatest of the
/// pairs; none without any.
pub fn rod_memory(memories: &[Memory]) -> Option<f64> {
    let all = memories.iter().map(Memory::of_a_light_load);
    all.max_by(f64::total_cmp).map(|share| share.clamp(SHARES[0], SHARES[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_of_the_gap_is_a_share_of_the_load() {
        // 2 mm/N at 1 N: 0.4 mm lower is 20 % more load.
        let before: Vec<(f64, f64, f64)> = (1..20).map(|k| (f64::from(k), 0.1 - 1e-4 * f64::from(k), 50e-6)).collect();
        let after: Vec<(f64, f64, f64)> = before.iter().map(|(t, gap, half)| (t + 0.01, gap + 0.4e-3, *half)).collect();
        let found = Memory::of("after", [&before, &after], [1.0, 15.0], |_| Some(2e-3)).expect("pairs");
        assert!((found.share - 0.2).abs() < 1e-9, "{found:?}");
        assert!(found.half_width_90 > 0.0 && found.half_width_90 < 0.05, "{found:?}");
        // The firmware takes exp(−1/7) of a light load's share at 1 N.
        let light = rod_memory(&[found]).expect("a pair");
        assert!((light - 0.2 * (1.0f64 / 7.0).exp()).abs() < 1e-6, "{light}");
    }

    #[test]
    fn nothing_is_stated_without_a_pair_and_a_slope() {
        assert_eq!(rod_memory(&[]), None);
        let some = [(1.0, 0.1, 0.0)];
        assert!(Memory::of("after", [&some, &some], [1.0, 15.0], |_| None).is_none());
        assert!(Memory::of("after", [&some, &[(2.0, 0.1, 0.0)]], [1.0, 15.0], |_| Some(1e-3)).is_none());
    }
}
