//! The limit switches at the ends of the rail.

use super::super::{Controller, Inputs, lasts};
use crate::observer::TRAVEL_M;

/// Ticks that a limit switch must be open: its contacts bounce.
const SWITCH_TICKS: u16 = 2;

/// The upper switch (least gap) and the lower one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Switches {
    /// How long each has been open.
    open_ticks: [u16; 2],
    /// The gap past which an open switch is a fault again, where it was cleared open (m): the load has travelled towards it.
    bound_m: [Option<f32>; 2],
}

impl Switches {
    /// After a `clear` at this gap (m).
    pub(super) fn cleared(inputs: &Inputs, gap_m: Option<f32>) -> Self {
        let bound = |open: bool, past_m: f32| gap_m.filter(|_| open).map(|gap_m| gap_m + past_m);
        let bound_m = [bound(inputs.upper_limit_open, -TRAVEL_M), bound(inputs.lower_limit_open, TRAVEL_M)];
        Self { open_ticks: [0; 2], bound_m }
    }

    /// Gaps mean something else from now on. The first gap in the new units is within these bounds, and moves them.
    pub(super) fn forget_places(&mut self) {
        let [upper, lower] = self.bound_m;
        self.bound_m = [upper.map(|_| f32::NEG_INFINITY), lower.map(|_| f32::INFINITY)];
    }

    /// An end of the rail has been reached, or passed after a `clear`.
    pub(super) fn reached(&mut self, rig: &Controller, inputs: &Inputs) -> bool {
        let sensing = &rig.sensing;
        let reached = self.step([inputs.upper_limit_open, inputs.lower_limit_open], sensing.readings.lvdt.gap_m());
        reached && (sensing.drive_zero.is_matched() || rig.closed_loop && sensing.drive_zero.offset().is_some())
    }

    fn step(&mut self, open: [bool; 2], gap_m: Option<f32>) -> bool {
        let mut reached = false;
        // Away from the upper switch the gap grows, away from the lower one it shrinks.
        for (k, away) in [1.0f32, -1.0].into_iter().enumerate() {
            let stays_open = lasts(&mut self.open_ticks[k], open[k], SWITCH_TICKS);
            let bound_m = &mut self.bound_m[k];
            if !open[k] {
                *bound_m = None;
            }
            reached |= match (bound_m, gap_m) {
                (None, _) => stays_open,
                // Nothing to judge by; the loss of the gap is a fault of its own.
                (Some(_), None) => false,
                (Some(bound_m), Some(gap_m)) => {
                    // On the way back the bound follows.
                    let nearer_m = gap_m - away * TRAVEL_M;
                    if away * (nearer_m - *bound_m) > 0.0 {
                        *bound_m = nearer_m;
                    }
                    away * (gap_m - *bound_m) < 0.0
                }
            };
        }
        reached
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_switch_is_reached_when_it_has_stopped_bouncing() {
        let mut switches = Switches::default();
        assert!(!switches.step([true, false], Some(0.05)));
        assert!(!switches.step([false, false], Some(0.05)));
        assert!(!switches.step([true, false], Some(0.05)));
        assert!(switches.step([true, false], None));
    }

    #[test]
    fn after_a_clear_only_the_way_back_is_free() {
        let cleared = || Switches { open_ticks: [0; 2], bound_m: [Some(0.05 - TRAVEL_M), None] };
        let step = |switches: &mut Switches, gap_m| switches.step([true, false], Some(gap_m));
        let mut switches = cleared();
        assert!((0..100).all(|_| !step(&mut switches, 0.05)));
        assert!(!step(&mut switches, 0.0498) && step(&mut switches, 0.0496));
        // Away by 5 mm, and then back towards the switch: the bound has followed.
        let mut switches = cleared();
        assert!(!step(&mut switches, 0.055) && !step(&mut switches, 0.0548) && step(&mut switches, 0.0546));
        let mut switches = cleared();
        switches.forget_places();
        assert!(!step(&mut switches, 0.07) && step(&mut switches, 0.0696));
        // Once it has closed, the next opening is a fault at any gap.
        let mut switches = cleared();
        assert!(!switches.step([false, false], Some(0.06)));
        assert!(!step(&mut switches, 0.06) && step(&mut switches, 0.06));
    }
}
