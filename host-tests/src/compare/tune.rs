//! The best settings of a loop: a search over plants and moves of the comparison itself, which the firmware's own
//! settings never saw.

use super::baseline::Loop;
use super::score::{Score, Summary};

/// Steps of the search, as ratios of a parameter: wide first.
const STEPS: [f32; 3] = [1.6, 1.25, 1.1];

/// What the search wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// The least rms error where the load does not change, whatever else happens.
    LeastError,
    /// First as many moves as can be that settle, load steps among them, then the least rms error as above.
    Settling,
}

impl Goal {
    /// What it makes of the figures of many moves, each with whether the plant changed: less is better.
    pub fn cost(self, moves: &[(bool, Score)]) -> f64 {
        let rms_m = Summary::new(moves.iter().filter(|(changed, _)| !changed).map(|(_, score)| score)).rms_m;
        let unsettled = moves.iter().filter(|(_, score)| score.settling_s.is_none()).count();
        match self {
            Self::LeastError => rms_m,
            // No rms error here comes near a metre.
            Self::Settling => unsettled as f64 + rms_m,
        }
    }
}

/// Coordinate search from `start` for the least `cost`, and that cost: each parameter up and down by a ratio as long as
/// that helps, then by a smaller one. `cost` gets all new candidates of a round at once.
pub fn search(start: Loop, mut cost: impl FnMut(&[Loop]) -> Vec<f64>) -> (Loop, f64) {
    let mut tried = vec![start];
    let mut best = (start, cost(&tried).first().copied().unwrap_or(f64::INFINITY));
    for step in STEPS {
        loop {
            let near = [step, 1.0 / step].into_iter().flat_map(|by| neighbours(best.0, by));
            let candidates: Vec<Loop> = near.filter(|c| !tried.contains(c)).collect();
            tried.extend(&candidates);
            let found = candidates.iter().copied().zip(cost(&candidates)).min_by(|a, b| a.1.total_cmp(&b.1));
            match found {
                Some(found) if found.1 < best.1 => best = found,
                _ => break,
            }
        }
    }
    best
}

fn neighbours(at: Loop, by: f32) -> Vec<Loop> {
    let mut found = vec![
        Loop { gain_per_s: at.gain_per_s * by, ..at },
        Loop { corner_rad_per_s: at.corner_rad_per_s * by, ..at },
        // A faster corner lets the gain be higher.
        Loop { gain_per_s: at.gain_per_s * by, corner_rad_per_s: at.corner_rad_per_s * by, ..at },
    ];
    if let Some(tr) = at.tr_rad_per_m {
        found.push(Loop { tr_rad_per_m: Some(tr * by), ..at });
        // The loop's gain is the product of both: along this line it stays.
        found.push(Loop { tr_rad_per_m: Some(tr * by), gain_per_s: at.gain_per_s / by, ..at });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_bottom_of_a_bowl() {
        let off = |value: f32, at: f32| f64::from((value / at).ln()).powi(2);
        let cost = |candidates: &[Loop]| {
            let of = |c: &Loop| {
                off(c.tr_rad_per_m.unwrap_or(3300.0), 3300.0)
                    + 2.0 * off(c.gain_per_s, 1.7)
                    + 0.5 * off(c.corner_rad_per_s, 22.0)
            };
            candidates.iter().map(of).collect()
        };
        let start = Loop { tr_rad_per_m: Some(1000.0), gain_per_s: 9.0, corner_rad_per_s: 5.0 };
        let (best, least) = search(start, cost);
        assert!(least < 1e-2, "{least}");
        assert!((best.tr_rad_per_m.unwrap() / 3300.0 - 1.0).abs() < 0.06 && (best.gain_per_s / 1.7 - 1.0).abs() < 0.06);
        let (best, _) = search(Loop { tr_rad_per_m: None, ..start }, cost);
        assert!(best.tr_rad_per_m.is_none() && (best.corner_rad_per_s / 22.0 - 1.0).abs() < 0.06);
    }

    #[test]
    fn a_move_that_does_not_settle_outweighs_any_error() {
        let score = |error_m: f64, settles: bool| Score {
            squares_m2: error_m * error_m,
            ticks: 1,
            settling_s: settles.then_some(0.0),
            ..Score::default()
        };
        let small_but_loose = [(false, score(1e-5, true)), (true, score(0.0, false))];
        let large_but_firm = [(false, score(1e-2, true)), (true, score(0.0, true))];
        assert!(Goal::Settling.cost(&small_but_loose) > Goal::Settling.cost(&large_but_firm));
        assert!(Goal::LeastError.cost(&small_but_loose) < Goal::LeastError.cost(&large_but_firm));
    }
}
