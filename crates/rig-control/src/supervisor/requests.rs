//! What the host asks, and what may begin now.

use super::fault_policy::{After, POLICY, Response};
use super::guard::STILL_TICKS;
use super::load_control::{LoadControl, Move};
use super::modes::{Jog, Mode};
use super::sensing::DriveZero;
use super::{Events, Inputs, JOG_SPEED_MAX, Rig};
use crate::homing::Homing;
use crate::move_check::{MoveRequest, MoveStart, check_load, in_range};
use crate::planner::Ramp;
use crate::sensors::LvdtReading;
use rig_link::messages::{Accepted, EventKind, Fault, Limit, LoadChoice, Parameter, Refusal, Request, Sensor, Setting};

impl Rig<'_> {
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
            Request::Home { load } => self.start_homing(load),
            Request::Move { target_m, speed_m_per_s, load } => {
                self.start_move(&MoveRequest { target_m, speed_m_per_s, load })
            }
            Request::Jog { twist_speed_rad_per_s } => self.start_jog(twist_speed_rad_per_s),
            Request::Stop => {
                self.stop();
                Ok(Accepted::Done)
            }
            Request::Clear => self.clear(inputs, events),
            // The firmware makes the table; it is used when nothing moves.
            Request::Rebuild(_) => self.idle().map(|()| Accepted::Started),
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
            Mode::EStop(_) => Err(Refusal::EStop),
            Mode::Boot(_) => Err(Refusal::DriveNotReady),
            Mode::Homing(_) | Mode::Moving(_) | Mode::Jogging(_) => Err(Refusal::Busy { state: self.state() }),
        }
    }

    fn start_homing(&mut self, load: LoadChoice) -> Result<Accepted, Refusal> {
        self.idle()?;
        check_load(load, &self.table.metadata)?;
        let readings = &self.sensing.readings;
        let gap_m = readings.lvdt.gap_m().ok_or(Refusal::SensorInvalid { sensor: Sensor::Lvdt })?;
        self.tracking = None;
        let twist_scale = self.settings.get(Setting::TwistScale);
        self.mode = Mode::Homing(Homing::new(readings.shaft_rad, gap_m, twist_scale, load));
        Ok(Accepted::Started)
    }

    fn start_move(&mut self, request: &MoveRequest) -> Result<Accepted, Refusal> {
        if !matches!(self.mode, Mode::Moving(_)) {
            self.idle()?;
        }
        let Some(tracking) = &mut self.tracking else { return Err(Refusal::NotHomed) };
        let start = MoveStart {
            mechanism: tracking.mechanism(self.table),
            load_n: tracking.observer.load_n(),
            friction_n: tracking.homed.found.friction_n,
            twist_rad: tracking.twist_rad(self.shaft.position),
            position_m: tracking.position_m,
            zero_gap_m: tracking.homed.found.reference_gap_m,
            settings: &self.settings,
        };
        start.check(request)?;
        tracking.observer.source = request.load;
        tracking.adaptation.forget_move();
        let control = match &self.mode {
            Mode::Moving(planned) => planned.control,
            Mode::Holding(control) if self.limit != Some(Limit::Travel) => *control,
            // The load may have settled a little beside the reference, or hang where the strings' travel ends, out of
            // reach of the hold's set-point: the move begins where it is.
            _ => LoadControl::at(tracking.position_m),
        };
        self.mode = Mode::Moving(Move::new(control, request.target_m, request.speed_m_per_s));
        Ok(Accepted::Started)
    }

    fn start_jog(&mut self, speed_rad_per_s: f32) -> Result<Accepted, Refusal> {
        let jogging = matches!(self.mode, Mode::Jogging(_));
        if !jogging {
            self.idle()?;
        }
        in_range(Parameter::TwistSpeed, speed_rad_per_s, -JOG_SPEED_MAX, JOG_SPEED_MAX)?;
        if !jogging {
            self.shaft = Ramp::at(self.sensing.readings.shaft_rad);
        }
        self.mode = Mode::Jogging(Jog { speed_rad_per_s });
        Ok(Accepted::Started)
    }

    /// Ramps down whatever moves. Never refused.
    fn stop(&mut self) {
        match &mut self.mode {
            Mode::Moving(planned) => planned.stop(),
            Mode::Jogging(jog) => jog.speed_rad_per_s = 0.0,
            Mode::Homing(_) => self.end_homing(),
            Mode::Boot(_) | Mode::Idle | Mode::Holding(_) | Mode::Fault | Mode::EStop(_) => {}
        }
    }

    fn clear(&mut self, inputs: &Inputs, events: &mut Events) -> Result<Accepted, Refusal> {
        match self.mode {
            Mode::EStop(_) if inputs.estop_open => return Err(Refusal::EStop),
            Mode::EStop(_) | Mode::Fault => {}
            _ => return Ok(Accepted::Done),
        }
        let latched = self.guard.latched;
        let rows = POLICY.iter().filter(|row| latched.all().contains(row.fault));
        if let Some(row) = rows.clone().find(|row| self.cause_remains(row.fault, inputs)) {
            return Err(Refusal::CauseRemains { fault: row.fault });
        }
        // By its gravest fault the load is held. A shaft that turns says otherwise, and that must be reported first.
        let should_hold = latched.response().is_some_and(|response| response < Response::LetGo);
        if should_hold && self.guard.still_ticks() < STILL_TICKS {
            return Err(Refusal::ShaftTurns);
        }
        for row in rows {
            let _ = events.push(EventKind::FaultCleared(row.fault));
        }
        let restart = matches!(self.mode, Mode::EStop(_)) || !self.sensing.drive_zero.is_matched();
        match if restart { After::Restart } else { latched.after() } {
            After::Restart => {
                self.restart();
                return Ok(Accepted::Done);
            }
            // The drive need not let go: its twist is good, but the gap no longer goes with it.
            After::Home => self.tracking = None,
            After::Nothing => {}
        }
        let readings = &self.sensing.readings;
        let twist_rad = self.tracking.as_ref().map(|tracking| tracking.twist_rad(readings.shaft_rad));
        self.guard.clear(inputs, readings.lvdt.gap_m(), twist_rad);
        self.mode = Mode::Idle;
        Ok(Accepted::Done)
    }

    fn cause_remains(&self, fault: Fault, inputs: &Inputs) -> bool {
        match fault {
            Fault::TableCorrupt => true,
            Fault::CanBusOff => inputs.bus_off,
            Fault::Supply => super::guard::supply_is_off(inputs, &self.constants),
            _ => self.sensing.readings.lvdt == LvdtReading::Invalid(fault),
        }
    }

    /// Begins again as after power-up, without moving.
    fn restart(&mut self) {
        self.tracking = None;
        self.sensing.drive_zero = DriveZero::Unknown;
        self.restart_drive = true;
        self.guard.restart();
        self.mode = Mode::reboot();
    }
}
