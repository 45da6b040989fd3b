//! The best gains for the loop with a fixed ratio: a search over plants and moves of the comparison itself, which the
//! firmware's own gains never saw.

use super::baseline::FixedRatio;

/// Steps of the search, as ratios of a parameter: wide first.
const STEPS: [f32; 4] = [1.6, 1.25, 1.1, 1.04];

/// Coordinate search from `start` for the least `cost`, and that cost: each parameter up and down by a ratio as long as
/// that helps, then by a smaller one. `cost` gets all candidates of a round at once.
pub fn search(start: FixedRatio, mut cost: impl FnMut(&[FixedRatio]) -> Vec<f64>) -> (FixedRatio, f64) {
    let mut best = start;
    let mut least = cost(&[start]).first().copied().unwrap_or(f64::INFINITY);
    for step in STEPS {
        loop {
            let candidates: Vec<FixedRatio> = [step, 1.0 / step]
                .into_iter()
                .flat_map(|by| {
                    [
                        FixedRatio { tr_rad_per_m: best.tr_rad_per_m * by, ..best },
                        FixedRatio { gain_per_s: best.gain_per_s * by, ..best },
                        FixedRatio { corner_rad_per_s: best.corner_rad_per_s * by, ..best },
                        // The loop's gain is the product of ratio and gain: along this line it stays.
                        FixedRatio { tr_rad_per_m: best.tr_rad_per_m * by, gain_per_s: best.gain_per_s / by, ..best },
                    ]
                })
                .collect();
            let found = cost(&candidates).into_iter().zip(&candidates).min_by(|a, b| a.0.total_cmp(&b.0));
            match found {
                Some((value, candidate)) if value < least => (best, least) = (*candidate, value),
                _ => break,
            }
        }
    }
    (best, least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_bottom_of_a_bowl() {
        let off = |value: f32, at: f32| f64::from((value / at).ln()).powi(2);
        let cost = |candidates: &[FixedRatio]| {
            candidates
                .iter()
                .map(|c| {
                    off(c.tr_rad_per_m, 3300.0) + 2.0 * off(c.gain_per_s, 1.7) + 0.5 * off(c.corner_rad_per_s, 22.0)
                })
                .collect()
        };
        let start = FixedRatio { tr_rad_per_m: 1000.0, gain_per_s: 9.0, corner_rad_per_s: 5.0 };
        let (best, least) = search(start, cost);
        assert!(least < 2e-3, "{least}");
        assert!((best.tr_rad_per_m / 3300.0 - 1.0).abs() < 0.03 && (best.gain_per_s / 1.7 - 1.0).abs() < 0.03);
    }
}
