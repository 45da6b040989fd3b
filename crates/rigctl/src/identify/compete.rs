//! Laws and materials compete: each is fitted to a part of the sweeps and predicts the rest.
//!
//! What is held out is a block of twist of every sweep: rows next to fitted ones would be predicted well by any law that
//! bends. A whole sweep would have to be predicted from two others where there are three, which no law does well enough to
//! be told from another. All candidates are fitted to the same thinned rows, and the one that is chosen then to all.

use super::constants::{Constant, Unknowns};
use super::data::Data;
use super::fit::{Fit, IdentifyError, fit};
use super::laws::{LAWS, Law};
use super::linear::Linear;
use crate::parallel::parallel;
use crate::statistics::{Errors, effective, mean};
use rig_config::Scene;
use serde::Serialize;
use tsa_model::Parameters;

/// Materials that compete, simplest first.
pub const MATERIALS: [Constant; 2] = [Constant::Modulus, Constant::OddCurve];
/// Rows of each sweep that candidates are compared on.
const ROWS: usize = 20;
/// Blocks of twist, which are held out in turn.
pub(super) const BLOCKS: usize = 4;
/// How many standard errors of the comparison one may be worse and still be enough: the usual rule for the simplest of
/// several models (Breiman, Friedman, Olshen and Stone, "Classification and Regression Trees", 1984).
const NOISE: f64 = 1.0;

/// What takes part: a law, a material, and what is fitted.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// The radius model.
    pub law: Law,
    /// How the rods' curve is fitted.
    pub material: Option<Constant>,
    /// The scene with the law, where the fit starts.
    pub scene: Scene,
    /// The unknowns.
    pub unknowns: Unknowns,
}

impl Candidate {
    /// All laws, or one, with all materials, simplest first.
    pub fn all(scene: &Scene, law: Option<Law>, known: bool) -> Vec<Self> {
        let laws = LAWS.iter().map(|(law, _)| *law).filter(|l| law.is_none_or(|only| only == *l));
        let pairs = laws.flat_map(|law| MATERIALS.map(|material| (law, material)));
        let mut all: Vec<Self> = pairs
            .map(|(law, material)| Self {
                law,
                material: Some(material),
                scene: law.start(scene),
                unknowns: Unknowns::usual(law, material, known),
            })
            .collect();
        all.sort_by_key(|candidate| candidate.unknowns.count());
        all
    }

    /// One law with these constants.
    pub fn with(scene: &Scene, law: Law, unknowns: Unknowns) -> Self {
        let material = unknowns.constants.iter().copied().find(|c| c.is_material());
        Self { law, material, scene: law.start(scene), unknowns }
    }

    /// The constants where the fit starts.
    ///
    /// # Errors
    /// In words.
    pub fn start(&self) -> Result<Parameters, IdentifyError> {
        let scene = &self.scene;
        Parameters::new(&scene.geometry, &scene.string, &scene.material)
            .map_err(|e| IdentifyError::Start(e.to_string()))
    }

    /// The fit to all rows.
    ///
    /// # Errors
    /// As [`fit`].
    pub fn fit(&self, data: &Data) -> Result<Fit, IdentifyError> {
        let start = self.start()?;
        fit(&self.unknowns, &start, &data.based_on(&start), &[])
    }
}

/// Whether a candidate is enough.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The one with the fewest constants among those that are not worse than the best; of several the best.
    Chosen,
    /// Not worse than the best, but not the simplest.
    Indistinguishable,
    /// Worse than the best by more than the noise of the comparison.
    Worse,
    /// The sweeps cannot tell its constants.
    Undetermined,
}

/// How a candidate did.
#[derive(Debug, Clone, Serialize)]
pub struct Scored {
    /// Radius law.
    pub law: &'static str,
    /// How the rods' curve is fitted.
    pub material: &'static str,
    /// How many constants.
    pub constants: usize,
    /// Rms error of what was fitted (m).
    pub fitted_rms: Option<f64>,
    /// Rms error of what was held out (m).
    pub held_out_rms: Option<f64>,
    /// Verdict.
    pub verdict: Verdict,
    /// Why its constants cannot be told.
    pub why: Option<String>,
    /// Errors of the rows compared, each predicted from the others (m), and the same in standard deviations of the rows.
    #[serde(skip)]
    pub errors: Vec<f64>,
    #[serde(skip)]
    weighed: Vec<f64>,
    /// The fit to the rows compared.
    #[serde(skip)]
    pub fit: Option<Fit>,
}

/// A law and a material.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Named {
    law: &'static str,
    material: &'static str,
}

/// The outcome.
#[derive(Debug, Clone, Serialize)]
pub struct Competition {
    /// How each did.
    #[serde(rename = "candidates")]
    pub scored: Vec<Scored>,
    /// Which is chosen.
    #[serde(rename = "chosen")]
    named: Named,
    /// Which others are not worse than the best.
    indistinguishable: Vec<Named>,
    /// The place of the chosen one.
    #[serde(skip)]
    pub chosen: usize,
    /// The rows compared.
    #[serde(skip)]
    pub data: Data,
}

impl Competition {
    /// The fits of those that are not worse than the best, beside the chosen one.
    pub fn others(&self) -> impl Iterator<Item = &Fit> {
        self.scored.iter().filter(|s| s.verdict == Verdict::Indistinguishable).filter_map(|s| s.fit.as_ref())
    }

    /// Errors of the chosen one on what was held out.
    pub fn held_out(&self) -> Errors {
        Errors::over(self.scored[self.chosen].errors.iter().copied())
    }
}

/// Sum of the squared errors of what was held out, in standard deviations; infinite for what could not be fitted.
fn held_out(scored: &Scored) -> f64 {
    if scored.fit.is_none() { f64::INFINITY } else { scored.weighed.iter().map(|e| e * e).sum() }
}

/// Which rows are held out together: a block of twist of every sweep.
fn folds(data: &Data) -> Vec<Vec<usize>> {
    let runs = data.runs();
    let block = |b: usize| {
        let part = |run: &Vec<usize>| {
            let at = |b: usize| b * run.len() / BLOCKS;
            run[at(b)..at(b + 1)].to_vec()
        };
        runs.iter().flat_map(part).collect::<Vec<_>>()
    };
    (0..BLOCKS).map(block).filter(|rows| !rows.is_empty()).collect()
}

/// Errors of every row, predicted from the rows that are not held out with it (m).
fn predicted(data: &Data, whole: &Fit, folds: &[Vec<usize>]) -> Option<Vec<f64>> {
    let linear = Linear::about(data, whole);
    let mut errors = vec![0.0; data.rows.len()];
    for held_out in folds {
        let all = linear.without(held_out)?;
        held_out.iter().for_each(|k| errors[*k] = all[*k]);
        // An unknown zero of which nothing was fitted has to be that of the held-out rows.
        for zero in 0..data.zeros {
            let (inside, outside): (Vec<usize>, Vec<usize>) =
                (0..data.rows.len()).filter(|k| data.rows[*k].zero == Some(zero)).partition(|k| held_out.contains(k));
            if outside.is_empty() {
                let mean = mean(&inside.iter().map(|k| errors[*k]).collect::<Vec<_>>());
                inside.iter().for_each(|k| errors[*k] -= mean);
            }
        }
    }
    Some(errors)
}

fn score(candidate: &Candidate, data: &Data, folds: &[Vec<usize>]) -> Result<Scored, IdentifyError> {
    let start = candidate.start()?;
    let data = data.based_on(&start);
    let whole = fit(&candidate.unknowns, &start, &data, &[]);
    let name = candidate.material.map_or("as in the scene", Constant::symbol);
    let mut scored = Scored {
        law: candidate.law.name(),
        material: name,
        constants: candidate.unknowns.count(),
        fitted_rms: None,
        held_out_rms: None,
        verdict: Verdict::Undetermined,
        why: None,
        errors: Vec::new(),
        weighed: Vec::new(),
        fit: None,
    };
    match whole {
        Ok(whole) => {
            let singular = || IdentifyError::NotConverged("what is not held out cannot tell the constants".into());
            scored.errors = predicted(&data, &whole, folds).ok_or_else(singular)?;
            scored.weighed = data.in_deviations(&scored.errors);
            scored.fitted_rms = Some(whole.fitted.rms);
            scored.held_out_rms = Some(Errors::over(scored.errors.iter().copied()).rms);
            scored.fit = Some(whole);
        }
        Err(why) => scored.why = Some(why.to_string()),
    }
    Ok(scored)
}

/// Whether errors (in standard deviations of their rows) are larger than others of the same rows by more than the noise of
/// that comparison: the ratio of their mean squares, whose logarithm has the variance 2/n + 2/m for two samples of n and m
/// independent values.
pub(super) fn worse(errors: &[f64], best: &[f64], runs: &[Vec<usize>]) -> bool {
    let squares = |errors: &[f64]| errors.iter().map(|e| e * e).sum::<f64>();
    let independent = |errors: &[f64]| {
        effective(&runs.iter().map(|run| run.iter().map(|k| errors[*k]).collect()).collect::<Vec<_>>())
    };
    let spread = (2.0 / independent(errors) + 2.0 / independent(best)).sqrt();
    squares(errors) > squares(best) * (NOISE * spread).exp()
}

/// Lets the candidates predict what is held out; the simplest that is not worse than the best is chosen.
///
/// # Errors
/// That of the first candidate if no candidate can be fitted.
pub fn compete(candidates: &[Candidate], data: &Data) -> Result<Competition, IdentifyError> {
    let data = data.thinned(ROWS);
    let (folds, runs) = (folds(&data), data.runs());
    let scored = parallel(&|_, _| (), candidates.len(), |k| score(&candidates[k], &data, &folds));
    let mut scored = scored.into_iter().collect::<Result<Vec<_>, _>>()?;
    let best = scored.iter().filter(|s| s.fit.is_some()).min_by(|a, b| held_out(a).total_cmp(&held_out(b)));
    let Some(best) = best.map(|s| s.weighed.clone()) else {
        let first = candidates.first().ok_or_else(|| IdentifyError::Start("no law takes part".into()))?;
        return Err(first.fit(&data).err().unwrap_or_else(|| IdentifyError::NotConverged("no candidate".into())));
    };
    for s in scored.iter_mut().filter(|s| s.fit.is_some()) {
        s.verdict = if worse(&s.weighed, &best, &runs) { Verdict::Worse } else { Verdict::Indistinguishable };
    }
    let enough = (0..scored.len()).filter(|k| scored[*k].verdict == Verdict::Indistinguishable);
    let simplest = |a: &usize, b: &usize| {
        let (a, b) = (&scored[*a], &scored[*b]);
        a.constants.cmp(&b.constants).then(held_out(a).total_cmp(&held_out(b)))
    };
    let chosen = enough.min_by(simplest).unwrap_or(0);
    scored[chosen].verdict = Verdict::Chosen;
    let named = |s: &Scored| Named { law: s.law, material: s.material };
    let others = scored.iter().filter(|s| s.verdict == Verdict::Indistinguishable).map(named).collect();
    Ok(Competition { named: named(&scored[chosen]), indistinguishable: others, scored, chosen, data })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_worse_by_their_size_and_by_how_many_of_them_are_independent() {
        // Independent by their alternating signs: an autocorrelation below zero ends its sum.
        let alternating = |size: f64, count: usize| -> Vec<f64> {
            (0..count).map(|k| if k % 2 == 0 { size } else { -size }).collect()
        };
        let runs = |count: usize| [(0..count).collect::<Vec<_>>()];
        let (small, large) = (alternating(1.0, 60), alternating(1.5, 60));
        assert!(
            worse(&large, &small, &runs(60)) && !worse(&small, &large, &runs(60)) && !worse(&small, &small, &runs(60))
        );
        // The same sizes, but each sample is one value sixty times.
        assert!(!worse(&[1.5; 60], &[1.0; 60], &runs(60)));
        // A few large errors among many small ones count.
        let mut few = small.clone();
        few[50..].iter_mut().for_each(|e| *e *= 10.0);
        assert!(worse(&few, &small, &runs(60)));
    }
}
