//! Plants as they might be built: constants off by up to a tenth, friction, noise, play, supply.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rigctl::plant::Setting;

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
    pub keys: Vec<Setting>,
}

impl RandomPlant {
    /// The same for the same seed.
    pub fn new(seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut between = |[low, high]: [f64; 2]| random.random_range(low..=high);
        let around = |value: f64| [value * (1.0 - TOLERANCE), value * (1.0 + TOLERANCE)];
        let supply_v = crate::scene().rig.supply_voltage_v;
        let keys = [
            ("k2_scale", around(1.0)),
            ("k3_scale", around(1.0)),
            ("stiffness_scale", around(1.0)),
            ("modulus_scale", around(1.0)),
            ("friction", FRICTION_N),
            ("damping", DAMPING_N_S_PER_M),
            ("lvdt_noise", NOISE_M),
            ("gear_backlash", BACKLASH_RAD),
            ("supply_voltage", around(supply_v)),
        ];
        Self { seed, keys: keys.into_iter().map(|(key, range)| Setting { key, value: between(range) }).collect() }
    }

    /// The first so many of the list that every run of the comparison uses.
    pub fn list(count: usize) -> Vec<Self> {
        (1..=count as u64).map(Self::new).collect()
    }
}
