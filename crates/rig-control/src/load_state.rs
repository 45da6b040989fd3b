//! The load in one tick, as the code that controls it sees it.

use crate::load_motion::LoadMotion;
use crate::mechanism::{Mechanism, OUTSIDE_RAD};
use crate::observer::Observation;
use crate::ramp::{Ramp, braking_speed};
use crate::{RigConstants, TICK_S};
use rig_link::messages::HomingResult;

/// Change of the gap that is motion and no noise, over the noise of the gap in one tick.
const MOVED_NOISES: f32 = 4.0;

/// Change of the gap that is motion and no noise (m), with a noise of the gap in one tick (m, rms).
pub(crate) fn moved_m(gap_noise_m: f32) -> f32 {
    MOVED_NOISES * gap_noise_m
}

/// The load in one tick.
#[derive(Clone, Copy, Debug)]
pub struct LoadState<'t> {
    /// The table, with these strings' scale of the twist.
    pub mechanism: Mechanism<'t>,
    /// What the observer makes of twist and gap.
    pub observation: Observation,
    /// Measured position (m).
    pub position_m: f32,
    /// How the load will move when a command of this tick acts.
    pub motion: LoadMotion,
    /// Set-point of the twist (rad).
    pub twist_rad: f32,
    /// What homing found.
    pub found: &'t HomingResult,
    /// The rig's numbers.
    pub rig: &'t RigConstants,
}

impl LoadState<'_> {
    /// Change of this load's gap that is motion and no noise (m).
    pub fn moved_m(&self) -> f32 {
        moved_m(self.found.gap_noise_m)
    }

    /// Set-point of the shaft one tick later, with strings that are to turn at a speed (rad/s), as far as the motor can follow; it
    /// brakes into the ends of the strings' travel. And whether such an end makes them slower than they are to turn. `zero_rad` is
    /// where the shaft has zero twist (rad).
    pub fn turned(&self, shaft: Ramp, zero_rad: f32, twist_speed_rad_per_s: f32) -> (Ramp, bool) {
        let limits = self.rig.twist_limits();
        let table = &self.mechanism.table.metadata;
        let twist_rad = shaft.position - zero_rad;
        let brakes = |left_rad: f32| braking_speed(left_rad.max(0.0), limits.acceleration);
        // Below the half-turn pre-twist by half of what the mechanism covers, so that a shaft which lags stays within that.
        let slowest = -brakes(twist_rad - (table.twist_min_rad - 0.5 * OUTSIDE_RAD));
        let fastest = brakes(self.mechanism.twist_max_rad() - twist_rad);
        let free = limits.after_a_tick(shaft.speed, twist_speed_rad_per_s);
        let speed = limits.after_a_tick(shaft.speed, free.clamp(slowest, fastest));
        (Ramp { position: shaft.position + speed * TICK_S, speed }, speed != free)
    }
}
