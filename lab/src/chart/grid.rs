//! The states of a map, and the map as a panel.

use rigctl::plot::{Axis, Item, Panel, Pen, RGBColor};

/// Loads (N) in equal ratios and turns in equal steps: the middles of the map's cells.
#[derive(Debug, Clone)]
pub struct Grid {
    /// Loads (N), rising.
    pub load_n: Vec<f64>,
    /// Turns past the half-turn pre-twist, rising.
    pub turns: Vec<f64>,
    /// Minimum and maximum load (N) of the whole.
    pub load_range_n: [f64; 2],
    /// Minimum and maximum turns of the whole.
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

    /// Every state, turns slowest.
    pub fn states(&self) -> Vec<(f64, f64)> {
        self.turns.iter().flat_map(|&turns| self.load_n.iter().map(move |&load| (load, turns))).collect()
    }

    /// Where cell `i` of the turns and cell `j` of the loads begin.
    fn corner(&self, i: usize, j: usize) -> (f64, f64) {
        let part = |k: usize, count: usize| k as f64 / count as f64;
        let ([f0, f1], [t0, t1]) = (self.load_range_n, self.turn_range);
        let turns = t0 + (t1 - t0) * part(i, self.turns.len());
        (turns, f0 * (f1 / f0).powf(part(j, self.load_n.len())))
    }

    /// The map of a colour for each of [`Self::states`]; neighbours of one load with the same colour are one rectangle.
    pub fn panel(&self, title: impl Into<String>, colour: impl Fn(usize) -> RGBColor) -> Panel {
        let (loads, twists) = (self.load_n.len(), self.turns.len());
        let mut items = Vec::new();
        for j in 0..loads {
            let mut from = 0;
            for i in 1..=twists {
                let here = colour(from * loads + j);
                if i == twists || colour(i * loads + j) != here {
                    items.push(Item::Fill { from: self.corner(from, j), to: self.corner(i, j + 1), colour: here });
                    from = i;
                }
            }
        }
        let x = Axis::linear("turns past the pre-twist", self.turn_range).tight(self.turn_range);
        let ticks = [0.5, 1.0, 2.0, 5.0, 10.0].map(|load| (load, load.to_string()));
        let y = Axis::log("load, N", self.load_range_n).ticked(ticks).tight(self.load_range_n);
        Panel::new(title, x, y, items)
    }

    /// The edges of cells where [`Self::states`] that are inside meet others; not where a state is neither.
    pub fn edges(&self, inside: &[Option<bool>], pen: Pen) -> Vec<Item> {
        let loads = self.load_n.len();
        let differ = |a: usize, b: usize| inside[a].zip(inside[b]).is_some_and(|(a, b)| a != b);
        let mut items = Vec::new();
        for (k, (i, j)) in (0..inside.len()).map(|k| (k, (k / loads, k % loads))) {
            if i > 0 && differ(k, k - loads) {
                items.push(Item::line([self.corner(i, j), self.corner(i, j + 1)], pen));
            }
            if j > 0 && differ(k, k - 1) {
                items.push(Item::line([self.corner(i, j), self.corner(i + 1, j)], pen));
            }
        }
        items
    }
}
