//! Collocation: the rod's equations at the ends and middles of equal intervals, all at once, by Newton.

use crate::ode::{Point, RodOde, plain, response, with_compliance};
use tsa_model::SolveError;
use tsa_model::rod::{Rod, RodResponse, TipForce};
use tsa_model::scalar::{Dual, Scalar};

/// Maximum intervals along half a rod.
pub const MAX_INTERVALS: usize = 256;

/// Maximum rotation by which Newton may move a point at once (rad).
const LARGEST_TURN: f64 = 0.3;
/// Maximum Newton steps.
const STEPS: u32 = 50;

/// Rotation and moment at the points.
struct Curve<T> {
    at: [[T; 2]; MAX_INTERVALS + 1],
    strain: [(T, T); MAX_INTERVALS + 1],
}

/// One interval's equations, linear in the changes d of its ends: d_next = transfer d + shift.
struct Interval<T> {
    transfer: [T; 4],
    shift: [T; 2],
    /// Gain of X/l and w/l over the interval.
    gain: [T; 2],
}

fn point<T: Scalar>(at: [T; 2]) -> Point<T> {
    [at[0], at[1], T::of(0.0), T::of(0.0)]
}

fn times<T: Scalar>(a: [T; 4], b: [T; 4]) -> [T; 4] {
    [a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3], a[2] * b[0] + a[3] * b[2], a[2] * b[1] + a[3] * b[3]]
}

fn apply<T: Scalar>(a: [T; 4], x: [T; 2]) -> [T; 2] {
    [a[0] * x[0] + a[1] * x[1], a[2] * x[0] + a[3] * x[1]]
}

impl<T: Scalar> Curve<T> {
    /// The interval from point i: y' − y − h/6 (f + 4 f_mid + f') = 0 with y_mid = (y + y')/2 + h/8 (f − f').
    fn interval(&mut self, ode: &RodOde<T>, i: usize, h: f64) -> Result<Interval<T>, SolveError> {
        let (a, b) = (self.at[i], self.at[i + 1]);
        let fa = ode.slope(point(a), self.strain[i])?;
        let fb = ode.slope(point(b), self.strain[i + 1])?;
        (self.strain[i], self.strain[i + 1]) = (fa.strain, fb.strain);
        let mid = core::array::from_fn(|k| (a[k] + b[k]) * 0.5 + (fa.by_length[k] - fb.by_length[k]) * (h / 8.0));
        let fm = ode.slope(point(mid), fa.strain)?;
        let mean = |k: usize| (fa.by_length[k] + fm.by_length[k] * 4.0 + fb.by_length[k]) * (h / 6.0);
        let residual = [b[0] - a[0] - mean(0), b[1] - a[1] - mean(1)];
        let one = [T::of(1.0), T::of(0.0), T::of(0.0), T::of(1.0)];
        // Derivatives of the residual by the two ends.
        let side = |own: [T; 4], sign: f64| -> [T; 4] {
            let mid_by: [T; 4] = core::array::from_fn(|k| one[k] * 0.5 + own[k] * (-sign * h / 8.0));
            let through = times(fm.jacobian, mid_by);
            core::array::from_fn(|k| one[k] * sign - (own[k] + through[k] * 4.0) * (h / 6.0))
        };
        let (left, right) = (side(fa.jacobian, -1.0), side(fb.jacobian, 1.0));
        let det = right[0] * right[3] - right[1] * right[2];
        let inverse = [right[3] / det, -(right[1] / det), -(right[2] / det), right[0] / det];
        let minus = |x: T| -x;
        Ok(Interval {
            transfer: times(inverse, left).map(minus),
            shift: apply(inverse, residual).map(minus),
            gain: [mean(2), mean(3)],
        })
    }

    /// One Newton step; returns its size relative to the curve, and X/l and w/l of the curve before it.
    fn step(&mut self, ode: &RodOde<T>, n: usize, evaluations: &mut u32) -> Result<(f64, [T; 2]), SolveError> {
        let zero = T::of(0.0);
        let h = 1.0 / n as f64;
        // Every change as a function of the clamp moment's change d: d_i = base_i + by_moment_i · d.
        let (mut base, mut by_moment) = ([[zero; 2]; MAX_INTERVALS + 1], [[zero; 2]; MAX_INTERVALS + 1]);
        by_moment[0][1] = T::of(1.0);
        let mut tip = [zero; 2];
        for i in 0..n {
            let interval = self.interval(ode, i, h)?;
            *evaluations += 3;
            let moved = apply(interval.transfer, base[i]);
            base[i + 1] = [moved[0] + interval.shift[0], moved[1] + interval.shift[1]];
            by_moment[i + 1] = apply(interval.transfer, by_moment[i]);
            for (sum, gain) in tip.iter_mut().zip(interval.gain) {
                *sum += gain;
            }
        }
        let change = -(self.at[n][1] + base[n][1]) / by_moment[n][1];
        let steps = |i: usize, k: usize| base[i][k] + by_moment[i][k] * change;
        let turn = (0..=n).map(|i| steps(i, 0).value().abs()).fold(0.0, f64::max);
        // A straight guess may be far off: no rotation changes by more than the limit in one step.
        let fraction = (LARGEST_TURN / turn).min(1.0);
        let (mut far, mut size) = (0.0f64, 0.0f64);
        for i in 0..=n {
            for k in 0..2 {
                let step = steps(i, k) * fraction;
                self.at[i][k] += step;
                // Rotation is of order one, the moment is compared with the clamp's.
                let unit = if k == 0 { 1.0 } else { self.at[0][1].value().abs() };
                far = far.max(step.value().abs() / unit);
                size = size.max(self.at[i][k].value().abs() / unit);
            }
        }
        Ok((far / size, tip))
    }
}

/// The rod's response, from a straight first guess.
pub(crate) fn respond(
    rod: &Rod,
    force: TipForce,
    intervals: usize,
    tolerance: f64,
    evaluations: &mut u32,
) -> Result<RodResponse, SolveError> {
    let n = intervals.clamp(1, MAX_INTERVALS);
    let ode = plain(rod, force);
    let moment = ode.sideways * ode.slenderness;
    let mut curve = Curve { at: [[0.0; 2]; MAX_INTERVALS + 1], strain: [(0.0, 0.0); MAX_INTERVALS + 1] };
    for i in 0..=n {
        curve.at[i][1] = moment * (1.0 - i as f64 / n as f64);
        curve.strain[i] = (-ode.inward, 4.0 * curve.at[i][1]);
    }
    let mut settled = false;
    for _ in 0..STEPS {
        let (far, _) = curve.step(&ode, n, evaluations)?;
        if far.is_nan() {
            break;
        }
        settled = far <= tolerance.max(16.0 * f64::EPSILON);
        if settled {
            break;
        }
    }
    if !settled {
        return Err(SolveError::Diverged { stage: "Newton on the collocation equations" });
    }
    // One more step in numbers that carry derivatives by the force gives those of the solution.
    let ode = with_compliance(rod, force);
    let mut dual = Curve {
        at: curve.at.map(|point| point.map(Dual::of)),
        strain: curve.strain.map(|(e, b)| (Dual::of(e), Dual::of(b))),
    };
    dual.step(&ode, n, evaluations)?;
    let (_, tip) = dual.step(&ode, n, evaluations)?;
    let (e, b) = dual.strain[0];
    Ok(response(rod, [dual.at[n][0], dual.at[n][1], tip[0], tip[1]], (e.value, b.value)))
}
