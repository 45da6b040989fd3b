//! Fitting a scene's constants to what was measured, with exact derivatives from the solver, and saying how far the result
//! can be trusted.
//!
//! - [`data`]: recorded sweeps. [`constants`]: what can be fitted. [`laws`]: the radius laws.
//! - [`mod@fit`]: the least squares, and what the data can tell. [`linear`]: the same without some rows.
//! - [`mod@compete`]: laws and materials predict held-out sweeps. [`predict`]: contractions with their errors. [`plan`]: which
//!   further sweep would tell most.
//! - [`plausible`], [`consistent`]: numbers that no rig gives, wrong units, sweeps that do not belong together.
//! - [`correction`]: what no law has, as a surface that was measured. [`hysteresis`]: loops between up and down, and what the rods
//!   remember of a heavier load.

pub mod compete;
pub mod consistent;
pub mod constants;
pub mod correction;
pub mod data;
pub mod fit;
pub mod hysteresis;
pub mod laws;
pub mod linear;
pub mod plan;
pub mod plausible;
pub mod predict;

use crate::statistics::{half_width_factor, rms};
use crate::units::MM;
use compete::{Candidate, Competition, compete};
use correction::{Corrected, corrected};
use data::Data;
use fit::{Fit, IdentifyError};
use hysteresis::{Memory, memories, rod_memory};
use predict::{Known, Prediction};
use rig_config::{Envelope, Scene, Uncertainty};
use serde::Serialize;
use tsa_table::fit::Fit as Table;

/// Minimum standard errors of an identified scene: strings bed in, creep and warm up between the sweeps and later use
/// (crates/rig-plant/README.md), which no sweep shows. Radius (relative), gap's zero (m), dependence on the load
/// (relative). The last one was chosen by the stated 90 % errors of loads on calibrated plants (`coverage`, seeds 880 001 to 880 100).
const MIN_RADIUS_ERROR: f64 = 0.004;
const MIN_ZERO_ERROR_M: f64 = 50e-6;
const CHANGE_ERROR: f64 = 0.005;

/// Standard error of the gap's zero (m) by sweeps that law and correction miss by so much (m, rms). That is smooth over a
/// sweep, not noise that averages out, so that it counts in full.
fn zero_error_m(missed_m: f64) -> f64 {
    missed_m.hypot(MIN_ZERO_ERROR_M).min(0.05)
}

/// Standard error (relative) of a load that is weighed by a mechanism which misses so much of held-out rows (m, rms), and whose
/// contraction goes so far with a relative change of the load (m). What it misses is smooth over a sweep, and homing finds most of
/// it anew, as zero and slope of the LVDT and as growth of the radius. That a third is taken for load was chosen on the same
/// plants as [`CHANGE_ERROR`].
fn shape_error(missed_m: f64, by_load_m: f64) -> f64 {
    (missed_m / (3.0 * by_load_m)).hypot(CHANGE_ERROR).min(0.5)
}

/// How far a contraction goes with a relative change of the load, rms over the rows of the sweeps (m).
fn contraction_by_load_m(data: &Data, fit: &Fit) -> f64 {
    let slopes = hysteresis::slopes(&fit.unknowns, data, &fit.x);
    let of_run = |run: Vec<usize>| {
        let first = slopes[run[0]];
        run.into_iter().map(|k| data.rows[k].load_n * (slopes[k] - first)).collect::<Vec<_>>()
    };
    let all: Vec<f64> = data.runs().into_iter().flat_map(of_run).filter(|by_load_m| by_load_m.is_finite()).collect();
    rms(&all)
}

/// Whether a law describes the sweeps as well as they were measured.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Residual {
    /// What the law misses, rms (m).
    pub rms_m: f64,
    /// What sensor noise explains, and what the loops between up and down leave in the mean of the two ways, rms (m).
    pub explained_m: f64,
    /// What is left: the root of the difference of their squares (m).
    pub excess_m: f64,
    /// Whether what is left is within the noise of that comparison.
    pub holds: bool,
}

impl Residual {
    fn of(data: &Data, fit: &Fit) -> Self {
        let explained_m = rms(data.rows.iter().map(|row| &row.sigma));
        let rms_m = fit.fitted.rms;
        // A mean square of n independent values has a relative standard error of sqrt(2/n).
        let max = 1.0 + half_width_factor(fit.noise.freedom) * (2.0 / fit.noise.effective).sqrt();
        let excess_m = (rms_m.powi(2) - explained_m.powi(2)).max(0.0).sqrt();
        Self { rms_m, explained_m, excess_m, holds: rms_m.powi(2) <= max * explained_m.powi(2) }
    }
}

/// An identified rig, as `--json` prints it.
#[derive(Debug, Clone, Serialize)]
pub struct Identified {
    /// The chosen candidate fitted to all rows; its held-out errors are those of the competition.
    #[serde(flatten)]
    pub fit: Fit,
    /// How all of them did.
    #[serde(flatten)]
    pub competition: Competition,
    /// Whether the chosen law holds.
    pub law_holds: bool,
    /// How far it does.
    pub residual: Residual,
    /// What it misses, as a surface that the scene has; none if the law holds.
    pub correction: Option<Corrected>,
    /// Why the scene has none, though no law holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncorrected: Option<String>,
    /// Predicted contractions.
    pub predictions: Vec<Prediction>,
    /// What the rods remember of a heavier load; empty without sweeps that show it.
    pub rod_memory: Vec<Memory>,
    /// Size of the scene's table (bytes); none if it has none, or asks for none.
    pub table_bytes: Option<usize>,
    /// Why the scene has no table, if so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub untabled: Option<String>,
    /// The scene with the chosen law and its constants.
    pub scene: Scene,
    /// The chosen candidate.
    #[serde(skip)]
    pub candidate: Candidate,
    /// What follows for predictions.
    #[serde(skip)]
    pub known: Known,
    /// The table of the scene.
    #[serde(skip)]
    pub table: Option<Table>,
}

/// Lets the candidates compete on recorded sweeps, and fits the chosen one to all rows. Where it does not hold, what it
/// misses is corrected if that helps.
///
/// # Errors
/// If the sweeps cannot tell the constants of any candidate, do not belong together, or a scene with them is not valid.
pub fn identify(scene: &Scene, data: &Data, candidates: &[Candidate]) -> Result<Identified, IdentifyError> {
    consistent::slipped(data).map_or(Ok(()), |why| Err(IdentifyError::Apart(why)))?;
    let competition = compete(candidates, data)?;
    let candidate = candidates[competition.chosen].clone();
    consistent::apart(&competition).map_or(Ok(()), |why| Err(IdentifyError::Apart(why)))?;
    let mut fit = candidate.fit(data)?;
    let mut identified = fit.unknowns.scene(&candidate.scene, &fit.base, &fit.x);
    let mut known = Known { fit: fit.clone(), others: competition.others().cloned().collect(), surface: None };
    let memories = memories(data, &known)?;
    let residual = Residual::of(data, &fit);
    fit.held_out = competition.held_out();
    let based = data.based_on(&fit.base);
    let by_load_m = contraction_by_load_m(&based, &fit);
    if fit.unknowns.expected {
        identified.uncertainty = Uncertainty {
            radius: MIN_RADIUS_ERROR,
            gap_zero_m: zero_error_m(fit.fitted.rms),
            load_shape: if residual.holds { CHANGE_ERROR } else { shape_error(fit.held_out.rms, by_load_m) },
            rod_memory: scene.uncertainty.rod_memory,
        };
    }
    if let Some(fraction) = rod_memory(&memories) {
        identified.uncertainty.rod_memory = fraction;
    }
    identified.validate().map_err(|e| IdentifyError::NotConverged(format!("the identified scene: {e}")))?;
    let (mut table, untabled) = match tabled(&mut identified) {
        Ok(table) => (table, None),
        Err(why) => (None, Some(why)),
    };
    let corrected = (!residual.holds).then(|| corrected(&identified, &based, &fit, by_load_m));
    let (correction, uncorrected) = match corrected {
        Some(Ok(found)) => {
            (identified, table) = (found.scene.clone(), found.table.clone());
            known.surface = Some(found.surface.clone());
            (Some(found), None)
        }
        Some(Err(why)) => (None, Some(why)),
        None => (None, None),
    };
    let left_m = correction.as_ref().map_or(residual.rms_m, |found| found.rms_m);
    if left_m > MOST_LEFT_M {
        let [left, most] = [left_m, MOST_LEFT_M].map(|m| MM.show(m));
        return Err(IdentifyError::Apart(format!(
            "the best law misses the sweeps by {left} rms, and homing refuses a rig that misses its table by more than {most}: are the loads \
             of the sweeps those in their files, and are they all of this actuator?"
        )));
    }
    Ok(Identified {
        fit,
        competition,
        law_holds: residual.holds,
        residual,
        correction,
        uncorrected,
        predictions: known.predictions(scene),
        rod_memory: memories,
        table_bytes: table.as_ref().map(|fit| fit.table.numbers.bytes()),
        untabled,
        scene: identified,
        candidate,
        known,
        table,
    })
}

/// What law and correction may miss, rms (m): homing refuses a rig that misses its table by more.
const MOST_LEFT_M: f64 = 10.0 * rig_control::homing::load_estimate::LAW_GAP_ERROR_M as f64;

/// Under light loads and many turns the strings of some rigs have no equilibrium, or a transmission ratio that no table
/// follows. The envelope then begins at a heavier load: by how much a limit moves inwards from one attempt to the next, and at most: first the least load, then the turns.
const STEP: f64 = 1.05;
const MAX: f64 = 2.0;

/// The table of a scene, without which it is of no use to a board; `None` if the scene does not say what a table has to cover and how well. Where there is no table
/// over the whole envelope, its least load rises to the first at which there is one, at most to twice; if that is not
/// enough, its turns become fewer too, at most by half.
///
/// # Errors
/// Why there is no table over the whole envelope, in words, if there is none over a smaller one either. The scene then stays
/// as it is.
fn tabled(scene: &mut Scene) -> Result<Option<Table>, String> {
    let (Some(envelope), Some(_)) = (scene.envelope, scene.accuracy) else { return Ok(None) };
    let why = match scene.fit_table() {
        Ok(table) => return Ok(Some(table)),
        Err(e) => e.to_string(),
    };
    let steps = (MAX.ln() / STEP.ln()).round() as i32;
    let ([min_n, max_n], [first, last]) = (envelope.load_n, envelope.turns);
    for step in 1..=2 * steps {
        let (up, back) = (STEP.powi(step.min(steps)), STEP.powi((step - steps).max(0)));
        let narrowed =
            Envelope { load_n: [three_digits(up * min_n), max_n], turns: [first, three_digits(last / back)] };
        let narrowed = Scene { envelope: Some(narrowed), ..scene.clone() };
        if narrowed.validate().is_ok()
            && let Ok(table) = narrowed.fit_table()
        {
            *scene = narrowed;
            return Ok(Some(table));
        }
    }
    Err(why)
}

/// As a person would write it.
fn three_digits(value: f64) -> f64 {
    let digits = 10f64.powf(2.0 - value.log10().floor());
    (value * digits).round() / digits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_third_of_what_a_law_misses_is_taken_for_load() {
        // Missed by 0.6 mm, where twice the load shortens the strings by 2 mm less.
        assert!((shape_error(0.6e-3, 2e-3) - 0.1f64.hypot(CHANGE_ERROR)).abs() < 1e-12);
        assert_eq!(shape_error(0.0, 2e-3), CHANGE_ERROR);
        assert_eq!(shape_error(1.0, 2e-3), 0.5, "more than a scene may state");
    }

    fn scene(min_n: f64) -> Scene {
        let mut scene = Scene::from_toml_str(include_str!("../../../../scenes/default.toml")).expect("a scene");
        scene.envelope.as_mut().expect("an envelope").load_n[0] = min_n;
        scene
    }

    #[test]
    fn the_least_load_rises_to_the_first_that_has_a_table() {
        // At 0.5 N and 7.5 turns the strings have no equilibrium.
        let mut narrowed = scene(0.5);
        assert!(tabled(&mut narrowed).expect("a table").is_some());
        let min_n = narrowed.envelope.expect("an envelope").load_n[0];
        assert!(narrowed.fit_table().is_ok() && min_n < 0.75, "{min_n}");
        assert!(scene(min_n / STEP / STEP).fit_table().is_err());
        assert_eq!(Scene { envelope: scene(0.5).envelope, ..narrowed }, scene(0.5));
    }

    #[test]
    fn the_turns_become_fewer_where_twice_the_least_load_has_no_table_either() {
        let mut narrowed = scene(0.5);
        narrowed.envelope.as_mut().expect("an envelope").turns[1] = 10.0;
        assert!(tabled(&mut narrowed).expect("a table").is_some());
        let envelope = narrowed.envelope.expect("an envelope");
        assert!(envelope.load_n[0] > 0.98 && (7.5..9.6).contains(&envelope.turns[1]), "{envelope:?}");
    }

    #[test]
    fn a_scene_that_has_a_table_asks_for_none_or_can_have_none_stays_as_it_is() {
        let (mut sound, mut without) = (scene(1.0), Scene { accuracy: None, ..scene(0.5) });
        assert!(tabled(&mut sound).expect("a table").is_some());
        assert!(tabled(&mut without).expect("nothing is asked for").is_none());
        let mut hopeless = scene(0.05);
        assert!(tabled(&mut hopeless).expect_err("no equilibrium").contains("past a limit of the model"));
        assert_eq!([sound, without, hopeless], [scene(1.0), Scene { accuracy: None, ..scene(0.5) }, scene(0.05)]);
    }
}
