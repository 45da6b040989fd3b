//! The bootstrap of an identification: the chosen law is fitted again to sweeps whose residuals changed places.
//!
//! The residuals of neighbouring rows are alike, because what a law leaves is smooth. They are therefore resampled in blocks
//! of twist (moving blocks: Künsch, "The jackknife and the bootstrap for general stationary observations", 1989), as many in
//! a sweep as the competition holds out in turn. What is expected of the constants beforehand is drawn anew too, from its
//! own spread: otherwise a constant that only the expectation tells would not vary (Bardsley and others,
//! "Randomize-then-optimize", 2014).

use super::compete::{BLOCKS, Candidate};
use super::data::Data;
use super::fit::{IdentifyError, fit_about};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use rig_config::Scene;

/// A uniform number from 0 to 1.
fn uniform(random: &mut Pcg64Mcg) -> f64 {
    f64::from(random.next_u32()) / (f64::from(u32::MAX) + 1.0)
}

/// A normal number: twelve uniform ones have the variance of one normal one.
fn normal(random: &mut Pcg64Mcg) -> f64 {
    (0..12).map(|_| uniform(random)).sum::<f64>() - 6.0
}

/// `count` numbers of `of`, in blocks of neighbours.
fn blocks(of: &[f64], random: &mut Pcg64Mcg) -> Vec<f64> {
    let long = of.len().div_ceil(BLOCKS).max(1);
    let starts = of.len().saturating_sub(long) + 1;
    let mut drawn = Vec::with_capacity(of.len() + long);
    while drawn.len() < of.len() {
        let start = ((uniform(random) * starts as f64) as usize).min(starts - 1);
        drawn.extend_from_slice(&of[start..(start + long).min(of.len())]);
    }
    drawn.truncate(of.len());
    drawn
}

/// The data with the residuals of a fit in other places.
fn resampled(data: &Data, computed: &[Option<f64>], random: &mut Pcg64Mcg) -> Data {
    let mut changed = data.clone();
    for run in data.runs() {
        let told: Vec<(usize, f64)> = run.iter().filter_map(|k| Some((*k, computed[*k]?))).collect();
        let residuals: Vec<f64> = told.iter().map(|(k, c)| (data.rows[*k].value - c) / data.rows[*k].sigma).collect();
        for ((k, computed), residual) in told.iter().zip(blocks(&residuals, random)) {
            changed.rows[*k].value = computed + residual * data.rows[*k].sigma;
        }
    }
    changed
}

/// The scene with a candidate's constants, fitted to sweeps (`None`) or to a resample of them (its seed).
///
/// # Errors
/// As [`Candidate::fit`].
pub fn refit(data: &Data, candidate: &Candidate, seed: Option<u64>) -> Result<Scene, IdentifyError> {
    let start = candidate.start()?;
    let based = data.based_on(&start);
    let unknowns = &candidate.unknowns;
    let mut fit = fit_about(unknowns, &start, &based, &[])?;
    if let Some(seed) = seed {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let computed: Vec<Option<f64>> = fit.rows.iter().map(|row| row.computed).collect();
        let changed = resampled(&based, &computed, &mut random);
        let shifts: Vec<f64> = (0..unknowns.count()).map(|_| normal(&mut random)).collect();
        fit = fit_about(unknowns, &start, &changed, &shifts)?;
    }
    Ok(unknowns.scene(&candidate.scene, &start, &fit.x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_keep_neighbours_together_and_are_those_of_their_seed() {
        let of: Vec<f64> = (0..40).map(f64::from).collect();
        let draw = |seed| blocks(&of, &mut Pcg64Mcg::seed_from_u64(seed));
        let drawn = draw(1);
        assert_eq!(drawn.len(), of.len());
        let breaks = drawn.windows(2).filter(|pair| pair[1] != pair[0] + 1.0).count();
        assert!(breaks < BLOCKS, "{drawn:?}");
        assert_eq!(draw(1), drawn);
        assert_ne!(draw(2), drawn);
        assert!(blocks(&[], &mut Pcg64Mcg::seed_from_u64(1)).is_empty());
        assert_eq!(blocks(&[3.0], &mut Pcg64Mcg::seed_from_u64(1)), [3.0]);
    }
}
