//! Host to drive (crates/rmds405/README.md 2.2, functions 0x0 to 0xA, 0xE and 0xF).

use crate::address::{Address, Function};
use crate::frame::{Frame, Ignored, PAD, Received, accept, i16_at, position_of, words};
use crate::units::{CurrentLimit, Milliamps, OutOfRange, Pwm, PwmLimit, QuadCounts, Rpm, SpeedLimit};

/// The eight ways to run a motor (crates/rmds405/README.md 2.3). Only the `Current…` modes bound the torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// A voltage.
    OpenLoop = 1,
    /// A current.
    Current = 2,
    /// A speed; torque is bounded by the PWM limit alone.
    Velocity = 3,
    /// A position, as fast as possible.
    Position = 4,
    /// A position at a bounded speed.
    VelocityPosition = 5,
    /// A speed at a bounded current.
    CurrentVelocity = 6,
    /// A position at a bounded current.
    CurrentPosition = 7,
    /// A position at a bounded current and speed.
    CurrentVelocityPosition = 8,
}

impl Mode {
    /// The function of this mode's data frames: code + 1.
    pub const fn data_function(self) -> Function {
        Function::of_id(self as u16 + 1)
    }
}

impl TryFrom<u8> for Mode {
    type Error = OutOfRange;

    fn try_from(code: u8) -> Result<Self, OutOfRange> {
        const MODES: [Mode; 8] = [
            Mode::OpenLoop,
            Mode::Current,
            Mode::Velocity,
            Mode::Position,
            Mode::VelocityPosition,
            Mode::CurrentVelocity,
            Mode::CurrentPosition,
            Mode::CurrentVelocityPosition,
        ];
        MODES.into_iter().find(|mode| *mode as u8 == code).ok_or(OutOfRange::Mode(code))
    }
}

/// What to do with an opto-coupled output. The wire is inverted: 0x00 is on (V-CAN p22).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// Opto-coupler lit.
    On,
    /// Opto-coupler dark, as after a reset.
    Off,
    /// Left as it is; any byte but 0x00 and 0x01.
    Unchanged,
}

impl Output {
    const fn byte(self) -> u8 {
        match self {
            Self::On => 0x00,
            Self::Off => 0x01,
            Self::Unchanged => PAD,
        }
    }

    const fn of_byte(byte: u8) -> Self {
        match byte {
            0x00 => Self::On,
            0x01 => Self::Off,
            _ => Self::Unchanged,
        }
    }
}

/// Every command to a drive. Data commands work only in their own mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Restart: un-moded, position 0, no torque. Valid in any state.
    Reset,
    /// Choose a mode; only in the un-moded state.
    ChooseMode(Mode),
    /// Mode 1.
    OpenLoop {
        /// Motor voltage.
        pwm: Pwm,
    },
    /// Mode 2.
    Current {
        /// Bound on the voltage.
        pwm_limit: PwmLimit,
        /// Target.
        current: Milliamps,
    },
    /// Mode 3.
    Velocity {
        /// Bound on the voltage.
        pwm_limit: PwmLimit,
        /// Target.
        speed: Rpm,
    },
    /// Mode 4.
    Position {
        /// Bound on the voltage.
        pwm_limit: PwmLimit,
        /// Target, absolute.
        position: QuadCounts,
    },
    /// Mode 5.
    VelocityPosition {
        /// Bound on the voltage.
        pwm_limit: PwmLimit,
        /// Bound on the speed.
        speed_limit: SpeedLimit,
        /// Target, absolute.
        position: QuadCounts,
    },
    /// Mode 6.
    CurrentVelocity {
        /// Bound on the current.
        current_limit: CurrentLimit,
        /// Target.
        speed: Rpm,
    },
    /// Mode 7.
    CurrentPosition {
        /// Bound on the current.
        current_limit: CurrentLimit,
        /// Target, absolute.
        position: QuadCounts,
    },
    /// Mode 8.
    CurrentVelocityPosition {
        /// Bound on the current.
        current_limit: CurrentLimit,
        /// Bound on the speed.
        speed_limit: SpeedLimit,
        /// Target, absolute.
        position: QuadCounts,
    },
    /// Feedback periods in ms, 0 = off. Valid in any state; whether a reset clears them is unknown, so send it after
    /// each.
    Config {
        /// Of the motion report (T1).
        motion_ms: u8,
        /// Of the mixed report (T2). 0 also means "off" to firmware older than 2018-07-28 (crates/rmds405/README.md 4).
        mixed_ms: u8,
    },
    /// The two outputs.
    Outputs {
        /// OUT1.
        out1: Output,
        /// OUT2.
        out2: Output,
    },
    /// Asks for an echo. Valid in any state.
    OnlineCheck,
}

impl Command {
    /// The function that carries it.
    pub const fn function(&self) -> Function {
        match self {
            Self::Reset => Function::Reset,
            Self::ChooseMode(_) => Function::ChooseMode,
            Self::OpenLoop { .. } => Function::OpenLoop,
            Self::Current { .. } => Function::Current,
            Self::Velocity { .. } => Function::Velocity,
            Self::Position { .. } => Function::Position,
            Self::VelocityPosition { .. } => Function::VelocityPosition,
            Self::CurrentVelocity { .. } => Function::CurrentVelocity,
            Self::CurrentPosition { .. } => Function::CurrentPosition,
            Self::CurrentVelocityPosition { .. } => Function::CurrentVelocityPosition,
            Self::Config { .. } => Function::Config,
            Self::Outputs { .. } => Function::Outputs,
            Self::OnlineCheck => Function::OnlineCheck,
        }
    }

    /// The frame for one drive.
    pub fn encode(&self, to: Address) -> Frame {
        Frame { id: to.id(self.function()), data: self.data() }
    }

    fn data(&self) -> [u8; 8] {
        let bytes = |first: u8, second: u8| [first, second, PAD, PAD, PAD, PAD, PAD, PAD];
        match *self {
            Self::Reset | Self::OnlineCheck => [PAD; 8],
            Self::ChooseMode(mode) => bytes(mode as u8, PAD),
            Self::OpenLoop { pwm } => words(pwm.get(), None, None),
            Self::Current { pwm_limit, current } => words(pwm_limit.get(), Some(current.0), None),
            Self::Velocity { pwm_limit, speed } => words(pwm_limit.get(), Some(speed.0), None),
            Self::Position { pwm_limit, position } => words(pwm_limit.get(), None, Some(position)),
            Self::VelocityPosition { pwm_limit, speed_limit, position } => {
                words(pwm_limit.get(), Some(speed_limit.get()), Some(position))
            }
            Self::CurrentVelocity { current_limit, speed } => words(current_limit.get(), Some(speed.0), None),
            Self::CurrentPosition { current_limit, position } => words(current_limit.get(), None, Some(position)),
            Self::CurrentVelocityPosition { current_limit, speed_limit, position } => {
                words(current_limit.get(), Some(speed_limit.get()), Some(position))
            }
            Self::Config { motion_ms, mixed_ms } => bytes(motion_ms, mixed_ms),
            Self::Outputs { out1, out2 } => bytes(out1.byte(), out2.byte()),
        }
    }

    /// The command in a frame that the drive at `own` receives, broadcasts to its group included. Padding is not
    /// checked.
    ///
    /// # Errors
    /// [`Ignored`] if the frame is not for this drive, or no command.
    pub fn decode(own: Address, received: &Received<'_>) -> Result<Self, Ignored> {
        let (function, data) = accept(own, received, true)?;
        Self::of(function, &data)
    }

    /// The command that a function and its eight bytes are.
    ///
    /// # Errors
    /// [`Ignored`] if the function is a report's, or a field is out of range.
    pub fn of(function: Function, data: &[u8; 8]) -> Result<Self, Ignored> {
        let first = i16_at(data, 0);
        let second = i16_at(data, 2);
        let pwm_limit = || PwmLimit::new(first).map_err(|_| Ignored::Field(0));
        let current_limit = || CurrentLimit::new(first).map_err(|_| Ignored::Field(0));
        let speed_limit = || SpeedLimit::new(second).map_err(|_| Ignored::Field(2));
        let position = position_of(data);
        Ok(match function {
            Function::Reset => Self::Reset,
            Function::ChooseMode => Self::ChooseMode(Mode::try_from(data[0]).map_err(|_| Ignored::Field(0))?),
            Function::OpenLoop => Self::OpenLoop { pwm: Pwm::new(first).map_err(|_| Ignored::Field(0))? },
            Function::Current => Self::Current { pwm_limit: pwm_limit()?, current: Milliamps(second) },
            Function::Velocity => Self::Velocity { pwm_limit: pwm_limit()?, speed: Rpm(second) },
            Function::Position => Self::Position { pwm_limit: pwm_limit()?, position },
            Function::VelocityPosition => {
                Self::VelocityPosition { pwm_limit: pwm_limit()?, speed_limit: speed_limit()?, position }
            }
            Function::CurrentVelocity => Self::CurrentVelocity { current_limit: current_limit()?, speed: Rpm(second) },
            Function::CurrentPosition => Self::CurrentPosition { current_limit: current_limit()?, position },
            Function::CurrentVelocityPosition => {
                Self::CurrentVelocityPosition { current_limit: current_limit()?, speed_limit: speed_limit()?, position }
            }
            Function::Config => Self::Config { motion_ms: data[0], mixed_ms: data[1] },
            Function::Outputs => Self::Outputs { out1: Output::of_byte(data[0]), out2: Output::of_byte(data[1]) },
            Function::OnlineCheck => Self::OnlineCheck,
            Function::Motion | Function::Mixed | Function::Error => return Err(Ignored::WrongDirection(function)),
        })
    }
}
