//! Medians of many passes: other load on the machine disturbs some of them, but not most.

use crate::grid::Grid;
use serde::Serialize;
use std::hint::black_box;
use std::time::{Duration, Instant};
use tsa_model::{Equilibrium, SolveError};

/// Longest time for one row; a slow row gets fewer passes, but at least three.
const LONGEST: Duration = Duration::from_secs(6);
const FEWEST: usize = 3;

/// Cost of a grid.
#[derive(Serialize)]
pub struct Cost {
    /// States in the grid.
    pub states: usize,
    /// States without a solution.
    pub failed: usize,
    /// Passes over the grid.
    pub passes: usize,
    /// Median time of a pass (s).
    pub seconds: f64,
    /// The same per state (µs).
    pub us: f64,
    /// Largest scaled residual of the method's own equations.
    pub max_residual: f64,
    /// Steps of the outermost iteration, mean over the states that were solved.
    pub mean_iterations: f64,
    /// Evaluations of a section or a right-hand side, mean over the states that were solved.
    pub mean_evaluations: f64,
}

/// Solves the grid `repeats` times.
pub fn cost(grid: &Grid, repeats: usize, solve: impl Fn(f64, f64) -> Result<Equilibrium, SolveError>) -> Cost {
    let states = grid.states();
    let found: Vec<Equilibrium> = states.iter().filter_map(|&(load, twist)| solve(load, twist).ok()).collect();
    let mean = |count: fn(&Equilibrium) -> u32| {
        found.iter().map(|e| f64::from(count(e))).sum::<f64>() / found.len().max(1) as f64
    };
    let (seconds, passes) = median(repeats, || {
        for &(load, twist) in &states {
            let _ = black_box(solve(black_box(load), black_box(twist)));
        }
    });
    Cost {
        states: states.len(),
        failed: states.len() - found.len(),
        passes,
        seconds,
        us: seconds * 1e6 / states.len() as f64,
        max_residual: found.iter().map(|e| e.residual).fold(0.0, f64::max),
        mean_iterations: mean(|e| e.iterations),
        mean_evaluations: mean(|e| e.evaluations),
    }
}

/// Median over `states` of the time that solving one takes (µs).
pub fn typical_us<S: Copy>(states: &[S], solve: impl Fn(S)) -> f64 {
    // A single solution takes little more than the clock's resolution.
    const ROUNDS: usize = 50;
    let each = |&state: &S| {
        let (seconds, _) = median(25, || (0..ROUNDS).for_each(|_| solve(black_box(state))));
        seconds * 1e6 / ROUNDS as f64
    };
    middle(states.iter().map(each).collect())
}

/// Median time of a pass (s), and of how many.
fn median(repeats: usize, pass: impl Fn()) -> (f64, usize) {
    let mut times = Vec::with_capacity(repeats);
    let start = Instant::now();
    while times.len() < FEWEST || (times.len() < repeats && start.elapsed() < LONGEST) {
        let before = Instant::now();
        pass();
        times.push(before.elapsed().as_secs_f64());
    }
    let passes = times.len();
    (middle(times), passes)
}

/// The middle one of an odd number of values, the upper of the two middle ones of an even number.
fn middle(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
