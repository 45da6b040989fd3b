//! What the host asks of the board.

use crate::codes::Setting;
use crate::lvdt_curve::LvdtCurve;
use crate::versions::Versions;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// What the host asks of the board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// The greeting, which both sides understand whatever their versions. The first variant for ever, see [`Versions`].
    Hello(Versions),
    /// The host is running. No reply.
    Heartbeat,
    /// Find the half-turn pre-twist and weigh the load.
    Home {
        /// Where the load's weight comes from.
        load: LoadChoice,
    },
    /// Bring the load to a position.
    Move {
        /// Wanted position (m).
        target_m: f32,
        /// Speed of the load on the way (m/s); infinite is as fast as the motor and the setting `speed-max` allow.
        speed_m_per_s: f32,
        /// Where the load's weight comes from.
        load: LoadChoice,
    },
    /// Follow a stream of set-points, of which this is the next one. The first one starts it. It ends in a hold: by `Stop`, when
    /// the next one does not come in time, and by one that is refused. A `Move` goes on from it.
    Track {
        /// Where the load should be when this arrives (m).
        position_m: f32,
        /// How fast it should move then (m/s); it goes on like that until the next one comes.
        speed_m_per_s: f32,
        /// For how long at most this goes on without the next one (s).
        for_s: f32,
    },
    /// Turn the strings at a constant speed, homed or not, within the twist limits.
    Jog {
        /// Twist speed, positive twists up (rad/s).
        twist_speed_rad_per_s: f32,
    },
    /// Ramp down and hold. Accepted in every state. It overtakes all requests that wait, which are refused.
    Stop,
    /// Clear the latched faults, if their causes have gone.
    Clear,
    /// Send the identity again.
    Status,
    /// Make a table for other constants, use it and keep it in flash. The rig must then be homed again.
    Rebuild(Constants),
    /// Send the settings.
    GetSettings,
    /// Change one setting at once, and keep it in flash; `Settings` follows when it is there. Refused during a motion.
    SetSetting {
        /// Which.
        setting: Setting,
        /// Its new value (its unit).
        value: f32,
    },
    /// Change all settings: all of them are accepted, or none.
    SetSettings(SettingValues),
    /// Send the present readings of the sensors, homed or not.
    ReadSensors,
    /// Turn the shaft slowly by less than a tenth of a radian of the strings each way, in open loop, and compare which way
    /// the drive and the rig's own encoder count. Every first motion after a start of the drive begins with it.
    CheckDirection,
}

impl Request {
    /// A homing that weighs the load itself.
    pub const HOME: Self = Self::Home { load: LoadChoice::Auto };
}

/// All that a board's settings are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SettingValues {
    /// One value for each [`Setting`], in the order of [`Setting::ALL`].
    pub numbers: [f32; Setting::ALL.len()],
    /// Correction of the LVDT, before its offset and gain.
    pub lvdt_curve: Option<LvdtCurve>,
}

/// The mechanism's constants as a calibration found them (docs/model.md section 2; SI units).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Constants {
    /// Hash of the scene file that holds them.
    pub scene_hash: u32,
    /// L0, D0, c, R (m).
    pub geometry_m: [f64; 4],
    /// r0 (m), K (N/m), k1 (1/N), k2, k3, k4 of the radius law.
    pub string: [f64; 6],
    /// p where the radius follows a power of the twist; `None` where it follows X0/X (eq. 6 as printed).
    pub twist_exponent: Option<f64>,
    /// a1 … a5 of eq. 12 (Pa).
    pub stress_coefficients_pa: [f64; 5],
    /// Standard errors: of the string radius (relative), of the gap's zero (m), of how the radius depends on the load
    /// (relative), of a light load on rods that have carried a much heavier one since (relative).
    pub uncertainty: [f32; 4],
    /// What the law misses of this rig's gap.
    pub correction: Option<Correction>,
}

/// A measured correction of the gap (docs/model.md section 4).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Correction {
    /// Least and greatest load of the data (N).
    pub load_n: [f32; 2],
    /// Least and greatest turns of the data past the half-turn pre-twist.
    pub turns: [f32; 2],
    /// Coefficients (m): a row for each power of the load's logarithm, a column for each power of the twist.
    pub coefficients_m: [[f32; 3]; 3],
}

/// Where homing or a move takes the load from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LoadChoice {
    /// The board's own estimate.
    Auto,
    /// The operator's value (N).
    Known(f32),
}
