//! The modes of the rig, and what each does in a tick.

use super::guard::SHORT_TICKS;
use super::load_control::{LoadControl, Move};
use super::sensing::DriveZero;
use super::stream::Stream;
use super::{Controller, DriveLoop, Events, Inputs, STANDING_RPM, ticks};
use crate::direction::{DirectionCheck, Step, Witnesses};
use crate::homing::{self, Homing, HomingInputs, Progress};
use crate::ramp::Ramp;
use crate::sensors::{DriveReading, LvdtReading};
use crate::{TICK_S, whole_counts};
use core::f32::consts::TAU;
use rig_link::messages::{EventKind, Fault, Faults, HomingFailure, Limit, LoadChoice, State};

/// Motor speed (rad/s) below which it stands during a start while it is only shorted: a heavy load on twisted strings turns it at
/// 11 rad/s. In the 10 ms of a report the counts then move by less than a fifth of the difference that is a fault.
const SINKING_RAD_PER_S: f32 = 40.0;
/// Longest start, from the drive's first report: fifty times what a shaft takes to come to rest.
const BOOT_TICKS: u16 = ticks(1000);

/// What the rig is doing, with what is needed only while it does that.
// There is no heap to put the 2 kB of a homing on, and a tick that begins one has the time to write them.
#[allow(clippy::large_enum_variant)]
#[derive(Clone)]
pub(super) enum Mode {
    /// Waits until drive and LVDT are steady.
    Boot(Boot),
    /// Turns the shaft a little each way in open loop, to see which way motor and encoders go.
    Proving(Proving),
    /// At rest: unhomed, or ready where the load is tracked.
    Idle,
    /// Looks for zero twist and weighs the load.
    Homing(Homing),
    /// A planned move of the load.
    Moving(Move),
    /// Follows a stream of set-points.
    Streaming(Stream),
    /// Turns the strings at a constant speed.
    Jogging(Jog),
    /// Keeps the load where a move has ended.
    Holding(LoadControl),
    /// Stopped by the faults that [`super::guard::Guard`] has latched.
    Fault,
    /// Stopped by the emergency stop.
    EStop(EStopContact),
}

/// A start of the drive.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Boot {
    /// The drive was told to restart and still reports from before, with another zero.
    awaiting_restart: bool,
    /// Own and drive's counts where both began to stand.
    stood_at: [i64; 2],
    standing_ticks: u16,
    /// Since the drive's first report.
    ticks: u16,
    /// What begins after it.
    pub(super) then: Option<First>,
}

/// The first motion after a start of the drive, before which the directions are checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum First {
    /// Nothing more.
    Check,
    Home(LoadChoice),
    /// At this twist speed (rad/s).
    Jog(f32),
}

impl First {
    fn state(self) -> State {
        match self {
            Self::Check | Self::Jog(_) => State::Moving,
            Self::Home(_) => State::Homing,
        }
    }
}

/// The check of the directions, and what comes after it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proving {
    check: DirectionCheck,
    /// Voltage on the motor (1/5000 of the supply).
    pub(super) pwm: i16,
    pub(super) then: First,
}

/// A jog.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jog {
    /// Wanted twist speed (rad/s); 0 ends the jog.
    pub(super) speed_rad_per_s: f32,
}

/// The contact of the emergency stop, once it has opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EStopContact {
    Open,
    /// It has closed in this tick.
    Closing,
    Closed,
}

impl EStopContact {
    /// One tick later, and the event that this is.
    pub(super) fn next(self, open: bool) -> (Self, Option<EventKind>) {
        match (self, open) {
            (Self::Open, true) => (Self::Open, None),
            (Self::Open, false) => (Self::Closing, Some(EventKind::EStopClosed)),
            (Self::Closing | Self::Closed, true) => (Self::Open, Some(EventKind::EStopOpened)),
            (Self::Closing | Self::Closed, false) => (Self::Closed, None),
        }
    }
}

impl Mode {
    /// A start after power-up.
    pub(super) fn boot() -> Self {
        Self::Boot(Boot::default())
    }

    /// A start after the drive was told to restart.
    pub(super) fn reboot(then: Option<First>) -> Self {
        Self::Boot(Boot { awaiting_restart: true, then, ..Boot::default() })
    }

    /// The check of the directions, and then this.
    pub(super) fn proving(then: First) -> Self {
        Self::Proving(Proving { check: DirectionCheck::NEW, pwm: 0, then })
    }

    /// The first motion that waits for a start of the drive, or for the check.
    pub(super) fn first(&mut self) -> Option<&mut First> {
        match self {
            Self::Boot(boot) => boot.then.as_mut(),
            Self::Proving(proving) => Some(&mut proving.then),
            _ => None,
        }
    }

    /// As the host sees it.
    pub(super) fn state(&self, homed: bool) -> State {
        match self {
            Self::Boot(boot) => boot.then.map_or(State::Boot, First::state),
            Self::Proving(proving) => proving.then.state(),
            Self::Idle if homed => State::Ready,
            Self::Idle => State::Unhomed,
            Self::Homing(_) => State::Homing,
            Self::Moving(_) | Self::Streaming(_) | Self::Jogging(_) => State::Moving,
            Self::Holding(_) => State::Holding,
            Self::Fault => State::Fault,
            Self::EStop(_) => State::EStop,
        }
    }

    /// What controls the load, where something does.
    pub(super) fn load_control(&self) -> Option<&LoadControl> {
        match self {
            Self::Moving(planned) => Some(&planned.control),
            Self::Streaming(stream) => Some(&stream.control),
            Self::Holding(control) => Some(control),
            _ => None,
        }
    }
}

impl Controller {
    /// One tick of the present mode; what held it back.
    pub(super) fn step_mode(&mut self, inputs: &Inputs, events: &mut Events) -> Option<Limit> {
        if self.drive_loop == DriveLoop::Open {
            // Nothing holds it anywhere.
            self.shaft = Ramp::at(self.sensing.readings.shaft_rad);
        }
        match self.mode {
            Mode::Boot(_) => self.step_boot(inputs, events),
            Mode::Proving(_) => self.step_proving(inputs, events),
            Mode::Homing(_) => self.step_homing(events),
            Mode::Moving(_) | Mode::Streaming(_) | Mode::Holding(_) => return self.control_load(events),
            Mode::Jogging(jog) => return self.step_jog(jog, events),
            Mode::Idle | Mode::Fault | Mode::EStop(_) => self.shaft.speed = 0.0,
        }
        None
    }

    /// Own and drive's counts are matched only when the shaft stands, because a report is up to 10 ms old. In closed loop a hold
    /// is commanded at once, because until its first command the drive gives no torque and a loaded string untwists.
    fn step_boot(&mut self, inputs: &Inputs, events: &mut Events) {
        let Mode::Boot(boot) = &mut self.mode else { return };
        let DriveReading::Reports { position_qc, .. } = inputs.drive else {
            boot.awaiting_restart = false;
            return;
        };
        if boot.awaiting_restart {
            return;
        }
        let readings = &self.sensing.readings;
        let counts = [inputs.encoder_counts, i64::from(position_qc)];
        let offset = counts[0] - counts[1];
        if self.sensing.drive_zero == DriveZero::Unknown {
            self.sensing.drive_zero = DriveZero::Rough(offset);
            self.shaft = Ramp::at(readings.shaft_rad);
        }
        // Counts, not the drive's speed, in which the dither of a few counts looks like motion.
        let standing_rad_per_s = match self.drive_loop {
            DriveLoop::Open => SINKING_RAD_PER_S,
            DriveLoop::Closed => f32::from(STANDING_RPM) / 60.0 * TAU,
        };
        let standing_counts = standing_rad_per_s / self.constants.gear_ratio
            * self.constants.counts_per_rad.abs()
            * TICK_S
            * f32::from(SHORT_TICKS);
        let stands =
            counts.iter().zip(boot.stood_at).all(|(now, then)| (now - then).abs() <= whole_counts(standing_counts));
        // The first readings of a sensor after power-up are not relied on.
        if stands && matches!(readings.lvdt, LvdtReading::Valid { .. }) {
            boot.standing_ticks += 1;
        } else {
            (boot.stood_at, boot.standing_ticks) = (counts, 0);
        }
        boot.ticks = boot.ticks.saturating_add(1);
        if boot.standing_ticks < SHORT_TICKS {
            if boot.ticks >= BOOT_TICKS {
                self.raise(Faults::NONE.with(Fault::ShaftUnsteady), events);
            }
            return;
        }
        let then = boot.then;
        self.sensing.drive_zero = DriveZero::Matched(offset);
        self.shaft = Ramp::at(readings.shaft_rad);
        self.mode = Mode::Idle;
        // The gap may have been lost since the motion was asked for; a jog needs none.
        if then.is_some_and(|first| self.begin(first).is_err()) {
            let _ = events.push(EventKind::HomingRefused(HomingFailure::SensorInvalid));
        }
    }

    fn step_proving(&mut self, inputs: &Inputs, events: &mut Events) {
        let (Mode::Proving(proving), DriveReading::Reports { position_qc, .. }, Some(gap_m)) =
            (&mut self.mode, inputs.drive, self.sensing.readings.lvdt.gap_m())
        else {
            // Without a witness nothing turns; a lasting loss of one is a fault of its own.
            if let Mode::Proving(proving) = &mut self.mode {
                proving.pwm = 0;
            }
            return;
        };
        let now = Witnesses::new(&self.constants, position_qc.into(), inputs.encoder_counts, gap_m);
        match proving.check.step(&now) {
            Step::Voltage(pwm) => proving.pwm = pwm,
            Step::Proven => {
                let then = proving.then;
                let _ = events.push(EventKind::DirectionProven);
                self.drive_loop = DriveLoop::Closed;
                self.start_drive(Some(then));
            }
            Step::Wrong(fault) => {
                self.raise(Faults::NONE.with(fault), events);
            }
        }
    }

    fn step_homing(&mut self, events: &mut Events) {
        let readings = &self.sensing.readings;
        let (Mode::Homing(homing), Some(gap_m)) = (&mut self.mode, readings.lvdt.gap_m()) else { return };
        let inputs = HomingInputs { shaft_rad: readings.shaft_rad, shaft_at_gap_rad: readings.shaft_at_gap_rad, gap_m };
        let event = match homing.step(&self.table.table(), &self.constants, &inputs) {
            Progress::Turning(ramp) => {
                self.shaft = ramp;
                return;
            }
            Progress::Done(homed) => {
                self.resume(homed);
                EventKind::Homed(homed.found)
            }
            Progress::Failed(failure) => {
                self.end_homing();
                EventKind::HomingRefused(failure)
            }
        };
        let _ = events.push(event);
    }

    /// Ends a homing without a result: the shaft is held where it is.
    pub(super) fn end_homing(&mut self) {
        self.shaft = Ramp::at(self.sensing.readings.shaft_rad);
        self.mode = Mode::Idle;
    }

    fn step_jog(&mut self, jog: Jog, events: &mut Events) -> Option<Limit> {
        let speed_change = homing::ACCELERATION * TICK_S;
        self.shaft.speed += (jog.speed_rad_per_s - self.shaft.speed).clamp(-speed_change, speed_change);
        let next = self.shaft.position + self.shaft.speed * TICK_S;
        // A homed rig knows how far the strings may be twisted, either way.
        let outside = self.tracking.as_ref().is_some_and(|tracking| {
            let twist_rad = tracking.twist_rad(next);
            twist_rad.abs() > self.table.metadata().twist_max_rad && twist_rad * self.shaft.speed > 0.0
        });
        if outside {
            self.shaft.speed = 0.0;
        } else {
            self.shaft.position = next;
        }
        if jog.speed_rad_per_s == 0.0 && self.shaft.speed == 0.0 {
            self.mode = Mode::Idle;
            let _ = events.push(EventKind::Stopped);
        }
        outside.then_some(Limit::Travel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_change_of_the_emergency_stop_is_an_event_and_closing_lasts_one_tick() {
        let mut contact = EStopContact::Open;
        let mut step = |open: bool| {
            let (next, event) = contact.next(open);
            contact = next;
            (next, event)
        };
        assert_eq!(step(true), (EStopContact::Open, None));
        assert_eq!(step(false), (EStopContact::Closing, Some(EventKind::EStopClosed)));
        assert_eq!(step(false), (EStopContact::Closed, None));
        assert_eq!(step(true), (EStopContact::Open, Some(EventKind::EStopOpened)));
        assert_eq!(step(false).0, EStopContact::Closing);
        assert_eq!(step(true), (EStopContact::Open, Some(EventKind::EStopOpened)));
    }

    #[test]
    fn at_rest_the_state_follows_from_whether_the_rig_is_homed() {
        assert_eq!((Mode::Idle.state(false), Mode::Idle.state(true)), (State::Unhomed, State::Ready));
        let jog = Mode::Jogging(Jog { speed_rad_per_s: 1.0 });
        assert_eq!((jog.state(false), jog.state(true)), (State::Moving, State::Moving));
        assert!(jog.load_control().is_none());
    }
}
