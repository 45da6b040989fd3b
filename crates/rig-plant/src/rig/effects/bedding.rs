//! New strings bed in: their radius falls over the first cycles of twisting.

use crate::effects::{BEDDING_CYCLES as CYCLES, TURNS_PER_CYCLE};
use std::f64::consts::TAU;

/// Share of the new strings' radius that is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bedding {
    /// Share of the radius that is lost in the end.
    share: f64,
    turned_rad: f64,
    last_rad: f64,
}

impl Bedding {
    /// New strings, twisted to an angle (rad), that lose a share of their radius in the end.
    pub fn new(share: f64, twist_rad: f64) -> Self {
        Self { share, turned_rad: 0.0, last_rad: twist_rad }
    }

    /// Takes the twist (rad) to a new value and returns the radius as a share of the new one.
    pub fn step(&mut self, twist_rad: f64) -> f64 {
        self.turned_rad += (twist_rad - self.last_rad).abs();
        self.last_rad = twist_rad;
        let cycles = self.turned_rad / (TURNS_PER_CYCLE * TAU);
        1.0 + self.share * (-cycles / CYCLES).exp_m1()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_radius_falls_over_twenty_cycles_and_never_rises() {
        let mut bedding = Bedding::new(0.05, 0.0);
        let cycle = |bedding: &mut Bedding| {
            bedding.step(7.5 * TAU);
            bedding.step(0.0)
        };
        let first = cycle(&mut bedding);
        assert!((first - (1.0 - 0.05 * (1.0 - (-0.05f64).exp()))).abs() < 1e-12, "{first}");
        let mut last = first;
        for _ in 1..20 {
            let now = cycle(&mut bedding);
            assert!(now < last);
            last = now;
        }
        assert!((last - (1.0 - 0.05 * (1.0 - (-1f64).exp()))).abs() < 1e-12, "{last}");
        assert!((0..1000).map(|_| cycle(&mut bedding)).last().unwrap() > 0.95 - 1e-9);
    }

    #[test]
    fn a_shaft_that_stands_changes_nothing() {
        let mut bedding = Bedding::new(0.05, 4.0);
        assert_eq!((bedding.step(4.0), bedding.step(4.0)), (1.0, 1.0));
    }
}
