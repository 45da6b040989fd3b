//! Where load, twist and gap meet: the gap at which the mechanism balances a load.

use tsa_model::Mechanism;

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

impl Transmission for Mechanism {
    fn gap(&self, twist_rad: f64, load_n: f64) -> Option<GapPoint> {
        let solved = self.solve(load_n, twist_rad).ok()?;
        Some(GapPoint {
            gap_m: solved.gap_m,
            by_twist_m_per_rad: if twist_rad == 0.0 { 0.0 } else { solved.dgap_dtwist_m_per_rad },
            by_load_m_per_n: solved.dgap_dload_m_per_n,
        })
    }
}
