//! What a homing finds.

use crate::gap_curve::GapCurve;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Result of a homing. An error is half the width of the interval that holds the truth in 90 of 100 cases.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[serde(deny_unknown_fields)]
pub struct HomingResult {
    /// Error of zero twist (rad).
    pub zero_error_rad: f32,
    /// Load (N).
    pub load_n: f32,
    /// Error of the load (N).
    pub load_error_n: f32,
    /// Coulomb friction of the rail (N).
    pub friction_n: f32,
    /// Measured gap at position zero (m): the half-turn pre-twist, unless a setting says otherwise.
    pub reference_gap_m: f32,
    /// Noise of the gap in one tick, measured at rest (m, rms).
    pub gap_noise_m: f32,
    /// How far the load jumps when it breaks loose from stiction (m); 0 where it slides smoothly.
    pub jump_m: f32,
    /// Scale of the twist: 1 is what the table was made for.
    pub twist_scale: f32,
    /// Measured less modelled gap over the twist.
    pub curve: GapCurve,
    /// Covariance of the logarithm of the scale and of the curve's constant (m): scale, both, constant.
    pub covariance: [f32; 3],
    /// How far the shaft stays behind its set-point, in time (s): the drive's own position loop, measured.
    pub drive_lag_s: f32,
}
