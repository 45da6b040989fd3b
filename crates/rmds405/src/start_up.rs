//! From power-up to the first data frame (crates/rmds405/README.md 2.5), as a pure state machine.
//!
//! ```text
//! Reset at once -> 500 ms -> online check until echo -> Reset -> 600 ms -> Mode -> 600 ms -> Config
//!     -> first motion report -> Ready
//! ```
//! The first Reset is for a drive that kept its power while the microcontroller restarted: it carries out its last
//! command indefinitely (crates/rmds405/README.md 2.6), so the microcontroller stops it before anything else. A drive that
//! is still booting ignores the Reset.

use crate::address::Address;
use crate::command::{Command, Mode};
use crate::frame::Frame;
use crate::report::Report;

/// From power-up to the first frame that the drive must understand: at least 500 ms (crates/rmds405/README.md 2.5).
pub const POWER_UP_MS: u64 = 500;
/// From Reset to Mode: at least 500 ms, 600 ms recommended (crates/rmds405/README.md 4).
pub const AFTER_RESET_MS: u64 = 600;
/// From Mode to the first data: at least 500 ms, 600 ms recommended (crates/rmds405/README.md 4).
pub const AFTER_MODE_MS: u64 = 600;
/// Between online checks. Our choice: the answer takes well under 1 ms, a booting drive up to 500 ms.
pub const ONLINE_RETRY_MS: u64 = 100;
/// Online checks before the start-up has failed: no power, no bus, other bit rate or address. Our choice: 3 s, six times a drive's boot.
pub const ONLINE_TRIES: u8 = 30;
/// Between Config frames while no report comes. Our choice: longer than any sensible period.
pub const CONFIG_RETRY_MS: u64 = 300;
/// Config frames before it has failed, because the drive has not taken the mode. Our choice.
pub const CONFIG_TRIES: u8 = 4;

/// What to do now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Nothing yet.
    Wait,
    /// Send this frame.
    Send(Frame),
    /// The drive is in its mode and reports; data frames may follow.
    Ready,
    /// The start-up has failed; begin again with a new [`StartUp`].
    Failed,
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
    Failed,
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
    /// For the drive at `address`, to run in `mode` and report its motion every `motion_ms` (1 to 255), and inputs and output
    /// every `mixed_ms` as well (0: not at all).
    pub const fn new(address: Address, mode: Mode, motion_ms: u8, mixed_ms: u8) -> Self {
        Self { address, mode, motion_ms, mixed_ms, state: State::Begin }
    }

    /// One step, at least every 10 ms, with what the drive has reported since the last one. `now_ms` never runs backwards; the
    /// first call counts as power-up.
    pub fn step(&mut self, now_ms: u64, report: Option<Report>) -> Action {
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
            State::Online { .. } if report == Some(Report::Online) => {
                self.state = State::AfterReset { since_ms: now_ms };
                self.send(Command::Reset)
            }
            State::Online { sent_ms, tries } if passed(sent_ms, ONLINE_RETRY_MS) => {
                if tries >= ONLINE_TRIES {
                    return self.fail();
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
            State::Configured { .. } if matches!(report, Some(Report::Motion { .. })) => {
                self.state = State::Ready;
                Action::Ready
            }
            State::Configured { sent_ms, tries } if passed(sent_ms, CONFIG_RETRY_MS) => {
                if tries >= CONFIG_TRIES {
                    return self.fail();
                }
                self.state = State::Configured { sent_ms: now_ms, tries: tries + 1 };
                self.configure()
            }
            State::Ready => Action::Ready,
            State::Failed => Action::Failed,
            _ => Action::Wait,
        }
    }

    fn configure(&self) -> Action {
        self.send(Command::Config { motion_ms: self.motion_ms, mixed_ms: self.mixed_ms })
    }

    fn send(&self, command: Command) -> Action {
        Action::Send(command.encode(self.address))
    }

    fn fail(&mut self) -> Action {
        self.state = State::Failed;
        Action::Failed
    }
}
