//! The table of all messages. Change anything here and [`crate::PROTOCOL_HASH`] changes with it.
//!
//! | from  | message     | when                                                             |
//! |-------|-------------|------------------------------------------------------------------|
//! | host  | [`Request`] | as the operator wishes; `Heartbeat` all the time                 |
//! | board | `Reply`     | once for each request except `Heartbeat`, with its number        |
//! | board | `Identity`  | after `Hello` and after `Status`, following the reply            |
//! | board | `Settings`  | after `GetSettings`, and when settings are in flash              |
//! | board | `Gap`       | after `ReadGap`                                                  |
//! | board | `Telemetry` | every 10 ms, asked or not                                        |
//! | board | `Event`     | when something ends or goes wrong                                |
//!
//! SI units throughout; the unit is in the name. `None` means "not known", never "zero".
//! Position is how far the load has come up from where it hung, at the half-turn pre-twist, when the rig was homed.

use crate::named_codes;
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
    /// Ramp down and hold. Accepted in every state.
    Stop,
    /// Hold the present position in closed loop.
    Hold,
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
    /// Send the gap that the LVDT shows now.
    ReadGap,
}

named_codes! {
    /// What a rig is told for good. Each has its unit, default and range in [`crate::settings`]. The numbers are for good:
    /// boards keep their settings by them.
    pub enum Setting {
        /// Gap where the scene's LVDT numbers say 0 (m).
        LvdtOffset = 0, "lvdt-offset";
        /// True change of the gap for one that the scene's LVDT numbers show.
        LvdtGain = 1, "lvdt-gain";
        /// Position that is called 0, from where the load hangs at the half-turn pre-twist (m).
        PositionZero = 2, "position-zero";
        /// Which way the strings are twisted: +1 as the encoder counts, -1 the other way.
        TwistSign = 3, "twist-sign";
        /// True gear ratio over the scene's.
        GearScale = 4, "gear-scale";
        /// Greatest speed that may be asked of the load (m/s).
        SpeedMax = 5, "speed-max";
        /// Current limit sent with every command to the drive (A).
        CurrentLimit = 6, "current-limit";
        /// Scale of the twist that homing expects of these strings.
        TwistScale = 7, "twist-scale";
    }
}

/// One value for each [`Setting`], in the order of [`Setting::ALL`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SettingValues(pub [f32; Setting::ALL.len()]);

named_codes! {
    /// What flash holds of the settings.
    pub enum Kept {
        /// Nothing: these are the defaults, or were set and could not be kept.
        Nothing = 0, "not kept";
        /// These values.
        These = 1, "kept";
        /// Others: these are about to be written.
        Others = 2, "being written";
        /// A damaged record, or one for other constants of the rig. These are the defaults.
        Damaged = 3, "damaged";
    }
}

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
    /// What the LVDT shows, calibrated; nothing if it gives no valid reading.
    Gap {
        /// Gap (m).
        gap_m: Option<f32>,
    },
    /// Something ended or went wrong.
    Event {
        /// Time since boot (µs).
        t_us: u64,
        /// What.
        kind: EventKind,
    },
}

named_codes! {
    /// How a request was taken.
    pub enum Accepted {
        /// It took effect at once.
        Done = 0, "done";
        /// It has begun; an event tells how it ended.
        Started = 1, "started";
        /// It has begun, and the position is not known any more: home again.
        Unhomed = 2, "unhomed";
    }
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
}

named_codes! {
    /// Parameters that a refusal can name.
    pub enum Parameter {
        /// Target position (m).
        Target = 0, "target";
        /// Speed of the load (m/s).
        Speed = 1, "speed";
        /// Load (N).
        Load = 2, "load";
        /// Twist speed (rad/s).
        TwistSpeed = 3, "twist speed";
        /// Twist (rad).
        Twist = 4, "twist";
    }
}

impl Parameter {
    /// SI unit of the values that a refusal gives.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Target => "m",
            Self::Speed => "m/s",
            Self::Load => "N",
            Self::TwistSpeed => "rad/s",
            Self::Twist => "rad",
        }
    }
}

named_codes! {
    /// The rig's sensors.
    pub enum Sensor {
        /// Displacement transducer of the load.
        Lvdt = 0, "LVDT";
        /// The rig's own encoder.
        Encoder = 1, "encoder";
        /// What the drive reports of its motor.
        Drive = 2, "drive";
    }
}

named_codes! {
    /// What the rig is doing.
    pub enum State {
        /// Starting; drive and sensors not yet heard.
        Boot = 0, "boot";
        /// Ready to home; the twist is not known.
        Unhomed = 1, "unhomed";
        /// Homing.
        Homing = 2, "homing";
        /// Homed, at rest.
        Ready = 3, "ready";
        /// On the way to a target or jogging.
        Moving = 4, "moving";
        /// Holding a position in closed loop.
        Holding = 5, "holding";
        /// Stopped by a latched fault.
        Fault = 6, "fault";
        /// Emergency stop.
        EStop = 7, "estop";
    }
}

named_codes! {
    /// What stopped the rig. Latched until cleared; `docs/faults.md` has an entry for each. The numbers are for good: never
    /// reuse one (24 was taken).
    pub enum Fault {
        /// No heartbeat from the host during a motion.
        HostSilent = 1, "host-silent";
        /// Control ticks came late or were left out.
        TickLate = 2, "tick-late";
        /// The last boot was the watchdog's doing.
        WatchdogReset = 3, "watchdog-reset";
        /// The board was reset while the strings may have been twisted.
        UnexpectedReset = 4, "unexpected-reset";
        /// The drive sends no feedback.
        DriveSilent = 5, "drive-silent";
        /// The CAN controller has left the bus.
        CanBusOff = 6, "can-bus-off";
        /// The drive reports a stall.
        DriveStall = 7, "drive-stall";
        /// The drive restarted by itself: un-moded, its position is 0 again.
        DriveReset = 8, "drive-reset";
        /// The motor is told to turn and the encoder does not count.
        EncoderStuck = 9, "encoder-stuck";
        /// The encoder counted more than the motor can turn.
        EncoderJump = 10, "encoder-jump";
        /// Encoder and drive tell different positions.
        EncoderDisagrees = 11, "encoder-disagrees";
        /// LVDT signal at the rail of a broken wire.
        LvdtOpen = 12, "lvdt-open";
        /// LVDT signal at the rail of a short circuit.
        LvdtShort = 13, "lvdt-short";
        /// LVDT noise above its limit.
        LvdtNoisy = 14, "lvdt-noisy";
        /// The LVDT repeats one code exactly: a live one has noise.
        LvdtFrozen = 15, "lvdt-frozen";
        /// No new LVDT samples arrive.
        LvdtStalled = 16, "lvdt-stalled";
        /// LVDT and table disagree: slip, creep or overtwist.
        ModelResidual = 17, "model-residual";
        /// The load dropped without motor motion.
        StringBreak = 18, "string-break";
        /// The position fell too far behind its set-point.
        FollowingError = 19, "following-error";
        /// The embedded table fails its checksum.
        TableCorrupt = 20, "table-corrupt";
        /// A computed value is infinite or not a number.
        NotFinite = 21, "not-finite";
        /// What is kept in flash is damaged, or for another rig.
        SettingsCorrupt = 22, "settings-corrupt";
        /// A limit switch opened.
        LimitSwitch = 23, "limit-switch";
        /// The previous run ended in a panic or a fault of the core.
        Panicked = 25, "panicked";
        /// The drive refused or left its start-up sequence.
        DriveStartUp = 26, "drive-start-up";
        /// Supply voltage of the drive outside its limits.
        Supply = 27, "supply";
        /// Twist outside the range that the strings stand.
        TwistRange = 28, "twist-range";
        /// The estimated load left the range of the table.
        LoadRange = 29, "load-range";
    }
}

named_codes! {
    /// What holds the rig back without stopping it.
    pub enum Limit {
        /// The motor is at its greatest speed.
        MotorSpeed = 1, "motor-speed";
        /// The motor is at its greatest current.
        MotorCurrent = 2, "motor-current";
        /// The set-point stands at the end of the travel.
        Travel = 3, "travel";
        /// The load estimate stands at the end of the table's range.
        LoadRange = 4, "load-range";
        /// The motor is at its greatest acceleration.
        MotorAcceleration = 5, "motor-acceleration";
        /// The load is not known well: light, fast, or it has just changed.
        LoadUnknown = 6, "load-unknown";
    }
}

named_codes! {
    /// Why homing did not come to an end.
    pub enum HomingFailure {
        /// It took longer than allowed.
        TimeOut = 0, "time-out";
        /// The gap did not change as twisted strings would make it.
        NoPretwist = 1, "no-pretwist";
        /// Twist and gap fit no load in the table's range.
        LoadOutOfRange = 2, "load-out-of-range";
        /// The sweep does not fit the model.
        PoorFit = 3, "poor-fit";
        /// A sensor gave no valid reading.
        SensorInvalid = 4, "sensor-invalid";
        /// The motor did not move as told.
        DriveFailed = 5, "drive-failed";
        /// Stopped by the operator.
        Stopped = 6, "stopped";
        /// The end of the sensor's or the string's travel came first.
        TravelEnd = 7, "travel-end";
    }
}

named_codes! {
    /// Why a table could not be made on the board.
    pub enum TableRefusal {
        /// A constant is not finite, of the wrong sign, or does not fit the others.
        Constants = 0, "constants";
        /// The table in use is of a form that cannot be made again.
        Form = 1, "form";
        /// The envelope reaches past a limit of the model.
        Model = 2, "model-limit";
        /// The fit is not determined.
        Fit = 3, "fit";
        /// It misses the scene's accuracy.
        Accuracy = 4, "accuracy";
        /// The gap is not monotone.
        NotMonotone = 5, "not-monotone";
        /// No memory is left for another one: reset the board.
        NoRoom = 6, "no-room";
    }
}

named_codes! {
    /// Why the board last started.
    pub enum ResetCause {
        /// Power came on.
        PowerOn = 0, "power-on";
        /// The supply dipped.
        BrownOut = 1, "brown-out";
        /// The reset pin.
        Pin = 2, "pin";
        /// Reset by the firmware itself or by a debugger.
        Software = 3, "software";
        /// A watchdog.
        Watchdog = 4, "watchdog";
        /// Low-power reset.
        LowPower = 5, "low-power";
        /// No flag was set.
        Unknown = 6, "unknown";
    }
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
    /// The embedded table.
    pub table: TableIdentity,
    /// Why the board last started.
    pub reset_cause: ResetCause,
    /// Boots since power came on, counting this one.
    pub boot_count: u32,
    /// What the run before this one ended with, if it was a panic or a fault of the core; as much as fits.
    pub last_panic: Option<String<96>>,
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

/// What the board sees and does, every 10 ms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Telemetry {
    /// Time since boot of the control tick that this shows (µs).
    pub t_us: u64,
    /// What the rig is doing.
    pub state: State,
    /// The latched fault.
    pub fault: Option<Fault>,
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
    /// A motion ended before its target, by `Stop` or `Hold`.
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
