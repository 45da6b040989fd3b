//! Superelastic rods remember: their stress is not the same on the way up and down.
//!
//! The extra stress follows the strain at the clamp by Prandtl–Ishlinskii: a sum of stop operators, each an elastic element
//! in series with a slider. Under a growing strain the sum reaches the half width of the loop, and after the strain has
//! turned by twice the thresholds it reaches minus that. A sweep of the twist changes the strain by less than the
//! thresholds, so that only a change of the load shows the loop.

use crate::effects::ROD_THRESHOLDS as THRESHOLDS;

/// Extra stress of the rods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RodMemory {
    /// Half width of the loop, Pa.
    half_width_pa: f64,
    strain: f64,
    /// Elastic strain in each element.
    elastic: [f64; THRESHOLDS.len()],
}

impl RodMemory {
    /// Rods that were bent once from straight to a strain. The half width of the loop is in Pa.
    pub fn new(half_width_pa: f64, strain: f64) -> Self {
        let mut memory = Self { half_width_pa, strain: 0.0, elastic: [0.0; THRESHOLDS.len()] };
        memory.step(strain);
        memory
    }

    /// Takes the strain at the clamp to a new value and returns the extra stress, Pa.
    pub fn step(&mut self, strain: f64) -> f64 {
        let change = strain - self.strain;
        self.strain = strain;
        for (elastic, threshold) in self.elastic.iter_mut().zip(THRESHOLDS) {
            *elastic = (*elastic + change).clamp(-threshold, threshold);
        }
        self.stress_pa()
    }

    /// Slope of the extra stress by the strain, Pa: that of the elements that do not slip.
    pub fn stiffness_pa(&self) -> f64 {
        let slopes = self.elastic.iter().zip(THRESHOLDS).map(|(e, t)| if e.abs() < t { 1.0 / t } else { 0.0 });
        self.half_width_pa * slopes.sum::<f64>() / THRESHOLDS.len() as f64
    }

    /// The extra stress now, Pa.
    pub fn stress_pa(&self) -> f64 {
        let shares = self.elastic.iter().zip(THRESHOLDS).map(|(elastic, threshold)| elastic / threshold);
        self.half_width_pa * shares.sum::<f64>() / THRESHOLDS.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(memory: &mut RodMemory, from: f64, to: f64) -> f64 {
        (0..=1000).map(|k| memory.step(from + (to - from) * f64::from(k) * 1e-3)).last().unwrap()
    }

    #[test]
    fn the_loop_is_as_wide_as_stated() {
        let mut memory = RodMemory::new(60e6, 0.0);
        assert!((sweep(&mut memory, 0.0, 0.05) - 60e6).abs() < 1.0);
        assert!((sweep(&mut memory, 0.05, 0.03) + 60e6).abs() < 1.0, "120 MPa below the way up");
    }

    #[test]
    fn a_small_loop_is_elastic_and_a_large_one_loses_energy() {
        let lost = |turn: f64| {
            let mut memory = RodMemory::new(60e6, 0.05);
            sweep(&mut memory, 0.05, 0.05 - turn);
            sweep(&mut memory, 0.05 - turn, 0.05);
            // Energy per volume over one closed cycle, J/m³.
            let (mut energy, mut last) = (0.0, 0.05);
            for k in 0..=2000 {
                let share = f64::from(if k <= 1000 { k } else { 2000 - k }) * 1e-3;
                let strain = 0.05 - turn * share;
                let before = memory.stress_pa();
                let after = memory.step(strain);
                energy += 0.5 * (before + after) * (strain - last);
                last = strain;
            }
            energy
        };
        assert!(lost(0.007).abs() < 1.0, "{}: what a sweep of the twist adds", lost(0.007));
        // The area of the loop: for each slider 4 x stress x (half the sweep less its threshold).
        let expected: f64 = THRESHOLDS.iter().map(|t| 4.0 * 20e6 * (0.015 - t)).sum();
        assert!((lost(0.03) / expected - 1.0).abs() < 1e-3, "{} and {expected} J/m3", lost(0.03));
    }

    #[test]
    fn without_a_width_there_is_no_stress() {
        let mut memory = RodMemory::new(0.0, 0.02);
        assert_eq!(memory.step(0.05), 0.0);
    }
}
