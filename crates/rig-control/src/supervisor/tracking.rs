//! What is known of the load since homing: position, load, TR, and how the strings drift.

use super::sensing::Readings;
use crate::adaptation::Adaptation;
use crate::homing::{Homed, NINETY_PERCENT};
use crate::load_motion::{AHEAD_S, LoadMotion, Measured};
use crate::mechanism::Mechanism;
use crate::observer::{LoadObserver, Observation};
use crate::{RigConstants, TICK_S};
use rig_link::messages::{Doubt, Doubts, Setting, SettingValues};
use tsa_table::Table;

/// Error of the load, as a fraction of it, above which the load is reported as unknown.
const UNKNOWN_FRACTION: f32 = 0.3;

/// A homed rig's knowledge of its load.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoadTracking {
    pub(super) homed: Homed,
    pub(super) observer: LoadObserver,
    pub(super) adaptation: Adaptation,
    /// Gap where the load hung when homing ended (m).
    homed_gap_m: f32,
    /// Newest measured position (m).
    pub(super) position_m: f32,
    /// How far the load may have moved since that was measured (m).
    moved_since_m: f32,
    /// Observation of this tick; `None` outside the table's twists.
    pub(super) observation: Option<Observation>,
}

impl LoadTracking {
    /// From a homing, at rest at the half-turn pre-twist.
    pub(super) fn new(mut homed: Homed, table: &Table<'_>, settings: &SettingValues) -> Self {
        let homed_gap_m = homed.found.reference_gap_m;
        homed.found.reference_gap_m -= settings.get(Setting::PositionZero);
        Self {
            homed,
            observer: LoadObserver::new(&homed.found, &table.metadata.uncertainty, homed.heaviest_n),
            homed_gap_m,
            adaptation: Adaptation::new(homed.found.twist_scale),
            // Subtract from zero: negating 0.0 would print as -0.
            position_m: 0.0 - settings.get(Setting::PositionZero),
            moved_since_m: 0.0,
            observation: None,
        }
    }

    /// The table with these strings' scale of the twist.
    pub(super) fn mechanism<'t>(&self, table: Table<'t>) -> Mechanism<'t> {
        Mechanism { table, twist_scale: self.homed.found.twist_scale, curve: self.homed.found.curve }
    }

    /// Error of the position, 90 % (m): the LVDT's between here and where it was homed, the noise here, and in full how far the
    /// load may have moved since it was measured.
    pub(super) fn position_error_m(&self, rig: &RigConstants) -> f32 {
        let gap_m = self.homed.found.reference_gap_m - self.position_m;
        let by_lvdt_m = rig.lvdt_change_error().of(gap_m - self.homed_gap_m);
        libm::hypotf(by_lvdt_m, NINETY_PERCENT * self.homed.found.gap_noise_m) + self.moved_since_m
    }

    /// Twist (rad) at a shaft angle (rad).
    pub(super) fn twist_rad(&self, shaft_rad: f32) -> f32 {
        shaft_rad - self.homed.zero_rad
    }

    /// One tick's readings: position, load and TR.
    pub(super) fn observe(&mut self, table: &Table<'_>, readings: &Readings) {
        let gap_m = readings.lvdt.gap_m();
        if let Some(gap_m) = gap_m {
            self.position_m = self.homed.found.reference_gap_m - gap_m;
        }
        // Twist and gap of the same time belong together.
        let twist_rad = self.twist_rad(readings.shaft_at_gap_rad);
        let mechanism = self.mechanism(*table);
        let measured = gap_m.map(|gap_m| Measured { gap_m, step_s: readings.gap_step_s });
        self.observation = if mechanism.covers(twist_rad) {
            Some(self.observer.step(&mechanism, twist_rad, measured.as_ref()))
        } else {
            self.observer.lose();
            None
        };
        // One step more than its age, because a load that falls gains speed.
        let steps = 1.0 + readings.gap_age_s / readings.gap_step_s.max(TICK_S);
        self.moved_since_m = self.observation.map_or(0.0, |observation| steps * observation.moved_m);
    }

    /// How the load will move when the strings have come to a twist (rad) that is commanded now.
    pub(super) fn motion_ahead(&self, readings: &Readings, commanded_rad: f32) -> Option<LoadMotion> {
        let now = self.observer.motion?.after(readings.gap_age_s, self.twist_rad(readings.shaft_rad));
        Some(now.after(AHEAD_S, commanded_rad))
    }

    /// What the observation says against relying on the load. Without a gap it is an old one.
    pub(super) fn doubts(&self, has_gap: bool) -> Doubts {
        let Some(observation) = self.observation.filter(|_| has_gap) else {
            return Doubts::NONE.with(Doubt::LoadUnknown);
        };
        let known = observation.confirmed && observation.load_error_n <= UNKNOWN_FRACTION * self.observer.load_n();
        let mut doubts = Doubts::NONE;
        // A homing that ended at the end of the range holds until the load is known to be another one.
        if observation.at_range_end || self.homed.beyond_range && observation.confirmed {
            doubts.insert(Doubt::LoadRange);
        }
        if !known {
            doubts.insert(Doubt::LoadUnknown);
        }
        doubts
    }

    /// Position 0 is called another height: every position is `higher_m` greater.
    pub(super) fn shift_position(&mut self, higher_m: f32) {
        self.homed.found.reference_gap_m += higher_m;
        self.position_m += higher_m;
    }
}
