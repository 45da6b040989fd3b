//! The table of all messages; the named codes in them are [`crate::codes`]. Change anything in either and
//! [`crate::PROTOCOL_HASH`] changes with it.
//!
//! | from  | message     | when                                                             |
//! |-------|-------------|------------------------------------------------------------------|
//! | host  | [`Request`] | as the operator wishes; `Heartbeat` all the time                 |
//! | board | `Reply`     | once for each request except `Heartbeat`, with its number        |
//! | board | `Identity`  | after `Hello` and after `Status`, following the reply            |
//! | board | `Settings`  | after `GetSettings`, and when settings are in flash              |
//! | board | `Sensors`   | after `ReadSensors`                                              |
//! | board | `Telemetry` | every 10 ms, asked or not                                        |
//! | board | `Event`     | when something ends or goes wrong                                |
//!
//! SI units throughout; the unit is in the name. `None` means "not known", never "zero".
//! Position is how far the load has come up from where it hung, at the half-turn pre-twist, when the rig was homed.

pub use crate::codes::*;
pub use crate::faults::Faults;
use heapless::String;
use serde::{Deserialize, Serialize};

/// What the host asks of the board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// First message: both sides must be built from the same table.
    Hello {
        /// The host's [`crate::PROTOCOL_HASH`].
        protocol_hash: u32,
    },
    /// The host lives. No reply.
    Heartbeat,
    /// Find the half-turn pre-twist and weigh the load.
    Home,
    /// Bring the load to a position.
    Move {
        /// Wanted position (m).
        target_m: f32,
        /// Speed of the load on the way (m/s).
        speed_m_per_s: f32,
        /// Where the load's weight comes from.
        load: LoadChoice,
    },
    /// Turn the strings at a constant speed, homed or not, within the twist limits.
    Jog {
        /// Twist speed, positive twists up (rad/s).
        twist_speed_rad_per_s: f32,
    },
    /// Ramp down and hold. Accepted in every state; goes before whatever else waits, which is refused.
    Stop,
    /// Clear a latched fault whose cause has gone.
    Clear,
    /// Send the identity again.
    Status,
    /// Make a table for other constants, use it and keep it. The rig must then be homed again.
    Rebuild(Constants),
    /// Send the settings.
    GetSettings,
    /// Change one setting, at once and for good; `Settings` follows when it is in flash. Not while anything moves.
    SetSetting {
        /// Which.
        setting: Setting,
        /// Its new value (its unit).
        value: f32,
    },
    /// The same for all of them: all are taken, or none.
    SetSettings(SettingValues),
    /// Send what the sensors show now, homed or not.
    ReadSensors,
}

/// One value for each [`Setting`], in the order of [`Setting::ALL`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SettingValues(pub [f32; Setting::ALL.len()]);

/// The settings of a board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SettingsReport {
    /// In use.
    pub values: SettingValues,
    /// What they are when nobody sets them; that of the current limit is the scene's.
    pub defaults: SettingValues,
    /// What flash holds.
    pub kept: Kept,
}

/// The mechanism's constants as a calibration found them (model.md section 2; SI units).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Constants {
    /// Hash of the scene file that holds them.
    pub scene_hash: u32,
    /// L0, D0, c, R (m).
    pub geometry_m: [f64; 4],
    /// r0 (m), K (N/m), k1 (1/N), k2, k3 of eq. 6.
    pub string: [f64; 5],
    /// p where the radius follows a power of the twist; nothing where it follows X0/X (eq. 6 as printed).
    pub twist_exponent: Option<f64>,
    /// a1 … a5 of eq. 12 (Pa).
    pub stress_coefficients_pa: [f64; 5],
}

/// Where a move takes the load's weight from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LoadChoice {
    /// The board's own estimate.
    Auto,
    /// The operator's word (N).
    Known(f32),
}

/// What the board tells the host.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Message {
    /// The answer to one request.
    Reply {
        /// Sequence number of the request's frame.
        to: u16,
        /// Taken, or why not.
        result: Result<Accepted, Refusal>,
    },
    /// Who the board is.
    Identity(Identity),
    /// What the board sees and does.
    Telemetry(Telemetry),
    /// What it is told for good.
    Settings(SettingsReport),
    /// What the sensors show.
    Sensors(Sensors),
    /// Something ended or went wrong.
    Event {
        /// Time since boot (µs).
        t_us: u64,
        /// What.
        kind: EventKind,
    },
}

/// Why a request was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// Needs a homed rig.
    #[error("not homed: `home` first")]
    NotHomed,
    /// Not possible in this state.
    #[error("not possible while {state}")]
    Busy {
        /// The state that is in the way.
        state: State,
    },
    /// A fault is latched.
    #[error("fault {fault} is latched: remove its cause, then `clear`")]
    InFault {
        /// The latched fault.
        fault: Fault,
    },
    /// `Clear` while the cause is still there.
    #[error("fault {fault} cannot be cleared: its cause is still there")]
    CauseRemains {
        /// The fault.
        fault: Fault,
    },
    /// `Clear` while the shaft turns: the load is falling, or something turns it.
    #[error("the shaft turns: wait until it stands, then `clear`")]
    ShaftTurns,
    /// The emergency stop is open.
    #[error("the emergency stop is pressed")]
    EStop,
    /// A parameter is outside its limits.
    #[error("{parameter} is {given} {unit}, allowed are {min} to {max} {unit}", unit = parameter.unit())]
    OutOfRange {
        /// Which.
        parameter: Parameter,
        /// Least allowed value (unit of the parameter).
        min: f32,
        /// Greatest allowed value (unit of the parameter).
        max: f32,
        /// What was asked for (unit of the parameter).
        given: f32,
    },
    /// A parameter is infinite or not a number.
    #[error("{parameter} is not a finite number")]
    NotFinite {
        /// Which.
        parameter: Parameter,
    },
    /// A setting is outside its limits.
    #[error("{setting} is {}, allowed are {}", .setting.show(*.given), .setting.allowed(*.min, *.max))]
    SettingOutOfRange {
        /// Which.
        setting: Setting,
        /// Least allowed value (its unit).
        min: f32,
        /// Greatest allowed value (its unit).
        max: f32,
        /// What was asked for (its unit).
        given: f32,
    },
    /// A setting is infinite or not a number.
    #[error("{setting} is not a finite number")]
    SettingNotFinite {
        /// Which.
        setting: Setting,
    },
    /// Host and board were built from different message tables.
    #[error("protocol of the board is {board:#010x}, another than the tool's: build both from the same source")]
    ProtocolMismatch {
        /// The board's protocol hash.
        board: u32,
    },
    /// The drive has not answered its start-up sequence.
    #[error("the drive is not ready")]
    DriveNotReady,
    /// A sensor that the request needs gives no valid reading.
    #[error("no valid reading from the {sensor}")]
    SensorInvalid {
        /// Which.
        sensor: Sensor,
    },
    /// More requests at once than the board can keep waiting.
    #[error("too many requests at once: ask again")]
    TooMany,
    /// A stop came before this was begun.
    #[error("a stop came before this was begun")]
    Stopped,
    /// Its number is not newer than the last request's: an old message that came once more.
    #[error("an older message than the last one came once more: it is not carried out again")]
    Repeated,
}

/// Who the board is and what it was built for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identity {
    /// Firmware version.
    pub version: String<24>,
    /// Short commit, with `-dirty` if the tree had changes.
    pub git: String<24>,
    /// The board's [`crate::PROTOCOL_HASH`].
    pub protocol_hash: u32,
    /// Hash of the scene that the table was fitted to.
    pub scene_hash: u32,
    /// Hash of the `[rig]` that was built in: gear, encoder, motor, drive, LVDT.
    pub rig_hash: u32,
    /// Hash of the `[envelope]` and `[accuracy]` that were built in.
    pub demand_hash: u32,
    /// The embedded table.
    pub table: TableIdentity,
    /// Why the board last started.
    pub reset_cause: ResetCause,
    /// Boots since power came on, counting this one.
    pub boot_count: u32,
    /// What it runs on.
    pub clock: Clock,
    /// Level of the chip's brown-out reset, 1 (2.1 V) to 3 (2.7 V), an option byte; 0 is off, as delivered.
    pub brown_out_level: u8,
    /// What the run before this one ended with, if it was a panic or a fault of the core; as much as fits.
    pub last_panic: Option<String<88>>,
}

/// The embedded transmission table and its certificate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TableIdentity {
    /// Form of the table, in words.
    pub form: String<32>,
    /// Size (bytes).
    pub bytes: u16,
    /// Certified greatest error of the contraction (m).
    pub contraction_error_m: f32,
    /// Certified greatest relative error of TR.
    pub tr_relative_error: f32,
    /// Least load (N).
    pub load_min_n: f32,
    /// Greatest load (N).
    pub load_max_n: f32,
    /// Least motor turns past the half-turn pre-twist.
    pub turns_min: f32,
    /// Greatest motor turns past the half-turn pre-twist.
    pub turns_max: f32,
    /// Checksum of the table.
    pub crc: u32,
    /// Made on the board from constants, not built in.
    pub rebuilt: bool,
}

/// What the sensors show, homed or not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sensors {
    /// Gap by the LVDT, calibrated (m); `None` if it gives no valid reading.
    pub gap_m: Option<f32>,
    /// Turned by the strings since boot, by the rig's own encoder, positive twists up (rad).
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
}

/// What the board sees and does, every 10 ms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Telemetry {
    /// Time since boot of the control tick that this shows (µs).
    pub t_us: u64,
    /// What the rig is doing.
    pub state: State,
    /// The gravest of the latched faults.
    pub fault: Option<Fault>,
    /// All latched faults.
    pub faults: Faults,
    /// What holds it back.
    pub limit: Option<Limit>,
    /// Where it is going (m).
    pub target_m: Option<f32>,
    /// Where the planner wants it now (m).
    pub setpoint_m: Option<f32>,
    /// Where the LVDT sees it (m); `None` before homing.
    pub position_m: Option<f32>,
    /// Twist of the strings from untwisted (rad); `None` until known.
    pub twist_rad: Option<f32>,
    /// Estimated load (N).
    pub load_n: Option<f32>,
    /// Transmission ratio at this twist and load (rad/m).
    pub tr_rad_per_m: Option<f32>,
    /// Motor current as the drive reports it (A).
    pub drive_current_a: f32,
    /// Speed of the motor shaft, before the gear (rad/s).
    pub drive_speed_rad_per_s: f32,
    /// Time until the set-point is at its target (s); `None` while the motor's limits hold the move back.
    pub time_left_s: Option<f32>,
    /// Learned scale of the twist: 1 is what the table was made for.
    pub twist_scale: Option<f32>,
    /// What went wrong quietly.
    pub counters: Counters,
}

/// Things that are ignored and counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
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

/// Something that ended or went wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EventKind {
    /// Homing ended; the twist is known.
    Homed {
        /// Estimated error of the twist (rad).
        twist_error_estimate_rad: f32,
        /// Load (N).
        load_n: f32,
        /// Measured minus modelled gap: the LVDT's zero (m).
        gap_offset_m: f32,
    },
    /// Homing did not come to an end.
    HomingRefused(HomingFailure),
    /// The load is at rest at the target.
    MoveDone {
        /// Measured position minus target (m).
        error_m: f32,
    },
    /// A motion ended before its target, by `Stop`.
    Stopped,
    /// A fault was latched.
    FaultRaised(Fault),
    /// A fault was cleared.
    FaultCleared(Fault),
    /// The emergency stop opened.
    EStopOpened,
    /// The emergency stop closed again.
    EStopClosed,
    /// A table made on the board is in use; home again.
    TableRebuilt {
        /// Largest error of the contraction found (m).
        contraction_error_m: f32,
        /// Largest relative error of TR found.
        tr_relative_error: f32,
        /// Equilibria solved.
        states: u32,
        /// Time from request to table (µs).
        took_us: u64,
        /// It is in flash and will be used after a reset.
        kept: bool,
    },
    /// No table could be made; the one in use stays.
    TableRefused {
        /// Why.
        reason: TableRefusal,
        /// Load of the first state that broke it (N), or the contraction's error (m).
        load_n_or_error_m: f32,
        /// Twist of that state (rad), or TR's relative error.
        twist_rad_or_error: f32,
    },
}
