//! A fast and smooth replacement for the solver: bicubic Hermite patches over exact gaps and exact slopes.
//!
//! One axis is ln F, since the radius model has a term in 1/F. The other is twist, in two parts that meet at θ = π, where
//! the strings begin to touch and the gap's second derivative jumps, with k4 in the radius model the first as well: below it θ itself, above it the fraction of the
//! way to the last twist that has an equilibrium, so that every patch lies where the model does.
//!
//! Outside the range of the model the surface is a guess that keeps a simulation going:
//! - past the last twist the gap continues in a straight line for 2 rad and then stays constant;
//! - above the maximum load it continues in a straight line in F;
//! - below the least load (0.3 N) the string goes slack: see `Surface::pull`.

use std::f64::consts::PI;

/// Minimum load of the surface, N; below it the pull falls linearly to zero with the gap.
pub use tsa_model::SLACK_LOAD_N;
use tsa_model::STEEPEST_M_PER_RAD;
/// Cells along ln F.
const LOAD_CELLS: usize = 48;
/// Cells below θ = π.
const OPEN_CELLS: usize = 24;
/// Last twist of the open strings (rad), where the slope is still theirs.
const OPEN_END_RAD: f64 = PI * (1.0 - 1e-9);
/// Width of a cell from θ = π to the last twist, at most, rad.
const TWISTED_CELL_RAD: f64 = 0.48;
/// Places and weights of Gauss's quadrature with three points over a cell of loads.
const QUADRATURE: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
/// How far past the last twist the gap continues, rad.
const RUN_ON_RAD: f64 = 2.0;

/// The gap at which the mechanism balances a load, and its slopes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GapPoint {
    /// Gap G between the clamps, m.
    pub gap_m: f64,
    /// ∂G/∂θ at constant load, m/rad; 0 at zero twist, negative above.
    pub by_twist_m_per_rad: f64,
    /// ∂G/∂F at constant twist, m/N; positive.
    pub by_load_m_per_n: f64,
}

/// Why no surface can be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the mechanism has no equilibrium at {load_n:.2} N and {twist_rad:.2} rad, which the emulated rig has to pass")]
pub struct NoSurface {
    /// Load, N.
    pub load_n: f64,
    /// Twist, rad.
    pub twist_rad: f64,
}

/// The force of the string on the rail at a twist and a gap.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pull {
    /// Force on the load, N; the load that the mechanism carries.
    pub force_n: f64,
    /// ∂F/∂G at constant twist, N/m.
    pub stiffness_n_per_m: f64,
    /// ∂G/∂θ at constant load, m/rad.
    pub by_twist_m_per_rad: f64,
}

/// Value, a gap or a torque, and the three derivatives that a Hermite patch needs, by the local coordinates (see [`Surface`]).
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    value: f64,
    by_x: f64,
    by_u: f64,
    by_xu: f64,
}

/// One rectangular grid over x in 0..=1 and u = ln F.
#[derive(Clone, Debug)]
struct Grid {
    cells: usize,
    nodes: Vec<Node>,
}

/// The interpolant.
#[derive(Clone, Debug)]
pub struct Surface {
    u_min: f64,
    u_step: f64,
    max_load_n: f64,
    /// Last twist with an equilibrium and its slope by u, at each load of the grid.
    ends: Vec<(f64, f64)>,
    /// Twist at which the strings lie side by side and the motor meets a wall, at each load of the grid.
    hard_stops: Vec<f64>,
    open: Grid,
    twisted: Grid,
    open_torque: Grid,
    twisted_torque: Grid,
}

impl Surface {
    /// Samples `exact`, the gap at a twist of at least 0 rad and a load in N where there is one, from [`SLACK_LOAD_N`] to
    /// `max_load_n` and to `max_twist_rad`.
    ///
    /// # Errors
    /// [`NoSurface`] where the mechanism has no equilibrium.
    pub fn new(
        exact: impl Fn(f64, f64) -> Option<GapPoint>,
        max_load_n: f64,
        max_twist_rad: f64,
    ) -> Result<Self, NoSurface> {
        let u_min = SLACK_LOAD_N.ln();
        let u_step = (max_load_n.ln() - u_min) / LOAD_CELLS as f64;
        let loads: Vec<f64> = (0..=LOAD_CELLS).map(|i| (u_min + u_step * i as f64).exp()).collect();
        let last: Vec<f64> =
            loads.iter().map(|&load| last_twist(&exact, load, max_twist_rad)).collect::<Result<_, _>>()?;
        let slopes = differences(&last, u_step);
        let ends: Vec<_> = last.iter().copied().zip(slopes).collect();
        // Where a greater load ends earlier it is the rods' strain that ends it: no wall for the motor.
        let hard_stops = last
            .iter()
            .scan(0.0_f64, |max, &end| {
                *max = max.max(end);
                Some(*max)
            })
            .collect();
        let sample = |load: f64, twist: f64| exact(twist, load).ok_or(NoSurface { load_n: load, twist_rad: twist });
        let open = Grid::new(OPEN_CELLS, &loads, u_step, |i, x| {
            let point = sample(loads[i], (PI * x).min(OPEN_END_RAD))?;
            Ok((point.gap_m, PI * point.by_twist_m_per_rad, loads[i] * point.by_load_m_per_n))
        })?;
        let last_rad = last.iter().copied().fold(PI, f64::max);
        let twisted_cells = ((last_rad - PI) / TWISTED_CELL_RAD).ceil() as usize;
        let twisted = Grid::new(twisted_cells, &loads, u_step, |i, x| {
            let (end, end_by_u) = ends[i];
            let point = sample(loads[i], PI + (end - PI) * x)?;
            let along = loads[i] * point.by_load_m_per_n + point.by_twist_m_per_rad * x * end_by_u;
            Ok((point.gap_m, (end - PI) * point.by_twist_m_per_rad, along))
        })?;
        let no_torque = Grid { cells: 0, nodes: Vec::new() };
        let [open_torque, twisted_torque] = [no_torque.clone(), no_torque];
        let mut surface =
            Self { u_min, u_step, max_load_n, ends, hard_stops, open, twisted, open_torque, twisted_torque };
        surface.open_torque = surface.torques(OPEN_CELLS, &loads, |_| (0.0, OPEN_END_RAD, 0.0));
        surface.twisted_torque =
            surface.torques(twisted_cells, &loads, |i| (PI, surface.ends[i].0 - PI, surface.ends[i].1));
        Ok(surface)
    }

    /// Maximum load of the surface, N.
    pub fn max_load_n(&self) -> f64 {
        self.max_load_n
    }

    /// Last twist with an equilibrium at a load, rad.
    pub fn last_twist_rad(&self, load_n: f64) -> f64 {
        self.end(self.u(load_n)).0
    }

    /// Twist at which the motor meets the wall of fully closed strings at a load, rad.
    pub fn hard_stop_rad(&self, load_n: f64) -> f64 {
        let (i, t) = self.cell(self.u(load_n));
        self.hard_stops[i] + t * (self.hard_stops[i + 1] - self.hard_stops[i])
    }

    /// Gap and slopes at a twist of either sign and a load within the surface (clamped to it).
    pub fn gap(&self, twist_rad: f64, load_n: f64) -> GapPoint {
        let u = self.u(load_n);
        let (gap_m, by_twist_m_per_rad, by_u_m) = self.gap_at(twist_rad, u);
        GapPoint { gap_m, by_twist_m_per_rad, by_load_m_per_n: by_u_m / u.exp() }
    }

    /// Gap (m) and its slopes by the twist (m/rad) and by u = ln F (m), at a twist of either sign.
    fn gap_at(&self, twist_rad: f64, u: f64) -> (f64, f64, f64) {
        let twist = twist_rad.abs();
        let sign = if twist_rad < 0.0 { -1.0 } else { 1.0 };
        let (i, t) = self.cell(u);
        if twist < PI {
            let (gap, by_x, by_u) = self.open.at(i, t, self.u_step, twist / PI);
            return (gap, sign * by_x / PI, by_u);
        }
        let (end, end_by_u) = self.end(u);
        let x = (twist - PI) / (end - PI);
        let (gap, by_x, by_u) = self.twisted.at(i, t, self.u_step, x.min(1.0));
        let by_twist = by_x / (end - PI);
        let over = (twist - end).clamp(0.0, RUN_ON_RAD);
        (gap + by_twist * over, sign * by_twist, by_u - by_twist * x.min(1.0) * end_by_u)
    }

    /// The inverse: the force at a twist and a gap. `near_n` is a guess, the force a step ago.
    pub fn pull(&self, twist_rad: f64, gap_m: f64, near_n: f64) -> Pull {
        // Newton in u = ln F inside a bracket that shrinks: the gap rises with the load.
        let (mut low, mut high) = (self.u_min, self.u_min + self.u_step * LOAD_CELLS as f64);
        let mut u = self.u(near_n);
        let mut point = self.gap_at(twist_rad, u);
        let mut is_inside = false;
        for _ in 0..60 {
            let (here_m, _, by_u_m) = point;
            let miss = here_m - gap_m;
            if miss.abs() < 1e-12 {
                break;
            }
            if miss > 0.0 {
                high = u
            } else {
                low = u
            }
            let newton = u - miss / by_u_m;
            u = if newton > low && newton < high {
                newton
            } else {
                if !is_inside && let Some(pull) = self.pull_outside(twist_rad, gap_m) {
                    return pull;
                }
                is_inside = true;
                0.5 * (low + high)
            };
            point = self.gap_at(twist_rad, u);
        }
        let (_, by_twist_m_per_rad, by_u_m) = point;
        let force_n = u.exp();
        Pull { force_n, stiffness_n_per_m: force_n / by_u_m, by_twist_m_per_rad }
    }

    /// The force at a gap that no load of the surface has.
    fn pull_outside(&self, twist_rad: f64, gap_m: f64) -> Option<Pull> {
        let min = self.gap(twist_rad, SLACK_LOAD_N);
        if gap_m <= min.gap_m {
            // Slack: falls to zero over as much gap as its slope at 0.3 N asks for.
            let stiffness = 1.0 / min.by_load_m_per_n;
            let force_n = SLACK_LOAD_N - (min.gap_m - gap_m) * stiffness;
            if force_n <= 0.0 {
                return Some(Pull { by_twist_m_per_rad: min.by_twist_m_per_rad, ..Pull::default() });
            }
            return Some(Pull { force_n, stiffness_n_per_m: stiffness, by_twist_m_per_rad: min.by_twist_m_per_rad });
        }
        let max = self.gap(twist_rad, self.max_load_n);
        let stiffness = 1.0 / max.by_load_m_per_n;
        (gap_m >= max.gap_m).then_some(Pull {
            force_n: self.max_load_n + (gap_m - max.gap_m) * stiffness,
            stiffness_n_per_m: stiffness,
            by_twist_m_per_rad: max.by_twist_m_per_rad,
        })
    }

    /// Torque of the strings on the shaft at a twist of either sign (rad) and a force (N), N m; negative towards zero twist.
    ///
    /// It conserves energy: with S the elastic energy, dS = F dG − T dθ, so that ∂T/∂F = ∂G/∂θ here, and T is its integral
    /// over the force from zero (docs/explanation/model.md 4).
    pub fn torque_nm(&self, twist_rad: f64, force_n: f64) -> f64 {
        let slope = |load_n: f64| self.gap(twist_rad, load_n).by_twist_m_per_rad;
        if force_n < SLACK_LOAD_N {
            return force_n * slope(SLACK_LOAD_N);
        }
        let u = self.u(force_n);
        let (i, t) = self.cell(u);
        let twist = twist_rad.abs();
        let (nm, ..) = if twist < PI {
            self.open_torque.at(i, t, self.u_step, twist / OPEN_END_RAD)
        } else {
            self.twisted_torque.at(i, t, self.u_step, ((twist - PI) / (self.end(u).0 - PI)).min(1.0))
        };
        let within_nm = nm.copysign(-twist_rad);
        if force_n <= self.max_load_n {
            return within_nm;
        }
        within_nm + (force_n - self.max_load_n) * slope(self.max_load_n)
    }

    /// The torques of one part of the twists, load by load: what the load before has at the same twist, and the integral of ∂G/∂θ
    /// from there. `part(i)` is where the part begins at load i (rad), its width (rad) and the width's derivative by u.
    fn torques(&self, cells: usize, loads: &[f64], part: impl Fn(usize) -> (f64, f64, f64)) -> Grid {
        let rows = cells + 1;
        let x_step = 1.0 / cells as f64;
        let mut grid = Grid { cells, nodes: Vec::with_capacity(loads.len() * rows) };
        for (i, load_n) in loads.iter().enumerate() {
            let (from_rad, width_rad, width_by_u) = part(i);
            let twists = (0..rows).map(|k| from_rad + width_rad * k as f64 * x_step);
            let values: Vec<f64> = twists
                .clone()
                .map(|twist_rad| {
                    let slope = |load_n: f64| load_n * self.gap(twist_rad, load_n).by_twist_m_per_rad;
                    let Some(below) = i.checked_sub(1) else { return slope(*load_n) };
                    let (from_rad, width_rad, _) = part(below);
                    let before = grid.along(below, (twist_rad - from_rad) / width_rad);
                    let gain = |(at, weight): (f64, f64)| weight * slope(loads[below] * (self.u_step * at).exp());
                    before + self.u_step * QUADRATURE.into_iter().map(gain).sum::<f64>()
                })
                .collect();
            let by_x = differences(&values, x_step);
            for (k, ((value, by_x), twist_rad)) in values.into_iter().zip(by_x).zip(twists).enumerate() {
                let at_twist = load_n * self.gap(twist_rad, *load_n).by_twist_m_per_rad;
                let by_u = at_twist + by_x / width_rad * width_by_u * k as f64 * x_step;
                grid.nodes.push(Node { value, by_x, by_u, by_xu: 0.0 });
            }
        }
        grid.cross(loads.len(), self.u_step);
        grid
    }

    fn u(&self, load_n: f64) -> f64 {
        load_n.clamp(SLACK_LOAD_N, self.max_load_n).ln()
    }

    fn cell(&self, u: f64) -> (usize, f64) {
        let at = ((u - self.u_min) / self.u_step).clamp(0.0, LOAD_CELLS as f64);
        let i = (at as usize).min(LOAD_CELLS - 1);
        (i, at - i as f64)
    }

    /// The last twist and its slope by u, as a cubic through the loads of the grid.
    fn end(&self, u: f64) -> (f64, f64) {
        let (i, t) = self.cell(u);
        let [value, slope] = hermite(t);
        let ((a, da), (b, db)) = (self.ends[i], self.ends[i + 1]);
        let mix = |w: [f64; 4]| w[0] * a + w[1] * b + (w[2] * da + w[3] * db) * self.u_step;
        (mix(value), mix(slope) / self.u_step)
    }
}

impl Grid {
    /// `sample(i, x)` is the gap and its slopes by x and u at load `i`.
    fn new(
        cells: usize,
        loads: &[f64],
        u_step: f64,
        sample: impl Fn(usize, f64) -> Result<(f64, f64, f64), NoSurface>,
    ) -> Result<Self, NoSurface> {
        let rows = cells + 1;
        let mut nodes = Vec::with_capacity(loads.len() * rows);
        for i in 0..loads.len() {
            for k in 0..rows {
                let (gap, by_x, by_u) = sample(i, k as f64 / cells as f64)?;
                nodes.push(Node { value: gap, by_x, by_u, by_xu: 0.0 });
            }
        }
        let mut grid = Self { cells, nodes };
        grid.cross(loads.len(), u_step);
        Ok(grid)
    }

    /// Sets the cross derivatives, from the slopes by x at each of so many loads.
    fn cross(&mut self, loads: usize, u_step: f64) {
        let rows = self.cells + 1;
        for k in 0..rows {
            let slopes: Vec<f64> = (0..loads).map(|i| self.nodes[i * rows + k].by_x).collect();
            for (i, slope) in differences(&slopes, u_step).into_iter().enumerate() {
                self.nodes[i * rows + k].by_xu = slope;
            }
        }
    }

    /// The value at load `i` and x; straight on beyond the ends.
    fn along(&self, i: usize, x: f64) -> f64 {
        let at = (x * self.cells as f64).clamp(0.0, self.cells as f64);
        let k = (at as usize).min(self.cells - 1);
        let x_step = 1.0 / self.cells as f64;
        let [value, slope] = hermite(at - k as f64);
        let [a, b] = [0, 1].map(|dx| self.nodes[i * (self.cells + 1) + k + dx]);
        let mix = |w: [f64; 4]| w[0] * a.value + w[1] * b.value + (w[2] * a.by_x + w[3] * b.by_x) * x_step;
        mix(value) + mix(slope) * (x * self.cells as f64 - at)
    }

    /// Gap and slopes in load cell `i` at fraction `t`, at x.
    fn at(&self, i: usize, t: f64, u_step: f64, x: f64) -> (f64, f64, f64) {
        let at = (x * self.cells as f64).clamp(0.0, self.cells as f64);
        let k = (at as usize).min(self.cells - 1);
        let x_step = 1.0 / self.cells as f64;
        let [x_value, x_slope] = hermite(at - k as f64);
        let [u_value, u_slope] = hermite(t);
        let rows = self.cells + 1;
        let corner = |du: usize, dx: usize| &self.nodes[(i + du) * rows + k + dx];
        let (mut gap, mut by_x, mut by_u) = (0.0, 0.0, 0.0);
        for (du, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let node = corner(du, dx);
            // Along x at this end of u: the value, and the slope by u.
            let along = |w: &[f64; 4], value: f64, slope: f64| w[dx] * value + w[2 + dx] * slope * x_step;
            let value = along(&x_value, node.value, node.by_x);
            let value_by_u = along(&x_value, node.by_u, node.by_xu);
            let slope = along(&x_slope, node.value, node.by_x);
            let slope_by_u = along(&x_slope, node.by_u, node.by_xu);
            gap += u_value[du] * value + u_value[2 + du] * value_by_u * u_step;
            by_x += u_value[du] * slope + u_value[2 + du] * slope_by_u * u_step;
            by_u += u_slope[du] * value + u_slope[2 + du] * value_by_u * u_step;
        }
        (gap, by_x / x_step, by_u / u_step)
    }
}

/// Weights of the values at both ends and the slopes at both ends, and their derivatives.
fn hermite(t: f64) -> [[f64; 4]; 2] {
    let (s, t2) = (1.0 - t, t * t);
    [
        [(1.0 + 2.0 * t) * s * s, t2 * (3.0 - 2.0 * t), t * s * s, -t2 * s],
        [-6.0 * t * s, 6.0 * t * s, s * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)],
    ]
}

/// Slopes of equally spaced values: fourth order inside, second at the ends.
fn differences(values: &[f64], step: f64) -> Vec<f64> {
    let n = values.len();
    (0..n)
        .map(|i| {
            let v = |k: usize| values[k];
            let difference = if i >= 2 && i + 2 < n {
                (v(i - 2) - v(i + 2) + 8.0 * (v(i + 1) - v(i - 1))) / 12.0
            } else if i >= 1 && i + 1 < n {
                0.5 * (v(i + 1) - v(i - 1))
            } else if i == 0 {
                -1.5 * v(0) + 2.0 * v(1) - 0.5 * v(2)
            } else {
                1.5 * v(n - 1) - 2.0 * v(n - 2) + 0.5 * v(n - 3)
            };
            difference / step
        })
        .collect()
}

/// The last twist, at most `max_twist_rad`, up to which every twist has an equilibrium that is not about to run away.
fn last_twist(
    exact: &impl Fn(f64, f64) -> Option<GapPoint>,
    load_n: f64,
    max_twist_rad: f64,
) -> Result<f64, NoSurface> {
    let exists = |twist: f64| exact(twist, load_n).is_some_and(|point| point.by_twist_m_per_rad >= -STEEPEST_M_PER_RAD);
    let mut low = PI;
    if !exists(low) {
        return Err(NoSurface { load_n, twist_rad: low });
    }
    let mut high = low;
    while high < max_twist_rad {
        high = (high + 1.0).min(max_twist_rad);
        if !exists(high) {
            break;
        }
        low = high;
    }
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if exists(middle) { low = middle } else { high = middle }
    }
    if low < PI + 1.0 {
        return Err(NoSurface { load_n, twist_rad: PI + 1.0 });
    }
    Ok(low)
}
