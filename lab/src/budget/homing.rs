//! What homing makes of a gap that is not the table's: the least-squares fit of the weighing, to first order.
//!
//! The firmware fits the load, a scale of the twist and the LVDT's zero to the gap over the twist, with priors
//! (rig-control, `homing/weigh.rs`, whose constants these are), and puts a cubic through what the fit leaves. For a change
//! δG of the gap the fit moves by x = N⁻¹ (Jᵀ W δG + p), with J the derivatives of the gap by the three unknowns, N = Jᵀ W J
//! + P, and p what a prior is wrong by.

use super::columns::Column;
use rig_control::homing::{WEIGH_TURNS, weigh};
use std::f64::consts::TAU;
use std::ops::RangeInclusive;
use tsa_model::PRETWIST_RAD;

/// Standard errors of what homing takes from elsewhere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Priors {
    /// Of the string radius, relative.
    pub radius: f64,
    /// Of the LVDT's zero (m).
    pub zero_m: f64,
    /// Of the load by the motor's work, relative.
    pub work: f64,
}

/// The fit under one load.
#[derive(Clone, Debug)]
pub(super) struct Homing {
    /// Places of the states that are weighed.
    weighed: RangeInclusive<usize>,
    /// Of each state: derivatives of the gap by the logarithm of the load, that of the scale, and the zero (m).
    jacobian: Vec<[f64; 3]>,
    /// Twist of each state, from −1 to 1 over those that are weighed; beyond them the cubic is level.
    place: Vec<f64>,
    /// Weight of a state (1/m²).
    weight: f64,
    inverse: [[f64; 3]; 3],
    pub priors: Priors,
}

/// What a change of the gap is taken for.
#[derive(Clone, Debug)]
pub(super) struct Taken {
    /// Relative error of the load.
    pub load: f64,
    /// What the cubic leaves of the gap at each state (m).
    pub left_m: Vec<f64>,
}

impl Homing {
    /// Under the load of a column, with a misfit (m, rms) of the law on this rig.
    pub fn new(column: &Column, misfit_m: f64, priors: Priors) -> Self {
        let states = &column.0;
        let last_rad = states[states.len() - 1].twist_rad;
        let sweep_rad = (TAU * f64::from(WEIGH_TURNS)).min(last_rad - PRETWIST_RAD);
        let edge = weigh::END_BINS as f64 / weigh::BINS as f64;
        let used = [edge, 1.0 - edge].map(|share| PRETWIST_RAD + share * sweep_rad);
        let inside = |k: &usize| (used[0]..=used[1]).contains(&states[*k].twist_rad);
        let first = (0..states.len()).find(inside).unwrap_or(0);
        let last = (0..states.len()).rfind(inside).unwrap_or(states.len() - 1);
        let [from, to] = [first, last].map(|k| states[k].twist_rad);
        let jacobian: Vec<[f64; 3]> =
            states.iter().map(|s| [s.load_n * s.by_load, s.by_twist * s.twist_rad, 1.0]).collect();
        let place = |twist_rad: f64| (2.0 * (twist_rad - from) / (to - from) - 1.0).clamp(-1.0, 1.0);
        let error_m = misfit_m.clamp(f64::from(weigh::LEAST_GAP_ERROR_M), f64::from(weigh::LAW_GAP_ERROR_M));
        let weight = f64::from(weigh::INDEPENDENT_BINS) / ((last - first + 1) as f64 * error_m * error_m);
        let mut normal = [[0.0; 3]; 3];
        for row in &jacobian[first..=last] {
            for (a, line) in normal.iter_mut().enumerate() {
                for (b, cell) in line.iter_mut().enumerate() {
                    *cell += weight * row[a] * row[b];
                }
            }
        }
        for (k, sigma) in [priors.work, priors.radius, priors.zero_m].into_iter().enumerate() {
            normal[k][k] += 1.0 / (sigma * sigma);
        }
        let unit = |k: usize| std::array::from_fn(|a| if a == k { 1.0 } else { 0.0 });
        Self {
            weighed: first..=last,
            place: states.iter().map(|s| place(s.twist_rad)).collect(),
            jacobian,
            weight,
            inverse: std::array::from_fn(|k| solve(normal, unit(k))),
            priors,
        }
    }

    /// A gap that differs by `change_m` at each state.
    pub fn gap(&self, change_m: &[f64]) -> Taken {
        self.taken(change_m, [0.0; 3])
    }

    /// A prior that is wrong by its standard error: 0 for the work, 1 the radius, 2 the LVDT's zero.
    pub fn prior(&self, which: usize) -> Taken {
        let sigma = [self.priors.work, self.priors.radius, self.priors.zero_m][which];
        let mut right = [0.0; 3];
        right[which] = 1.0 / sigma;
        self.taken(&vec![0.0; self.place.len()], right)
    }

    /// Work that gives the load wrong by a share of it.
    pub fn work(&self, share: f64) -> f64 {
        self.inverse[0][0] * share / (self.priors.work * self.priors.work)
    }

    /// Relative error of the load for gaps that are wrong by 1 m rms, in as many independent stretches as the fit counts on.
    pub fn load_of_stretches(&self) -> f64 {
        let count = weigh::INDEPENDENT_BINS as usize;
        let (first, states) = (*self.weighed.start(), self.weighed.clone().count());
        let mut squares = 0.0;
        for stretch in 0..count {
            let mut change_m = vec![0.0; self.place.len()];
            for k in (0..states).filter(|k| k * count / states == stretch) {
                change_m[first + k] = 1.0;
            }
            squares += self.gap(&change_m).load.powi(2);
        }
        squares.sqrt()
    }

    /// Rms over the weighed states of what the fit leaves of a change of the gap, before the cubic (m).
    pub fn misfit_m(&self, change_m: &[f64]) -> f64 {
        let rest = self.rest(change_m, self.step(change_m, [0.0; 3]));
        let weighed = &rest[self.weighed.clone()];
        (weighed.iter().map(|r| r * r).sum::<f64>() / weighed.len() as f64).sqrt()
    }

    fn step(&self, change_m: &[f64], mut right: [f64; 3]) -> [f64; 3] {
        for k in self.weighed.clone() {
            for (r, j) in right.iter_mut().zip(self.jacobian[k]) {
                *r += self.weight * j * change_m[k];
            }
        }
        self.inverse.map(|row| row.iter().zip(right).map(|(a, b)| a * b).sum())
    }

    fn rest(&self, change_m: &[f64], step: [f64; 3]) -> Vec<f64> {
        let fitted = |j: &[f64; 3]| j.iter().zip(step).map(|(a, b)| a * b).sum::<f64>();
        change_m.iter().zip(&self.jacobian).map(|(change, j)| change - fitted(j)).collect()
    }

    fn taken(&self, change_m: &[f64], right: [f64; 3]) -> Taken {
        let step = self.step(change_m, right);
        let rest = self.rest(change_m, step);
        let (mut normal, mut sums) = ([[0.0; 4]; 4], [0.0; 4]);
        for k in self.weighed.clone() {
            let x = powers(self.place[k]);
            for a in 0..4 {
                sums[a] += x[a] * rest[k];
                for b in 0..4 {
                    normal[a][b] += x[a] * x[b];
                }
            }
        }
        let cubic = solve(normal, sums);
        let curve = |place: f64| powers(place).iter().zip(cubic).map(|(a, b)| a * b).sum::<f64>();
        let left_m = rest.iter().zip(&self.place).map(|(rest, place)| rest - curve(*place)).collect();
        Taken { load: step[0], left_m }
    }
}

/// 1, x, x², x³.
fn powers(x: f64) -> [f64; 4] {
    [1.0, x, x * x, x * x * x]
}

/// Solves a x = b by elimination with the greatest pivot of each column.
fn solve<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> [f64; N] {
    for k in 0..N {
        let pivot = (k..N).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap_or(k);
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..N {
            let share = a[i][k] / a[k][k];
            let row = a[k];
            a[i].iter_mut().zip(row).for_each(|(cell, above)| *cell -= share * above);
            b[i] -= share * b[k];
        }
    }
    for k in (0..N).rev() {
        let known: f64 = (k + 1..N).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::tests::scene;

    fn homing() -> (Column, Homing) {
        let column = Column::all(&scene()).unwrap().swap_remove(4);
        let homing = Homing::new(&column, 0.1e-3, Priors { radius: 0.03, zero_m: 1e-3, work: 0.5 });
        (column, homing)
    }

    /// A heavier load is taken for a heavier one as far as the priors let it, and nothing of it is left.
    #[test]
    fn another_load_is_found_and_leaves_nothing() {
        let (column, _) = homing();
        let open = Priors { radius: 0.5, zero_m: 0.5, work: 1e3 };
        let sure = Homing::new(&column, 0.0, Priors { radius: 1e-6, zero_m: 1e-6, work: 1e3 });
        for homing in [Homing::new(&column, 0.0, open), sure] {
            let taken = homing.gap(&column.each(|s| 0.01 * s.load_n * s.by_load));
            assert!((taken.load / 0.01 - 1.0).abs() < 0.02, "{}", taken.load);
            assert!(taken.left_m[homing.weighed.clone()].iter().all(|m| m.abs() < 1e-6));
        }
    }

    /// A gap that is a cubic of the twist leaves nothing for the observer, whatever load it is taken for.
    #[test]
    fn the_curve_takes_what_a_cubic_can() {
        let (column, homing) = homing();
        let change: Vec<f64> = homing.place.iter().map(|x| 1e-4 * (1.0 - 2.0 * x * x * x)).collect();
        let taken = homing.gap(&change);
        // What the fit takes is no cubic, but nearly.
        let left = homing.weighed.clone().map(|k| taken.left_m[k].abs()).fold(0.0, f64::max);
        assert!(taken.load != 0.0 && left < 5e-6, "{left}");
        assert_eq!(column.0.len(), taken.left_m.len());
    }

    /// A radius that is not the prior's is the same as a gap of strings that are so much thicker, the other way round.
    #[test]
    fn a_wrong_prior_is_a_thicker_string() {
        let (column, homing) = homing();
        let by_prior = homing.prior(1).load;
        let by_gap = homing.gap(&column.each(|s| -0.03 * s.by_twist * s.twist_rad)).load;
        // The fit that takes the strings for thicker by all of it would need no other load at all.
        assert!((by_prior - by_gap).abs() < 1e-9 * by_prior.abs() + 1e-12, "{by_prior} {by_gap}");
    }

    #[test]
    fn work_counts_by_its_error() {
        let (column, homing) = homing();
        let sure = Homing::new(&column, 0.1e-3, Priors { work: 1e-4, ..homing.priors });
        assert!((sure.work(0.05) - 0.05).abs() < 1e-5 && homing.work(0.05) < 0.01);
        assert!((homing.prior(0).load - homing.work(0.5)).abs() < 1e-12);
    }

    #[test]
    fn equations_are_solved_whatever_their_order() {
        let a = [[0.0, 2.0, 1.0], [1.0, -1.0, 0.0], [3.0, 0.0, -2.0]];
        let x = [1.0, 2.0, 3.0];
        let b = a.map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum());
        assert!(solve(a, b).iter().zip(x).all(|(found, x)| (found - x).abs() < 1e-12));
    }
}
