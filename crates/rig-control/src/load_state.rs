//! The load in one tick, as the code that controls it sees it.

use crate::constants::TwistLimits;
use crate::load_motion::LoadMotion;
use crate::mechanism::Mechanism;
use crate::observer::Observation;

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
    /// Gap at position 0 (m).
    pub reference_gap_m: f32,
    /// Noise of the gap in one tick (m, rms).
    pub gap_noise_m: f32,
    /// How far the load jumps when it breaks loose (m), as homing saw it.
    pub jump_m: f32,
    /// Set-point of the twist (rad).
    pub twist_rad: f32,
    /// What the motor can do.
    pub twist_limits: TwistLimits,
}
