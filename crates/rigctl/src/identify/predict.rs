//! Contractions as the identified constants predict them, with their errors.

use super::MIN_RADIUS_ERROR;
use super::constants::Number;
use super::correction::Surface;
use super::fit::Fit;
use crate::statistics::half_width;
use nalgebra::{DMatrix, DVector};
use rig_config::Scene;
use serde::Serialize;
use tsa_model::{Mechanism, PRETWIST_RAD, Parameters, SolveError, twist_from_turns};

/// Turns of the paper's experiment, which contractions are predicted for unless the scene ends before.
const TURNS: f64 = 7.5;

/// A predicted contraction.
#[derive(Debug, Clone, Serialize)]
pub struct Prediction {
    /// Load (N).
    pub load_n: f64,
    /// Turns past the half-turn pre-twist.
    pub turns: f64,
    /// Contraction since the pre-twist (m); none where the model refuses.
    pub contraction_m: Option<f64>,
    /// Half the width of the interval that holds the truth nine times in ten (m).
    pub half_width_m: Option<f64>,
}

/// What a fitted law predicts.
impl Fit {
    fn parameters(&self) -> Parameters<Number> {
        self.unknowns.put(&self.base, &self.x, "", Number::parameter)
    }

    /// Derivatives of a number by all unknowns, zeros of sensors included.
    pub(super) fn by_unknowns(&self, number: &Number) -> DVector<f64> {
        let count = self.unknowns.count();
        DVector::from_fn(self.x.len(), |j, _| if j < count { number.by[j] } else { 0.0 })
    }

    /// Contraction since the pre-twist (m), with its derivatives by the unknowns.
    ///
    /// # Errors
    /// If the model refuses one of the two states.
    pub fn contraction(&self, load_n: f64, turns: f64) -> Result<Number, SolveError> {
        contraction(self.parameters(), load_n, turns)
    }

    /// Gap (m) at a load (N) and a twist (rad), with its derivatives by the unknowns, and its slope by the load (m/N).
    ///
    /// # Errors
    /// If the model refuses the state.
    pub fn gap(&self, load_n: f64, twist_rad: f64) -> Result<(Number, f64), SolveError> {
        let e = Mechanism::of(self.parameters()).formal(load_n, twist_rad)?;
        Ok((e.gap_m, e.dgap_dload_m_per_n.value))
    }

    /// What a relative change of the strings' radius adds to the contraction (m).
    fn by_radius(&self, load_n: f64, turns: f64, fraction: f64) -> Result<f64, SolveError> {
        let mut p = self.parameters();
        // All terms of the radius by one factor, which no string's own size takes part in.
        (p.k2, p.k3, p.k4) = (p.k2 * (1.0 + fraction), p.k3 * (1.0 + fraction), p.k4 * (1.0 + fraction));
        p.k1_per_n = p.k1_per_n / (1.0 + fraction);
        Ok(contraction(p, load_n, turns)?.value - self.contraction(load_n, turns)?.value)
    }
}

fn contraction(p: Parameters<Number>, load_n: f64, turns: f64) -> Result<Number, SolveError> {
    let m = Mechanism::of(p);
    Ok(m.formal(load_n, PRETWIST_RAD)?.gap_m - m.formal(load_n, twist_from_turns(turns))?.gap_m)
}

/// What is known after an identification.
#[derive(Debug, Clone)]
pub struct Known {
    /// The chosen law's fit to all rows.
    pub fit: Fit,
    /// Those that cannot be told from it.
    pub others: Vec<Fit>,
    /// What the chosen law misses, as measured.
    pub surface: Option<Surface>,
}

/// Variance (m2) that a covariance of the unknowns gives a number with these derivatives.
pub(super) fn variance(by: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    by.dot(&(covariance * by))
}

impl Known {
    /// Variance of what the chosen law misses at one end of a contraction (m2).
    pub fn missed_m2(&self) -> f64 {
        let noise = self.fit.noise;
        self.fit.fitted.rms.powi(2) * noise.effective / noise.freedom
    }

    /// Variance of a predicted contraction (m2) that no sweep takes away and no residual shows: strings that go on changing,
    /// and laws that cannot be told apart. What the law misses comes to this, at both ends ([`Known::missed_m2`]).
    ///
    /// The contraction is the mean of the way up and the way down, so that friction is no part of its error a second time:
    /// what friction did in the sweeps is in the errors of the constants already.
    ///
    /// # Errors
    /// If the model refuses the state.
    pub fn floor_m2(&self, load_n: f64, turns: f64) -> Result<f64, SolveError> {
        let here = self.fit.contraction(load_n, turns)?.value;
        let aged_m = self.fit.by_radius(load_n, turns, MIN_RADIUS_ERROR)?;
        let apart = self.others.iter().filter_map(|other| other.contraction(load_n, turns).ok());
        let apart: Vec<f64> = apart.map(|other| (other.value - here).powi(2)).collect();
        let apart_m2 = apart.iter().sum::<f64>() / apart.len().max(1) as f64;
        Ok(aged_m.powi(2) + apart_m2)
    }

    /// The contraction at a load and so many turns, with the correction. Where that was measured, the errors that the law's
    /// residuals give are those of what it leaves; outside they go over into those of the law alone.
    pub fn predict(&self, load_n: f64, turns: f64) -> Prediction {
        let computed = self.fit.contraction(load_n, turns).ok();
        let (added_m, added_m2, left) = self.surface.as_ref().map_or((0.0, 0.0, 1.0), |surface| {
            let (added_m, added_m2, size) = surface.contraction(load_n, turns);
            (added_m, added_m2, 1.0 - size * (1.0 - surface.fraction))
        });
        let half_width_m = computed.as_ref().and_then(|contraction| {
            let by = self.fit.by_unknowns(contraction);
            let [all, estimated] = [&self.fit.covariance, &self.fit.estimated].map(|part| variance(&by, part));
            let known_m2 = all - estimated + self.floor_m2(load_n, turns).ok()?;
            Some(half_width(left * (estimated + 2.0 * self.missed_m2()) + added_m2, known_m2, self.fit.noise.freedom))
        });
        Prediction { load_n, turns, contraction_m: computed.map(|law| law.value + added_m), half_width_m }
    }

    /// Contractions at the scene's lowest, middle and highest load; none without an envelope.
    pub fn predictions(&self, scene: &Scene) -> Vec<Prediction> {
        let Some(envelope) = scene.envelope else { return Vec::new() };
        let [min, max] = envelope.load_n;
        let turns = TURNS.min(envelope.turns[1]);
        [min, 0.5 * (min + max), max].map(|load_n| self.predict(load_n, turns)).to_vec()
    }
}
