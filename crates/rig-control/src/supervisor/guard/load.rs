//! The load: whether it follows its set-point, and whether the table covers it.

use super::super::{Controller, lasts};
use super::{LONG_TICKS, SHORT_TICKS};
use crate::TICK_S;
use rig_link::messages::{Limit, State};

/// How far the load may stay behind its set-point (m).
const FOLLOW_M: f32 = 2e-3;

/// What the load's checks remember. Both are made only while the load is controlled: at rest weights are changed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LoadChecks {
    jammed_ticks: u16,
    off_ticks: u16,
    range_ticks: u16,
}

impl LoadChecks {
    /// The load stays behind its set-point. A load that is held where the strings' travel ends does not: it has become too
    /// light to be let down to its place, or too heavy to be brought up. The limit `travel` is reported, and nothing turns.
    pub(super) fn lags(&mut self, rig: &Controller) -> bool {
        let at_end = rig.state() == State::Holding && rig.limit == Some(Limit::Travel);
        let controlled = rig.mode.load_control().zip(rig.tracking.as_ref());
        let behind_m =
            controlled.map_or(0.0, |(control, tracking)| control.planner.set_point_m() - tracking.position_m);
        let off = !at_end && behind_m.abs() > FOLLOW_M;
        let jammed = controlled.is_some_and(|(control, _)| control.position_loop.stopped);
        let lags = lasts(&mut self.jammed_ticks, off && jammed, SHORT_TICKS);
        // A load that has changed must be known and brought back: at most the strings' whole way.
        let table = &rig.table.table().metadata;
        let way_s = (table.twist_max_rad - table.twist_min_rad) / rig.constants.twist_speed_max();
        lasts(&mut self.off_ticks, off, LONG_TICKS.saturating_add((way_s / TICK_S) as u16)) || lags
    }

    /// The load is beyond what the table, and so the mechanism, was made for.
    pub(super) fn is_out_of_range(&mut self, rig: &Controller) -> bool {
        let tracking = rig.mode.load_control().and(rig.tracking.as_ref());
        let at_end = tracking.and_then(|tracking| tracking.observation).is_some_and(|o| o.at_range_end);
        let [min_n, max_n] = rig.load_range_n();
        let middle_n = 0.5 * (min_n + max_n);
        let heavy = tracking.is_some_and(|tracking| tracking.observer.load_n() > middle_n);
        // At the light end nothing breaks.
        lasts(&mut self.range_ticks, at_end, if heavy { SHORT_TICKS } else { LONG_TICKS })
    }
}
