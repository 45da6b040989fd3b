//! The values that the wire carries, as newtypes: a current cannot be sent as a speed, and no limit can be negative.
//!
//! Ranges and units are those of crates/rmds405/README.md section 1, "Units and conventions".

/// A value outside the range of its field; the variant names the parameter and holds what was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OutOfRange {
    /// Group is 0 to 7 (V-CAN p6).
    #[error("drive group {0} is not within 0 to 7")]
    Group(u8),
    /// Number is 1 to 15; 0 is the broadcast (V-CAN p6).
    #[error("drive number {0} is not within 1 to 15")]
    Number(u8),
    /// Mode code is 1 to 8 (crates/rmds405/README.md 2.3).
    #[error("mode code {0} is not within 1 to 8")]
    Mode(u8),
    /// PWM is -5000 to 5000.
    #[error("PWM {0} is not within -5000 to 5000")]
    Pwm(i16),
    /// PWM limit is 0 to 5000.
    #[error("PWM limit {0} is not within 0 to 5000")]
    PwmLimit(i16),
    /// Current limit is 0 to 32767 mA.
    #[error("current limit {0} mA is negative")]
    CurrentLimit(i16),
    /// Speed limit is 0 to 32767 RPM.
    #[error("speed limit {0} RPM is negative")]
    SpeedLimit(i16),
}

/// Winding current in mA, any `i16` (V-FAQ p6: not the supply current).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Milliamps(pub i16);

/// Speed of the motor shaft in revolutions per minute, any `i16`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Rpm(pub i16);

/// Position of the motor shaft in quadrature counts, 4 for each encoder line (V-FAQ p9); 0 is the position at
/// the last reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct QuadCounts(pub i32);

macro_rules! ranged {
    ($(#[$doc:meta])* $name:ident, $error:ident, $min:expr, $max:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
                pub struct $name(i16);

        impl $name {
            /// The maximum value.
            pub const MAX: Self = Self($max);

            /// Checks the range.
            ///
            /// # Errors
            /// [`OutOfRange`] if the value is outside it.
            pub const fn new(value: i16) -> Result<Self, OutOfRange> {
                if value < $min || value > $max { Err(OutOfRange::$error(value)) } else { Ok(Self(value)) }
            }

            /// The value as the wire carries it.
            pub const fn get(self) -> i16 {
                self.0
            }
        }
    };
}

ranged!(
    /// Motor voltage in 1/5000 of the supply voltage, -5000 to 5000.
    Pwm, Pwm, -5000, 5000
);
ranged!(
    /// Bound on the size of the motor voltage in 1/5000 of the supply voltage, 0 to 5000 (V-CAN p9).
    PwmLimit, PwmLimit, 0, 5000
);
ranged!(
    /// Bound on the size of the winding current in mA, 0 to 32767.
    CurrentLimit, CurrentLimit, 0, i16::MAX
);
ranged!(
    /// Bound on the speed of the motor shaft in RPM, 0 to 32767.
    SpeedLimit, SpeedLimit, 0, i16::MAX
);
