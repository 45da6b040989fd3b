//! What the board measures and does.

use crate::codes::{Fault, HomingFailure, Limit, State, StreamEnd, TableRefusal};
use crate::faults::{Doubts, Faults};
use crate::gap_curve::GapCurve;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Readings of the sensors, homed or not, and what the board has counted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sensors {
    /// Gap by the LVDT, calibrated (m); `None` if it gives no valid reading.
    pub gap_m: Option<f32>,
    /// Rotation of the strings since boot by the rig's own encoder, positive twists up (rad).
    pub shaft_rad: f32,
    /// The same since the drive's start, by the drive's counts (rad); `None` until it reports.
    pub drive_rad: Option<f32>,
    /// Supply of the drive (V); `None` where it is not wired, or not reported yet.
    pub supply_v: Option<f32>,
    /// The emergency stop's contact is open.
    pub estop_open: bool,
    /// The limit switch at the upper end is open.
    pub upper_limit_open: bool,
    /// The limit switch at the lower end is open.
    pub lower_limit_open: bool,
    /// How far beside its target a load at rest is left alone (m): by the gap's noise, and where it sticks by how far it jumps
    /// when it breaks loose. `None` where nothing is held.
    pub rest_tolerance_m: Option<f32>,
    /// Counts of ignored errors.
    pub counters: Counters,
}

/// State and measurements of the board, every 10 ms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Telemetry {
    /// Time since boot of the control tick that this shows (µs).
    pub t_us: u64,
    /// What the rig is doing.
    pub state: State,
    /// The most severe of the latched faults.
    pub fault: Option<Fault>,
    /// All latched faults.
    pub faults: Faults,
    /// What limits the motion.
    pub limit: Option<Limit>,
    /// Which estimates are not to be relied on.
    pub doubts: Doubts,
    /// Target position (m).
    pub target_m: Option<f32>,
    /// Set-point of the planner (m).
    pub setpoint_m: Option<f32>,
    /// Position by the LVDT (m); `None` before homing.
    pub position_m: Option<f32>,
    /// Twist of the strings from untwisted (rad); `None` until known.
    pub twist_rad: Option<f32>,
    /// Estimated load (N).
    pub load_n: Option<f32>,
    /// Half the width of the interval around `load_n` that holds the true load in 90 of 100 cases (N); `None` where the load
    /// is.
    pub load_error_n: Option<f32>,
    /// The same of `position_m` (m).
    pub position_error_m: Option<f32>,
    /// Transmission ratio at this twist and load (rad/m).
    pub tr_rad_per_m: Option<f32>,
    /// Motor current as the drive reports it (A). While the drive is silent, it and the speed are NaN.
    pub drive_current_a: f32,
    /// Speed of the motor shaft, before the gear (rad/s).
    pub drive_speed_rad_per_s: f32,
    /// Time until the set-point is at its target (s); `None` while the motor's limits delay the move.
    pub time_left_s: Option<f32>,
    /// Learned scale of the twist: 1 is what the table was made for.
    pub twist_scale: Option<f32>,
    /// Gap by the LVDT, calibrated (m), homed or not; `None` if it gives no valid reading.
    pub gap_m: Option<f32>,
    /// Rotation of the strings since boot by the rig's own encoder, positive twists up (rad).
    pub shaft_rad: f32,
    /// Supply of the drive (V); `None` where it is not wired, or not reported yet.
    pub supply_v: Option<f32>,
}

/// Counts of errors that are ignored, and the longest tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Counters {
    /// Damaged frames from the host.
    pub link_errors: u32,
    /// CAN frames that are not the drive's.
    pub foreign_frames: u32,
    /// Control ticks that came late.
    pub late_ticks: u32,
    /// Messages that the board could not send in time: the link was full.
    pub unsent: u32,
    /// Longest control tick so far (µs).
    pub longest_tick_us: u32,
}

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
    /// Noise of the gap in one tick, measured at rest (m, rms); at least what the converter resolves.
    pub gap_noise_m: f32,
    /// How far the load jumps when it breaks loose from stiction (m); 0 where it slides smoothly.
    pub jump_m: f32,
    /// Scale of the twist: 1 is what the table was made for.
    pub twist_scale: f32,
    /// Measured less modelled gap over the twist.
    pub curve: GapCurve,
    /// Covariance of the logarithm of the scale, the curve's constant (m) at gap 0 and the LVDT's slope: the lower triangle of
    /// the matrix, row by row.
    pub covariance: [f32; 6],
    /// How far the shaft stays behind its set-point, in time (s): the drive's own position loop, measured.
    pub drive_lag_s: f32,
}

/// Something that ended or went wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EventKind {
    /// Homing ended; the twist is known.
    Homed(HomingResult),
    /// Homing did not come to an end.
    HomingRefused(HomingFailure),
    /// The load is at rest at the target.
    MoveDone {
        /// Measured position minus target (m).
        error_m: f32,
    },
    /// A motion ended before its target, by `Stop`.
    Stopped,
    /// A stream of set-points ended by itself. The load is braked and held; `Stopped` follows when it is at rest.
    StreamEnded(StreamEnd),
    /// A fault was latched.
    FaultRaised(Fault),
    /// A fault was cleared.
    FaultCleared(Fault),
    /// The emergency stop opened.
    EStopOpened,
    /// The emergency stop closed again.
    EStopClosed,
    /// The table that the host sent is in use; home again.
    TableStored {
        /// Its checksum.
        crc: u32,
        /// It is in flash and will be used after a reset.
        kept: bool,
    },
    /// The table that the host sent cannot be used; the one in use stays.
    TableRefused(TableRefusal),
    /// Motor, drive's encoder and own encoder turn the same way, and the drive has started again, with its loop closed.
    DirectionProven,
}
