//! The best settings of a loop: a search over plants and moves of the comparison itself, which the firmware's own
//! settings never saw.

use super::baseline::Loop;
use super::score::Score;
use crate::study::each;

/// Steps of the search, as ratios of a parameter: wide first.
const STEPS: [f32; 3] = [1.6, 1.25, 1.1];

/// What the search wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// The least rms error where the load does not change, whatever else happens.
    SmallestError,
    /// First as many moves as can be that settle, load steps among them, then the least rms error as above.
    Settling,
}

/// What a candidate has done so far. It only grows, so that a bad candidate is known before it has played everything.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tally {
    unsettled: usize,
    squares_m2: f64,
}

impl Tally {
    /// One more move, and whether the plant changed during it.
    pub fn add(&mut self, changed: bool, score: &Score) {
        self.unsettled += usize::from(score.settling_s.is_none());
        if !changed {
            self.squares_m2 += score.squares_m2;
        }
    }
}

impl Goal {
    /// What it makes of a tally whose moves without a change travel so many ticks in the end: less is better.
    pub fn cost(self, tally: &Tally, ticks: usize) -> f64 {
        let rms_m = (tally.squares_m2 / ticks.max(1) as f64).sqrt();
        match self {
            Self::SmallestError => rms_m,
            // No rms error here comes near a metre.
            Self::Settling => tally.unsettled as f64 + rms_m,
        }
    }
}

/// `search` for the loop that costs least in all cases together, so many of them at a time: whoever costs more than the best so far
/// plays no further ones. A tally costs something; `play` a case, then `add` what came of it.
pub fn search_in<C: Sync, P: Send, T: Clone + Default>(
    (jobs, start): (usize, Loop),
    cases: std::slice::Chunks<'_, C>,
    play: impl Fn(&C, Loop) -> P + Sync,
    add: impl Fn(&mut T, &C, P),
    cost: impl Fn(&T) -> f64,
) -> Loop {
    search(start, |candidates, limit| {
        let mut tallies = vec![T::default(); candidates.len()];
        for some in cases.clone() {
            let alive = (0..candidates.len()).filter(|k| cost(&tallies[*k]) < limit);
            let runs: Vec<(usize, &C)> = alive.flat_map(|k| some.iter().map(move |case| (k, case))).collect();
            let played = each(jobs, &runs, |(k, case)| play(case, candidates[*k]));
            runs.iter().zip(played).for_each(|((k, case), played)| add(&mut tallies[*k], case, played));
        }
        tallies.iter().map(&cost).collect()
    })
}

/// Coordinate search from `start` for the least `cost`: each parameter up and down by a ratio as long as that helps,
/// then by a smaller one. `cost` gets all new candidates of a round at once, and what they have to stay below: above
/// that any number will do.
fn search(start: Loop, mut cost: impl FnMut(&[Loop], f64) -> Vec<f64>) -> Loop {
    let mut tried = vec![start];
    let mut best = (start, cost(&tried, f64::INFINITY).first().copied().unwrap_or(f64::INFINITY));
    for step in STEPS {
        loop {
            let near = [step, 1.0 / step].into_iter().flat_map(|by| neighbours(best.0, by));
            let candidates: Vec<Loop> = near.filter(|c| !tried.contains(c)).collect();
            tried.extend(&candidates);
            let costs = cost(&candidates, best.1);
            match candidates.into_iter().zip(costs).min_by(|a, b| a.1.total_cmp(&b.1)) {
                Some(found) if found.1 < best.1 => best = found,
                _ => break,
            }
        }
    }
    best.0
}

fn neighbours(at: Loop, by: f32) -> [Loop; 4] {
    [
        Loop { gain_per_s: at.gain_per_s * by, ..at },
        Loop { corner_rad_per_s: at.corner_rad_per_s * by, ..at },
        // A faster corner lets the gain be higher.
        Loop { gain_per_s: at.gain_per_s * by, corner_rad_per_s: at.corner_rad_per_s * by, ..at },
        Loop { breakaway_rad: at.breakaway_rad * by, ..at },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_bottom_of_a_bowl() {
        let off = |value: f32, at: f32| f64::from((value / at).ln()).powi(2);
        let cost = |candidates: &[Loop], limit: f64| {
            let of = |c: &Loop| 2.0 * off(c.gain_per_s, 1.7) + 0.5 * off(c.corner_rad_per_s, 22.0);
            // What is above the limit need not be right.
            candidates.iter().map(of).map(|cost| if cost > limit { f64::INFINITY } else { cost }).collect()
        };
        let start = Loop { tr_rad_per_m: None, gain_per_s: 9.0, corner_rad_per_s: 5.0, breakaway_rad: 0.0 };
        let best = search(start, cost);
        assert!((best.gain_per_s / 1.7 - 1.0).abs() < 0.06, "{best:?}");
        assert!((best.corner_rad_per_s / 22.0 - 1.0).abs() < 0.06, "{best:?}");
    }

    #[test]
    fn a_move_that_does_not_settle_outweighs_any_error() {
        let tally = |error_m: f64, settles: bool| {
            let score = |error_m: f64, settles: bool| Score {
                squares_m2: error_m * error_m,
                settling_s: settles.then_some(0.0),
                ..Score::default()
            };
            let mut tally = Tally::default();
            tally.add(false, &score(error_m, true));
            tally.add(true, &score(1.0, settles));
            tally
        };
        let [small_but_loose, large_but_firm] = [tally(1e-5, false), tally(1e-2, true)];
        assert!(Goal::Settling.cost(&small_but_loose, 1) > Goal::Settling.cost(&large_but_firm, 1));
        assert!(Goal::SmallestError.cost(&small_but_loose, 1) < Goal::SmallestError.cost(&large_but_firm, 1));
        assert_eq!(Goal::SmallestError.cost(&large_but_firm, 4), 5e-3, "a load step's error is nobody's fault");
    }
}
