//! The least time in which a load that hangs by elastic strings can be brought to rest at its place, by whatever control.
//!
//! In the load's coordinates (docs/explanation/control.md 1) the strings set where the load would rest, q, by the speed
//! u, which the motor limits with its change; the load oscillates about it, p'' = ω² (q − p) − d p'. With u constant in
//! each tick everything is linear in the u of the ticks, and whether the load can be at rest after the given number of ticks is a
//! linear programme. Coulomb friction is left out: it calms an oscillation as well, so that a light load may be faster than
//! this.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

/// A tick (s).
const TICK_S: f64 = 0.01;
/// Steps of the integration in a tick.
const STEPS: u8 = 5;
/// Longest time that is tried (ticks).
const LONGEST: usize = 400;

/// The load on its strings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillation {
    /// ω (rad/s).
    pub frequency: f64,
    /// d (1/s).
    pub damping_per_s: f64,
    /// Maximum speed of q (m/s).
    pub speed_m_per_s: f64,
    /// Maximum change of it (m/s²).
    pub acceleration_m_per_s2: f64,
}

/// A bound of a linear programme: factors of the variables by their numbers, and between which values their sum lies: a middle
/// and a width.
type Row = (Vec<(usize, f64)>, f64, f64);

/// p, p', q.
type State = [f64; 3];

impl Oscillation {
    /// A tick later, with q moving evenly: classical Runge-Kutta.
    fn after_a_tick(&self, state: State, u: f64) -> State {
        let slope = |[p, v, q]: State| [v, self.frequency * self.frequency * (q - p) - self.damping_per_s * v, u];
        let along = |[p, v, q]: State, [dp, dv, dq]: State, h: f64| [p + h * dp, v + h * dv, q + h * dq];
        let h = TICK_S / f64::from(STEPS);
        (0..STEPS).fold(state, |state, _| {
            let first = slope(state);
            let second = slope(along(state, first, 0.5 * h));
            let third = slope(along(state, second, 0.5 * h));
            let fourth = slope(along(state, third, h));
            let mean = [0, 1, 2].map(|k| (first[k] + 2.0 * (second[k] + third[k]) + fourth[k]) / 6.0);
            along(state, mean, h)
        })
    }

    /// Minimum time (s) to come to rest within a distance (m) of 0, from rest at 0 with q that far away (m): a load that has just
    /// changed. `None` where 4 s are not enough.
    pub fn min_time_s(&self, q_m: f64, within_m: f64) -> Option<f64> {
        let (mut low, mut high) = (0, LONGEST);
        if !self.can_rest(q_m, within_m, high) {
            return None;
        }
        while high - low > 1 {
            let middle = (low + high) / 2;
            if self.can_rest(q_m, within_m, middle) { high = middle } else { low = middle }
        }
        Some(TICK_S * high as f64)
    }

    /// Whether it can. The linear programme looks for the least excess by which all bounds have to be widened, in their own
    /// widths: 0 where it can.
    fn can_rest(&self, q_m: f64, within_m: f64, ticks: usize) -> bool {
        let mut rows: Vec<Row> = (0..ticks).map(|k| (vec![(k, 1.0)], 0.0, 1.0)).collect();
        // In units of the maximum speed, so that all numbers are near 1. It begins and ends with none.
        let unit = self.speed_m_per_s;
        let change = self.acceleration_m_per_s2 * TICK_S / unit;
        for k in 0..=ticks {
            let ends = [(k < ticks).then_some((k, 1.0)), k.checked_sub(1).map(|before| (before, -1.0))];
            rows.push((ends.into_iter().flatten().collect(), 0.0, change));
        }
        // What is there at the end: of the beginning, and of each tick's speed.
        let free = (0..ticks).fold([0.0, 0.0, q_m], |state, _| self.after_a_tick(state, 0.0));
        let first = self.after_a_tick([0.0; 3], unit);
        let of_speed: Vec<State> =
            std::iter::successors(Some(first), |state| Some(self.after_a_tick(*state, 0.0))).take(ticks).collect();
        for (k, width) in [within_m, within_m * self.frequency, within_m].into_iter().enumerate() {
            let factors = of_speed.iter().rev().map(|state| state[k]).enumerate();
            rows.push((factors.collect(), -free[k], width));
        }
        excess(ticks, &rows).is_some_and(|excess| excess < 1e-3)
    }
}

/// Minimum excess of rows over their widths.
fn excess(variables: usize, rows: &[Row]) -> Option<f64> {
    // ±(sum − middle)/width − excess ≤ 1, and −excess ≤ 0.
    let (mut at, mut bounds) = ((Vec::new(), Vec::new(), Vec::new()), Vec::new());
    let mut put = |row: usize, column: usize, value: f64| {
        at.0.push(row);
        at.1.push(column);
        at.2.push(value);
    };
    for (factors, middle, width) in rows {
        for sign in [1.0, -1.0] {
            let row = bounds.len();
            factors.iter().for_each(|(column, factor)| put(row, *column, sign * factor / width));
            put(row, variables, -1.0);
            bounds.push(1.0 + sign * middle / width);
        }
    }
    put(bounds.len(), variables, -1.0);
    bounds.push(0.0);
    let (height, width) = (bounds.len(), variables + 1);
    let mut cost = vec![0.0; width];
    cost[variables] = 1.0;
    let matrix = CscMatrix::new_from_triplets(height, width, at.0, at.1, at.2);
    let settings = DefaultSettings { verbose: false, ..DefaultSettings::default() };
    let nothing = CscMatrix::zeros((width, width));
    let cones = [SupportedConeT::NonnegativeConeT(height)];
    let mut solver = DefaultSolver::new(&nothing, &cost, &matrix, &bounds, &cones, settings).ok()?;
    solver.solve();
    matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved).then(|| solver.solution.obj_val)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOFT: Oscillation =
        Oscillation { frequency: 20.0, damping_per_s: 2.0, speed_m_per_s: 0.005, acceleration_m_per_s2: 0.1 };

    #[test]
    fn a_load_needs_the_motors_time_and_that_of_its_swing() {
        // Calmed by itself, it needs the motor's time: 5 mm at 5 mm/s, and 50 ms to get up to that.
        let calm = Oscillation { frequency: 100.0, damping_per_s: 140.0, ..SOFT };
        let stiff = calm.min_time_s(-0.005, 20e-6).unwrap();
        assert!((stiff - 1.05).abs() < 0.04, "{stiff}");
        let soft = SOFT.min_time_s(-0.005, 20e-6).unwrap();
        assert!(soft > stiff + 0.1 && soft < 2.0, "{soft}");
        // A little way is as long as half an oscillation.
        assert!(SOFT.min_time_s(-1e-4, 1e-6).unwrap() > 2.0 / 20.0);
        assert_eq!(SOFT.min_time_s(-0.1, 20e-6), None);
    }

    #[test]
    fn a_tick_is_that_of_the_equation() {
        // Without damping: the distance from q swings freely.
        let oscillation = Oscillation { frequency: 60.0, damping_per_s: 0.0, ..SOFT };
        let ([p, v, q], u) = ([1e-3, -0.02, -2e-3], 0.01);
        let (sin, cos) = (60.0 * TICK_S).sin_cos();
        let (away, speed, later) = (p - q, v - u, q + u * TICK_S);
        let exact = [later + away * cos + speed / 60.0 * sin, u - away * 60.0 * sin + speed * cos, later];
        for (a, b) in oscillation.after_a_tick([p, v, q], u).into_iter().zip(exact) {
            assert!((a - b).abs() < 1e-4 * b.abs(), "{a} {b}");
        }
        let damped = Oscillation { frequency: 1e-3, damping_per_s: 20.0, ..SOFT }.after_a_tick([0.0, 1.0, 0.0], 0.0);
        assert!((damped[1] / (-20.0 * TICK_S).exp() - 1.0).abs() < 1e-6, "{damped:?}");
    }
}
