//! Applying settings, while nothing moves.

use super::modes::Mode;
use super::{Controller, Inputs};
use crate::ramp::Ramp;
use crate::settings;
use rig_link::messages::{Accepted, Refusal, Setting, SettingValues, State};

impl Controller {
    /// The settings in use.
    pub fn settings(&self) -> &SettingValues {
        &self.settings
    }

    /// Starts with settings from flash: before the first tick.
    pub fn set_up(&mut self, values: &SettingValues) {
        self.apply(values);
    }

    /// Applies all of the settings or none. Refused while anything moves, and before the drive's zero is known.
    pub(super) fn configure(&mut self, values: &SettingValues, inputs: &Inputs) -> Result<Accepted, Refusal> {
        match self.state() {
            State::Boot => return Err(Refusal::DriveNotReady),
            state @ (State::Moving | State::Homing) => return Err(Refusal::Busy { state }),
            // In fault or emergency stop nothing moves, and settings may be what is wrong.
            State::Unhomed | State::Ready | State::Holding | State::Fault | State::EStop => {}
        }
        values.check(&settings::defaults(&self.scene))?;
        let was_homed = self.tracking.is_some();
        if self.apply(values) {
            self.sensing.read_again(inputs, &self.constants);
        }
        Ok(if was_homed && self.tracking.is_none() { Accepted::Unhomed } else { Accepted::Started })
    }

    /// Whether angles, gaps or loads mean something else with them; the position is then not known any more.
    fn apply(&mut self, values: &SettingValues) -> bool {
        let before = core::mem::replace(&mut self.settings, *values);
        let old = core::mem::replace(&mut self.constants, settings::apply(values, &self.scene));
        let changes = |setting: &Setting| setting.spec().unhomes && before.get(*setting) != values.get(*setting);
        if Setting::ALL.iter().any(changes) || before.lvdt_curve != values.lvdt_curve {
            // The same place in the new units; nothing is compared with readings in the old ones.
            self.shaft = Ramp::at(self.shaft.position * old.counts_per_rad / self.constants.counts_per_rad);
            self.guard.forget_places();
            if changes(&Setting::HeaviestLoad) {
                self.heaviest_n = values.get(Setting::HeaviestLoad);
            }
            self.forget_position();
            return true;
        }
        let higher_m = before.get(Setting::PositionZero) - values.get(Setting::PositionZero);
        if let Some(tracking) = &mut self.tracking {
            tracking.shift_position(higher_m);
        }
        if let Mode::Holding(control) = &mut self.mode {
            control.shift_position(higher_m);
        }
        false
    }
}
