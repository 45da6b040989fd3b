//! `[accuracy]`: how well a table must reproduce the model, in numbers or by the error budget.

use crate::budget::{Budget, Rig};
use crate::{Scene, SceneError};
use rig_plant::RigPreset;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use tsa_table::Accuracy;

/// How well a table must reproduce the full model, as a scene says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TableAccuracy {
    /// `contraction_m` and `tr_relative`.
    Given(Accuracy),
    /// `accuracy = "budget"` (on a nominal rig), or `budget` with a kind of rig: as well as it is worth having on such a rig.
    Budget(RigPreset),
}

impl TableAccuracy {
    /// In numbers, for a scene.
    ///
    /// # Errors
    /// [`SceneError::Budget`]: the budget needs an envelope in which every state has an equilibrium.
    pub(crate) fn of(self, scene: &Scene) -> Result<Accuracy, SceneError> {
        match self {
            Self::Given(accuracy) => Ok(accuracy),
            Self::Budget(kind) => {
                let rig = Rig { sizes: &|key| kind.rms(key), gauge_m: None };
                let budget = Budget::new(scene, &rig).map_err(|e| SceneError::Budget(Box::new(e)))?;
                Ok(budget.worth())
            }
        }
    }
}

/// The word for the budget of a nominal rig.
const WORD: &str = "budget";

impl Serialize for TableAccuracy {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Given(accuracy) => accuracy.serialize(serializer),
            Self::Budget(kind) if *kind == RigPreset::default() => serializer.serialize_str(WORD),
            Self::Budget(kind) => {
                let mut map = serializer.serialize_map(Some(1))?;
                map.serialize_entry(WORD, kind.name())?;
                map.end()
            }
        }
    }
}

/// The keys of `[accuracy]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    contraction_m: Option<f64>,
    tr_relative: Option<f64>,
    budget: Option<String>,
}

impl<'de> Deserialize<'de> for TableAccuracy {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Word)
    }
}

struct Word;

impl<'de> Visitor<'de> for Word {
    type Value = TableAccuracy;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("accuracy = \"budget\", or a table with contraction_m and tr_relative, or with budget")
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<TableAccuracy, E> {
        if word == WORD {
            return Ok(TableAccuracy::Budget(RigPreset::default()));
        }
        Err(E::custom(format!("accuracy: `{word}` is not \"budget\", nor a table of numbers")))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<TableAccuracy, A::Error> {
        let Keys { contraction_m, tr_relative, budget } = Keys::deserialize(MapAccessDeserializer::new(map))?;
        let missing = |key| A::Error::custom(format!("missing field `{key}` in [accuracy]"));
        match (budget, contraction_m, tr_relative) {
            (Some(kind), None, None) => {
                let kind = kind.parse().map_err(|e| A::Error::custom(format!("accuracy.budget: {e}")))?;
                Ok(TableAccuracy::Budget(kind))
            }
            (Some(_), ..) => {
                Err(A::Error::custom("accuracy.budget: stands alone, without contraction_m and tr_relative"))
            }
            (None, contraction_m, tr_relative) => Ok(TableAccuracy::Given(Accuracy {
                contraction_m: contraction_m.ok_or_else(|| missing("contraction_m"))?,
                tr_relative: tr_relative.ok_or_else(|| missing("tr_relative"))?,
            })),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NUMBERS: &str = "[accuracy]\ncontraction_m = 5e-6\ntr_relative = 2e-3\n";

    fn file(first: &str, table: &str) -> String {
        let text = include_str!("../../../scenes/default.toml");
        assert!(text.contains(NUMBERS));
        format!("{first}{}", text.replace(NUMBERS, table))
    }

    fn error(first: &str, table: &str) -> String {
        Scene::from_toml_str(&file(first, table)).expect_err(table).to_string()
    }

    #[test]
    fn the_budget_stands_for_its_numbers() {
        let scene = Scene::from_toml_str(&file("accuracy = \"budget\"\n", "")).unwrap();
        let named = Scene::from_toml_str(&file("", "[accuracy]\nbudget = \"nominal\"\n")).unwrap();
        assert_eq!(scene, named);
        let kind = RigPreset::Nominal;
        let rig = Rig { sizes: &|key| kind.rms(key), gauge_m: None };
        let worth = Budget::new(&scene, &rig).unwrap().worth();
        assert_eq!(scene.demand().unwrap().accuracy, worth);
        // A scene with the numbers typed is the same, for a board as well.
        let typed = Scene { accuracy: Some(TableAccuracy::Given(worth)), ..scene.clone() };
        assert_eq!((typed.hash(), typed.demand_hash()), (scene.hash(), scene.demand_hash()));
        assert_ne!(Scene::from_toml_str(&file("", NUMBERS)).unwrap().hash(), scene.hash());
        let ideal = Scene::from_toml_str(&file("", "[accuracy]\nbudget = \"ideal\"\n")).unwrap();
        assert!(ideal.demand().unwrap().accuracy.tr_relative < worth.tr_relative);
    }

    #[test]
    fn a_scene_keeps_the_word_in_a_file() {
        for table in ["[accuracy]\nbudget = \"hard\"\n", "[accuracy]\nbudget = \"nominal\"\n", NUMBERS] {
            let scene = Scene::from_toml_str(&file("", table)).unwrap();
            let text = toml::to_string(&scene).unwrap();
            assert_eq!(Scene::from_toml_str(&text).unwrap(), scene, "{text}");
        }
    }

    #[test]
    fn what_is_neither_is_refused_by_name() {
        for (first, table, named) in [
            ("accuracy = \"fine\"\n", "", "accuracy: `fine`"),
            ("accuracy = 5e-6\n", "", "accuracy = \"budget\""),
            ("", "[accuracy]\nbudget = \"good\"\n", "accuracy.budget: `good` is no rig"),
            ("", "[accuracy]\nbudget = 3\n", "budget"),
            ("", "[accuracy]\ncontraction_m = 5e-6\n", "tr_relative"),
            ("", "[accuracy]\ntr_relative = 5e-6\n", "contraction_m"),
            ("", "[accuracy]\ncontraction = 5e-6\ntr_relative = 2e-3\n", "contraction"),
            ("", "[accuracy]\nbudget = \"hard\"\ntr_relative = 2e-3\n", "accuracy.budget: stands alone"),
            ("", "[accuracy]\ncontraction_m = -1.0\ntr_relative = 2e-3\n", "accuracy.contraction_m"),
        ] {
            assert!(error(first, table).contains(named), "{table}: {}", error(first, table));
        }
    }

    #[test]
    fn a_budget_needs_an_envelope() {
        let text =
            file("accuracy = \"budget\"\n", "").replace("[envelope]\nload_n = [0.75, 18.0]\nturns = [0.0, 7.5]\n", "");
        let scene = Scene::from_toml_str(&text).unwrap();
        let error = scene.accuracy().unwrap_err().to_string();
        assert!(error.contains("accuracy = \"budget\"") && error.contains("[envelope]"), "{error}");
        assert_eq!(scene.hash(), Scene::from_toml_str(&text).unwrap().hash());
    }
}
