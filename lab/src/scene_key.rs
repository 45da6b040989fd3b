//! One key of a scene, named as in the file (`geometry.rod_span_m`) or by the paper's symbol (`D0`), and changed.

use rig_config::{Scene, SceneError};
use rig_plant::units::Quantity;
use tsa_model::ParameterError;

/// The paper's symbols and the keys that they stand for.
pub const SYMBOLS: [(&str, &str); 11] = [
    ("L0", "geometry.string_length_m"),
    ("D0", "geometry.rod_span_m"),
    ("c", "geometry.clamp_width_m"),
    ("R", "geometry.rod_radius_m"),
    ("r0", "string.diameter_m"),
    ("K", "string.stiffness_n_per_m"),
    ("k1", "string.k1_per_n"),
    ("k2", "string.k2"),
    ("k3", "string.k3"),
    ("k4", "string.k4"),
    ("p", "string.twist_exponent"),
];

/// Why a key could not be changed.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// Neither a symbol nor `table.key`, or the scene has no such key, or not of this type.
    #[error("{0}")]
    Key(String),
    /// No rig can have this value.
    #[error(transparent)]
    Value(#[from] SceneError),
}

impl KeyError {
    /// Of a name that is neither a symbol nor `table.key`.
    pub fn form(name: &str) -> Self {
        let symbols = SYMBOLS.map(|(symbol, _)| symbol).join(", ");
        Self::Key(format!(
            "`{name}` is no scene key: give one as in a scene file (geometry.rod_span_m) or one of {symbols}"
        ))
    }

    /// Of a key with what is wrong.
    pub fn unknown(key: &str, reason: &str) -> Self {
        Self::Key(format!("scene key `{key}`: {}", reason.trim()))
    }
}

impl From<ParameterError> for KeyError {
    fn from(error: ParameterError) -> Self {
        Self::Value(error.into())
    }
}

/// The key as in a scene file.
pub fn full_name(name: &str) -> &str {
    SYMBOLS.iter().find(|(symbol, _)| *symbol == name).map_or(name, |(_, key)| key)
}

/// The paper's symbol for a key, or the key itself where the paper has none.
pub fn symbol(key: &str) -> &str {
    SYMBOLS.iter().find(|(_, full)| *full == key).map_or(key, |(symbol, _)| symbol)
}

/// What a key's value measures, as the ending of the key says.
pub fn quantity(key: &str) -> Quantity {
    // `_n_per_m` also ends in `_m`, so it goes first.
    let endings = [
        ("_n_per_m", Quantity::Stiffness),
        ("_per_n", Quantity::PerForce),
        ("_rad_per_s", Quantity::AngularSpeed),
        ("_m", Quantity::Length),
        ("_v", Quantity::Voltage),
    ];
    endings.into_iter().find(|(ending, _)| key.ends_with(ending)).map_or(Quantity::Number, |(_, quantity)| quantity)
}

/// A key's value for people.
pub fn shown(key: &str, value: f64) -> String {
    quantity(key).show(value)
}

/// The scene with one key changed. It goes through the scene's own file form, so every key that a file may have works
/// and is checked as in a file.
///
/// # Errors
/// [`KeyError`] naming the key.
pub fn set(scene: &Scene, name: &str, value: toml::Value) -> Result<Scene, KeyError> {
    let full = full_name(name);
    let Some((table, key)) = full.split_once('.').filter(|(table, key)| !table.is_empty() && !key.is_empty()) else {
        return Err(KeyError::form(name));
    };
    let unknown = |reason: &str| KeyError::unknown(full, reason);
    let mut file = toml::Table::try_from(scene).map_err(|e| unknown(&e.to_string()))?;
    file.entry(table)
        .or_insert_with(|| toml::Table::new().into())
        .as_table_mut()
        .ok_or_else(|| unknown("is no table"))?
        .insert(key.into(), value);
    let changed: Scene = file.try_into().map_err(|e: toml::de::Error| unknown(e.message()))?;
    changed.validate()?;
    Ok(changed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        Scene::from_toml_str(include_str!("../../scenes/default.toml")).unwrap()
    }

    #[test]
    fn symbols_and_keys_change_the_same_value_and_nothing_else() {
        let (old, mut expected) = (scene(), scene());
        expected.geometry.rod_span_m = 0.020;
        assert_eq!(set(&old, "D0", 0.020.into()).unwrap(), expected);
        assert_eq!(set(&old, "geometry.rod_span_m", 0.020.into()).unwrap(), expected);
    }

    #[test]
    fn every_symbol_is_a_key() {
        // No law has both p and k4.
        let power = Scene::from_toml_str(include_str!("../../scenes/paper-identified.toml")).unwrap();
        for (symbol, key) in SYMBOLS {
            let (table, name) = key.split_once('.').unwrap();
            let scene = if symbol == "p" { power.clone() } else { scene() };
            let file = toml::Table::try_from(scene.clone()).unwrap();
            let value = file[table][name].clone();
            assert_eq!(set(&scene, symbol, value).unwrap(), scene, "{symbol}");
        }
    }

    #[test]
    fn values_for_people_have_the_unit_of_their_key() {
        for (key, value, text) in [
            ("geometry.rod_radius_m", 0.00045, "0.45 mm"),
            ("string.stiffness_n_per_m", 10.0, "10 N/m"),
            ("string.stiffness_n_per_m", 1370.0, "1.37 kN/m"),
            ("string.k1_per_n", 7.5, "7.5 1/N"),
            ("string.k2", 0.0, "0"),
            ("string.k3", 123_456.7, "123457"),
            ("geometry.rod_span_m", 0.1 + 0.2, "300 mm"),
        ] {
            assert_eq!(shown(key, value), text);
        }
    }

    #[test]
    fn refusals_name_the_key() {
        for (key, value, named) in [
            ("X9", 1.0, "X9"),
            ("string.", 1.0, "string."),
            ("string.thickness", 1.0, "thickness"),
            ("strings.k2", 1.0, "strings"),
            ("rig.encoder_lines", 1.5, "encoder_lines"),
            ("D0", -1.0, "geometry.rod_span_m"),
        ] {
            let message = set(&scene(), key, value.into()).unwrap_err().to_string();
            assert!(message.contains(named), "{message}");
        }
    }
}
