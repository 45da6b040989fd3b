//! Gauss–Legendre nodes on (0, 1).

use crate::math::sin_cos;

/// Most nodes a rule can have.
pub(crate) const MAX_NODES: usize = 64;

/// Nodes and weights on (0, 1).
#[derive(Clone, Debug)]
pub(crate) struct Rule {
    count: usize,
    nodes: [f64; MAX_NODES],
    weights: [f64; MAX_NODES],
}

impl Rule {
    /// The rule of `count` nodes (1 to [`MAX_NODES`]), by Newton's method on the Legendre polynomial.
    pub(crate) fn new(count: usize) -> Self {
        let n = count.clamp(1, MAX_NODES);
        let (mut nodes, mut weights) = ([0.0; MAX_NODES], [0.0; MAX_NODES]);
        for i in 0..n {
            let (_, mut x) = sin_cos(core::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5));
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut p, mut previous) = (1.0, 0.0);
                for k in 0..n {
                    let k = k as f64;
                    (p, previous) = (((2.0 * k + 1.0) * x * p - k * previous) / (k + 1.0), p);
                }
                slope = n as f64 * (x * p - previous) / (x * x - 1.0);
                let step = p / slope;
                x -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            nodes[i] = 0.5 * (1.0 - x);
            weights[i] = 1.0 / ((1.0 - x * x) * slope * slope);
        }
        Self { count: n, nodes, weights }
    }

    /// Pairs of node and weight, nodes ascending.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.nodes[..self.count].iter().copied().zip(self.weights[..self.count].iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrates_polynomials_up_to_twice_its_order() {
        for n in [1, 2, 5, 8, 16, 24, 64] {
            let rule = Rule::new(n);
            for power in 0..(2 * n).min(40) {
                let sum: f64 = rule.iter().map(|(t, w)| w * t.powi(power as i32)).sum();
                assert!((sum - 1.0 / (power as f64 + 1.0)).abs() < 1e-14, "{n} nodes, power {power}: {sum}");
            }
        }
    }
}
