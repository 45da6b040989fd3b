//! Fitting one patch by least squares.

use crate::arc::{MAX_COLUMNS, MAX_ROWS, Patch, Shape};
use crate::least_squares::Normal;

/// A solved state and its arc.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// Load (N).
    pub load_n: f64,
    /// Twist (rad).
    pub twist_rad: f64,
    /// Arc (m).
    pub arc_m: f64,
    /// ∂a/∂θ (m/rad).
    pub arc_by_twist: f64,
    /// Gap (m).
    pub gap_m: f64,
    /// ∂G/∂θ (m/rad).
    pub by_twist: f64,
}

/// The equations of a patch: products of Chebyshev polynomials, [`MAX_COLUMNS`] of the arc for each of the load.
pub(crate) struct PatchFit {
    normal: Normal<{ MAX_ROWS * MAX_COLUMNS }>,
    load_max_n: f32,
    centre: [f32; 2],
    half: [f64; 2],
    tolerance: [f64; 2],
}

/// T_k(x) and its derivative for every k.
fn chebyshev<const M: usize>(x: f64) -> ([f64; M], [f64; M]) {
    let (mut t, mut d) = ([0.0; M], [0.0; M]);
    for k in 0..M {
        (t[k], d[k]) = match k {
            0 => (1.0, 0.0),
            1 => (x, 1.0),
            _ => (2.0 * x * t[k - 1] - t[k - 2], 2.0 * t[k - 1] + 2.0 * x * d[k - 1] - d[k - 2]),
        };
    }
    (t, d)
}

/// Coefficients of T_k in powers of its argument.
fn powers_of_chebyshev(k: usize) -> [f64; MAX_COLUMNS] {
    let (mut previous, mut current) = ([0.0; MAX_COLUMNS], [0.0; MAX_COLUMNS]);
    previous[0] = 1.0;
    current[1] = 1.0;
    if k == 0 {
        return previous;
    }
    for _ in 1..k {
        let mut next = previous.map(|p| -p);
        for i in 1..MAX_COLUMNS {
            next[i] += 2.0 * current[i - 1];
        }
        (previous, current) = (current, next);
    }
    current
}

impl PatchFit {
    /// A patch over these ranges of load (N) and arc (m); `tolerance` of gap (m) and TR (relative) weights the
    /// equations.
    pub(crate) fn new(load_n: [f64; 2], arc_m: [f64; 2], tolerance: [f64; 2]) -> Self {
        let ranges = [load_n, arc_m];
        let centre = ranges.map(|[low, high]| (0.5 * (low + high)) as f32);
        let half = ranges.map(|[low, high]| 0.5 * (high - low));
        Self { normal: Normal::default(), load_max_n: load_n[1] as f32, centre, half, tolerance }
    }

    /// Adds the equations of a state: its gap and its slope.
    pub(crate) fn add(&mut self, s: &Sample) {
        let position = |k: usize, at: f64| (at - f64::from(self.centre[k])) / self.half[k];
        let (tx, _) = chebyshev::<MAX_ROWS>(position(0, s.load_n));
        let (ty, dy) = chebyshev::<MAX_COLUMNS>(position(1, s.arc_m));
        let by_arc = 2.0 * s.gap_m * s.by_twist / s.arc_by_twist;
        let weight = 0.5 / (s.gap_m * self.tolerance[0]);
        let slope_weight = 1.0 / (by_arc.abs() * self.tolerance[1]);
        let place = |k: usize| (k / MAX_COLUMNS, k % MAX_COLUMNS);
        let value = std::array::from_fn(|k| weight * tx[place(k).0] * ty[place(k).1]);
        let slope = std::array::from_fn(|k| slope_weight / self.half[1] * tx[place(k).0] * dy[place(k).1]);
        self.normal.add(&value, weight * s.gap_m * s.gap_m);
        self.normal.add(&slope, slope_weight * by_arc);
    }

    /// The patch of this shape and its coefficients in the order of their evaluation. `None` if the states do not
    /// determine them.
    pub(crate) fn solve(&self, shape: Shape) -> Option<(Patch, Vec<f32>)> {
        let [rows, columns] = [shape.rows, shape.columns].map(usize::from);
        let kept: Vec<usize> = (0..rows * columns).map(|k| k / columns * MAX_COLUMNS + k % columns).collect();
        let solution = self.normal.solve(&kept)?;
        // From Chebyshev polynomials on [−1, 1] to powers of the offsets in N and m.
        let scale = |k: usize, power: usize| libm::pow(self.half[k], -(power as f64));
        let coefficient = |at: usize| {
            let (j, i) = (columns - 1 - at / rows, rows - 1 - at % rows);
            let mut sum = 0.0;
            for a in i..rows {
                let along = powers_of_chebyshev(a)[i];
                for b in j..columns {
                    sum += solution[a * columns + b] * along * powers_of_chebyshev(b)[j];
                }
            }
            (sum * scale(0, i) * scale(1, j)) as f32
        };
        let patch = Patch { load_max_n: self.load_max_n, centre: self.centre };
        Some((patch, (0..rows * columns).map(coefficient).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chebyshev_polynomials_are_cosines_and_their_powers_add_up_to_them() {
        for at in [-0.9f64, -0.3, 0.0, 0.45, 0.8] {
            let angle = at.acos();
            let (values, slopes) = chebyshev::<MAX_COLUMNS>(at);
            for k in 0..MAX_COLUMNS {
                let order = k as f64;
                let value = (order * angle).cos();
                assert!((values[k] - value).abs() < 1e-12, "T_{k}({at})");
                assert!((slopes[k] - order * (order * angle).sin() / angle.sin()).abs() < 1e-11, "T_{k}'({at})");
                let by_powers: f64 = powers_of_chebyshev(k).iter().rev().fold(0.0, |sum, c| sum * at + c);
                assert!((by_powers - value).abs() < 1e-12, "T_{k}({at}) by powers");
            }
        }
    }

    const LOADS_N: [f64; 2] = [2.0, 10.0];
    const ARCS_M: [f64; 2] = [0.005, 0.045];

    /// States of a gap G(F, a) with a = 1 mm · θ.
    fn states(gap_m: impl Fn(f64, f64) -> f64) -> Vec<Sample> {
        let at = |[low, high]: [f64; 2], k: usize, n: usize| low + (high - low) * k as f64 / n as f64;
        let state = |k: usize| {
            let (load_n, arc_m) = (at(LOADS_N, k % 7, 6), at(ARCS_M, k / 7, 11));
            let step = 1e-7;
            let by_arc = (gap_m(load_n, arc_m + step) - gap_m(load_n, arc_m - step)) / (2.0 * step);
            let (arc_by_twist, gap_m) = (1e-3, gap_m(load_n, arc_m));
            Sample { load_n, twist_rad: arc_m / 1e-3, arc_m, arc_by_twist, gap_m, by_twist: by_arc * arc_by_twist }
        };
        (0..84).map(state).collect()
    }

    /// G² and its derivative by the arc, from coefficients in the order of their evaluation.
    fn square(shape: Shape, patch: &Patch, c: &[f32], s: &Sample) -> [f64; 2] {
        let [rows, columns] = [shape.rows, shape.columns].map(usize::from);
        let [load, arc] = [s.load_n - f64::from(patch.centre[0]), s.arc_m - f64::from(patch.centre[1])];
        let (mut value, mut slope) = (0.0, 0.0);
        for (at, c) in c.iter().enumerate() {
            let (j, i) = (columns - 1 - at / rows, rows - 1 - at % rows);
            let row = f64::from(*c) * load.powi(i as i32);
            value += row * arc.powi(j as i32);
            slope += if j > 0 { row * j as f64 * arc.powi(j as i32 - 1) } else { 0.0 };
        }
        [value, slope]
    }

    fn fitted(shape: Shape, states: &[Sample], tolerance: [f64; 2]) -> (Patch, Vec<f32>) {
        let mut fit = PatchFit::new(LOADS_N, ARCS_M, tolerance);
        states.iter().for_each(|s| fit.add(s));
        fit.solve(shape).unwrap()
    }

    #[test]
    fn a_square_that_is_a_polynomial_is_found_again() {
        let of = |load: f64, arc: f64| {
            0.01 + 1e-4 * load - 2e-6 * load * load - 0.06 * arc - 0.9 * arc * arc * (1.0 - 0.01 * load)
        };
        let states = states(|load, arc| of(load, arc).sqrt());
        let shape = Shape::of(3, 4).unwrap();
        let (patch, coefficients) = fitted(shape, &states, [5e-6, 2e-3]);
        assert_eq!(patch, Patch { load_max_n: 10.0, centre: [6.0, 0.025] });
        for s in &states {
            let error = square(shape, &patch, &coefficients, s)[0] - of(s.load_n, s.arc_m);
            assert!(error.abs() < 1e-8, "{error:e} at {} N, {} m", s.load_n, s.arc_m);
        }
    }

    /// The errors of gap and slope, each in units of its tolerance, have the least sum of squares.
    #[test]
    fn what_no_polynomial_meets_is_met_best_in_units_of_the_tolerances() {
        let states = states(|load, arc| (0.012 - (0.03 + arc).powi(2)).sqrt() + 1e-3 / (load + arc * 40.0));
        let shape = Shape::of(2, 3).unwrap();
        for tolerance in [[5e-6, 2e-3], [1e-3, 2e-3], [5e-6, 1.0]] {
            let (patch, coefficients) = fitted(shape, &states, tolerance);
            let cost = |c: &[f32]| -> f64 {
                let of = |s: &Sample| {
                    let [value, slope] = square(shape, &patch, c, s);
                    let by_arc = 2.0 * s.gap_m * s.by_twist / s.arc_by_twist;
                    let gap = (value - s.gap_m * s.gap_m) / (2.0 * s.gap_m * tolerance[0]);
                    gap.powi(2) + ((slope - by_arc) / (by_arc * tolerance[1])).powi(2)
                };
                states.iter().map(of).sum()
            };
            let min = cost(&coefficients);
            for k in 0..shape.terms() {
                // A least cost rises with the square of a change: the same to both sides.
                let changed = |fraction: f32| {
                    let mut c = coefficients.clone();
                    c[k] *= 1.0 + fraction;
                    cost(&c) - min
                };
                let [up, down] = [changed(0.01), changed(-0.01)];
                assert!(
                    up > 0.0 && down > 0.0 && (up - down).abs() < 0.05 * (up + down),
                    "{tolerance:?} {k}: {up} {down}"
                );
            }
        }
    }

    #[test]
    fn what_is_not_determined_is_none() {
        assert!(PatchFit::new(LOADS_N, ARCS_M, [1e-6, 1e-3]).solve(Shape::of(2, 2).unwrap()).is_none());
    }
}
