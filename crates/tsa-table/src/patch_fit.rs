//! Fitting one patch by least squares: on a desktop when the firmware is built, on the board after a calibration.

use crate::arc::{MAX_COLUMNS, MAX_ROWS, Patch, Shape};
use crate::least_squares::Normal;

/// Most coefficients of a patch.
pub const MAX_TERMS: usize = MAX_ROWS * MAX_COLUMNS;

/// A solved state and its arc.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
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

/// The equations of a patch with up to N coefficients: `columns` powers of the arc and as many powers of the load as fit.
pub struct PatchFit<const N: usize> {
    normal: Normal<N>,
    columns: usize,
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

impl<const N: usize> PatchFit<N> {
    /// A patch over these ranges of load (N) and arc (m); `tolerance` of gap (m) and TR (relative) weights the equations.
    pub fn new(columns: usize, load_n: [f64; 2], arc_m: [f64; 2], tolerance: [f64; 2]) -> Self {
        let (mut centre, mut half) = ([0.0; 2], [0.0; 2]);
        for (k, [low, high]) in [load_n, arc_m].into_iter().enumerate() {
            centre[k] = (0.5 * (low + high)) as f32;
            half[k] = 0.5 * (high - low);
        }
        Self { normal: Normal::default(), columns, load_max_n: load_n[1] as f32, centre, half, tolerance }
    }

    /// Adds the equations of a state: its gap and its slope.
    pub fn add(&mut self, s: &Sample) {
        let position = |k: usize, at: f64| (at - f64::from(self.centre[k])) / self.half[k];
        let (tx, _) = chebyshev::<MAX_ROWS>(position(0, s.load_n));
        let (ty, dy) = chebyshev::<MAX_COLUMNS>(position(1, s.arc_m));
        let by_arc = 2.0 * s.gap_m * s.by_twist / s.arc_by_twist;
        let weight = 0.5 / (s.gap_m * self.tolerance[0]);
        let slope_weight = 1.0 / (by_arc.abs() * self.tolerance[1]);
        let (mut value, mut slope) = ([0.0; N], [0.0; N]);
        for (k, (v, d)) in value.iter_mut().zip(&mut slope).enumerate() {
            let (i, j) = (k / self.columns, k % self.columns);
            if i >= MAX_ROWS {
                break;
            }
            *v = weight * tx[i] * ty[j];
            *d = slope_weight / self.half[1] * tx[i] * dy[j];
        }
        self.normal.add(&value, weight * s.gap_m * s.gap_m);
        self.normal.add(&slope, slope_weight * by_arc);
    }

    /// Solves for the patch of this shape and writes its coefficients to `out` in the order of their evaluation. `None` if
    /// the states do not determine them or the sizes do not fit.
    pub fn solve(&self, shape: Shape, out: &mut [f32]) -> Option<Patch> {
        let [rows, columns] = [shape.rows, shape.columns].map(usize::from);
        if rows > MAX_ROWS || columns > self.columns || rows * self.columns > N {
            return None;
        }
        let mut kept = heapless::Vec::<usize, N>::new();
        for k in 0..rows * columns {
            kept.push(k / columns * self.columns + k % columns).ok()?;
        }
        let solution = self.normal.solve(&kept)?;
        let out = out.get_mut(..rows * columns)?;
        // From Chebyshev polynomials on [−1, 1] to powers of the offsets in N and m.
        let scale = |k: usize, power: usize| libm::pow(self.half[k], -(power as f64));
        for (at, c) in out.iter_mut().enumerate() {
            let (j, i) = (columns - 1 - at / rows, rows - 1 - at % rows);
            let mut sum = 0.0;
            for a in i..rows {
                let along = powers_of_chebyshev(a)[i];
                for b in j..columns {
                    sum += solution[a * columns + b] * along * powers_of_chebyshev(b)[j];
                }
            }
            *c = (sum * scale(0, i) * scale(1, j)) as f32;
        }
        Some(Patch { load_max_n: self.load_max_n, centre: self.centre })
    }
}
