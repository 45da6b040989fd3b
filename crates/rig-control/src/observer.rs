//! The load, from twist and gap (model.md section 4): rods and strings are the rig's own load cell.
//!
//! One Newton step of the table's inverse each tick, damped: an observer in the load whose innovation is the gap that
//! the table did not expect. One table lookup serves the estimate and TR alike.

use crate::TICK_S;
use tsa_table::{Point, Table};

/// How long the estimate takes to follow (s): longer than a swing of the load, shorter than a step of it matters.
const TIME_CONSTANT_S: f32 = 0.15;
/// Largest relative change of the estimate in one tick: keeps Newton from overshooting where the gap bends like 1/F.
const LARGEST_STEP: f32 = 0.2;

/// Where the load comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadSource {
    /// From twist and gap.
    Estimate,
    /// Given by the operator (N).
    Known(f32),
}

/// The load observer.
#[derive(Clone, Copy, Debug)]
pub struct LoadObserver {
    load_n: f32,
    /// Measured less modelled gap, found at homing (m).
    offset_m: f32,
    /// Where the load for TR comes from.
    pub source: LoadSource,
}

/// What the observer says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Load for TR (N).
    pub load_n: f32,
    /// The table at that load and twist.
    pub point: Point,
    /// The estimate stands at the end of the table's range.
    pub at_range_end: bool,
}

impl LoadObserver {
    /// Starts from a weighed load (N) and the gap offset (m) that goes with it.
    pub const fn new(load_n: f32, offset_m: f32) -> Self {
        Self { load_n, offset_m, source: LoadSource::Estimate }
    }

    /// The estimate (N).
    pub fn load_n(&self) -> f32 {
        self.load_n
    }

    /// One tick: twist (rad) and measured gap (m); `None` keeps the estimate.
    /// Twists below the table's range count as its edge.
    pub fn step(&mut self, table: &Table<'_>, twist_rad: f32, gap_m: Option<f32>) -> Observation {
        let m = &table.metadata;
        let twist = twist_rad.clamp(m.twist_min_rad, m.twist_max_rad);
        let mut at_range_end = false;
        let seen = table.point_inside(self.load_n, twist);
        if let Some(gap_m) = gap_m {
            let innovation = gap_m - self.offset_m - seen.gap_m;
            let newton = innovation / seen.dgap_dload_m_per_n;
            let step =
                (newton * TICK_S / TIME_CONSTANT_S).clamp(-LARGEST_STEP * self.load_n, LARGEST_STEP * self.load_n);
            let load_n = self.load_n + step;
            if load_n.is_finite() {
                self.load_n = load_n.clamp(m.load_min_n, m.load_max_n);
                at_range_end = load_n != self.load_n;
            }
        }
        match self.source {
            LoadSource::Estimate => Observation { load_n: self.load_n, point: seen, at_range_end },
            LoadSource::Known(load_n) => {
                let load_n = load_n.clamp(m.load_min_n, m.load_max_n);
                Observation { load_n, point: table.point_inside(load_n, twist), at_range_end }
            }
        }
    }
}
