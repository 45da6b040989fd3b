//! What homing makes of a gap that is not the table's: the least-squares fit of the weighing, to first order.
//!
//! The firmware fits the load, a scale of the twist, zero and slope of the LVDT, and the growth of the string radius to the gap
//! over the twist, with priors (rig-control, `homing/load_estimate.rs`, whose constants these are). After the fit one scale
//! stands for scale and growth, and a cubic goes through what load, scale and zero leave. For a change δG of the gap the fit
//! moves by x = N⁻¹ (Jᵀ W δG + p), with J the derivatives of the gap by the unknowns, N = Jᵀ W J + P, and p what a prior is wrong by.

use super::columns::{Column, State};
use nalgebra::{Matrix4, SMatrix, SVector, Vector4};
use rig_control::homing::{LOAD_TURNS, load_estimate};
use rig_link::gap_curve::TERMS;
use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;
use tsa_model::PRETWIST_RAD;

/// Standard errors of what homing takes from elsewhere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Priors {
    /// Of the scale of the twist, relative.
    pub scale: f64,
    /// Of the LVDT's zero and its reading there (m).
    pub zero_m: f64,
    /// Of the LVDT's slope.
    pub slope: f64,
    /// By how much the mechanism may miss the gaps of the sweep (m, rms).
    pub law_m: f64,
}

/// The unknowns, in the firmware's order: logarithm of the load, that of the scale, zero (m), slope of the LVDT, exponent by
/// which the radius grows faster with the twist.
const UNKNOWNS: usize = load_estimate::UNKNOWNS;
type Vector = SVector<f64, UNKNOWNS>;
type Matrix = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

impl Priors {
    /// In the order of the unknowns; nothing else says the load.
    fn sigmas(&self) -> Vector {
        Vector::from([f64::INFINITY, self.scale, self.zero_m, self.slope, self.scale])
    }
}

/// The fit under one load.
#[derive(Clone, Debug)]
pub(super) struct Homing {
    /// Places of the states that are weighed.
    weighed: RangeInclusive<usize>,
    /// Of each state: derivatives of the gap (m) by the unknowns.
    jacobian: Vec<Vector>,
    /// Twist of each state, from −1 to 1 over those that are weighed; beyond them the cubic is level.
    place: Vec<f64>,
    /// Weight of a state (1/m²).
    weight: f64,
    inverse: Matrix,
    /// By how much the scale makes good for a growth that is left out.
    scale_by_growth: f64,
    pub priors: Priors,
}

/// What a change of the gap is taken for: relative error of the load, and what the cubic leaves of the gap at each state (m).
pub(super) type Taken = (f64, Vec<f64>);

impl Homing {
    /// Under the load of a column, with a residual (m, rms) of the law on this rig.
    pub fn new(column: &Column, residual_m: f64, priors: Priors) -> Self {
        let states = &column.0;
        let [first, last] = Self::ends(column);
        let [from, to] = [first, last].map(|k| states[k].twist_rad);
        let middle_m = states[first..=last].iter().map(|s| s.gap_m).sum::<f64>() / (last - first + 1) as f64;
        let by = |s: &State| {
            let by_scale = s.by_twist * s.twist_rad;
            let by_growth = by_scale * (s.twist_rad / PI).ln();
            Vector::from([s.load_n * s.by_load, by_scale, 1.0, s.gap_m - middle_m, by_growth])
        };
        let jacobian: Vec<Vector> = states.iter().map(by).collect();
        let place = |twist_rad: f64| (2.0 * (twist_rad - from) / (to - from) - 1.0).clamp(-1.0, 1.0);
        let error_m = residual_m.hypot(priors.law_m).max(f64::from(load_estimate::MIN_GAP_ERROR_M));
        let bins = load_estimate::BINS - 2 * load_estimate::END_BINS;
        let weight = bins as f64 / ((last - first + 1) as f64 * error_m * error_m);
        let known = priors.sigmas().map(|sigma| 1.0 / (sigma * sigma));
        let seen: Matrix = jacobian[first..=last].iter().map(|j| j * j.transpose() * weight).sum();
        Self {
            weighed: first..=last,
            place: states.iter().map(|s| place(s.twist_rad)).collect(),
            jacobian,
            weight,
            scale_by_growth: seen[(4, 1)] / seen[(1, 1)],
            // The priors make it regular.
            inverse: (seen + Matrix::from_diagonal(&known)).lu().try_inverse().unwrap_or_default(),
            priors,
        }
    }

    /// First and last state of the sweep that is weighed.
    fn ends(column: &Column) -> [usize; 2] {
        let states = &column.0;
        let last_rad = states[states.len() - 1].twist_rad;
        let sweep_rad = (TAU * f64::from(LOAD_TURNS)).min(last_rad - PRETWIST_RAD);
        let edge = load_estimate::END_BINS as f64 / load_estimate::BINS as f64;
        let used = [edge, 1.0 - edge].map(|fraction| PRETWIST_RAD + fraction * sweep_rad);
        let inside = |k: &usize| (used[0]..=used[1]).contains(&states[*k].twist_rad);
        [(0..states.len()).find(inside).unwrap_or(0), (0..states.len()).rfind(inside).unwrap_or(states.len() - 1)]
    }

    /// By how much a mechanism with this `load_shape` may miss the gaps of the sweep (m, rms), as the firmware takes it: from the
    /// column of the load in the middle of the table.
    pub fn law_error_m(column: &Column, load_shape: f64) -> f64 {
        let [first_m, last_m] = Self::ends(column).map(|k| column.0[k].load_n * column.0[k].by_load);
        load_shape * (last_m - first_m).abs() / 12.0f64.sqrt()
    }

    /// A gap that differs by `change_m` at each state.
    pub fn gap(&self, change_m: &[f64]) -> Taken {
        self.taken(change_m, Vector::zeros())
    }

    /// The prior of an unknown that is wrong by so much.
    pub fn prior(&self, which: usize, error: f64) -> Taken {
        let sigma = self.priors.sigmas()[which];
        let mut right = Vector::zeros();
        right[which] = error / (sigma * sigma);
        self.taken(&vec![0.0; self.place.len()], right)
    }

    /// Relative error of the load for gaps that are wrong by 1 m rms, in as many independent stretches as a cubic has terms.
    pub fn load_of_stretches(&self) -> f64 {
        let (first, states) = (*self.weighed.start(), self.weighed.clone().count());
        let mut squares = 0.0;
        for stretch in 0..TERMS {
            let mut change_m = vec![0.0; self.place.len()];
            for k in (0..states).filter(|k| k * TERMS / states == stretch) {
                change_m[first + k] = 1.0;
            }
            squares += self.gap(&change_m).0.powi(2);
        }
        squares.sqrt()
    }

    /// Rms over the weighed states of what the fit leaves of a change of the gap, before the cubic (m).
    pub fn residual_m(&self, change_m: &[f64]) -> f64 {
        let step = self.step(change_m, Vector::zeros());
        let rest: Vec<f64> = change_m.iter().zip(&self.jacobian).map(|(change, j)| change - j.dot(&step)).collect();
        let weighed = &rest[self.weighed.clone()];
        (weighed.iter().map(|r| r * r).sum::<f64>() / weighed.len() as f64).sqrt()
    }

    fn step(&self, change_m: &[f64], right: Vector) -> Vector {
        let seen: Vector = self.weighed.clone().map(|k| self.jacobian[k] * (self.weight * change_m[k])).sum();
        self.inverse * (right + seen)
    }

    fn taken(&self, change_m: &[f64], right: Vector) -> Taken {
        let step = self.step(change_m, right);
        let scale = step[1] + self.scale_by_growth * step[4];
        let kept = |j: &Vector| j[0] * step[0] + j[1] * scale + j[2] * step[2];
        let rest: Vec<f64> = change_m.iter().zip(&self.jacobian).map(|(change, j)| change - kept(j)).collect();
        let normal: Matrix4<f64> =
            self.weighed.clone().map(|k| powers(self.place[k]) * powers(self.place[k]).transpose()).sum();
        let sums: Vector4<f64> = self.weighed.clone().map(|k| powers(self.place[k]) * rest[k]).sum();
        let cubic = normal.lu().solve(&sums).unwrap_or_default();
        let left_m = rest.iter().zip(&self.place).map(|(rest, place)| rest - powers(*place).dot(&cubic)).collect();
        (step[0], left_m)
    }
}

/// 1, x, x², x³.
fn powers(x: f64) -> Vector4<f64> {
    Vector4::new(1.0, x, x * x, x * x * x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::tests::scene;

    fn homing() -> (Column, Homing) {
        let column = Column::all(&scene()).unwrap().swap_remove(4);
        let homing = Homing::new(&column, 0.1e-3, Priors { scale: 0.03, zero_m: 0.5e-3, slope: 0.0074, law_m: 0.0 });
        (column, homing)
    }

    /// A heavier load is taken for a heavier one as far as the priors let it, and nothing of it is left.
    #[test]
    fn another_load_is_found_and_leaves_nothing() {
        let (column, _) = homing();
        let open = Priors { scale: 0.5, zero_m: 0.5, slope: 0.1, law_m: 0.0 };
        let sure = Homing::new(&column, 0.0, Priors { scale: 1e-6, zero_m: 1e-6, slope: 1e-6, law_m: 0.0 });
        for homing in [Homing::new(&column, 0.0, open), sure] {
            let taken = homing.gap(&column.each(|s| 0.01 * s.load_n * s.by_load));
            assert!((taken.0 / 0.01 - 1.0).abs() < 0.02, "{}", taken.0);
            assert!(taken.1[homing.weighed.clone()].iter().all(|m| m.abs() < 1e-6));
        }
    }

    /// An error of the load by `load_shape` changes the gaps of the sweep by as much as the mechanism may miss them, about their mean;
    /// and that counts as a residual does.
    #[test]
    fn what_the_mechanism_may_miss_counts_as_a_residual() {
        let (column, homing) = homing();
        let missed_m = Homing::law_error_m(&column, 0.03);
        let changes_m = &column.each(|s| 0.03 * s.load_n * s.by_load)[homing.weighed.clone()];
        let mean_m = changes_m.iter().sum::<f64>() / changes_m.len() as f64;
        let rms_m = (changes_m.iter().map(|m| (m - mean_m).powi(2)).sum::<f64>() / changes_m.len() as f64).sqrt();
        assert!((missed_m / rms_m - 1.0).abs() < 0.15, "{missed_m} {rms_m}");
        let weight = |residual_m, law_m| Homing::new(&column, residual_m, Priors { law_m, ..homing.priors }).weight;
        assert_eq!(weight(0.0, 0.3e-3), weight(0.3e-3, 0.0));
        assert!((weight(0.3e-3, 0.4e-3) / weight(0.5e-3, 0.0) - 1.0).abs() < 1e-12);
    }

    /// A gap that is a cubic of the twist leaves nothing for the observer, whatever load it is taken for.
    #[test]
    fn the_curve_takes_what_a_cubic_can() {
        let (column, homing) = homing();
        let change: Vec<f64> = homing.place.iter().map(|x| 1e-4 * (1.0 - 2.0 * x * x * x)).collect();
        let taken = homing.gap(&change);
        // What the fit takes is no cubic, but nearly.
        let left = homing.weighed.clone().map(|k| taken.1[k].abs()).fold(0.0, f64::max);
        assert!(taken.0 != 0.0 && left < 5e-6, "{left}");
        assert_eq!(column.0.len(), taken.1.len());
    }

    /// A radius that is not the prior's is the same as a gap of strings that are so much thicker, the other way round.
    #[test]
    fn a_wrong_prior_is_a_thicker_string() {
        let (column, homing) = homing();
        let by_prior = homing.prior(1, 0.03).0;
        let by_gap = homing.gap(&column.each(|s| -0.03 * s.by_twist * s.twist_rad)).0;
        // The fit that takes the strings for thicker by all of it would need no other load at all.
        assert!((by_prior - by_gap).abs() < 1e-9 * by_prior.abs() + 1e-12, "{by_prior} {by_gap}");
    }
}
