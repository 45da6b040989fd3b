//! The states of a map: loads and turns.

/// Loads (N) in equal ratios and turns in equal steps: the middles of the map's cells.
#[derive(Debug, Clone)]
pub struct Grid {
    /// Loads (N), rising.
    pub load_n: Vec<f64>,
    /// Turns past the half-turn pre-twist, rising.
    pub turns: Vec<f64>,
    /// Least and greatest load (N) of the whole.
    pub load_range_n: [f64; 2],
    /// Least and greatest turns of the whole.
    pub turn_range: [f64; 2],
}

impl Grid {
    /// Of this many loads and turns between limits.
    pub fn new(load_n: [f64; 2], loads: usize, turns: [f64; 2], twists: usize) -> Self {
        let middle = |k: usize, count: usize| (k as f64 + 0.5) / count as f64;
        Self {
            load_n: (0..loads).map(|k| load_n[0] * (load_n[1] / load_n[0]).powf(middle(k, loads))).collect(),
            turns: (0..twists).map(|k| turns[0] + (turns[1] - turns[0]) * middle(k, twists)).collect(),
            load_range_n: load_n,
            turn_range: turns,
        }
    }

    /// Rectangles over neighbouring cells of one load that `same` calls equal, by their indices in
    /// [`Grid::states`].
    pub fn strips(&self, same: impl Fn(usize, usize) -> bool) -> Vec<Strip> {
        let (loads, twists) = (self.load_n.len(), self.turns.len());
        let [(f0, f1), (t0, t1)] = [self.load_range_n, self.turn_range].map(|r| (r[0], r[1]));
        let load = |k: usize| f0 * (f1 / f0).powf(k as f64 / loads as f64);
        let turn = |k: usize| t0 + (t1 - t0) * k as f64 / twists as f64;
        let mut strips = Vec::new();
        for j in 0..loads {
            let mut from = 0;
            for i in 1..=twists {
                if i == twists || !same(i * loads + j, from * loads + j) {
                    let cell = from * loads + j;
                    strips.push(Strip { cell, from: (turn(from), load(j)), to: (turn(i), load(j + 1)) });
                    from = i;
                }
            }
        }
        strips
    }

    /// Every state, turns slowest.
    pub fn states(&self) -> Vec<(f64, f64)> {
        self.turns.iter().flat_map(|&turns| self.load_n.iter().map(move |&load| (load, turns))).collect()
    }
}

/// Neighbouring equal cells as a rectangle over turns and load (N).
#[derive(Debug, Clone, Copy)]
pub struct Strip {
    /// The first of them.
    pub cell: usize,
    /// Fewest turns, least load.
    pub from: (f64, f64),
    /// Most turns, greatest load.
    pub to: (f64, f64),
}
