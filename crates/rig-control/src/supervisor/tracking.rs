//! What is known of the load since homing: position, load, TR, and how the strings drift.

use super::sensing::Readings;
use crate::adaptation::Adaptation;
use crate::homing::Homed;
use crate::mechanism::Mechanism;
use crate::observer::{Confidence, LoadObserver, Observation};
use rig_link::messages::{Limit, LoadChoice, Setting, SettingValues};
use tsa_table::Table;

/// Share of the gap by which the LVDT may differ from the model, and difference of the twist's scale from the expected one,
/// beyond which the load is reported as unknown: emulated rigs whose LVDT is 15 % off in gain, or all of whose constants
/// are 25 % off, come out beyond these and weigh 17 to 38 % wrongly.
const DOUBTFUL_OFFSET: f32 = 0.08;
const DOUBTFUL_SCALE: f32 = 0.08;

/// A homed rig's knowledge of its load.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoadTracking {
    pub(super) homed: Homed,
    pub(super) observer: LoadObserver,
    pub(super) adaptation: Adaptation,
    /// Newest measured position (m).
    pub(super) position_m: f32,
    /// Observation of this tick; `None` outside the table's twists.
    pub(super) observation: Option<Observation>,
}

impl LoadTracking {
    /// From a homing, at rest at the half-turn pre-twist.
    pub(super) fn new(mut homed: Homed, settings: &SettingValues) -> Self {
        homed.reference_gap_m -= settings.get(Setting::PositionZero);
        let mut observer = LoadObserver::new(homed.load_n, homed.gap_offset_m, homed.friction_n);
        let scale_off = (homed.twist_scale - settings.get(Setting::TwistScale)).abs();
        if homed.gap_offset_m.abs() > DOUBTFUL_OFFSET * homed.reference_gap_m || scale_off > DOUBTFUL_SCALE {
            observer.distrust();
        }
        Self {
            homed,
            observer,
            adaptation: Adaptation::new(homed.twist_scale),
            // Subtract from zero: negating 0.0 would print as -0.
            position_m: 0.0 - settings.get(Setting::PositionZero),
            observation: None,
        }
    }

    /// The table with these strings' scale of the twist.
    pub(super) fn mechanism<'t>(&self, table: &'t Table<'t>) -> Mechanism<'t> {
        Mechanism { table, twist_scale: self.homed.twist_scale }
    }

    /// Twist (rad) at a shaft angle (rad).
    pub(super) fn twist_rad(&self, shaft_rad: f32) -> f32 {
        shaft_rad - self.homed.zero_rad
    }

    /// One tick's readings: position, load and TR.
    pub(super) fn observe(&mut self, table: &Table<'_>, readings: &Readings) {
        let gap_m = readings.lvdt.gap_m();
        if let Some(gap_m) = gap_m {
            self.position_m = self.homed.reference_gap_m - gap_m;
        }
        // Twist and gap of the same time belong together.
        let twist_rad = self.twist_rad(readings.shaft_at_gap_rad);
        let mechanism = Mechanism { table, twist_scale: self.homed.twist_scale };
        self.observation = if mechanism.covers(twist_rad) {
            Some(self.observer.step(&mechanism, twist_rad, gap_m))
        } else {
            self.observer.lose();
            None
        };
    }

    /// Half the width of the interval around the load estimate that holds the truth in 90 of 100 cases (N).
    pub(super) fn load_error_n(&self) -> Option<f32> {
        None
    }

    /// The same of the position (m).
    pub(super) fn position_error_m(&self) -> Option<f32> {
        None
    }

    /// What the observation says against relying on the load.
    pub(super) fn limit(&self) -> Option<Limit> {
        match &self.observation {
            Some(observation) if observation.at_range_end => Some(Limit::LoadRange),
            Some(observation) if observation.confidence == Confidence::Sure => None,
            Some(_) | None => Some(Limit::LoadUnknown),
        }
    }

    /// Learns the scale of the twist from one tick of a move at a twist (rad); `done` when the set-point has arrived.
    pub(super) fn learn(&mut self, observation: &Observation, twist_rad: f32, done: bool) {
        let homed = &mut self.homed;
        // Change of the load estimate (N) for a change of the scale by 1: (∂G/∂s)/(∂G/∂F).
        let x = observation.point.dgap_dtwist_m_per_rad * twist_rad
            / homed.twist_scale
            / observation.point.dgap_dload_m_per_n;
        if observation.confidence == Confidence::Changing || self.observer.source != LoadChoice::Auto {
            self.adaptation.forget_move();
        } else if !done && observation.moved_m > 0.0 {
            self.adaptation.record(x, self.observer.load_n());
        } else if done {
            let finding = self.adaptation.end_move(homed.twist_scale);
            if let Some(agrees) = finding.agrees {
                self.observer.end_move(agrees);
            }
            if finding.scale_change != 0.0 {
                homed.twist_scale += finding.scale_change;
                self.observer.rescale(-x * finding.scale_change);
            }
        }
    }

    /// Position 0 is called another height: every position is `higher_m` greater.
    pub(super) fn shift_position(&mut self, higher_m: f32) {
        self.homed.reference_gap_m += higher_m;
        self.position_m += higher_m;
    }
}
