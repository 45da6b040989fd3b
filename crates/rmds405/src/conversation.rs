//! The whole conversation with one drive, as pure steps: start-up, a target every tick, letting go, and whether the
//! drive's motor power may be on. The firmware and the tests on a desktop run the same code.
//!
//! The drive keeps its last target indefinitely (crates/rmds405/README.md 2.6). So the first frame after every start of the
//! board is a Reset, motor power is switched on only after that frame, and a target that is no longer valid is
//! withdrawn by a Reset.

use crate::address::Address;
use crate::command::{Command, Mode};
use crate::frame::Frame;
use crate::report::Report;
use crate::start_up::{Action, StartUp};
use crate::units::{CurrentLimit, OutOfRange, Pwm, QuadCounts, SpeedLimit};

/// Period of the drive's motion reports (ms): its recommended data period (crates/rmds405/README.md 2.5).
pub const FEEDBACK_MS: u8 = 10;
/// Period of the drive's reports of its supply (ms), where the supply is wired to the drive's analog input.
pub const SUPPLY_MS: u8 = 50;
/// A drive that still reports its motion this long (µs) after a Reset has not received it. Our choice: ten reports.
const UNHEARD_RESET_US: u64 = 100_000;
/// Resets that the drive does not hear before its motor power goes off.
const UNHEARD_RESETS: u8 = 3;
/// Time between Resets while the motor must not move at all (µs). Our choice: the drive ignores frames for 0.5 s after
/// each.
const RESET_AGAIN_US: u64 = 1_000_000;
/// From the Reset to motor power off (µs): the drive no longer drives the motor by then. Our choice.
const POWER_OFF_US: u64 = 100_000;

/// What the drive is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveCommand {
    /// Nothing: it is starting, or there is no target yet.
    Silence,
    /// Go through the start-up sequence from its beginning, motor power included, into the mode that takes
    /// [`DriveCommand::Follow`].
    Restart,
    /// The same into open loop, which takes [`DriveCommand::Voltage`]: the drive closes no loop, so that motor leads or
    /// encoder wires of the wrong sign cannot make it run away.
    RestartOpenLoop,
    /// Forget the target and give no torque: a Reset, which is repeated as long as the drive goes on reporting. Where
    /// motor power is off it stays off.
    LetGo,
    /// The same with a Reset every second, and motor power off. For the emergency stop, whose contact has taken the
    /// motor off the drive, so that the drive's supply is not cut while the motor feeds it (docs/reference/hardware.md
    /// 1).
    PowerOff,
    /// Go to a position in the drive's own counts, at most this fast, with at most this current (mode 8). If the next
    /// command never comes, the motor stops there: the drive has no time-out of its own (crates/rmds405/README.md 2.6).
    Follow {
        /// Position (drive counts).
        position_qc: i32,
        /// Speed limit (rpm of the motor).
        speed_limit_rpm: i16,
        /// Current limit (mA).
        current_limit_ma: i16,
    },
    /// A voltage on the motor, in 1/5000 of the supply (mode 1). 0 shorts the motor, which brakes it (assumed,
    /// docs/reference/hardware.md 1).
    Voltage {
        /// Fraction of the supply, -5000 to 5000.
        pwm: i16,
    },
}

/// What is known of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriveReading {
    /// The start-up sequence is not over.
    Starting,
    /// The start-up sequence failed.
    Failed,
    /// The drive has been let go; its reports have no meaning any more.
    Released,
    /// Its last motion report (crates/rmds405/README.md 2.4).
    Reports {
        /// When it came (µs since boot).
        t_us: u64,
        /// Position in its own counts.
        position_qc: i32,
        /// Motor speed (rpm).
        speed_rpm: i16,
        /// Winding current (mA).
        current_ma: i16,
    },
}

/// Supply of the drive, and what it puts on the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupplyReading {
    /// When it was reported (µs since boot).
    pub t_us: u64,
    /// Voltage of the supply (V), as the analog input sees it; `None` where that is not wired.
    pub volts: Option<f32>,
    /// Voltage on the motor, as a fraction of the supply. It is only indicative (crates/rmds405/README.md 2.4).
    pub on_motor: f32,
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    /// Nothing has been sent yet: motor power is off.
    Silent,
    /// The start-up sequence runs, is over or has failed.
    Started { start_up: StartUp, mode: Mode, ready: bool },
    /// A Reset was sent at this time (µs), after so many that the drive has not heard.
    Released { reset_us: u64, unheard: u8 },
    /// The same since this time (µs), and motor power goes off.
    Off { since_us: u64, reset_us: u64 },
}

/// The conversation with one drive.
#[derive(Clone, Debug)]
pub struct Conversation {
    address: Address,
    supply_divider: Option<f32>,
    phase: Phase,
    motor_power: bool,
    reading: DriveReading,
    supply: Option<SupplyReading>,
    stalled: bool,
}

impl Conversation {
    /// With the drive at `address`. `supply_divider` is the ratio of the divider between the supply and the drive's
    /// analog input, `None` where that is not wired. Nothing is sent before the first [`DriveCommand`].
    pub const fn new(address: Address, supply_divider: Option<f32>) -> Self {
        Self {
            address,
            supply_divider,
            phase: Phase::Silent,
            motor_power: false,
            reading: DriveReading::Starting,
            supply: None,
            stalled: false,
        }
    }

    /// What is known of the drive.
    pub fn reading(&self) -> DriveReading {
        self.reading
    }

    /// The drive's supply, as it last reported it.
    pub fn supply(&self) -> Option<SupplyReading> {
        self.supply
    }

    /// Whether motor power has to be on now: from the first Reset of a start-up until [`DriveCommand::PowerOff`].
    pub fn motor_power(&self) -> bool {
        self.motor_power
    }

    /// Whether the drive has reported a stall since the last call.
    pub fn take_stall(&mut self) -> bool {
        core::mem::take(&mut self.stalled)
    }

    /// Time passes; call it at least every 10 ms. Gives the frame to send, if any.
    pub fn tick(&mut self, now_us: u64) -> Option<Frame> {
        match &mut self.phase {
            Phase::Silent | Phase::Released { .. } => None,
            Phase::Started { .. } => self.start(now_us, None),
            Phase::Off { since_us, reset_us } => {
                if now_us.saturating_sub(*since_us) >= POWER_OFF_US {
                    self.motor_power = false;
                }
                (now_us.saturating_sub(*reset_us) >= RESET_AGAIN_US).then(|| {
                    *reset_us = now_us;
                    Command::Reset.encode(self.address)
                })
            }
        }
    }

    /// The drive has reported. Gives the frame to send, if any.
    pub fn hear(&mut self, now_us: u64, report: Report) -> Option<Frame> {
        let frame = match &mut self.phase {
            Phase::Started { ready: false, .. } => self.start(now_us, Some(report)),
            Phase::Released { reset_us, .. } | Phase::Off { reset_us, .. } => {
                let unheard = matches!(report, Report::Motion { .. } | Report::Error(_))
                    && now_us.saturating_sub(*reset_us) >= UNHEARD_RESET_US;
                if !unheard {
                    return None;
                }
                *reset_us = now_us;
                if let Phase::Released { unheard, .. } = &mut self.phase {
                    *unheard = unheard.saturating_add(1);
                    // It goes on with its last target: the one thing left that ends that.
                    self.motor_power &= *unheard < UNHEARD_RESETS;
                }
                return Some(Command::Reset.encode(self.address));
            }
            Phase::Silent | Phase::Started { ready: true, .. } => None,
        };
        if matches!(self.phase, Phase::Started { ready: true, .. }) {
            self.take(now_us, report);
        }
        frame
    }

    /// What the drive is to do now. Gives the frame to send, if any.
    ///
    /// # Errors
    /// [`OutOfRange`] for a limit that the drive does not take.
    pub fn command(&mut self, now_us: u64, command: DriveCommand) -> Result<Option<Frame>, OutOfRange> {
        Ok(match (command, &mut self.phase) {
            (DriveCommand::Restart, _) => self.restart(now_us, Mode::CurrentVelocityPosition),
            (DriveCommand::RestartOpenLoop, _) => self.restart(now_us, Mode::OpenLoop),
            (DriveCommand::LetGo, Phase::Released { .. }) | (DriveCommand::PowerOff, Phase::Off { .. }) => None,
            (DriveCommand::LetGo, Phase::Off { reset_us, .. }) => {
                *reset_us = now_us;
                Some(Command::Reset.encode(self.address))
            }
            (DriveCommand::LetGo, _) => Some(self.release(Phase::Released { reset_us: now_us, unheard: 0 })),
            (DriveCommand::PowerOff, _) => Some(self.release(Phase::Off { since_us: now_us, reset_us: now_us })),
            (
                DriveCommand::Follow { position_qc, speed_limit_rpm, current_limit_ma },
                Phase::Started { mode: Mode::CurrentVelocityPosition, ready: true, .. },
            ) => {
                let command = Command::CurrentVelocityPosition {
                    current_limit: CurrentLimit::new(current_limit_ma)?,
                    speed_limit: SpeedLimit::new(speed_limit_rpm)?,
                    position: QuadCounts(position_qc),
                };
                Some(command.encode(self.address))
            }
            (DriveCommand::Voltage { pwm }, Phase::Started { mode: Mode::OpenLoop, ready: true, .. }) => {
                Some(Command::OpenLoop { pwm: Pwm::new(pwm)? }.encode(self.address))
            }
            (DriveCommand::Follow { .. } | DriveCommand::Voltage { .. } | DriveCommand::Silence, _) => None,
        })
    }

    fn restart(&mut self, now_us: u64, mode: Mode) -> Option<Frame> {
        let start_up = StartUp::new(self.address, mode, FEEDBACK_MS, SUPPLY_MS);
        self.enter(Phase::Started { start_up, mode, ready: false }, DriveReading::Starting);
        let reset = self.start(now_us, None);
        self.motor_power = true;
        reset
    }

    fn release(&mut self, phase: Phase) -> Frame {
        self.enter(phase, DriveReading::Released);
        Command::Reset.encode(self.address)
    }

    /// What the drive has reported before does not hold any more.
    fn enter(&mut self, phase: Phase, reading: DriveReading) {
        (self.phase, self.reading, self.supply, self.stalled) = (phase, reading, None, false);
    }

    fn start(&mut self, now_us: u64, report: Option<Report>) -> Option<Frame> {
        let Phase::Started { start_up, ready, .. } = &mut self.phase else { return None };
        match start_up.step(now_us / 1000, report) {
            Action::Wait => None,
            Action::Send(frame) => Some(frame),
            Action::Ready => {
                *ready = true;
                None
            }
            Action::Failed => {
                self.reading = DriveReading::Failed;
                None
            }
        }
    }

    fn take(&mut self, t_us: u64, report: Report) {
        match report {
            Report::Motion { current, speed, position } => {
                self.reading =
                    DriveReading::Reports { t_us, position_qc: position.0, speed_rpm: speed.0, current_ma: current.0 };
            }
            Report::Error(_) => self.stalled = true,
            Report::Mixed(mixed) => {
                // Older drives do not report it.
                if let Some(rest) = mixed.rest {
                    let volts = self.supply_divider.map(|divider| f32::from(rest.asin_mv) * 1e-3 * divider);
                    let on_motor = f32::from(rest.pwm.get()) / f32::from(Pwm::MAX.get());
                    self.supply = Some(SupplyReading { t_us, volts, on_motor });
                }
            }
            Report::Online => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Mixed, MixedRest};
    use crate::units::{Milliamps, Pwm, Rpm};

    const FOLLOW: DriveCommand = DriveCommand::Follow { position_qc: 7, speed_limit_rpm: 100, current_limit_ma: 500 };
    const MOTION: Report = Report::Motion { current: Milliamps(12), speed: Rpm(-30), position: QuadCounts(4000) };

    fn address() -> Address {
        Address::new(0, 1).unwrap()
    }

    fn reset() -> Frame {
        Command::Reset.encode(address())
    }

    /// A drive that answers as crates/rmds405/README.md 2.5 says; ready at the returned time (µs).
    fn ready() -> (Conversation, u64) {
        started_by(DriveCommand::Restart)
    }

    fn started_by(command: DriveCommand) -> (Conversation, u64) {
        let mut c = Conversation::new(address(), Some(12.0));
        assert_eq!(c.command(0, command).unwrap(), Some(reset()), "the first frame is a Reset");
        for now_us in (10_000..5_000_000).step_by(10_000) {
            if let Some(frame) = c.tick(now_us) {
                if frame == Command::OnlineCheck.encode(address()) {
                    assert_eq!(c.hear(now_us, Report::Online), Some(reset()));
                } else if frame == (Command::Config { motion_ms: FEEDBACK_MS, mixed_ms: SUPPLY_MS }).encode(address()) {
                    c.hear(now_us, MOTION);
                    return (c, now_us);
                }
            }
        }
        panic!("not started: {:?}", c.reading());
    }

    #[test]
    fn nothing_is_sent_and_motor_power_is_off_before_the_first_command() {
        let mut c = Conversation::new(address(), None);
        assert_eq!(c.command(0, DriveCommand::Silence).unwrap(), None);
        assert_eq!(c.command(0, FOLLOW).unwrap(), None);
        assert!((0..300).all(|k| c.tick(k * 10_000).is_none()) && !c.motor_power());
        assert_eq!(c.hear(0, MOTION), None);
        assert_eq!(c.reading(), DriveReading::Starting);
        c.command(3_000_000, DriveCommand::Restart).unwrap();
        assert!(c.motor_power(), "after the first Reset");
    }

    #[test]
    fn a_started_drive_follows_and_reports() {
        let (mut c, now_us) = ready();
        let DriveReading::Reports { t_us, position_qc: 4000, speed_rpm: -30, current_ma: 12 } = c.reading() else {
            panic!("{:?}", c.reading())
        };
        assert_eq!(t_us, now_us);
        assert!(c.command(now_us, FOLLOW).unwrap().is_some_and(|frame| frame != reset()));
        assert!(!c.take_stall());
        c.hear(now_us, Report::Error(crate::report::STALL));
        assert!(c.take_stall() && !c.take_stall());
        let wrong = DriveCommand::Follow { position_qc: 0, speed_limit_rpm: -1, current_limit_ma: 500 };
        assert!(c.command(now_us, wrong).is_err());
    }

    #[test]
    fn each_mode_sends_its_own_data_only() {
        const VOLTAGE: DriveCommand = DriveCommand::Voltage { pwm: -120 };
        let (mut c, t) = started_by(DriveCommand::RestartOpenLoop);
        let frame = Command::OpenLoop { pwm: Pwm::new(-120).unwrap() }.encode(address());
        assert_eq!(c.command(t, VOLTAGE).unwrap(), Some(frame));
        assert_eq!(c.command(t, FOLLOW).unwrap(), None, "the drive closes no loop");
        assert!(c.command(t, DriveCommand::Voltage { pwm: 5001 }).is_err());
        let (mut c, t) = ready();
        assert_eq!(c.command(t, VOLTAGE).unwrap(), None);
    }

    #[test]
    fn letting_go_is_a_reset_repeated_while_the_drive_has_not_received_it() {
        let (mut c, t) = ready();
        assert_eq!(c.command(t, DriveCommand::LetGo).unwrap(), Some(reset()));
        assert_eq!(c.command(t + 10_000, DriveCommand::LetGo).unwrap(), None, "once");
        assert_eq!(c.reading(), DriveReading::Released);
        assert_eq!(c.command(t + 10_000, FOLLOW).unwrap(), None, "no target after that");
        // A report that was on its way is no sign; one that comes much later is.
        assert_eq!(c.hear(t + 20_000, MOTION), None);
        assert_eq!(c.hear(t + 120_000, MOTION), Some(reset()));
        assert_eq!(c.hear(t + 130_000, MOTION), None);
        assert!(c.motor_power() && c.reading() == DriveReading::Released);
        // One that hears nothing loses its power.
        for k in 2..4 {
            assert!(c.motor_power());
            assert_eq!(c.hear(t + k * 120_000, MOTION), Some(reset()));
        }
        assert!(!c.motor_power());
    }

    #[test]
    fn power_goes_off_after_the_reset_and_comes_back_with_a_start() {
        let (mut c, t) = ready();
        assert_eq!(c.command(t, DriveCommand::PowerOff).unwrap(), Some(reset()));
        assert!(c.motor_power(), "the Reset first");
        c.tick(t + 90_000);
        assert!(c.motor_power());
        c.tick(t + 100_000);
        assert!(!c.motor_power());
        let again = (11..250).filter(|k| c.tick(t + k * 10_000).is_some());
        assert!(again.eq([100, 200]), "a Reset every second, in ticks");
        assert_eq!(
            c.command(t + 2_500_000, DriveCommand::LetGo).unwrap(),
            Some(reset()),
            "and when the contact closes"
        );
        assert!(!c.motor_power());
        assert_eq!(c.command(t + 2_600_000, DriveCommand::Restart).unwrap(), Some(reset()));
        assert!(c.motor_power());
    }

    #[test]
    fn the_first_question_waits_until_the_drive_has_booted() {
        let mut c = Conversation::new(address(), None);
        c.command(0, DriveCommand::Restart).unwrap();
        let boot_us = 1000 * crate::start_up::POWER_UP_MS;
        assert_eq!(c.tick(boot_us - 1), None);
        assert_eq!(c.tick(boot_us), Some(Command::OnlineCheck.encode(address())));
    }

    #[test]
    fn the_supply_is_the_analog_input_times_the_divider() {
        let mixed = |asin_mv| {
            let rest = Some(MixedRest { dsin: false, asin_mv, chz: false, pwm: Pwm::new(-1250).unwrap() });
            Report::Mixed(Mixed { ctl1: false, ctl2: false, rest })
        };
        let (mut c, t) = ready();
        assert_eq!(c.supply(), None);
        c.hear(t + 1, mixed(2000));
        let supply = c.supply().unwrap();
        assert_eq!(supply.t_us, t + 1);
        assert!((supply.volts.unwrap() - 24.0).abs() < 1e-4, "2000 mV behind a divider by 12: {supply:?}");
        assert_eq!(supply.on_motor, -0.25);
        // An older drive does not report it.
        c.hear(t + 2, Report::Mixed(Mixed { ctl1: false, ctl2: false, rest: None }));
        assert_eq!(c.supply(), Some(supply));
        c.command(t + 3, DriveCommand::LetGo).unwrap();
        assert_eq!(c.supply(), None);
    }

    #[test]
    fn a_drive_that_does_not_answer_has_failed() {
        let mut c = Conversation::new(address(), None);
        c.command(0, DriveCommand::Restart).unwrap();
        (1..500).for_each(|k| {
            c.tick(k * 10_000);
        });
        assert_eq!(c.reading(), DriveReading::Failed);
        c.command(5_000_000, DriveCommand::Restart).unwrap();
        assert_eq!(c.reading(), DriveReading::Starting);
    }
}
