//! What the host asks, and what may begin now; and applying settings, while nothing moves.

use super::fault_policy::{After, POLICY, Response, policy};
use super::guard::SHORT_TICKS;
use super::load_control::{LoadControl, Move};
use super::modes::{Boot, First, Mode, Proving};
use super::stream::{HOLDS_FOR_S, Stream, StreamPoint, reach_m};
use super::{Controller, Events, Inputs, JOG_SPEED_MAX};
use crate::move_check::{MoveRequest, MoveStart, check_load, in_range};
use crate::ramp::Ramp;
use crate::sensors::LvdtReading;
use crate::{seconds, settings};
use rig_link::messages::{
    Accepted, EventKind, Fault, HomingFailure, Limit, LoadChoice, Parameter, Refusal, Request, Setting, SettingValues,
    State, StreamEnd,
};

impl Controller {
    /// Carries a request out or refuses it; `None` for requests that the link answers.
    pub(super) fn answer(
        &mut self,
        request: &Request,
        inputs: &Inputs,
        events: &mut Events,
    ) -> Option<Result<Accepted, Refusal>> {
        Some(match *request {
            Request::Hello { .. }
            | Request::Heartbeat
            | Request::Status
            | Request::GetSettings
            | Request::ReadSensors => return None,
            Request::Home { load } => self
                .idle()
                .and_then(|()| check_load(load, self.table.metadata()))
                .and_then(|_| self.begin(First::Home(load))),
            Request::Move { target_m, speed_m_per_s, load } => {
                self.start_move(&MoveRequest { target_m, speed_m_per_s, load })
            }
            Request::Track { position_m, speed_m_per_s, for_s } => {
                self.track(&StreamPoint { position_m, speed_m_per_s, for_s }, inputs.now_us, events)
            }
            Request::Jog { twist_speed_rad_per_s } => self.start_jog(twist_speed_rad_per_s),
            Request::CheckDirection => self.idle().and_then(|()| self.begin(First::Check)),
            Request::Stop => {
                self.stop(inputs.now_us, events);
                Ok(Accepted::Done)
            }
            Request::Clear => self.clear(inputs, events),
            // The firmware checks and keeps the table; it is used when nothing moves.
            Request::TablePart(_) => self.idle().map(|()| Accepted::Started),
            // The firmware writes the settings to flash.
            Request::SetSetting { setting, value } => self.configure(&self.settings.with(setting, value), inputs),
            Request::SetSettings(ref values) => self.configure(values, inputs),
        })
    }

    /// Whether a new motion may begin from rest.
    fn idle(&self) -> Result<(), Refusal> {
        match self.mode {
            Mode::Idle | Mode::Holding(_) => Ok(()),
            Mode::Fault => Err(Refusal::InFault { fault: self.fault().unwrap_or(Fault::NotFinite) }),
            Mode::EStop { .. } => Err(Refusal::EStop),
            Mode::Boot(Boot { then: None, .. }) => Err(Refusal::DriveNotReady),
            _ => Err(Refusal::Busy { state: self.state() }),
        }
    }

    /// Where a motion of the load would start; `None` where the rig is not homed.
    fn move_start(&self) -> Option<MoveStart<'_>> {
        let tracking = self.tracking.as_ref()?;
        Some(MoveStart {
            mechanism: tracking.mechanism(self.table.table()),
            mechanism_load_n: tracking.observer.apparent_n,
            friction_n: tracking.homed.found.friction_n,
            twist_rad: tracking.twist_rad(self.shaft.position),
            position_m: tracking.position_m,
            zero_gap_m: tracking.homed.found.reference_gap_m,
            settings: &self.settings,
        })
    }

    /// What controls the load when a motion begins now: it goes on from the present one. Where the load has settled a little
    /// beside the reference, or hangs where the strings' travel ends, out of reach of the hold's set-point, it begins where
    /// the load is.
    fn load_control(&self, position_m: f32) -> LoadControl {
        let out_of_reach = matches!(self.mode, Mode::Holding(_)) && self.limit == Some(Limit::Travel);
        self.mode.load_control().filter(|_| !out_of_reach).copied().unwrap_or_else(|| LoadControl::at(position_m))
    }

    /// Whether a motion of the load may begin or go on.
    fn may_move(&self) -> Result<(), Refusal> {
        match self.mode {
            Mode::Moving(_) | Mode::Streaming(_) => Ok(()),
            _ => self.idle(),
        }
    }

    fn start_move(&mut self, request: &MoveRequest) -> Result<Accepted, Refusal> {
        self.may_move()?;
        let request = request.with_speed_max(&self.settings);
        let start = self.move_start().ok_or(Refusal::NotHomed)?;
        start.check(&request)?;
        let control = self.load_control(start.position_m);
        self.set_out(request.load);
        self.mode = Mode::Moving(Move::new(control, request.target_m, request.speed_m_per_s));
        Ok(Accepted::Started)
    }

    /// A move or a stream begins with this choice of the load. What an interrupted move has recorded is forgotten.
    fn set_out(&mut self, load: LoadChoice) {
        if let Some(tracking) = &mut self.tracking {
            tracking.observer.source = load;
            tracking.adaptation.forget_move();
        }
    }

    /// The next set-point of a stream, or the first one. One that is refused ends the stream. Whoever goes on sending the set-points of a
    /// stream that a stop, a fault or the emergency stop has ended does not begin it again.
    fn track(&mut self, point: &StreamPoint, now_us: u64, events: &mut Events) -> Result<Accepted, Refusal> {
        let ended =
            self.stream_ended_us.is_some_and(|ended_us| seconds(now_us.saturating_sub(ended_us)) < HOLDS_FOR_S[1]);
        if ended || matches!(self.mode, Mode::Fault | Mode::EStop { .. }) {
            self.stream_ended_us = Some(now_us);
        }
        let checked = if ended { self.may_move().and(Err(Refusal::Stopped)) } else { self.check_stream(point) };
        match (checked, &mut self.mode) {
            (Ok(_), Mode::Streaming(stream)) => stream.take(point),
            (Ok(control), _) => {
                self.set_out(LoadChoice::Auto);
                self.mode = Mode::Streaming(Stream::new(control, point, self.settings.get(Setting::SpeedMax)));
            }
            (Err(refusal), mode) => {
                if let Mode::Streaming(stream) = mode {
                    let _ = events.push(EventKind::StreamEnded(StreamEnd::Refused));
                    *mode = Mode::Moving(stream.brake());
                }
                return Err(refusal);
            }
        }
        Ok(Accepted::Started)
    }

    /// Whether the load can be led to this set-point of a stream, and what controls it.
    fn check_stream(&self, point: &StreamPoint) -> Result<LoadControl, Refusal> {
        self.may_move()?;
        let start = self.move_start().ok_or(Refusal::NotHomed)?;
        in_range(Parameter::HoldsFor, point.for_s, HOLDS_FOR_S[0], HOLDS_FOR_S[1])?;
        let max_m_per_s = self.settings.get(Setting::SpeedMax);
        in_range(Parameter::Speed, point.speed_m_per_s, -max_m_per_s, max_m_per_s)?;
        let request = MoveRequest { target_m: point.position_m, speed_m_per_s: max_m_per_s, load: LoadChoice::Auto };
        start.check(&request)?;
        let control = self.load_control(start.position_m);
        let tr_rad_per_m = start.mechanism.at(start.mechanism_load_n, start.twist_rad).tr_rad_per_m();
        let (here_m, reach_m) = (control.planner.set_point_m(), reach_m(tr_rad_per_m, &self.constants));
        in_range(Parameter::Target, point.position_m, here_m - reach_m, here_m + reach_m)?;
        Ok(control)
    }

    fn start_jog(&mut self, speed_rad_per_s: f32) -> Result<Accepted, Refusal> {
        let allowed = in_range(Parameter::TwistSpeed, speed_rad_per_s, -JOG_SPEED_MAX, JOG_SPEED_MAX);
        match &mut self.mode {
            Mode::Jogging(speed)
            | Mode::Boot(Boot { then: Some(First::Jog(speed)), .. })
            | Mode::Proving(Proving { then: First::Jog(speed), .. }) => *speed = allowed?,
            _ => return self.idle().and_then(|()| self.begin(First::Jog(allowed?))),
        }
        Ok(Accepted::Started)
    }

    /// Ramps down whatever moves. Never refused.
    fn stop(&mut self, now_us: u64, events: &mut Events) {
        let begins = matches!(self.mode, Mode::Boot(_) | Mode::Proving(_));
        let ended = match self.state() {
            State::Homing => Some(EventKind::HomingRefused(HomingFailure::Stopped)),
            State::Moving if begins => Some(EventKind::Stopped),
            _ => None,
        };
        let _ = ended.map(|event| events.push(event));
        match &mut self.mode {
            // The motor is shorted at once.
            Mode::Proving(_) => self.mode = Mode::Idle,
            Mode::Boot(boot) => boot.then = None,
            Mode::Moving(planned) => planned.stop(),
            Mode::Streaming(stream) => {
                self.mode = Mode::Moving(stream.brake());
                self.stream_ended_us = Some(now_us);
            }
            Mode::Jogging(speed) => *speed = 0.0,
            Mode::Homing(_) => self.end_homing(),
            Mode::Idle | Mode::Holding(_) | Mode::Fault | Mode::EStop { .. } => {}
        }
    }

    fn clear(&mut self, inputs: &Inputs, events: &mut Events) -> Result<Accepted, Refusal> {
        match self.mode {
            Mode::EStop { open: true, .. } => return Err(Refusal::EStop),
            Mode::EStop { .. } | Mode::Fault => {}
            _ => return Ok(Accepted::Done),
        }
        let latched = self.guard.latched;
        let rows = POLICY.iter().filter(|row| latched.all.contains(row.fault));
        if let Some(row) = rows.clone().find(|row| self.cause_remains(row.fault, inputs)) {
            return Err(Refusal::CauseRemains { fault: row.fault });
        }
        // By its most severe fault the load is held. A shaft that turns says otherwise, and that must be reported first. In open loop
        // and in an emergency stop nothing is held.
        let by_fault = matches!(self.mode, Mode::Fault) && self.closed_loop;
        let should_hold = by_fault && latched.response().is_some_and(|response| response < Response::LetGo);
        if should_hold && self.guard.shaft.still_ticks < SHORT_TICKS {
            return Err(Refusal::ShaftTurns);
        }
        for row in rows {
            let _ = events.push(EventKind::FaultCleared(row.fault));
        }
        let restart = matches!(self.mode, Mode::EStop { .. }) || self.sensing.drive_zero.offset().is_none();
        match if restart { After::Restart } else { latched.after() } {
            After::Restart | After::Never => {
                // Begins again as after power-up, without moving: somebody may have changed the wiring meanwhile.
                self.closed_loop = false;
                self.start_drive(None);
                return Ok(Accepted::Done);
            }
            // The drive need not let go: its twist is good, but the gap no longer goes with it.
            After::Home => self.tracking = None,
            After::Nothing => {}
        }
        let readings = &self.sensing.readings;
        let twist_rad = self.tracking.as_ref().map(|tracking| tracking.twist_rad(readings.shaft_rad));
        self.guard.clear(inputs, readings.lvdt.gap_m(), twist_rad);
        // A start that the fault interrupted goes on.
        let matched = self.sensing.drive_zero.is_matched();
        self.mode = if matched { Mode::Idle } else { Mode::Boot(Boot::default()) };
        Ok(Accepted::Done)
    }

    fn cause_remains(&self, fault: Fault, inputs: &Inputs) -> bool {
        match fault {
            _ if policy(fault).after == After::Never => true,
            Fault::CanBusOff => inputs.bus_off,
            Fault::Supply => super::guard::supply_off_us(inputs, &self.constants).is_some(),
            _ => self.sensing.readings.lvdt == LvdtReading::Invalid(fault),
        }
    }

    /// The settings in use.
    pub fn settings(&self) -> &SettingValues {
        &self.settings
    }

    /// Applies all of the settings or none. Refused while anything moves, and before the drive's zero is known.
    pub(super) fn configure(&mut self, values: &SettingValues, inputs: &Inputs) -> Result<Accepted, Refusal> {
        match self.state() {
            State::Boot => return Err(Refusal::DriveNotReady),
            state @ (State::Moving | State::Homing) => return Err(Refusal::Busy { state }),
            // In fault or emergency stop nothing moves, and settings may be what is wrong.
            State::Unhomed | State::Ready | State::Holding | State::Fault | State::EStop => {}
        }
        values.check(&settings::defaults(&self.scene))?;
        let was_homed = self.tracking.is_some();
        if self.set_up(values) {
            self.sensing.read_again(inputs, &self.constants);
        }
        Ok(if was_homed && self.tracking.is_none() { Accepted::Unhomed } else { Accepted::Started })
    }

    /// Applies settings, those from flash before the first tick. Whether angles, gaps or loads mean something else with them; the
    /// position is then not known any more.
    pub fn set_up(&mut self, values: &SettingValues) -> bool {
        let before = core::mem::replace(&mut self.settings, *values);
        let old = core::mem::replace(&mut self.constants, settings::apply(values, &self.scene));
        let changes = |setting: &Setting| setting.spec().unhomes && before.get(*setting) != values.get(*setting);
        if Setting::ALL.iter().any(changes) || before.lvdt_curve != values.lvdt_curve {
            // The same place in the new units; nothing is compared with readings in the old ones.
            self.shaft = Ramp::at(self.shaft.position * old.counts_per_rad / self.constants.counts_per_rad);
            self.guard.forget_places();
            if changes(&Setting::HeaviestLoad) {
                self.heaviest_n = values.get(Setting::HeaviestLoad);
            }
            self.forget_position();
            return true;
        }
        let higher_m = before.get(Setting::PositionZero) - values.get(Setting::PositionZero);
        if let Some(tracking) = &mut self.tracking {
            tracking.shift_position(higher_m);
        }
        if let Mode::Holding(control) = &mut self.mode {
            control.shift_position(higher_m);
        }
        false
    }
}
