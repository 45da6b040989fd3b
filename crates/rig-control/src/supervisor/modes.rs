//! The modes of the rig, and what each does in a tick.

use super::guard::SHORT_TICKS;
use super::load_control::{LoadControl, Move};
use super::sensing::DriveZero;
use super::stream::Stream;
use super::{Controller, Events, Inputs, STANDING_RPM};
use crate::direction::{DirectionCheck, Step, Witnesses};
use crate::homing::{self, Homing, HomingInputs};
use crate::ramp::{Ramp, braking_speed};
use crate::sensors::{DriveReading, LvdtReading};
use crate::{TICK_S, whole_counts};
use core::f32::consts::TAU;
use rig_link::messages::{
    Accepted, EventKind, Fault, Faults, HomingFailure, Limit, LoadChoice, Refusal, Sensor, Setting, State,
};

/// Motor speed (rad/s) below which it stands during a start while it is only shorted: a heavy load on twisted strings turns it at
/// 11 rad/s. In the 10 ms of a report the counts then move by less than a fifth of the difference that is a fault.
const SINKING_RAD_PER_S: f32 = 40.0;
/// Longest start, from the drive's first report: fifty times what a shaft takes to come to rest.
const BOOT_TICKS: u16 = 1000;

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
    /// Turns the strings at this twist speed (rad/s); 0 ends the jog.
    Jogging(f32),
    /// Keeps the load where a move has ended.
    Holding(LoadControl),
    /// Stopped by the faults that [`super::guard::Guard`] has latched.
    Fault,
    /// Stopped by the emergency stop, whose contact is open, or has closed in this tick.
    EStop { open: bool, closing: bool },
}

/// A start of the drive.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Boot {
    /// Own and drive's counts where both began to stand.
    stood_at: [i64; 2],
    standing_ticks: u16,
    /// Since the drive's first report.
    ticks: u16,
    /// The motion that begins after it, if it follows a check of the directions.
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

impl Mode {
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
            Self::EStop { .. } => State::EStop,
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
        if !self.closed_loop {
            // Nothing holds it anywhere.
            self.shaft = Ramp::at(self.sensing.readings.shaft_rad);
        }
        self.find_drive_zero(inputs);
        match self.mode {
            Mode::Boot(_) => self.step_boot(inputs, events),
            Mode::Proving(_) => self.step_proving(inputs, events),
            Mode::Homing(_) => self.step_homing(events),
            Mode::Moving(_) | Mode::Streaming(_) | Mode::Holding(_) => return self.control_load(inputs, events),
            Mode::Jogging(speed_rad_per_s) => return self.step_jog(speed_rad_per_s, events),
            Mode::Idle | Mode::Fault | Mode::EStop { .. } => self.shaft.speed = 0.0,
        }
        None
    }

    /// Begins a motion from rest: in open loop with the check of the directions, in closed loop at once.
    pub(super) fn begin(&mut self, first: First) -> Result<Accepted, Refusal> {
        let readings = &self.sensing.readings;
        let gap_m = readings.lvdt.gap_m().ok_or(Refusal::SensorInvalid { sensor: Sensor::Lvdt });
        match (self.closed_loop, first) {
            (false, _) => {
                gap_m?;
                self.mode = Mode::Proving(Proving { check: DirectionCheck::NEW, pwm: 0, then: first });
            }
            // Proven since the drive has started; another check would let go of the load.
            (true, First::Check) => return Ok(Accepted::Done),
            (true, First::Home(load)) => {
                let twist_scale = self.settings.get(Setting::TwistScale);
                let limits = self.constants.twist_limits();
                let homing = Homing::new(limits, readings.shaft_rad, gap_m?, twist_scale, load, self.heaviest_n);
                self.mode = Mode::Homing(homing);
                self.tracking = None;
            }
            (true, First::Jog(speed_rad_per_s)) => {
                self.shaft = Ramp::at(readings.shaft_rad);
                self.mode = Mode::Jogging(speed_rad_per_s);
            }
        }
        Ok(Accepted::Started)
    }

    /// Starts the drive again, which forgets its position, and then begins a motion.
    pub(super) fn start_drive(&mut self, then: Option<First>) {
        self.tracking = None;
        self.sensing.drive_zero = DriveZero::Outdated;
        self.restart_drive = true;
        self.guard.restart();
        self.mode = Mode::Boot(Boot { then, ..Boot::default() });
    }

    /// From its first report on, a drive that has started is commanded to hold, also in a fault that came meanwhile: until its
    /// first command it gives no torque, and a loaded string untwists.
    fn find_drive_zero(&mut self, inputs: &Inputs) {
        self.sensing.drive_zero = match (self.sensing.drive_zero, inputs.drive) {
            (DriveZero::Outdated, DriveReading::Reports { .. }) => DriveZero::Outdated,
            (DriveZero::Unknown, DriveReading::Reports { position_qc, .. }) => {
                self.shaft = Ramp::at(self.sensing.readings.shaft_rad);
                DriveZero::Rough(inputs.encoder_counts - i64::from(position_qc))
            }
            (DriveZero::Outdated, _) => DriveZero::Unknown,
            (known, _) => known,
        };
    }

    /// Own and drive's counts are matched only when the shaft stands, because a report is up to 10 ms old.
    fn step_boot(&mut self, inputs: &Inputs, events: &mut Events) {
        let (Mode::Boot(boot), DriveReading::Reports { position_qc, .. }, DriveZero::Rough(_)) =
            (&mut self.mode, inputs.drive, self.sensing.drive_zero)
        else {
            return;
        };
        let readings = &self.sensing.readings;
        let counts = [inputs.encoder_counts, i64::from(position_qc)];
        // Counts, not the drive's speed, in which the dither of a few counts looks like motion.
        let standing_rad_per_s =
            if self.closed_loop { f32::from(STANDING_RPM) / 60.0 * TAU } else { SINKING_RAD_PER_S };
        let standing_counts = self.constants.counts_per_s(standing_rad_per_s) * TICK_S * f32::from(SHORT_TICKS);
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
        self.sensing.drive_zero = DriveZero::Matched(counts[0] - counts[1]);
        self.shaft = Ramp::at(readings.shaft_rad);
        self.mode = Mode::Idle;
        let Some(first) = then else { return };
        // Not at the end of the check: while the drive restarts, no other motion can begin.
        let _ = events.push(EventKind::DirectionProven);
        // The gap may have been lost since the motion was asked for; a jog needs none.
        if self.begin(first).is_err() {
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
                self.closed_loop = true;
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
        let (shaft_rad, shaft_at_gap_rad) = (readings.shaft_rad, readings.shaft_at_gap_rad);
        let inputs = HomingInputs { shaft_rad, shaft_at_gap_rad, gap_m };
        let event = match homing.step(&self.table.table(), &self.constants, &inputs) {
            Ok(None) => {
                self.shaft = homing.ramp;
                return;
            }
            Ok(Some(homed)) => {
                self.resume(homed);
                EventKind::Homed(homed.found)
            }
            Err(failure) => {
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

    fn step_jog(&mut self, wanted_rad_per_s: f32, events: &mut Events) -> Option<Limit> {
        let speed_change = homing::ACCELERATION * TICK_S;
        let free = self.shaft.speed + (wanted_rad_per_s - self.shaft.speed).clamp(-speed_change, speed_change);
        self.shaft.speed = free;
        // A homed rig knows how far the strings may be twisted, either way.
        if let Some(tracking) = &self.tracking {
            let twist_rad = tracking.twist_rad(self.shaft.position);
            let max_rad = self.table.metadata().twist_max_rad;
            let [back, on] = [max_rad + twist_rad, max_rad - twist_rad]
                .map(|left_rad| braking_speed(left_rad.max(0.0), homing::ACCELERATION));
            self.shaft.speed = free.clamp(-back, on);
        }
        self.shaft.position += self.shaft.speed * TICK_S;
        if wanted_rad_per_s == 0.0 && self.shaft.speed == 0.0 {
            self.mode = Mode::Idle;
            let _ = events.push(EventKind::Stopped);
        }
        (self.shaft.speed != free).then_some(Limit::Travel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_rest_the_state_follows_from_whether_the_rig_is_homed() {
        assert_eq!((Mode::Idle.state(false), Mode::Idle.state(true)), (State::Unhomed, State::Ready));
        let jog = Mode::Jogging(1.0);
        assert_eq!((jog.state(false), jog.state(true)), (State::Moving, State::Moving));
        assert!(jog.load_control().is_none());
    }
}
