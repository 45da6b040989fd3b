//! Plants as they might be built: constants off by up to a tenth, friction, noise, play, supply; or rigs of a kind, with
//! all that such rigs have besides their model.

use super::score::SETTLED_M;
use crate::rigs::commission::{Firmware, commission};
use crate::rigs::subject::Subject;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rig_plant::{PlantChange, PlantKey, RigPreset};
use std::fmt;

/// How far a constant of the mechanism or the supply may be off.
pub const TOLERANCE: f64 = 0.1;
/// Rail friction (N).
pub const FRICTION_N: [f64; 2] = [0.0, 0.3];
/// LVDT noise of one sample (m rms): half to twice the default.
pub const NOISE_M: [f64; 2] = [30e-6, 120e-6];
/// Play of the gear at its output (rad): up to about 1°, what planetary gears of this size have. Assumed.
pub const BACKLASH_RAD: [f64; 2] = [0.0, 0.02];
/// Viscous damping on the rail (N s/m). Assumed.
pub const DAMPING_N_S_PER_M: [f64; 2] = [0.5, 2.0];

/// How plants are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// By the ranges above.
    Random,
    /// A kind of rig.
    Rig(RigPreset),
}

impl Kind {
    /// The first so many of the list that every run of the comparison uses. Nothing was tuned on rigs of these seeds
    /// ([`crate::rigs`]).
    pub fn list(self, count: usize) -> Vec<RandomPlant> {
        let plant = |k| match self {
            Self::Random => RandomPlant::new(k),
            Self::Rig(rig) => RandomPlant { kind: self, seed: 1000 + k, keys: rig.changes(1000 + k) },
        };
        (1..=count as u64).map(plant).collect()
    }

    /// How near the target counts as settled (m). A calibrated LVDT is as wrong as the floors of rest against the truth
    /// allow ([`crate::rigs::floor`]), so that no controller could do better by it.
    pub fn settled_m(self) -> f64 {
        match self {
            Self::Random | Self::Rig(RigPreset::Ideal) => SETTLED_M,
            Self::Rig(RigPreset::Nominal) => 150e-6,
            Self::Rig(RigPreset::Hard) => 300e-6,
        }
    }

    /// What the plants differ in that a loop feels, and how that is called.
    fn felt(self) -> (&'static [PlantKey], &'static str) {
        match self {
            Self::Random => (
                &[
                    PlantKey::Friction,
                    PlantKey::Damping,
                    PlantKey::K2Scale,
                    PlantKey::ModulusScale,
                    PlantKey::GearBacklash,
                    PlantKey::LvdtNoise,
                ],
                "friction, damping, k2, modulus, backlash or noise",
            ),
            // Every further key would add two rigs, and the searches would take as much longer.
            Self::Rig(_) => (&[PlantKey::Friction], "friction"),
        }
    }

    /// Of which plants [`RandomPlant::extremes`] is, in words.
    pub fn felt_in_words(self) -> &'static str {
        self.felt().1
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Random => f.pad("random plants"),
            Self::Rig(rig) => write!(f, "{rig} rigs"),
        }
    }
}

/// One plant. The firmware is told none of it.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomPlant {
    /// How it was drawn.
    pub kind: Kind,
    /// Of its constants and its noise.
    pub seed: u64,
    /// Its keys; the load comes with the scenario.
    pub keys: Vec<PlantChange>,
}

impl RandomPlant {
    /// The same for the same seed.
    pub fn new(seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut between = |[low, high]: [f64; 2]| random.random_range(low..=high);
        let around = |value: f64| [value * (1.0 - TOLERANCE), value * (1.0 + TOLERANCE)];
        let supply_v = crate::scene().rig.supply_voltage_v;
        let keys = [
            (PlantKey::K2Scale, around(1.0)),
            (PlantKey::K3Scale, around(1.0)),
            (PlantKey::StiffnessScale, around(1.0)),
            (PlantKey::ModulusScale, around(1.0)),
            (PlantKey::Friction, FRICTION_N),
            (PlantKey::Damping, DAMPING_N_S_PER_M),
            (PlantKey::LvdtNoise, NOISE_M),
            (PlantKey::GearBacklash, BACKLASH_RAD),
            (PlantKey::SupplyVoltage, around(supply_v)),
        ];
        let kind = Kind::Random;
        Self {
            kind,
            seed,
            keys: keys.into_iter().map(|(key, range)| PlantChange { key, value: between(range) }).collect(),
        }
    }

    /// The same plant but for this key.
    #[must_use]
    pub fn with(mut self, change: PlantChange) -> Self {
        self.keys.retain(|s| s.key != change.key);
        self.keys.push(change);
        self
    }

    /// One of its keys.
    fn value(&self, key: PlantKey) -> f64 {
        self.keys.iter().find(|s| s.key == key).map_or(f64::NAN, |s| s.value)
    }

    /// What every controller is built and set up with on it: the default scene's table and no calibration. A nominal or a
    /// hard rig is calibrated and identified first, as its user would do; where that fails, nothing is changed.
    pub fn firmware(&self) -> Firmware {
        match self.kind {
            Kind::Random | Kind::Rig(RigPreset::Ideal) => Firmware::as_built(),
            Kind::Rig(rig) => {
                commission(&Subject { changes: self.keys.clone(), ..Subject::new(rig, self.seed) }, false).0
            }
        }
    }

    /// Seeds of those that have the least or the greatest of anything that a loop feels: whoever manages these should
    /// manage the others.
    pub fn extremes(plants: &[Self]) -> Vec<u64> {
        let keys = plants.first().map_or(&[][..], |plant| plant.kind.felt().0);
        let ends = keys.iter().flat_map(|key| {
            let by_value = |a: &&Self, b: &&Self| a.value(*key).total_cmp(&b.value(*key));
            [plants.iter().min_by(by_value), plants.iter().max_by(by_value)]
        });
        let mut seeds: Vec<u64> = ends.flatten().map(|plant| plant.seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        seeds
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plants_keep_to_their_ranges_and_differ() {
        let plants = Kind::Random.list(50);
        for plant in &plants {
            assert!(
                (0.9..=1.1).contains(&plant.value(PlantKey::K2Scale))
                    && (0.0..=0.3).contains(&plant.value(PlantKey::Friction))
            );
            assert!((21.6..=26.4).contains(&plant.value(PlantKey::SupplyVoltage)));
        }
        assert_eq!(plants[..7], Kind::Random.list(7));
        assert_ne!(plants[0].keys, plants[1].keys);
        let extremes = RandomPlant::extremes(&plants);
        assert!((6..=12).contains(&extremes.len()), "{extremes:?}");
        let most = plants.iter().map(|p| p.value(PlantKey::Friction)).fold(0.0, f64::max);
        assert!(plants.iter().any(|p| p.value(PlantKey::Friction) == most && extremes.contains(&p.seed)));
    }

    #[test]
    fn rigs_of_a_kind_are_those_of_their_seeds() {
        let kind = Kind::Rig(RigPreset::Hard);
        let rigs = kind.list(4);
        assert_eq!((rigs[0].seed, &rigs[0].keys), (1001, &RigPreset::Hard.changes(1001)));
        let extremes = RandomPlant::extremes(&rigs);
        assert_eq!(extremes.len(), 2, "the least and the most friction: {extremes:?}");
        // Rigs of their own model are all alike.
        assert_eq!(RandomPlant::extremes(&Kind::Rig(RigPreset::Ideal).list(3)).len(), 2);
        assert!(kind.settled_m() > Kind::Rig(RigPreset::Nominal).settled_m() && Kind::Random.settled_m() == SETTLED_M);
    }
}
