//! A scene: the mechanism's constants, the rig around it, and what a table must cover.

use crate::error::{SceneError, TableError};
use crate::rig::RigConfig;
use crate::uncertainty::Uncertainty;
use rig_control::RigConstants;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;
use tsa_model::error::require;
use tsa_model::mechanism::LIGHT_LOAD_N;
use tsa_model::{
    Correction, Geometry, Material, Mechanism, ParameterError, Parameters, StringParameters, Tier, twist_from_turns,
};
use tsa_table::fit::{self, Fit};
use tsa_table::{Accuracy, TableSpec};

/// One rig and one task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Lengths of the mechanism.
    pub geometry: Geometry,
    /// The strings.
    #[serde(rename = "string")]
    pub string: StringParameters,
    /// The rods' material.
    pub material: Material,
    /// What the law misses of this rig's gap, as measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<Correction>,
    /// The rig around the mechanism; assumed values where left out.
    #[serde(default)]
    pub rig: RigConfig,
    /// How well the mechanism's constants are known.
    #[serde(default, skip_serializing_if = "Uncertainty::is_default")]
    pub uncertainty: Uncertainty,
    /// What a table must cover.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub envelope: Option<Envelope>,
    /// How well a table must do it.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "accuracy")]
    pub accuracy: Option<Accuracy>,
}

/// What a table must cover.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Envelope {
    /// Minimum and maximum load (N).
    pub load_n: [f64; 2],
    /// Minimum and maximum motor turns past the half-turn pre-twist.
    pub turns: [f64; 2],
}

impl Scene {
    /// Parses and checks a scene.
    ///
    /// # Errors
    /// [`SceneError`] naming the key.
    pub fn from_toml_str(text: &str) -> Result<Self, SceneError> {
        let scene: Self = toml::from_str(text)?;
        scene.validate()?;
        Ok(scene)
    }

    /// Reads, parses and checks a scene file.
    ///
    /// # Errors
    /// [`SceneError`] naming the file or the key.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let read = || Self::from_toml_str(&std::fs::read_to_string(path)?);
        read().map_err(|error| error.in_file(path))
    }

    /// Checks every value, and against each other those that a solve uses or that could hurt hardware.
    ///
    /// # Errors
    /// [`SceneError`] naming the keys.
    pub fn validate(&self) -> Result<(), SceneError> {
        self.values()?;
        self.check_always()
    }

    /// Checks every value by itself.
    fn values(&self) -> Result<(), ParameterError> {
        self.geometry.validate()?;
        self.string.validate()?;
        self.material.validate()?;
        self.rig.validate()?;
        self.uncertainty.validate()?;
        self.correction.as_ref().map_or(Ok(()), Correction::validate)?;
        if let Some(Envelope { load_n: [min_n, max_n], turns: [first, last] }) = self.envelope {
            let (loads, turns, end) = ("envelope.load_n", "envelope.turns", "must end above its start");
            let supported = min_n >= LIGHT_LOAD_N && min_n.is_finite();
            require(supported, loads, min_n, "must start at 0.5 N or above, where the radius law holds")?;
            require(max_n > min_n && max_n.is_finite(), loads, max_n, end)?;
            require(first >= 0.0, turns, first, "must start at 0 or above, where the strings touch")?;
            require(last > first && last.is_finite(), turns, last, end)?;
        }
        self.accuracy.map_or(Ok(()), |Accuracy { contraction_m, tr_relative }| {
            let gap = "must be above 0 and at most 0.01 (m)";
            require(contraction_m > 0.0 && contraction_m <= 0.01, "accuracy.contraction_m", contraction_m, gap)?;
            let ratio = "must be above 0 and at most 0.5 (a fraction)";
            require(tr_relative > 0.0 && tr_relative <= 0.5, "accuracy.tr_relative", tr_relative, ratio)
        })
    }

    /// The solver for this scene, with the measured correction.
    ///
    /// # Errors
    /// [`ParameterError`] naming the key.
    pub fn mechanism(&self) -> Result<Mechanism, ParameterError> {
        let law = Parameters::new(&self.geometry, &self.string, &self.material)?;
        self.correction.as_ref().map_or(Ok(()), Correction::validate)?;
        Ok(Mechanism::of(Parameters { correction: self.correction, ..law }))
    }

    /// The rig's numbers for the control code; the settings on the board correct them later.
    pub fn constants(&self) -> RigConstants {
        self.rig.constants()
    }

    /// What a table must cover.
    ///
    /// # Errors
    /// [`SceneError::Missing`] if the scene does not say it.
    pub fn covered(&self) -> Result<Envelope, SceneError> {
        self.envelope.ok_or(SceneError::Missing { table: "envelope" })
    }

    /// Envelope and accuracy, which a table needs.
    ///
    /// # Errors
    /// [`SceneError::Missing`] naming the absent one.
    pub fn table_requirement(&self) -> Result<(Envelope, Accuracy), SceneError> {
        let envelope = self.covered()?;
        let accuracy = self.accuracy.ok_or(SceneError::Missing { table: "accuracy" })?;
        Ok((envelope, accuracy))
    }

    /// The same as the fit of a table takes it.
    ///
    /// # Errors
    /// As [`Scene::table_requirement`], and where the model has no equilibrium in the middle of the envelope.
    pub fn table_spec(&self) -> Result<TableSpec, SceneError> {
        let (envelope, accuracy) = self.table_requirement()?;
        let [_, twist_max_rad] = envelope.twist_rad();
        let uncertainty = self.uncertainty.of_table(self.twist_scale_error()?);
        Ok(TableSpec { load_n: envelope.load_n, twist_max_rad, accuracy, uncertainty, scene_hash: self.hash() })
    }

    /// Standard error (relative) of the scale of the twist that compensates an error of the string radius, in the middle of the
    /// envelope. The radius grows with the twist: a twist that is scaled by s has an arc θ r that is scaled by s to the power
    /// (∂(θ r)/∂θ)/r.
    ///
    /// # Errors
    /// Without an envelope, or an equilibrium there.
    pub fn twist_scale_error(&self) -> Result<f64, SceneError> {
        let Envelope { load_n: [min_n, max_n], turns: [first, last] } = self.covered()?;
        let (load_n, turns) = ((min_n * max_n).sqrt(), 0.5 * (first + last));
        let (mechanism, twist_rad) = (self.mechanism()?, twist_from_turns(turns));
        let found = mechanism.solve(load_n, twist_rad);
        let x_m = found.map_err(|limit| SceneError::Unsolvable { load_n, turns, limit })?.x_m;
        let radius = mechanism.parameters().radius(load_n, twist_rad, x_m, mechanism.start_length_m());
        Ok(self.uncertainty.radius * radius.radius_m / radius.arc_by_twist)
    }

    /// Fits, chooses and certifies the table of this scene.
    ///
    /// # Errors
    /// [`TableError`]: the scene is wrong or has no envelope or accuracy, the envelope breaks the model, or no table
    /// reaches the accuracy.
    pub fn fit_table(&self) -> Result<Fit, TableError> {
        let table_spec = self.table_spec()?;
        Ok(fit::fit_tier(&self.mechanism()?, &table_spec, Tier::Full)?)
    }

    /// CRC-32 of the scene's canonical form: the same for files that differ only in comments, order or defaults.
    pub fn hash(&self) -> u32 {
        hash(self)
    }

    /// The same of `[rig]` alone, which a table does not depend on and a board has built in.
    pub fn rig_hash(&self) -> u32 {
        hash(&self.rig)
    }
}

/// `[accuracy]`; a refusal says where its numbers can be had.
fn accuracy<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Accuracy>, D::Error> {
    Accuracy::deserialize(deserializer).map(Some).map_err(|error| {
        D::Error::custom(format!(
            "{error}: [accuracy] has the numbers contraction_m and tr_relative, and `tsa-lab budget` prints those that are worth having"
        ))
    })
}

fn hash(value: &impl Serialize) -> u32 {
    // Serialising plain numbers into a string cannot fail; an empty text would still be a valid hash input.
    let text = toml::to_string(value).unwrap_or_default();
    crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(text.as_bytes())
}

impl Envelope {
    /// Minimum and maximum twist (rad).
    pub fn twist_rad(&self) -> [f64; 2] {
        self.turns.map(twist_from_turns)
    }
}
