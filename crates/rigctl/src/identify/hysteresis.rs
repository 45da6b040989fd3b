//! What the way up and the way down differ by: the loop of each sweep, the friction that would make it, and what that
//! leaves unknown of the mean of the two ways.

use super::constants::{Unknowns, values};
use super::data::{Data, LOOP_SHARE, Quantity};
use serde::Serialize;
use tsa_model::Mechanism;

/// Standard error of the load in a sweep from what creeps, as a share of the load: no loop shows it. Chosen so that the stated intervals hold the truth on
/// emulated hard rigs (seeds 3001 to 3012). Rods that were not loaded more heavily before, as in sweeps from the lightest
/// load to the heaviest, have nothing to remember.
const CREEP_SHARE: f64 = 0.01;

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
        let halves: Vec<(f64, f64)> =
            run.iter().filter_map(half).filter(|(_, friction)| friction.is_finite()).collect();
        let count = halves.len() as f64;
        (!halves.is_empty()).then(|| Loop {
            sweep: data.file_of(run[0]).to_owned(),
            load_n: data.rows[run[0]].load_n,
            half_width_m: halves.iter().map(|(half_m, _)| half_m).sum::<f64>() / count,
            friction_n: halves.iter().map(|(_, friction_n)| friction_n).sum::<f64>() / count,
        })
    };
    let mut loops: Vec<Loop> = data.runs().into_iter().filter_map(one).collect();
    loops.sort_by(|a, b| a.load_n.total_cmp(&b.load_n));
    loops
}

/// How far each row's gap goes with the load (m/N); not a number where the model refuses the state or the row is no gap.
pub fn slopes(unknowns: &Unknowns, data: &Data, x: &[f64]) -> Vec<f64> {
    let slope = |row: &super::data::Row| {
        let gap = row.quantity == Quantity::Gap;
        let mechanism = Mechanism::of(values(&unknowns.parameters(&row.base, x, &row.fixed)));
        let solved = gap.then(|| mechanism.formal(row.load_n, row.twist_rad).ok()).flatten();
        solved.map_or(f64::NAN, |e| e.dgap_dload_m_per_n)
    };
    data.rows.iter().map(slope).collect()
}

/// Standard error of the load of a sweep that it has as a whole, as a share of the load: by the friction of the loops,
/// between their loads by a line. Without loops friction is not known, and nothing is said of it.
pub fn load_share(loops: &[Loop], load_n: f64) -> f64 {
    let above = loops.iter().position(|l| l.load_n >= load_n);
    let friction_n = match (above, loops.last()) {
        (_, None) => return 0.0,
        (None, Some(last)) => last.friction_n,
        (Some(0), _) => loops[0].friction_n,
        (Some(k), _) => {
            let (low, high) = (&loops[k - 1], &loops[k]);
            let share = (load_n - low.load_n) / (high.load_n - low.load_n);
            low.friction_n + share * (high.friction_n - low.friction_n)
        }
    };
    CREEP_SHARE.hypot(LOOP_SHARE * friction_n / load_n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::sweep::{Stop, Sweep};
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
        assert!((load_share(&loops, 5.0) - 0.006f64.hypot(CREEP_SHARE)).abs() < 1e-3);
        assert!(load_share(&loops, 1.0) > load_share(&loops, 5.0));
    }
}
