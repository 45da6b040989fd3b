//! Gauss–Legendre rules for even integrands on (0, 1), made at compile time.
//!
//! The positive half of a rule of 2n nodes on (−1, 1): n evaluations integrate even polynomials up to degree 4n − 2.

/// Maximum nodes a rule can have.
pub const MAX_NODES: usize = 96;

/// Nodes and weights on (0, 1), nodes ascending.
#[derive(Clone, Debug)]
pub(crate) struct Rule {
    count: usize,
    nodes: [f64; MAX_NODES],
    weights: [f64; MAX_NODES],
}

/// cos x for 0 ≤ x ≤ π/2, accurate enough as a start for Newton's method.
const fn cosine(x: f64) -> f64 {
    let (mut sum, mut term, mut k) = (1.0, 1.0, 0.0);
    while k < 20.0 {
        term *= -x * x / ((k + 1.0) * (k + 2.0));
        sum += term;
        k += 2.0;
    }
    sum
}

impl Rule {
    /// The rule of `count` nodes, 1 to [`MAX_NODES`], by Newton's method on the Legendre polynomial of degree 2n.
    pub(crate) const fn new(count: usize) -> Self {
        let n = if count < 1 {
            1
        } else if count > MAX_NODES {
            MAX_NODES
        } else {
            count
        };
        let degree = 2 * n;
        let (mut nodes, mut weights) = ([0.0; MAX_NODES], [0.0; MAX_NODES]);
        let mut i = 0;
        while i < n {
            let mut x = cosine(core::f64::consts::PI * (i as f64 + 0.75) / (degree as f64 + 0.5));
            let (mut slope, mut tries) = (1.0, 0);
            while tries < 20 {
                let (mut p, mut previous, mut k) = (1.0, 0.0, 0);
                while k < degree {
                    let next = ((2 * k + 1) as f64 * x * p - k as f64 * previous) / (k + 1) as f64;
                    previous = p;
                    p = next;
                    k += 1;
                }
                slope = degree as f64 * (x * p - previous) / (x * x - 1.0);
                let step = p / slope;
                x -= step;
                tries += 1;
                if step < 1e-16 && step > -1e-16 {
                    break;
                }
            }
            nodes[n - 1 - i] = x;
            weights[n - 1 - i] = 2.0 / ((1.0 - x * x) * slope * slope);
            i += 1;
        }
        Self { count: n, nodes, weights }
    }

    /// How many nodes.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Pairs of node and weight, nodes ascending.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.nodes[..self.count].iter().copied().zip(self.weights[..self.count].iter().copied())
    }
}

/// Each rule has twice the nodes of the one before, so that its residual is the error of the one before.
pub(crate) static LEVELS: [Rule; 5] = [Rule::new(6), Rule::new(12), Rule::new(24), Rule::new(48), Rule::new(96)];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrates_even_polynomials_up_to_four_times_its_order() {
        for rule in [1, 2, 5, 8, 16, 40].map(Rule::new).iter().chain(&LEVELS) {
            let n = rule.count();
            for power in (0..=(4 * n - 2).min(60)).step_by(2) {
                let sum: f64 = rule.iter().map(|(t, w)| w * t.powi(power as i32)).sum();
                assert!((sum - 1.0 / (power as f64 + 1.0)).abs() < 2e-15, "{n} nodes, power {power}: {sum}");
            }
        }
    }
}
