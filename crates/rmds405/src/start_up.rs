//! From power-up to the first data frame (hardware.md 2.5), as a pure state machine.
//!
//! ```text
//! Reset at once -> 500 ms -> online check until echo -> Reset -> 600 ms -> Mode -> 600 ms -> Config
//!     -> first motion report -> Ready
//! ```
//! The first Reset is for a drive that kept its power while the microcontroller restarted: it carries out its last
//! command for ever (hardware.md 2.6), so the microcontroller stops it before anything else. A drive that is still
//! booting ignores the Reset.

use crate::address::Address;
use crate::command::{Command, Mode};
use crate::frame::Frame;
use crate::report::Report;
use crate::units::OutOfRange;

/// From power-up to the first frame that the drive must understand: at least 500 ms (hardware.md 2.5).
pub const POWER_UP_MS: u64 = 500;
/// From Reset to Mode: at least 500 ms, 600 ms recommended (hardware.md 4).
pub const AFTER_RESET_MS: u64 = 600;
/// From Mode to the first data: at least 500 ms, 600 ms recommended (hardware.md 4).
pub const AFTER_MODE_MS: u64 = 600;
/// Between online checks. Our choice: the answer takes well under 1 ms, a booting drive up to 500 ms.
pub const ONLINE_RETRY_MS: u64 = 100;
/// Online checks before [`StartError::NoEcho`]. Our choice: 3 s, six times a drive's boot.
pub const ONLINE_TRIES: u8 = 30;
/// Between Config frames while no report comes. Our choice: longer than any sensible period.
pub const CONFIG_RETRY_MS: u64 = 300;
/// Config frames before [`StartError::NoFeedback`]. Our choice.
pub const CONFIG_TRIES: u8 = 4;

/// What happened since the last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Time passed. Step at least every 10 ms.
    Tick,
    /// The drive reported.
    Report(Report),
}

/// What to do now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Action {
    /// Nothing yet.
    Wait,
    /// Send this frame.
    Send(Frame),
    /// The drive is in its mode and reports; data frames may follow.
    Ready,
    /// The start-up has failed; begin again with a new [`StartUp`].
    Failed(StartError),
}

/// Why a start-up failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StartError {
    /// No echo to [`ONLINE_TRIES`] online checks: no power, no bus, other bit rate or address.
    #[error("the drive does not answer the online check")]
    NoEcho,
    /// No motion report after [`CONFIG_TRIES`] Config frames: the drive has not taken the mode.
    #[error("the drive answers but sends no motion reports")]
    NoFeedback,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Begin,
    PowerUp { since_ms: u64 },
    Online { sent_ms: u64, tries: u8 },
    AfterReset { since_ms: u64 },
    AfterMode { since_ms: u64 },
    Configured { sent_ms: u64, tries: u8 },
    Ready,
    Failed(StartError),
}

/// The start-up of one drive. The drive's position is 0 where the motor stood at the last Reset before
/// [`Action::Ready`].
#[derive(Clone, Copy, Debug)]
pub struct StartUp {
    address: Address,
    mode: Mode,
    motion_ms: u8,
    mixed_ms: u8,
    state: State,
}

impl StartUp {
    /// For the drive at `address`, to run in `mode` and report every `feedback_period_ms` (1 to 255).
    ///
    /// # Errors
    /// [`OutOfRange::FeedbackPeriod`] for a period of 0.
    pub const fn new(address: Address, mode: Mode, feedback_period_ms: u8) -> Result<Self, OutOfRange> {
        if feedback_period_ms == 0 {
            return Err(OutOfRange::FeedbackPeriod);
        }
        Ok(Self { address, mode, motion_ms: feedback_period_ms, mixed_ms: 0, state: State::Begin })
    }

    /// The same, with inputs and output reported every `mixed_ms` as well (0: not at all).
    #[must_use]
    pub const fn with_mixed(self, mixed_ms: u8) -> Self {
        Self { mixed_ms, ..self }
    }

    /// One step. `now_ms` never runs backwards; the first call counts as power-up.
    pub fn step(&mut self, now_ms: u64, event: Event) -> Action {
        let passed = |since_ms: u64, wait_ms: u64| now_ms.saturating_sub(since_ms) >= wait_ms;
        match self.state {
            State::Begin => {
                self.state = State::PowerUp { since_ms: now_ms };
                self.send(Command::Reset)
            }
            State::PowerUp { since_ms } if passed(since_ms, POWER_UP_MS) => {
                self.state = State::Online { sent_ms: now_ms, tries: 1 };
                self.send(Command::OnlineCheck)
            }
            State::Online { .. } if event == Event::Report(Report::Online) => {
                self.state = State::AfterReset { since_ms: now_ms };
                self.send(Command::Reset)
            }
            State::Online { sent_ms, tries } if passed(sent_ms, ONLINE_RETRY_MS) => {
                if tries >= ONLINE_TRIES {
                    return self.fail(StartError::NoEcho);
                }
                self.state = State::Online { sent_ms: now_ms, tries: tries + 1 };
                self.send(Command::OnlineCheck)
            }
            State::AfterReset { since_ms } if passed(since_ms, AFTER_RESET_MS) => {
                self.state = State::AfterMode { since_ms: now_ms };
                self.send(Command::ChooseMode(self.mode))
            }
            State::AfterMode { since_ms } if passed(since_ms, AFTER_MODE_MS) => {
                self.state = State::Configured { sent_ms: now_ms, tries: 1 };
                self.configure()
            }
            State::Configured { .. } if matches!(event, Event::Report(Report::Motion { .. })) => {
                self.state = State::Ready;
                Action::Ready
            }
            State::Configured { sent_ms, tries } if passed(sent_ms, CONFIG_RETRY_MS) => {
                if tries >= CONFIG_TRIES {
                    return self.fail(StartError::NoFeedback);
                }
                self.state = State::Configured { sent_ms: now_ms, tries: tries + 1 };
                self.configure()
            }
            State::Ready => Action::Ready,
            State::Failed(error) => Action::Failed(error),
            _ => Action::Wait,
        }
    }

    fn configure(&self) -> Action {
        self.send(Command::Config { motion_ms: self.motion_ms, mixed_ms: self.mixed_ms })
    }

    fn send(&self, command: Command) -> Action {
        Action::Send(command.encode(self.address))
    }

    fn fail(&mut self, error: StartError) -> Action {
        self.state = State::Failed(error);
        Action::Failed(error)
    }
}
