//! Why the board refuses a request. The texts are what an operator reads.

use crate::codes::{CurveFlaw, Fault, Parameter, Sensor, Setting, State};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Why a request was refused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// Needs a homed rig.
    #[error("not homed: `home` first")]
    NotHomed,
    /// Not possible in this state.
    #[error("not possible while {state}: wait, or `stop` first")]
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
    #[error("fault {fault} cannot be cleared: its cause is still there (docs/reference/faults.md)")]
    CauseRemains {
        /// The fault.
        fault: Fault,
    },
    /// `Clear` while the shaft turns: the load is falling, or something turns it.
    #[error("the shaft turns: wait until it stands, then `clear`")]
    ShaftTurns,
    /// The emergency stop is open.
    #[error("the emergency stop is pressed: release it, then `clear` and `home`")]
    EStop,
    /// A parameter is outside its limits.
    #[error("{parameter} is {given} {unit}, allowed are {min} to {max} {unit}", unit = parameter.unit())]
    OutOfRange {
        /// Which.
        parameter: Parameter,
        /// Minimum allowed value (unit of the parameter).
        min: f32,
        /// Maximum allowed value (unit of the parameter).
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
        /// Minimum allowed value (its unit).
        min: f32,
        /// Maximum allowed value (its unit).
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
    /// The points of the LVDT's calibration are none.
    #[error("lvdt-points: {flaw}")]
    LvdtPoints {
        /// Why.
        flaw: CurveFlaw,
    },
    /// No tool with the board's own protocol has greeted it since it started.
    #[error("the board has restarted, or serves a tool of another version: connect again")]
    NotGreeted,
    /// The drive has not answered its start-up sequence.
    #[error("the drive is not ready: check its supply and CAN, then run `rigctl doctor`")]
    DriveNotReady,
    /// A sensor that the request needs gives no valid reading.
    #[error("no valid reading from the {sensor}: check its wiring and supply, then run `rigctl doctor`")]
    SensorInvalid {
        /// Which.
        sensor: Sensor,
    },
    /// More requests at once than the board can queue.
    #[error("too many requests at once: ask again")]
    TooMany,
    /// A stop came before this request was begun, or ended the stream that this set-point belongs to.
    #[error(
        "a stop came before this was begun: give the command again, a stream after half a second without set-points"
    )]
    Stopped,
    /// Its number is not newer than that of the last request: an old message that has arrived again.
    #[error("an older message than the last one has arrived again: it is not carried out a second time")]
    Repeated,
}
