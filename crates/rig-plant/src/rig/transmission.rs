//! The relation of load, twist and gap: the gap at which the mechanism balances a load.

use rig_config::Scene;
use tsa_model::{Equilibrium, Mechanism, Tier, TierError, twist_from_turns};

/// The equilibrium gap and its slopes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GapPoint {
    /// Gap G between the clamps, m.
    pub gap_m: f64,
    /// ∂G/∂θ at constant load, m/rad; 0 at zero twist, negative above.
    pub by_twist_m_per_rad: f64,
    /// ∂G/∂F at constant twist, m/N; positive.
    pub by_load_m_per_n: f64,
}

/// A mechanism as the plant sees it. Twists are not negative: the mechanism is even in θ.
pub trait Transmission {
    /// The equilibrium at a twist of at least 0 rad and a load in N; `None` where there is none.
    fn gap(&self, twist_rad: f64, load_n: f64) -> Option<GapPoint>;
}

fn point(solved: &Equilibrium, twist_rad: f64) -> GapPoint {
    GapPoint {
        gap_m: solved.gap_m,
        by_twist_m_per_rad: if twist_rad == 0.0 { 0.0 } else { solved.dgap_dtwist_m_per_rad },
        by_load_m_per_n: solved.dgap_dload_m_per_n,
    }
}

impl Transmission for Mechanism {
    fn gap(&self, twist_rad: f64, load_n: f64) -> Option<GapPoint> {
        self.solve(load_n, twist_rad).ok().map(|e| point(&e, twist_rad))
    }
}

/// A mechanism by a cheaper model.
#[derive(Clone, Copy, Debug)]
pub struct Tiered<'a> {
    /// The mechanism.
    pub mechanism: &'a Mechanism,
    /// The model.
    pub tier: Tier,
}

impl Transmission for Tiered<'_> {
    fn gap(&self, twist_rad: f64, load_n: f64) -> Option<GapPoint> {
        self.mechanism.solve_tier(self.tier, load_n, twist_rad).ok().map(|t| point(&t.equilibrium, twist_rad))
    }
}

/// The plant has to be this much more accurate than the scene requires of the firmware's table, so that its errors do
/// not show in a test of the table.
const BETTER: f64 = 5.0;
/// Number of loads, and of twists, at which the models estimate their errors.
const ASKED: u32 = 9;

/// The cheapest model whose own error estimate is good enough for the scene, everywhere in its envelope; the full one
/// where the scene requires no accuracy.
pub fn cheapest_tier(mechanism: &Mechanism, scene: &Scene) -> Tier {
    let Ok((envelope, accuracy)) = scene.table_demand() else { return Tier::Full };
    let part = |k: u32| f64::from(k) / f64::from(ASKED - 1);
    let [f0, f1] = envelope.load_n;
    let [t0, t1] = envelope.turns;
    let states: Vec<(f64, f64)> = (0..ASKED)
        .flat_map(|i| {
            (0..ASKED).map(move |j| (f0 * (f1 / f0).powf(part(i)), twist_from_turns(t0 + (t1 - t0) * part(j))))
        })
        .collect();
    let good = |e: &TierError| {
        BETTER * e.contraction_m <= accuracy.contraction_m && BETTER * e.tr_relative <= accuracy.tr_relative
    };
    let serves = |tier: &Tier| {
        states.iter().all(|(load, twist)| mechanism.solve_tier(*tier, *load, *twist).is_ok_and(|t| good(&t.error)))
    };
    Tier::ALL.into_iter().find(serves).unwrap_or(Tier::Full)
}
