//! The solver on a table's range: the states that a table is fitted to and judged by.

use crate::table_spec::{FitError, TableSpec};
use tsa_model::{Equilibrium, Mechanism, PRETWIST_RAD, Tier};

/// The solver, the tier of the model, and the range.
pub struct Reference<'a> {
    /// The mechanism.
    pub mechanism: &'a Mechanism,
    /// The tier whose answers count as exact.
    pub tier: Tier,
    /// Minimum and maximum load (N).
    pub load_n: [f64; 2],
    /// Minimum and maximum twist (rad).
    pub twist_rad: [f64; 2],
}

/// The exact gap and its derivative by twist at a point, and the gap at the pre-twist under the same load.
#[derive(Clone, Copy, Debug)]
pub struct Exact {
    /// Load (N).
    pub load_n: f64,
    /// Twist (rad).
    pub twist_rad: f64,
    /// Gap (m).
    pub gap_m: f64,
    /// ∂G/∂θ (m/rad).
    pub by_twist: f64,
    /// Gap at the half-turn pre-twist (m).
    pub start_gap_m: f64,
}

impl<'a> Reference<'a> {
    /// The range that a demand covers.
    pub fn new(mechanism: &'a Mechanism, tier: Tier, table_spec: &TableSpec) -> Self {
        Self { mechanism, tier, load_n: table_spec.load_n, twist_rad: [PRETWIST_RAD, table_spec.twist_max_rad] }
    }

    /// The equilibrium at a load (N) and a twist (rad).
    ///
    /// # Errors
    /// [`FitError::Envelope`].
    pub fn solve(&self, load_n: f64, twist_rad: f64) -> Result<Equilibrium, FitError> {
        let solved = match self.tier {
            Tier::Full => self.mechanism.solve(load_n, twist_rad),
            tier => self.mechanism.formal_tier(tier, load_n, twist_rad),
        };
        solved.map_err(|source| FitError::Envelope {
            load_n,
            turns: (twist_rad - PRETWIST_RAD) / std::f64::consts::TAU,
            source,
        })
    }

    /// One point, with the gap at the pre-twist solved too.
    ///
    /// # Errors
    /// [`FitError::Envelope`].
    pub fn exact(&self, load_n: f64, twist_rad: f64) -> Result<Exact, FitError> {
        let e = self.solve(load_n, twist_rad)?;
        let start_gap_m = self.solve(load_n, self.twist_rad[0])?.gap_m;
        Ok(Exact { load_n, twist_rad, gap_m: e.gap_m, by_twist: e.dgap_dtwist_m_per_rad, start_gap_m })
    }

    /// The points at a load (N) and these twists (rad).
    ///
    /// # Errors
    /// [`FitError::Envelope`].
    pub fn exact_at(&self, load_n: f64, twists_rad: impl Iterator<Item = f64>) -> Result<Vec<Exact>, FitError> {
        let start_gap_m = self.solve(load_n, self.twist_rad[0])?.gap_m;
        let point = |twist_rad| {
            let e = self.solve(load_n, twist_rad)?;
            Ok(Exact { load_n, twist_rad, gap_m: e.gap_m, by_twist: e.dgap_dtwist_m_per_rad, start_gap_m })
        };
        twists_rad.map(point).collect()
    }

    /// The points by which candidates are compared: between any candidate's nodes, edges included, evenly spaced in the
    /// logarithm of the load.
    ///
    /// # Errors
    /// [`FitError::Envelope`].
    pub fn selection_grid(&self) -> Result<Vec<Exact>, FitError> {
        const LOADS: u32 = 37;
        const TWISTS: u32 = 53;
        let [f0, f1] = self.load_n;
        let [t0, t1] = self.twist_rad;
        let mut points = Vec::new();
        for i in 0..=LOADS {
            let load = f0 * (f1 / f0).powf(f64::from(i) / f64::from(LOADS));
            points
                .extend(self.exact_at(load, (0..=TWISTS).map(|j| t0 + (t1 - t0) * f64::from(j) / f64::from(TWISTS)))?);
        }
        Ok(points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arc_growth::example::PARAMETERS;

    #[test]
    fn candidates_are_compared_evenly_from_edge_to_edge() {
        // Rods that do not bend are solved in no time.
        let mechanism = Mechanism::of(PARAMETERS);
        let (load_n, twist_rad) = ([2.0, 16.0], [PRETWIST_RAD, 40.0]);
        let points =
            Reference { mechanism: &mechanism, tier: Tier::Rigid, load_n, twist_rad }.selection_grid().unwrap();
        let even = |value: fn(&Exact) -> f64, [first, last]: [f64; 2]| {
            let mut all: Vec<f64> = points.iter().map(value).collect();
            all.sort_by(f64::total_cmp);
            all.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
            let step = (last - first) / (all.len() - 1) as f64;
            all.iter().enumerate().all(|(k, at)| (at - first - step * k as f64).abs() < 1e-9).then_some(all.len())
        };
        let twists = even(|p| p.twist_rad, twist_rad).expect("twists");
        let loads = even(|p| p.load_n.ln(), load_n.map(f64::ln)).expect("logarithms of the load");
        assert!(twists > 50 && loads > 30 && points.len() == twists * loads, "{twists} × {loads}: {}", points.len());
    }
}
