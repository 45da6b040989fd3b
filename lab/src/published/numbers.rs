//! A number that the paper prints, and the same number computed for a scene.

use crate::scene_key::{self, KeyError};
use rig_config::Scene;
use rigctl::failure::Refused;
use rigctl::identify::data::Quantity;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use tsa_model::{Equilibrium, Mechanism, SolveError, twist_from_turns};

/// Turns after which the paper compares (past the half-turn pre-twist).
pub const TURNS: f64 = 7.5;

const ROWS: &str = include_str!("../../../host-tests/reference/published.csv");
const RATIOS: &str = include_str!("../../../host-tests/reference/published-ratios.csv");

/// A printed number.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Its name, for example `d0-8`.
    pub id: String,
    /// What it measures: `contraction_at_7.5_turns`, `tr_at_0_turns` …
    pub quantity: String,
    /// Computed or measured by the authors.
    pub kind: Kind,
    /// Load (N).
    pub load_n: f64,
    /// Changes of the scene, see [`apply`]; mostly none.
    pub changes: String,
    /// The number, in its unit.
    pub value: f64,
    /// Millimetres, or radians per millimetre for TR.
    pub unit: String,
    /// Section or figure of the paper.
    #[serde(rename = "where")]
    pub place: String,
}

/// The authors' source of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// From their solver.
    Theory,
    /// From their rig.
    Experiment,
}

/// The computed counterpart of a printed number.
#[derive(Debug, Clone, PartialEq)]
pub struct Computed {
    /// In the unit of the row.
    pub value: f64,
    /// Warnings of the model, at either end of the contraction.
    pub warnings: Vec<&'static str>,
}

impl Row {
    /// Turns past the half-turn pre-twist.
    pub fn turns(&self) -> f64 {
        if self.quantity.ends_with("_at_0_turns") { 0.0 } else { TURNS }
    }

    /// The quantity at any number of turns: contraction, TR or span.
    pub fn group(&self) -> Quantity {
        match self.quantity.split('_').next() {
            Some("tr") => Quantity::Tr,
            Some("span") => Quantity::Span,
            _ => Quantity::Contraction,
        }
    }

    /// The number for a scene. An overtwisted state counts, with a warning: the paper prints one ([`Mechanism::formal`]).
    ///
    /// # Errors
    /// The limit of the model, or the parameter of the changed scene, that leaves no number.
    pub fn compute(&self, scene: &Scene) -> Result<Computed, Refused> {
        let mechanism = changed_mechanism(scene, &self.changes)?;
        let at = |turns| mechanism.formal(self.load_n, twist_from_turns(turns)).map_err(Refused::from);
        let end = at(self.turns())?;
        let (value, start) = match self.group() {
            Quantity::Contraction => {
                let start = at(0.0)?;
                (1e3 * (start.gap_m - end.gap_m), start)
            }
            Quantity::Tr => (1e-3 * end.tr_rad_per_m(), end),
            Quantity::Span | Quantity::Gap => (1e3 * end.d_m, end),
        };
        Ok(Computed { value, warnings: warnings(&[start, end]) })
    }
}

/// Every printed number, in the order of the reference file.
///
/// # Errors
/// If the file that was compiled in is damaged.
pub fn rows() -> Result<Vec<Row>, csv::Error> {
    csv::Reader::from_reader(ROWS.as_bytes()).deserialize().collect()
}

/// The scene with `key=value` changed, or several of them between semicolons; an empty text changes nothing. Keys are
/// those of scene files or the paper's symbols ([`scene_key::set`]), values as in a scene file.
///
/// # Errors
/// [`KeyError`] naming the key.
pub fn apply(scene: &Scene, changes: &str) -> Result<Scene, KeyError> {
    changes.split(';').map(str::trim).filter(|change| !change.is_empty()).try_fold(scene.clone(), |scene, change| {
        let (key, value) = change.split_once('=').ok_or_else(|| KeyError::form(change))?;
        let (key, value) = (key.trim(), value.trim());
        let value: toml::Value = value.parse().map_err(|e: toml::de::Error| KeyError::unknown(key, &e.to_string()))?;
        scene_key::set(&scene, key, value)
    })
}

/// The solver for a scene with changes as in [`apply`].
///
/// # Errors
/// The kind `parameter` and the key in words.
pub fn changed_mechanism(scene: &Scene, changes: &str) -> Result<Mechanism, Refused> {
    let refused = |message: String| Refused::new("parameter", message);
    apply(scene, changes).map_err(|e| refused(e.to_string()))?.mechanism().map_err(|e| refused(e.to_string()))
}

/// The geometry that some of the paper's sweeps seem to have used instead of Table 1's (lab/paper.md): place in the paper, what is swept
/// there, and what differs, as in [`apply`]. Only D0 = 30 mm has the paper's word for it; the lengths are inferred, because with them
/// one law gives all numbers that the paper computes.
pub const INFERRED: [(&str, &str, &str); 5] = [
    ("section 4.2", "load", "L0=0.100"),
    ("Fig. 8", "R", "L0=0.100"),
    ("Fig. 9", "L0", "D0=0.030"),
    ("Fig. 10", "r0", "L0=0.100"),
    ("Fig. 11", "K", "L0=0.1055"),
];

/// What differs from Table 1 at a place in the paper; nothing where Table 1 holds.
pub fn inferred(place: &str) -> &'static str {
    INFERRED.iter().find(|(at, ..)| *at == place).map_or("", |(.., changes)| changes)
}

/// The changes of a place with others after them: a sweep may change the same key.
pub(super) fn changed(before: &str, changes: &str) -> String {
    [before, changes].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(";")
}

/// The table for people, in lines.
pub(super) fn inferred_text() -> Vec<String> {
    let mut lines = vec!["computed with a geometry inferred for each sweep; Table 1's elsewhere:".to_owned()];
    lines.extend(INFERRED.iter().map(|(place, swept, changes)| format!("  {swept:<5} {place:<12} {changes}")));
    lines
}

/// A ratio of two loads that the paper's text quotes.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ratio {
    /// Its name.
    pub id: String,
    /// What is compared.
    pub quantity: RatioQuantity,
    /// Computed or measured by the authors.
    pub kind: Kind,
    /// Load above the line (N).
    pub load_n: f64,
    /// Load below the line (N).
    pub to_load_n: f64,
    /// Turns past the half-turn pre-twist.
    pub turns: f64,
    /// The quoted ratio.
    pub value: f64,
    /// Section or figure of the paper.
    #[serde(rename = "where")]
    pub place: String,
}

/// What a quoted ratio compares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RatioQuantity {
    /// Contraction.
    Contraction,
    /// Transmission ratio at that number of turns.
    Tr,
    /// Average speed of the load up to there, at one motor speed.
    AverageSpeed,
    /// Motor speed over that average speed.
    AverageTr,
}

impl Ratio {
    /// The ratio for a scene's mechanism.
    ///
    /// # Errors
    /// The limit of the model that leaves no number.
    pub fn compute(&self, mechanism: &Mechanism) -> Result<f64, SolveError> {
        let of = |load_n| {
            let at = |turns| mechanism.formal(load_n, twist_from_turns(turns));
            let end = at(self.turns)?;
            Ok(match self.quantity {
                RatioQuantity::Tr => end.tr_rad_per_m(),
                // The time is the same for both loads, so speeds are in the ratio of the contractions.
                RatioQuantity::Contraction | RatioQuantity::AverageSpeed => at(0.0)?.gap_m - end.gap_m,
                RatioQuantity::AverageTr => TAU * self.turns / (at(0.0)?.gap_m - end.gap_m),
            })
        };
        Ok(of(self.load_n)? / of(self.to_load_n)?)
    }
}

/// Every ratio that the text quotes.
///
/// # Errors
/// If the file that was compiled in is damaged.
pub fn ratios() -> Result<Vec<Ratio>, csv::Error> {
    csv::Reader::from_reader(RATIOS.as_bytes()).deserialize().collect()
}

/// The warnings of some states, each once.
pub fn warnings<'a>(states: impl IntoIterator<Item = &'a Equilibrium>) -> Vec<&'static str> {
    let mut names: Vec<&str> = states.into_iter().flat_map(|e| e.warnings.names()).collect();
    names.sort_unstable();
    names.dedup();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_reach_the_scene() {
        let scene = Scene::from_toml_str(include_str!("../../../scenes/paper-identified.toml")).unwrap();
        assert_eq!(apply(&scene, "").unwrap(), scene);
        let changed = apply(&scene, "geometry.rod_span_m=0.020; K = 10").unwrap();
        assert_eq!((changed.geometry.rod_span_m, changed.string.stiffness_n_per_m), (0.020, 10.0));
        for (changes, named) in [("K", "`K`"), ("K=ten", "K"), ("radius=1", "radius")] {
            let message = apply(&scene, changes).unwrap_err().to_string();
            assert!(message.contains(named), "{changes}: {message}");
        }
    }

    #[test]
    fn a_changed_scene_that_is_impossible_leaves_a_named_limit() {
        let mut scene = Scene::from_toml_str(include_str!("../../../scenes/paper-identified.toml")).unwrap();
        scene.geometry.clamp_width_m = 0.010;
        let narrow = rows().unwrap().into_iter().find(|r| r.id == "d0-8").unwrap();
        let limit = narrow.compute(&scene).unwrap_err();
        assert_eq!(limit.kind, "parameter");
        assert!(limit.message.contains("geometry.clamp_width_m"), "{}", limit.message);
    }
}
