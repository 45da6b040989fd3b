//! Taking up settings, while nothing moves.

use super::{Planner, Ramp, Rig, State};
use crate::settings;
use rig_link::messages::{Accepted, Refusal, Setting, SettingValues};

impl Rig<'_> {
    /// The settings in use.
    pub fn settings(&self) -> &SettingValues {
        &self.settings
    }

    /// What they are when nobody sets them.
    pub fn default_settings(&self) -> SettingValues {
        settings::defaults(&self.scene)
    }

    /// Begins with settings that were kept: before the first tick.
    pub fn set_up(&mut self, values: &SettingValues) {
        self.take_up(values);
    }

    /// Takes them up for good, all or none. Not while anything moves, and not before the drive's zero is known.
    pub(super) fn configure(&mut self, values: &SettingValues) -> Result<Accepted, Refusal> {
        match self.state {
            State::Boot => return Err(Refusal::DriveNotReady),
            state @ (State::Moving | State::Homing) => return Err(Refusal::Busy { state }),
            // In fault or emergency stop nothing moves, and settings may be what is wrong.
            State::Unhomed | State::Ready | State::Holding | State::Fault | State::EStop => {}
        }
        values.check(&self.default_settings())?;
        Ok(if self.take_up(values) { Accepted::Unhomed } else { Accepted::Started })
    }

    /// Whether the position has been lost by it.
    fn take_up(&mut self, values: &SettingValues) -> bool {
        let before = core::mem::replace(&mut self.settings, *values);
        let old = core::mem::replace(&mut self.constants, settings::apply(values, &self.scene));
        let changes = |setting: &Setting| setting.spec().unhomes && before.get(*setting) != values.get(*setting);
        if Setting::ALL.iter().any(changes) {
            // The same place in other numbers, and nothing to be compared with what was seen in the old ones.
            self.shaft = Ramp::at(self.shaft.position * old.counts_per_rad / self.constants.counts_per_rad);
            self.last_shaft_rad = None;
            self.checks.forget_places();
            if matches!(self.state, State::Ready | State::Holding) {
                self.state = State::Unhomed;
            }
            return self.homed.take().is_some();
        }
        let higher_m = before.get(Setting::PositionZero) - values.get(Setting::PositionZero);
        if let Some(homed) = &mut self.homed {
            homed.reference_gap_m += higher_m;
            self.last_position_m += higher_m;
            self.planner = Planner::at(self.planner.set_point_m() + higher_m);
        }
        false
    }
}
