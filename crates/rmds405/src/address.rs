//! The address of a frame: `id = group << 8 | number << 4 | function` (crates/rmds405/README.md 2.1).

use crate::units::OutOfRange;

/// One drive: group 0 to 7, number 1 to 15. Factory default is group 0, number 1 (V-CAN p6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    group: u8,
    number: u8,
}

impl Address {
    /// Checks both ranges.
    ///
    /// # Errors
    /// [`OutOfRange::Group`] or [`OutOfRange::Number`] outside them.
    pub const fn new(group: u8, number: u8) -> Result<Self, OutOfRange> {
        match (group, number) {
            (8.., _) => Err(OutOfRange::Group(group)),
            (_, 0 | 16..) => Err(OutOfRange::Number(number)),
            _ => Ok(Self { group, number }),
        }
    }

    /// The 11-bit identifier; no valid address exceeds 0x7FF.
    pub const fn id(self, function: Function) -> u16 {
        self.broadcast_id(function) | (self.number as u16) << 4
    }

    /// Identifier of a broadcast to the drive's whole group (number 0).
    pub(crate) const fn broadcast_id(self, function: Function) -> u16 {
        (self.group as u16) << 8 | function as u16
    }

    /// Identifiers of everything that the drive sends (functions B, C, D, F): one bank of CAN filters.
    pub const fn report_ids(self) -> [u16; 4] {
        [self.id(Function::Motion), self.id(Function::Mixed), self.id(Function::Error), self.id(Function::OnlineCheck)]
    }
}

/// The low four bits of the identifier (crates/rmds405/README.md 2.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Function {
    /// Restart the drive.
    Reset = 0x0,
    /// Leave the un-moded state.
    ChooseMode = 0x1,
    /// Data of mode 1.
    OpenLoop = 0x2,
    /// Data of mode 2.
    Current = 0x3,
    /// Data of mode 3.
    Velocity = 0x4,
    /// Data of mode 4.
    Position = 0x5,
    /// Data of mode 5.
    VelocityPosition = 0x6,
    /// Data of mode 6.
    CurrentVelocity = 0x7,
    /// Data of mode 7.
    CurrentPosition = 0x8,
    /// Data of mode 8.
    CurrentVelocityPosition = 0x9,
    /// Feedback periods.
    Config = 0xA,
    /// Drive to host: current, speed, position.
    Motion = 0xB,
    /// Drive to host: inputs and PWM.
    Mixed = 0xC,
    /// Drive to host: error code.
    Error = 0xD,
    /// Outputs OUT1 and OUT2.
    Outputs = 0xE,
    /// In both directions: the question whether the drive is online, and its echo.
    OnlineCheck = 0xF,
}

impl Function {
    /// The function in the low four bits of an identifier; all sixteen values are functions.
    pub const fn of_id(id: u16) -> Self {
        match id & 0xF {
            0x0 => Self::Reset,
            0x1 => Self::ChooseMode,
            0x2 => Self::OpenLoop,
            0x3 => Self::Current,
            0x4 => Self::Velocity,
            0x5 => Self::Position,
            0x6 => Self::VelocityPosition,
            0x7 => Self::CurrentVelocity,
            0x8 => Self::CurrentPosition,
            0x9 => Self::CurrentVelocityPosition,
            0xA => Self::Config,
            0xB => Self::Motion,
            0xC => Self::Mixed,
            0xD => Self::Error,
            0xE => Self::Outputs,
            _ => Self::OnlineCheck,
        }
    }
}
