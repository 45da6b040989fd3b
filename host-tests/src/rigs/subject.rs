//! Which rigs the studies are made on: of a kind, with a single effect, or drawn by chance.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rig_config::Scene;
use rig_plant::PlantSettings;
use rig_plant::rig::{EmulatedRig, RigError};
use rig_plant::{PlantChange, PlantKey, RigPreset};
use std::fmt;

/// One of what real rigs have besides their model: its name in figures and tables, and the plant keys that make it.
pub type Effect = (&'static str, &'static [PlantKey]);

/// All of them, as crates/rig-plant/README.md has them.
pub const EFFECTS: [Effect; 10] = {
    use PlantKey as K;
    [
        ("current reading", &[K::CurrentOffset, K::CurrentNoise, K::CurrentQuantum]),
        (
            "motor and gear",
            &[K::TorqueConstantScale, K::MotorFriction, K::MotorFrictionAsymmetry, K::GearEfficiency, K::GearBacklash],
        ),
        ("rail friction", &[K::Friction, K::FrictionLoadShare, K::StictionRatio, K::StribeckSpeed, K::Presliding]),
        ("rod hysteresis", &[K::RodHysteresis]),
        ("string creep", &[K::StringCreep]),
        ("string bedding", &[K::StringBedding]),
        ("twist play", &[K::TwistPlay]),
        ("LVDT and converter", &[K::LvdtNonlinearity, K::AdcInl, K::LvdtNoiseInband, K::Hum]),
        ("radius law", &[K::TwistExponentShift]),
        ("temperature", &[K::Temperature]),
    ]
};

/// How far a single effect is turned up, in nominal sizes.
pub const FACTORS: [f64; 5] = [0.5, 1.0, 2.0, 4.0, 8.0];

/// How far a constant of the mechanism or the supply of a random plant may be off.
const TOLERANCE: f64 = 0.1;

/// One rig. The firmware is told none of it.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Whose floors it is held against.
    pub kind: RigPreset,
    /// Of its constants and its noise.
    pub seed: u64,
    /// The one effect that it has, if not all.
    pub effect: Option<String>,
    /// Size of that effect, in nominal sizes.
    pub factor: Option<f64>,
    /// Its plant keys, but for load and twist at boot.
    pub changes: Vec<PlantChange>,
    /// The board's setting `loop-gain`.
    pub loop_gain: f32,
}

/// Twist at power-up (rad), either way: a few turns.
const TWIST_AT_BOOT_RAD: f64 = 12.0;

impl Subject {
    /// The rig of a kind that a seed names, with all effects.
    pub fn new(kind: RigPreset, seed: u64) -> Self {
        Self { kind, seed, effect: None, factor: None, changes: kind.changes(seed), loop_gain: 1.0 }
    }

    /// A plant with constants off by up to a tenth, friction, noise, play and damping: the same for the same seed. Friction is in N;
    /// noise of one LVDT sample in m rms, half to twice the default; play of the gear at its output in rad, up to about 1°, what
    /// planetary gears of this size have (assumed); damping on the rail in N s/m (assumed).
    pub fn random(seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let around = |value: f64| [value * (1.0 - TOLERANCE), value * (1.0 + TOLERANCE)];
        let changes = [
            (PlantKey::K2Scale, around(1.0)),
            (PlantKey::K3Scale, around(1.0)),
            (PlantKey::StiffnessScale, around(1.0)),
            (PlantKey::ModulusScale, around(1.0)),
            (PlantKey::Friction, [0.0, 0.3]),
            (PlantKey::Damping, [0.5, 2.0]),
            (PlantKey::LvdtNoise, [30e-6, 120e-6]),
            (PlantKey::GearBacklash, [0.0, 0.02]),
            (PlantKey::SupplyVoltage, around(crate::scene().rig.supply_voltage_v)),
        ];
        let changes = changes.map(|(key, [low, high])| PlantChange { key, value: random.random_range(low..=high) });
        Self { changes: changes.into(), ..Self::new(RigPreset::Ideal, seed) }
    }

    /// One of its keys.
    pub fn value(&self, key: PlantKey) -> f64 {
        self.changes.iter().find(|s| s.key == key).map_or(f64::NAN, |s| s.value)
    }

    /// The rig of its own model but for one effect, `factor` times as large as a kind of rig has it at most. Rigs with even
    /// seeds have the other sign.
    pub fn with_effect((name, keys): &Effect, kind: RigPreset, factor: Option<f64>, seed: u64) -> Self {
        let sign = if seed.is_multiple_of(2) { -1.0 } else { 1.0 };
        let size = sign * factor.unwrap_or(1.0);
        let changes = keys.iter().filter_map(|key| kind.extreme(*key, size)).collect();
        // What is turned up beyond its size is held against the hard rigs' floors.
        let kind = if factor.is_some() { RigPreset::Hard } else { kind };
        Self { kind, seed, effect: Some((*name).to_owned()), factor, changes, loop_gain: 1.0 }
    }

    /// The rig as switched on under a load (N).
    ///
    /// # Errors
    /// [`RigError`] if the mechanism cannot carry it.
    pub fn switched_on(&self, load_n: f64) -> Result<EmulatedRig, RigError> {
        self.switched_on_at(load_n, self.twist_at_boot(load_n))
    }

    /// The same with the strings at a twist (rad).
    ///
    /// # Errors
    /// As [`Subject::switched_on`].
    pub fn switched_on_at(&self, load_n: f64, twist_rad: f64) -> Result<EmulatedRig, RigError> {
        let mut settings = self.settings();
        (settings.load_n, settings.twist_at_boot_rad) = (load_n, twist_rad);
        EmulatedRig::new(crate::scene(), settings, self.seed)
    }

    /// What the plant is set to, but for load and twist at boot.
    pub fn settings(&self) -> PlantSettings {
        let mut settings = PlantSettings::default();
        for change in &self.changes {
            settings.apply(*change).unwrap_or_else(|e| panic!("the study's own plant: {e}"));
        }
        settings
    }

    /// The scene with the constants that this rig's mechanism really has.
    pub fn constants(&self) -> Scene {
        self.settings().distort(crate::scene())
    }

    /// The true contraction (m) between the half-turn pre-twist and a twist (rad) under a load (N): of the rig as built,
    /// at rest, without friction.
    ///
    /// # Errors
    /// As [`Subject::switched_on`].
    pub fn contraction_m(&self, load_n: f64, twist_rad: f64) -> Result<f64, RigError> {
        let truth = self.switched_on_at(load_n, twist_rad)?.truth();
        Ok(truth.pretwist_gap_m - truth.gap_m)
    }

    /// The same rig at the temperature of its calibration: when it is calibrated and identified.
    #[must_use]
    pub fn at_calibration(&self) -> Self {
        let changes = self.changes.iter().filter(|change| change.key != PlantKey::Temperature).copied().collect();
        Self { changes, ..self.clone() }
    }

    /// Where the strings stand at power-up (rad): another place for each seed and load, as somebody left them.
    fn twist_at_boot(&self, load_n: f64) -> f64 {
        TWIST_AT_BOOT_RAD * (2.0 * ((0.618_034 * self.seed as f64 + 0.37 * load_n) % 1.0) - 1.0)
    }
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} rig {}", self.kind, self.seed)?;
        match (&self.effect, self.factor) {
            (Some(effect), Some(factor)) => write!(f, ", {effect} × {factor}"),
            (Some(effect), None) => write!(f, ", {effect} alone"),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_plants_keep_to_their_ranges_and_differ() {
        for plant in (1..=50).map(Subject::random) {
            assert!((0.9..=1.1).contains(&plant.value(PlantKey::K2Scale)));
            assert!((0.0..=0.3).contains(&plant.value(PlantKey::Friction)));
            assert!((21.6..=26.4).contains(&plant.value(PlantKey::SupplyVoltage)));
        }
        assert_eq!(Subject::random(1).changes, Subject::random(1).changes);
        assert_ne!(Subject::random(1).changes, Subject::random(2).changes);
    }

    #[test]
    fn every_key_of_a_preset_belongs_to_one_effect() {
        for change in RigPreset::Hard.changes(1) {
            let effects = EFFECTS.iter().filter(|(_, keys)| keys.contains(&change.key));
            assert_eq!(effects.count(), 1, "{}", change.key);
        }
    }

    #[test]
    fn a_single_effect_leaves_the_rest_of_its_model() {
        for effect in &EFFECTS {
            let [up, down] = [1, 2].map(|seed| Subject::with_effect(effect, RigPreset::Nominal, Some(2.0), seed));
            let keys: Vec<PlantKey> = up.changes.iter().map(|change| change.key).collect();
            assert_eq!(keys, effect.1, "{}", effect.0);
            assert_eq!((up.kind, down.factor), (RigPreset::Hard, Some(2.0)));
        }
        let current = |seed| Subject::with_effect(&EFFECTS[0], RigPreset::Nominal, None, seed).changes[0].value;
        assert_eq!((current(1), current(2)), (5e-3, -5e-3));
    }

    #[test]
    fn a_rig_is_calibrated_at_its_own_temperature() {
        let rig = Subject::new(RigPreset::Hard, 3);
        let temperature = |rig: &Subject| rig.changes.iter().any(|change| change.key == PlantKey::Temperature);
        assert!(temperature(&rig) && !temperature(&rig.at_calibration()));
        assert_eq!(rig.at_calibration().changes.len() + 1, rig.changes.len());
    }
}
