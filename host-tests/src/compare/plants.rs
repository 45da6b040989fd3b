//! Plants as they might be built: constants off by up to a tenth, friction, noise, play, supply.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sim_link::{PlantChange, PlantKey};

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

/// One plant. The firmware is told none of it.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomPlant {
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
        Self { seed, keys: keys.into_iter().map(|(key, range)| PlantChange { key, value: between(range) }).collect() }
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

    /// The first so many of the list that every run of the comparison uses.
    pub fn list(count: usize) -> Vec<Self> {
        (1..=count as u64).map(Self::new).collect()
    }

    /// Seeds of those that have the least or the greatest of anything that a loop feels: whoever manages these should
    /// manage the others.
    pub fn extremes(plants: &[Self]) -> Vec<u64> {
        let keys = [
            PlantKey::Friction,
            PlantKey::Damping,
            PlantKey::K2Scale,
            PlantKey::ModulusScale,
            PlantKey::GearBacklash,
            PlantKey::LvdtNoise,
        ];
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
        let plants = RandomPlant::list(50);
        for plant in &plants {
            assert!(
                (0.9..=1.1).contains(&plant.value(PlantKey::K2Scale))
                    && (0.0..=0.3).contains(&plant.value(PlantKey::Friction))
            );
            assert!((21.6..=26.4).contains(&plant.value(PlantKey::SupplyVoltage)));
        }
        assert_eq!(plants[..7], RandomPlant::list(7));
        assert_ne!(plants[0].keys, plants[1].keys);
        let extremes = RandomPlant::extremes(&plants);
        assert!((6..=12).contains(&extremes.len()), "{extremes:?}");
        let most = plants.iter().map(|p| p.value(PlantKey::Friction)).fold(0.0, f64::max);
        assert!(plants.iter().any(|p| p.value(PlantKey::Friction) == most && extremes.contains(&p.seed)));
    }
}
