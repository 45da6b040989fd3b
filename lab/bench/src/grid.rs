//! Loads and twists at which everything is solved.

use serde::Serialize;
use tsa_model::twist_from_turns;

/// Evenly spaced loads and turns, both ends included.
#[derive(Clone, Copy, Serialize)]
pub struct Grid {
    /// Least and greatest load (N).
    pub load_n: [f64; 2],
    /// Least and greatest number of turns past the half-turn pre-twist.
    pub turns: [f64; 2],
    /// How many loads.
    pub loads: u32,
    /// How many twists.
    pub twists: u32,
}

/// The range of the paper's load sweep (section 4.2), as fine as a table of it would be.
pub const PUBLISHED: Grid = Grid { load_n: [1.0, 17.0], turns: [0.0, 7.5], loads: 64, twists: 128 };

impl Grid {
    /// The same range with other numbers of loads and twists, each at least 2.
    pub fn with(self, loads: u32, twists: u32) -> Self {
        Self { loads, twists, ..self }
    }

    /// Load (N) and twist (rad) of every state.
    pub fn states(&self) -> Vec<(f64, f64)> {
        let at = |[first, last]: [f64; 2], k, count| first + (last - first) * f64::from(k) / f64::from(count - 1);
        let load = |k| at(self.load_n, k, self.loads);
        let twist = |k| twist_from_turns(at(self.turns, k, self.twists));
        (0..self.loads).flat_map(|i| (0..self.twists).map(move |j| (load(i), twist(j)))).collect()
    }
}
