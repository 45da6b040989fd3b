//! Drive to host (crates/rmds405/README.md 2.2 and 2.4, functions 0xB, 0xC, 0xD and 0xF).

use crate::address::{Address, Function};
use crate::frame::{Frame, Ignored, PAD, Received, accept, i16_at, position_of, words};
use crate::units::{Milliamps, Pwm, QuadCounts, Rpm};

/// Code of stall protection in an error report (V-CAN p21). Assume that only a reset clears it
/// (docs/reference/hardware.md 4). No manual defines another one.
pub const STALL: u8 = 0x01;

/// Inputs and present output of the drive (V-CAN p20-21). `true` is high or lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mixed {
    /// Input CTL1.
    pub ctl1: bool,
    /// Input CTL2.
    pub ctl2: bool,
    /// The rest; drives older than 2018-07-28 fill in only the first two bytes (crates/rmds405/README.md 4).
    pub rest: Option<MixedRest>,
}

/// What the 2018 manual added to the mixed report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MixedRest {
    /// Digital input.
    pub dsin: bool,
    /// Analog input, millivolt.
    pub asin_mv: u16,
    /// Encoder index channel; high also means floating.
    pub chz: bool,
    /// Present output. It is only indicative, and half as great at a switching frequency of 28.8 kHz.
    pub pwm: Pwm,
}

/// Every report of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Report {
    /// Sent every T1 once a mode is chosen.
    Motion {
        /// Winding current.
        current: Milliamps,
        /// Measured over a window of 1 ms, so in steps of 60000 / (4 lines) RPM (V-FAQ p3-4): average it.
        speed: Rpm,
        /// Since the last reset.
        position: QuadCounts,
    },
    /// Sent every T2 once a mode is chosen.
    Mixed(Mixed),
    /// Sent every 100 ms while the error lasts: its code.
    Error(u8),
    /// The echo to an online check. A host with loop-back on receives its own question as this too.
    Online,
}

impl Report {
    /// The function that carries it.
    pub const fn function(&self) -> Function {
        match self {
            Self::Motion { .. } => Function::Motion,
            Self::Mixed(_) => Function::Mixed,
            Self::Error(_) => Function::Error,
            Self::Online => Function::OnlineCheck,
        }
    }

    /// The report in a frame from the drive at `from`.
    ///
    /// # Errors
    /// [`Ignored`] if the frame is not from this drive, or no report.
    pub fn decode(from: Address, received: &Received<'_>) -> Result<Self, Ignored> {
        let (function, data) = accept(from, received, false)?;
        Self::of(function, &data)
    }

    /// The report that a function and its eight bytes are.
    ///
    /// # Errors
    /// [`Ignored`] if the function is a command's, or a byte holds no valid value.
    pub fn of(function: Function, data: &[u8; 8]) -> Result<Self, Ignored> {
        let level = |at: u8| match data[usize::from(at)] {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(Ignored::Field(at)),
        };
        Ok(match function {
            Function::Motion => Self::Motion {
                current: Milliamps(i16_at(data, 0)),
                speed: Rpm(i16_at(data, 2)),
                position: position_of(data),
            },
            Function::Mixed => Self::Mixed(Mixed {
                ctl1: level(0)?,
                ctl2: level(1)?,
                rest: match (level(2), level(5), Pwm::new(i16_at(data, 6))) {
                    (Ok(dsin), Ok(chz), Ok(pwm)) => {
                        Some(MixedRest { dsin, asin_mv: u16::from_be_bytes([data[3], data[4]]), chz, pwm })
                    }
                    _ => None,
                },
            }),
            Function::Error => Self::Error(data[0]),
            // The echo is identical to the question, and ours is all padding.
            Function::OnlineCheck => match data.iter().position(|&byte| byte != PAD) {
                None => Self::Online,
                Some(at) => return Err(Ignored::Field(at as u8)),
            },
            other => return Err(Ignored::WrongDirection(other)),
        })
    }

    /// The frame that the drive at `from` sends.
    pub fn encode(&self, from: Address) -> Frame {
        Frame { id: from.id(self.function()), data: self.data() }
    }

    /// The frame's eight bytes.
    pub fn data(&self) -> [u8; 8] {
        let mut data = [PAD; 8];
        match *self {
            Self::Motion { current, speed, position } => return words(current.0, Some(speed.0), Some(position)),
            Self::Mixed(Mixed { ctl1, ctl2, rest }) => {
                data[0] = u8::from(ctl1);
                data[1] = u8::from(ctl2);
                if let Some(rest) = rest {
                    data[2] = u8::from(rest.dsin);
                    data[3..5].copy_from_slice(&rest.asin_mv.to_be_bytes());
                    data[5] = u8::from(rest.chz);
                    data[6..].copy_from_slice(&rest.pwm.get().to_be_bytes());
                }
            }
            Self::Error(code) => data[0] = code,
            Self::Online => {}
        }
        data
    }
}
