//! Hysteresis: the loop of each sweep between up and down, the friction that would make it, and what that leaves unknown of
//! the mean of the two ways; and what the rods remember of a heavier load, which no sweep shows by itself, but two of the same
//! load do, one before the rods have carried the heavier load and one after it.

use super::constants::Unknowns;
use super::data::{Data, LOOP_FRACTION, Quantity, Row, SIGMA_M};
use super::fit::IdentifyError;
use super::predict::Known;
use crate::log::sweep::{Stop, Sweep};
use crate::statistics::mean;
use crate::units::N;
use rig_control::hysteresis::{MEMORY_COMPLETE_N, memory_shape};
use serde::Serialize;
use tsa_model::Mechanism;

/// Standard error of the load in a sweep from what creeps, as a fraction of the load: no loop shows it. Chosen so that the stated
/// intervals hold the truth on emulated hard rigs (seeds 3001 to 3012). Rods that were not loaded more heavily before, as in
/// sweeps from the lightest load to the heaviest, have nothing to remember.
const CREEP_FRACTION: f64 = 0.01;
/// Twists of two sweeps (rad) within which their equilibria are compared: both are means over the same bins.
const SAME_RAD: f64 = 0.1;
/// Loads of two sweeps, as a fraction, that count as the same.
const SAME_LOAD: f64 = 0.005;
/// Minimum and maximum value of [`rod_memory`] that a scene may state.
const FRACTIONS: [f64; 2] = [0.01, 0.5];

/// The loop of one sweep.
#[derive(Debug, Clone, Serialize)]
pub struct Loop {
    /// File.
    pub sweep: String,
    /// Load (N).
    pub load_n: f64,
    /// Half the width of the loop, mean over the sweep (m): down lies so far above the mean, and up below.
    pub half_width_m: f64,
    /// The friction that would make it (N): the half-width over how far the gap goes with the load.
    pub friction_n: f64,
}

/// The loops of all sweeps that were recorded both ways, in order of load; `slopes` are ∂G/∂F (m/N) of all rows.
pub fn loops(data: &Data, slopes: &[f64]) -> Vec<Loop> {
    let one = |run: Vec<usize>| {
        let half = |k: &usize| data.rows[*k].half_difference_m.map(|half_m| (half_m, half_m / slopes[*k].abs()));
        let (halves_m, frictions_n): (Vec<f64>, Vec<f64>) =
            run.iter().filter_map(half).filter(|(_, friction_n)| friction_n.is_finite()).unzip();
        (!halves_m.is_empty()).then(|| Loop {
            sweep: data.file_of(run[0]).to_owned(),
            load_n: data.rows[run[0]].load_n,
            half_width_m: mean(&halves_m),
            friction_n: mean(&frictions_n),
        })
    };
    let mut loops: Vec<Loop> = data.runs().into_iter().filter_map(one).collect();
    loops.sort_by(|a, b| a.load_n.total_cmp(&b.load_n));
    loops
}

/// How far each row's gap goes with the load (m/N); not a number where the model refuses the state or the row is no gap.
pub fn slopes(unknowns: &Unknowns, data: &Data, x: &[f64]) -> Vec<f64> {
    let slope = |row: &Row| {
        let gap = row.quantity == Quantity::Gap;
        let mechanism = Mechanism::of(unknowns.put(&row.base, x, &row.fixed, |value, _| value));
        let solved = gap.then(|| mechanism.formal(row.load_n, row.twist_rad).ok()).flatten();
        solved.map_or(f64::NAN, |e| e.dgap_dload_m_per_n)
    };
    data.rows.iter().map(slope).collect()
}

/// Standard error of the load of a sweep that it has as a whole, as a fraction of the load: by the friction of the loops,
/// between their loads by a line. Without loops friction is not known, and nothing is said of it.
pub fn load_fraction(loops: &[Loop], load_n: f64) -> f64 {
    let above = loops.iter().position(|l| l.load_n >= load_n);
    let friction_n = match (above, loops.last()) {
        (_, None) => return 0.0,
        (None, Some(last)) => last.friction_n,
        (Some(0), _) => loops[0].friction_n,
        (Some(k), _) => {
            let (low, high) = (&loops[k - 1], &loops[k]);
            let fraction = (load_n - low.load_n) / (high.load_n - low.load_n);
            low.friction_n + fraction * (high.friction_n - low.friction_n)
        }
    };
    CREEP_FRACTION.hypot(LOOP_FRACTION * friction_n / load_n)
}

/// What one pair of sweeps shows of the rods' memory.
#[derive(Debug, Clone, Serialize)]
pub struct Memory {
    /// File of the sweep after the heavier load.
    pub sweep: String,
    /// Load of both sweeps (N).
    pub load_n: f64,
    /// The heavier load between them (N).
    pub after_n: f64,
    /// How much heavier the load seems to be afterwards, mean over the sweep, as a fraction of it.
    pub fraction: f64,
    /// Half the width of the interval that holds that fraction in 90 of 100 cases.
    pub half_width_90: f64,
}

/// What each sweep after a heavier load shows beside one of the same load without, in the order of the files.
///
/// # Errors
/// If such a sweep has no partner, its zero is not known, or the heavier load was hardly heavier.
pub fn memories(data: &Data, known: &Known) -> Result<Vec<Memory>, IdentifyError> {
    let slope = |load_n: f64, twist_rad: f64| known.fit.gap(load_n, twist_rad).ok().map(|(_, slope)| slope);
    let one = |(name, sweep): &(String, Sweep)| {
        memory(data, slope, name, sweep).map_err(|why| IdentifyError::Apart(format!("sweep {name}: {why}")))
    };
    data.after.iter().map(one).collect()
}

/// Of one sweep; `slope` is ∂G/∂F (m/N) at a load and twist.
fn memory(data: &Data, slope: impl Fn(f64, f64) -> Option<f64>, name: &str, sweep: &Sweep) -> Result<Memory, String> {
    let Sweep { load_n, after_n: Some(after_n), zero_gap_m: Some(zero_gap_m), ref stops } = *sweep else {
        return Err("its log does not hold the gap at position zero".into());
    };
    let min_n = load_n + f64::from(MEMORY_COMPLETE_N);
    if after_n < min_n {
        return Err(format!(
            "{} before {} shows too little of the rods' hysteresis: at least {} does",
            N.show(after_n),
            N.show(load_n),
            N.show(min_n)
        ));
    }
    let same = |row: &&Row| row.zero.is_none() && (row.load_n / load_n - 1.0).abs() < SAME_LOAD;
    let run =
        data.runs().into_iter().find(|run| run.first().is_some_and(|k| same(&&data.rows[*k]))).unwrap_or_default();
    let pair = |stop: &Stop| {
        let row = run.iter().map(|k| &data.rows[*k]).find(|row| (row.twist_rad - stop.twist_rad).abs() < SAME_RAD)?;
        let by_share_m = slope(load_n, stop.twist_rad)? * load_n;
        // Noise averages out over a sweep; what friction leaves in the mean of both ways does not.
        let halves_m = stop.half_difference_m.hypot(row.half_difference_m.unwrap_or(0.0));
        let left_m = SIGMA_M.hypot(LOOP_FRACTION * halves_m);
        Some(((zero_gap_m - stop.position_m - row.value) / by_share_m, left_m / by_share_m))
    };
    let (fractions, left): (Vec<f64>, Vec<f64>) = stops.iter().filter_map(pair).unzip();
    if fractions.is_empty() {
        return Err(format!(
            "what {} has left in the rods shows next to a sweep of {} before it: record one without --after",
            N.show(after_n),
            N.show(load_n)
        ));
    }
    let half_width_90 = f64::from(rig_control::homing::NINETY_PERCENT) * mean(&left);
    Ok(Memory { sweep: name.to_owned(), load_n, after_n, fraction: mean(&fractions), half_width_90 })
}

/// By how much a light load seems heavier on rods that have carried a much heavier one, as the scene states it: the mean of the
/// pairs, by the firmware's rule; none without any.
pub fn rod_memory(memories: &[Memory]) -> Option<f64> {
    let of_a_light_load = |m: &Memory| m.fraction / f64::from(memory_shape(m.load_n as f32, m.after_n as f32));
    let all: Vec<f64> = memories.iter().map(of_a_light_load).collect();
    (!all.is_empty()).then(|| mean(&all).clamp(FRACTIONS[0], FRACTIONS[1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_config::Scene;
    use std::f64::consts::PI;
    use tsa_model::Parameters;

    #[test]
    fn a_loop_is_the_friction_that_makes_it() {
        let scene = Scene::load(format!("{}/../../scenes/default.toml", env!("CARGO_MANIFEST_DIR"))).expect("a scene");
        let base = Parameters::new(&scene.geometry, &scene.string, &scene.material).expect("constants");
        let mechanism = Mechanism::of(base);
        let (load_n, friction_n) = (5.0, 0.3);
        let stop = |k: u32| {
            let twist_rad = PI * f64::from(k);
            let gap = |load_n| mechanism.solve(load_n, twist_rad).expect("solved").gap_m;
            // On the way up the strings pull against friction too.
            let [up, down] = [gap(load_n + friction_n), gap(load_n - friction_n)];
            Stop { twist_rad, position_m: -0.5 * (up + down), half_difference_m: 0.5 * (up - down).abs() }
        };
        let sweep = Sweep { load_n, after_n: None, zero_gap_m: Some(0.0), stops: (2..16).map(stop).collect() };
        let mut data = Data::default();
        data.add_sweep("a sweep", &base, &sweep);
        let unknowns = Unknowns { constants: Vec::new(), expected: true };
        let loops = loops(&data, &slopes(&unknowns, &data, &[]));
        assert_eq!(loops.len(), 1);
        assert!((loops[0].friction_n / friction_n - 1.0).abs() < 0.02, "{loops:?}");
        // A tenth of 0.3 N of 5 N, beside what creeps.
        assert!((load_fraction(&loops, 5.0) - 0.006f64.hypot(CREEP_FRACTION)).abs() < 1e-3);
        assert!(load_fraction(&loops, 1.0) > load_fraction(&loops, 5.0));
    }

    /// 2 mm/N at 1 N: 0.4 mm lower is 20 % more load.
    #[test]
    fn a_shift_of_the_gap_after_a_heavier_load_is_a_share_of_the_load() {
        let scene = Scene::load(format!("{}/../../scenes/default.toml", env!("CARGO_MANIFEST_DIR"))).expect("a scene");
        let base = Parameters::new(&scene.geometry, &scene.string, &scene.material).expect("constants");
        let sweep = |after_n: Option<f64>, lower_m: f64| {
            let stop = |k: u32| Stop {
                twist_rad: f64::from(k) + 100.0 * lower_m,
                position_m: 1e-4 * f64::from(k) - lower_m,
                half_difference_m: 50e-6,
            };
            Sweep { load_n: 1.0, after_n, zero_gap_m: Some(0.1), stops: (1..20).map(stop).collect() }
        };
        let mut data = Data::default();
        data.add_sweep("before", &base, &sweep(None, 0.0));
        let found = memory(&data, |_, _| Some(2e-3), "after", &sweep(Some(15.0), 0.4e-3)).expect("pairs");
        assert!((found.fraction - 0.2).abs() < 1e-9, "{found:?}");
        assert!(found.half_width_90 > 0.0 && found.half_width_90 < 0.05, "{found:?}");
        // The firmware takes exp(−1/7) of a light load's share at 1 N.
        let light = rod_memory(&[found]).expect("a pair");
        assert!((light - 0.2 * (1.0f64 / 7.0).exp()).abs() < 1e-6, "{light}");
        assert_eq!(rod_memory(&[]), None);
        for (slope, lower_m) in [(None, 0.4e-3), (Some(2e-3), 0.4)] {
            let why = memory(&data, |_, _| slope, "after", &sweep(Some(15.0), lower_m)).expect_err("no pair");
            assert!(why.contains("without --after"), "{why}");
        }
    }
}
