//! The load: whether it follows its set-point, and whether the table covers it.

use super::super::{lasts, ticks};
use super::Situation;
use rig_link::messages::{Limit, State};

/// How far the load may stay behind its set-point (m), and for how long: by itself, and with the time that a changed load
/// needs to be known and brought back.
const FOLLOW_M: f32 = 2e-3;
const FOLLOW_TICKS: u16 = ticks(50);
const CHANGED_TICKS: u16 = ticks(300);
/// How long the load estimate may want to leave the table at its heavy end and at its light end, where nothing breaks.
const HEAVY_TICKS: u16 = ticks(30);
const LIGHT_TICKS: u16 = ticks(200);

/// What the load's checks remember. Both are made only while the load is controlled: at rest weights are changed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LoadChecks {
    follow_ticks: u16,
    changed_ticks: u16,
    range_ticks: u16,
}

impl LoadChecks {
    /// The load stays behind its set-point. A load that is held where the strings' travel ends, because it has become too
    /// light to come back down, does not: `travel` says so, and nothing turns.
    pub(super) fn lags(&mut self, situation: &Situation<'_>) -> bool {
        let at_end = situation.state == State::Holding && situation.limit == Some(Limit::Travel);
        let off = !at_end
            && situation
                .set_point_m
                .zip(situation.tracking)
                .is_some_and(|(set_point_m, tracking)| (set_point_m - tracking.position_m).abs() > FOLLOW_M);
        // A load that has changed moves, and one that is jammed does not.
        let observation = situation.tracking.and_then(|tracking| tracking.observation);
        let changed = observation.is_some_and(|o| o.changing && o.moved_m > 0.0);
        let lags = lasts(&mut self.follow_ticks, off && !changed, FOLLOW_TICKS);
        lasts(&mut self.changed_ticks, off, CHANGED_TICKS) || lags
    }

    /// The load is beyond what the table, and so the mechanism, was made for.
    pub(super) fn is_out_of_range(&mut self, situation: &Situation<'_>) -> bool {
        let tracking = situation.set_point_m.and(situation.tracking);
        let at_end = tracking.and_then(|tracking| tracking.observation).is_some_and(|o| o.at_range_end);
        let middle_n = 0.5 * (situation.table.load_min_n + situation.table.load_max_n);
        let heavy = tracking.is_some_and(|tracking| tracking.observer.load_n() > middle_n);
        lasts(&mut self.range_ticks, at_end, if heavy { HEAVY_TICKS } else { LIGHT_TICKS })
    }
}
