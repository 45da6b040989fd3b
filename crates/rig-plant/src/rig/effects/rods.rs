//! Stress in the rods beyond their law, as a force on the load: what they remember, and what warmth adds.
//!
//! At a gap and a twist the rods have a shape, whatever their stress. A stress that is greater by the fraction s everywhere
//! bends them as an s greater modulus E would, so that the mechanism carries at that gap the additional force
//! −(∂G/∂ln E)/(∂G/∂F) s. The fraction is taken at the clamp, where the strain is largest: s = Δσ/σ(ε). A force that
//! depends on the gap alone, or lags behind it as [`RodMemory`] does, creates no energy. All of it is first order in s.

use super::{ROD_STRESS_PER_K, ROD_THRESHOLDS, rod_onset};
use crate::rig::surface::{SLACK_LOAD_N, Surface};
use tsa_model::scalar::{Dual, Scalar};
use tsa_model::{Material, Mechanism, Parameters};

/// The strings cannot push: the load never loses more than this fraction of the force that the law gives.
const MAX_LOST: f64 = 0.9;
/// Loads that differ by less than this fraction are the same.
const SAME_LOAD: f64 = 1e-13;
/// Cells of the table along ln F and along the twist.
const CELLS: usize = 24;
/// Fraction of the last twist up to which the table reaches: nearer to it the slopes grow without a bound.
const REACH: f64 = 0.98;

/// The rods at a load and a twist.
#[derive(Clone, Copy, Debug, PartialEq)]
struct RodPoint {
    /// Bending strain at the clamp.
    strain: f64,
    /// ∂ε/∂F at constant twist, 1/N.
    strain_by_load: f64,
    /// Force on the load for each Pa of additional stress at the clamp, N/Pa.
    force_by_stress: f64,
}

/// [`RodPoint`]s over ln F and the fraction of the last twist.
#[derive(Clone, Debug)]
struct RodTable {
    u_min: f64,
    u_step: f64,
    reach_rad: Vec<f64>,
    /// ln ε and the force for each Pa.
    nodes: Vec<[f64; 2]>,
}

impl RodTable {
    /// Samples a mechanism over the loads of its surface; `None` where its rods do not bend.
    fn new(mechanism: &Mechanism, surface: &Surface) -> Option<Self> {
        if mechanism.is_rigid() {
            return None;
        }
        let material = Material { stress_coefficients_pa: mechanism.parameters().stress_coefficients_pa };
        let mut parameters = Parameters::<Dual<1>>::constant(mechanism.parameters());
        let modulus = Dual::parameter(1.0, 0);
        parameters.stress_coefficients_pa = parameters.stress_coefficients_pa.map(|a| a * modulus);
        let by_modulus = Mechanism::of(parameters);
        let u_min = SLACK_LOAD_N.ln();
        let u_step = (surface.max_load_n().ln() - u_min) / CELLS as f64;
        let loads: Vec<f64> = (0..=CELLS).map(|i| (u_min + u_step * i as f64).exp()).collect();
        let reach_rad: Vec<f64> = loads.iter().map(|load| REACH * surface.last_twist_rad(*load)).collect();
        let mut nodes: Vec<[f64; 2]> = Vec::with_capacity((CELLS + 1) * (CELLS + 1));
        for (load, reach) in loads.iter().zip(&reach_rad) {
            for k in 0..=CELLS {
                let solved = by_modulus.solve(*load, reach * k as f64 / CELLS as f64).ok();
                let node = solved.map(|e| {
                    let strain = e.bending_strain.value();
                    let fraction = -e.gap_m.by[0] / (e.dgap_dload_m_per_n.value() * material.stress_pa(strain));
                    [strain.ln(), fraction]
                });
                // A twist that is not reached is as the one before it.
                nodes.push(node.filter(|n| n.iter().all(|x| x.is_finite())).or(nodes.last().copied())?);
            }
        }
        Some(Self { u_min, u_step, reach_rad, nodes })
    }

    fn at(&self, load_n: f64, twist_rad: f64) -> RodPoint {
        let min = self.u_min.exp();
        let place = |x: f64| {
            let x = x.clamp(0.0, CELLS as f64);
            let i = (x as usize).min(CELLS - 1);
            (i, x - i as f64)
        };
        let (i, t) = place((load_n.max(min).ln() - self.u_min) / self.u_step);
        let reach = self.reach_rad[i] + t * (self.reach_rad[i + 1] - self.reach_rad[i]);
        let (k, s) = place(twist_rad.abs() / reach * CELLS as f64);
        let node = |di: usize, dk: usize| self.nodes[(i + di) * (CELLS + 1) + k + dk];
        let along = |di: usize, which: usize| node(di, 0)[which] * (1.0 - s) + node(di, 1)[which] * s;
        let [low, high] = [along(0, 0), along(1, 0)];
        // Slack strings bend nothing: below the table both fall to zero with the load.
        let slack = (load_n / min).clamp(0.0, 1.0);
        let strain = slack * (low + t * (high - low)).exp();
        let by_log = if slack < 1.0 { 1.0 } else { (high - low) / self.u_step };
        RodPoint {
            strain,
            strain_by_load: strain * by_log / load_n.max(1e-9),
            force_by_stress: slack * (along(0, 1) * (1.0 - t) + along(1, 1) * t),
        }
    }
}

/// What the rods' additional stress does to the load.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RodForce {
    /// N.
    pub force_n: f64,
    /// Slope by the gap at constant twist, N/m.
    pub stiffness_n_per_m: f64,
}

/// The rods of a mechanism.
#[derive(Clone, Debug)]
pub struct Rods {
    table: RodTable,
    memory: RodMemory,
}

impl Rods {
    /// Straight rods that remember with a half width in Pa; `None` where the mechanism's rods do not bend.
    pub fn new(mechanism: &Mechanism, surface: &Surface, half_width_pa: f64) -> Option<Self> {
        let table = RodTable::new(mechanism, surface)?;
        Some(Self { table, memory: RodMemory::new(half_width_pa, 0.0) })
    }

    /// Brings the rods to where their law carries a load (N) at a twist (rad), `temperature_k` from the calibration.
    /// `stiffness_n_per_m` is the law's own.
    pub fn step(&mut self, law_n: f64, stiffness_n_per_m: f64, twist_rad: f64, temperature_k: f64) -> RodForce {
        let point = self.table.at(law_n, twist_rad);
        let force_n = force(&point, &mut self.memory, law_n, temperature_k);
        let slope = self.memory.stiffness_pa() + thermal_stress(point.strain, temperature_k).1;
        RodForce {
            force_n,
            stiffness_n_per_m: point.force_by_stress * slope * point.strain_by_load * stiffness_n_per_m,
        }
    }

    /// What their law carries at a twist (rad) when they carry a weight (N) in all, if they went there from where they
    /// are; N.
    pub fn law_under(&self, weight_n: f64, twist_rad: f64, temperature_k: f64) -> f64 {
        let excess_n = |law_n: f64| {
            let mut memory = self.memory;
            law_n + force(&self.table.at(law_n, twist_rad), &mut memory, law_n, temperature_k) - weight_n
        };
        // False position; the end that stays counts half (Illinois), so that both come nearer.
        let (mut fixed, mut last) = (0.0, weight_n / (1.0 - MAX_LOST));
        let (mut fixed_n, mut last_n) = (-weight_n, excess_n(last));
        for _ in 0..50 {
            if last_n.abs() <= SAME_LOAD * weight_n {
                break;
            }
            let next = last - last_n * (last - fixed) / (last_n - fixed_n);
            let next_n = excess_n(next);
            if next_n * last_n > 0.0 {
                fixed_n *= 0.5;
            } else {
                (fixed, fixed_n) = (last, last_n);
            }
            (last, last_n) = (next, next_n);
        }
        last
    }
}

/// Force of the additional stress where the law carries a load (N).
fn force(point: &RodPoint, memory: &mut RodMemory, law_n: f64, temperature_k: f64) -> f64 {
    let stress_pa = memory.step(point.strain) + thermal_stress(point.strain, temperature_k).0;
    (point.force_by_stress * stress_pa).max(-MAX_LOST * law_n)
}

/// Stress that a temperature adds at a strain, Pa, and its slope by the strain, Pa: none before the transformation
/// begins.
fn thermal_stress(strain: f64, temperature_k: f64) -> (f64, f64) {
    let full = ROD_STRESS_PER_K * temperature_k;
    let [fraction, slope] = rod_onset(strain);
    (full * fraction, full * slope)
}

/// Extra stress of rods that remember: it is not the same on the way up and down. It follows the strain at the clamp by
/// Prandtl–Ishlinskii: a sum of stop operators, each an elastic element in series with a slider. Under a growing strain the
/// sum reaches the half width of the loop, and after the strain has turned by twice the thresholds it reaches minus that. A
/// sweep of the twist changes the strain by less than the thresholds, so that only a change of the load shows the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RodMemory {
    /// Half width of the loop, Pa.
    half_width_pa: f64,
    strain: f64,
    /// Elastic strain in each element.
    elastic: [f64; ROD_THRESHOLDS.len()],
}

impl RodMemory {
    /// Rods that were bent once from straight to a strain. The half width of the loop is in Pa.
    pub fn new(half_width_pa: f64, strain: f64) -> Self {
        let mut memory = Self { half_width_pa, strain: 0.0, elastic: [0.0; ROD_THRESHOLDS.len()] };
        memory.step(strain);
        memory
    }

    /// Takes the strain at the clamp to a new value and returns the extra stress, Pa.
    pub fn step(&mut self, strain: f64) -> f64 {
        let change = strain - self.strain;
        self.strain = strain;
        for (elastic, threshold) in self.elastic.iter_mut().zip(ROD_THRESHOLDS) {
            *elastic = (*elastic + change).clamp(-threshold, threshold);
        }
        self.stress_pa()
    }

    /// Slope of the extra stress by the strain, Pa: that of the elements that do not slip.
    pub fn stiffness_pa(&self) -> f64 {
        let slopes = self.elastic.iter().zip(ROD_THRESHOLDS).map(|(e, t)| if e.abs() < t { 1.0 / t } else { 0.0 });
        self.half_width_pa * slopes.sum::<f64>() / ROD_THRESHOLDS.len() as f64
    }

    /// The extra stress now, Pa.
    pub fn stress_pa(&self) -> f64 {
        let fractions = self.elastic.iter().zip(ROD_THRESHOLDS).map(|(elastic, threshold)| elastic / threshold);
        self.half_width_pa * fractions.sum::<f64>() / ROD_THRESHOLDS.len() as f64
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
                let fraction = f64::from(if k <= 1000 { k } else { 2000 - k }) * 1e-3;
                let strain = 0.05 - turn * fraction;
                let before = memory.stress_pa();
                let after = memory.step(strain);
                energy += 0.5 * (before + after) * (strain - last);
                last = strain;
            }
            energy
        };
        assert!(lost(0.007).abs() < 1.0, "{}: what a sweep of the twist adds", lost(0.007));
        // The area of the loop: for each slider 4 x stress x (half the sweep less its threshold).
        let expected: f64 = ROD_THRESHOLDS.iter().map(|t| 4.0 * 20e6 * (0.015 - t)).sum();
        assert!((lost(0.03) / expected - 1.0).abs() < 1e-3, "{} and {expected} J/m3", lost(0.03));
    }
}
