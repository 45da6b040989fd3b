//! Fitting a scene's constants to what was measured, with exact derivatives from the solver, and saying how far the result
//! can be trusted.
//!
//! - [`data`]: recorded sweeps and the paper's numbers. [`constants`]: what can be fitted. [`laws`]: the radius laws.
//! - [`mod@fit`]: the least squares, and what the data can tell. [`linear`]: the same without some rows.
//! - [`noise`]: how much correlated residuals tell.
//! - [`mod@compete`]: laws and materials predict held-out sweeps. [`predict`]: contractions with their errors.
//! - [`plausible`], [`consistent`]: numbers that no rig gives, wrong units, sweeps that do not belong together.
//! - [`correction`]: what no law has, as a surface that was measured.
//! - [`memory`]: what the rods remember of a heavier load, by sweeps before and after it.
//! - [`tabled`]: the table of the scene. [`hysteresis`]: loops between the way up and the way down.
//! - [`plan`]: which sweep would tell most. [`bootstrap`]: fits to resampled sweeps.

pub mod bootstrap;
pub mod compete;
pub mod consistent;
pub mod constants;
pub mod correction;
pub mod data;
pub mod fit;
pub mod hysteresis;
pub mod laws;
pub mod linear;
pub mod memory;
pub mod noise;
pub mod plan;
pub mod plausible;
pub mod predict;
pub mod tabled;

use compete::{Candidate, Competition, compete};
use constants::Unknowns;
use correction::{Corrected, corrected};
use data::Data;
use fit::{Fit, IdentifyError};
use memory::Memory;
use noise::half_width_factor;
use predict::{Known, Prediction};
use rig_config::{Scene, Uncertainty};
use serde::Serialize;
use tsa_table::fit::Fit as Table;

/// Errors over some rows: relative for the paper's numbers, in metres for sweeps.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Errors {
    /// Rows.
    pub count: usize,
    /// Root mean square.
    pub rms: f64,
    /// Median of the absolute values.
    pub median: f64,
    /// Greatest absolute value.
    pub worst: f64,
}

impl Errors {
    /// Of these errors.
    pub fn over(errors: impl Iterator<Item = f64>) -> Self {
        let mut all: Vec<f64> = errors.map(f64::abs).collect();
        all.sort_by(f64::total_cmp);
        let count = all.len();
        if count == 0 {
            return Self::default();
        }
        let rms = (all.iter().map(|e| e * e).sum::<f64>() / count as f64).sqrt();
        let median = 0.5 * (all[(count - 1) / 2] + all[count / 2]);
        Self { count, rms, median, worst: all[count - 1] }
    }
}

/// Least standard errors of an identified scene: strings bed in, creep and warm up between the sweeps and later use
/// (docs/plants.md), which no sweep shows. Radius (relative), gap's zero (m), change of the load (relative).
const LEAST_RADIUS_ERROR: f64 = 0.004;
const LEAST_ZERO_ERROR_M: f64 = 50e-6;
const CHANGE_ERROR: f64 = 0.01;

/// Standard error of the gap's zero (m) by sweeps that law and correction miss by so much (m, rms). That is smooth over a
/// sweep, not noise that averages out, so that it counts in full, and twice because the use is not the sweep.
fn zero_error_m(missed_m: f64) -> f64 {
    (2.0 * missed_m).hypot(LEAST_ZERO_ERROR_M).min(0.05)
}

/// Standard error (relative) of a load that is weighed by a mechanism which misses so much of held-out rows (m, rms), and whose
/// contraction goes so far with a relative change of the load (m): the board takes what the law misses for load.
fn shape_error(missed_m: f64, by_load_m: f64) -> f64 {
    (missed_m / by_load_m).hypot(CHANGE_ERROR).min(0.5)
}

/// How far a contraction goes with a relative change of the load, rms over the rows of the sweeps (m).
fn contraction_by_load_m(unknowns: &Unknowns, data: &Data, x: &[f64]) -> f64 {
    let slopes = hysteresis::slopes(unknowns, data, x);
    let of_run = |run: Vec<usize>| {
        let first = slopes[run[0]];
        run.into_iter().map(|k| data.rows[k].load_n * (slopes[k] - first)).collect::<Vec<_>>()
    };
    Errors::over(data.runs().into_iter().flat_map(of_run).filter(|by_load_m| by_load_m.is_finite())).rms
}

/// Whether a law describes the sweeps as well as they were measured.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Misfit {
    /// What the law misses, rms (m).
    pub rms_m: f64,
    /// What sensor noise explains, and what the loops between up and down leave in the mean of the two ways, rms (m).
    pub explained_m: f64,
    /// What is left: the root of the difference of their squares (m).
    pub excess_m: f64,
    /// Whether what is left is within the noise of that comparison.
    pub holds: bool,
}

impl Misfit {
    fn of(data: &Data, fit: &Fit) -> Self {
        let explained = |row: &data::Row| row.sigma.powi(2);
        let explained_m = (data.rows.iter().map(explained).sum::<f64>() / data.rows.len().max(1) as f64).sqrt();
        let rms_m = fit.fitted.rms;
        // A mean square of n independent values has a relative standard error of sqrt(2/n).
        let most = 1.0 + half_width_factor(fit.noise.freedom) * (2.0 / fit.noise.effective).sqrt();
        let excess_m = (rms_m.powi(2) - explained_m.powi(2)).max(0.0).sqrt();
        Self { rms_m, explained_m, excess_m, holds: rms_m.powi(2) <= most * explained_m.powi(2) }
    }
}

/// An identified rig.
#[derive(Debug, Clone)]
pub struct Identified {
    /// The scene with the chosen law and its constants.
    pub scene: Scene,
    /// The chosen candidate.
    pub candidate: Candidate,
    /// How all of them did.
    pub competition: Competition,
    /// The chosen one fitted to all rows; its held-out errors are those of the competition.
    pub fit: Fit,
    /// What follows for predictions.
    pub known: Known,
    /// Whether the chosen law holds.
    pub misfit: Misfit,
    /// What it misses, as a surface that the scene has, or why the scene has none; none if the law holds.
    pub corrected: Option<Result<Corrected, String>>,
    /// What the rods remember of a heavier load, where sweeps show it.
    pub memories: Vec<Memory>,
    /// Predicted contractions.
    pub predictions: Vec<Prediction>,
    /// The table of the scene; none if the scene does not say what a table has to cover, or has none.
    pub table: Option<Table>,
    /// Why the scene has no table, if so.
    pub untabled: Option<String>,
}

/// Lets the candidates compete on recorded sweeps, and fits the chosen one to all rows. Where it does not hold, what it
/// misses is corrected if that helps.
///
/// # Errors
/// If the sweeps cannot tell the constants of any candidate, do not belong together, or a scene with them is not valid.
pub fn identify(scene: &Scene, data: &Data, candidates: &[Candidate]) -> Result<Identified, IdentifyError> {
    if let Some(why) = consistent::slipped(data) {
        return Err(IdentifyError::Apart(why));
    }
    let competition = compete(candidates, data)?;
    let candidate = candidates[competition.chosen].clone();
    if let Some(why) = consistent::apart(&candidate.unknowns, &competition) {
        return Err(IdentifyError::Apart(why));
    }
    let mut fit = candidate.fit(data)?;
    let start = candidate.start()?;
    let mut identified = candidate.unknowns.scene(&candidate.scene, &start, &fit.x);
    let mut known = Known::new(candidates, &competition, &fit)
        .ok_or_else(|| IdentifyError::NotConverged("the chosen law has no start".into()))?;
    let memories = memory::memories(data, &known)?;
    let misfit = Misfit::of(data, &fit);
    fit.held_out = competition.held_out();
    let based = data.based_on(&start);
    let by_load_m = contraction_by_load_m(&candidate.unknowns, &based, &fit.x);
    if candidate.unknowns.expected {
        identified.uncertainty = Uncertainty {
            radius: LEAST_RADIUS_ERROR,
            gap_zero_m: zero_error_m(fit.fitted.rms),
            load_shape: if misfit.holds { CHANGE_ERROR } else { shape_error(fit.held_out.rms, by_load_m) },
            rod_memory: scene.uncertainty.rod_memory,
        };
    }
    if let Some(share) = memory::rod_memory(&memories) {
        identified.uncertainty.rod_memory = share;
    }
    identified.validate().map_err(|e| IdentifyError::NotConverged(format!("the identified scene: {e}")))?;
    let (mut table, untabled) = match tabled::table(&mut identified) {
        Ok(table) => (table, None),
        Err(why) => (None, Some(why)),
    };
    let corrected = (!misfit.holds).then(|| corrected(&identified, &candidate.unknowns, &based, &fit, by_load_m));
    if let Some(Ok(found)) = &corrected {
        (identified, table) = (found.scene.clone(), found.table.clone());
        known.surface = Some(found.surface.clone());
    }
    let predictions = known.predictions(scene);
    Ok(Identified {
        scene: identified,
        candidate,
        competition,
        fit,
        known,
        misfit,
        memories,
        corrected,
        predictions,
        table,
        untabled,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_law_misses_is_taken_for_load() {
        // 0.2 mm missed where twice the load shortens the strings by 2 mm less.
        assert!((shape_error(0.2e-3, 2e-3) - 0.1f64.hypot(CHANGE_ERROR)).abs() < 1e-12);
        assert_eq!(shape_error(0.0, 2e-3), CHANGE_ERROR);
        assert_eq!(shape_error(1.0, 2e-3), 0.5, "more than a scene may state");
    }
}
