//! What the host asks.

use super::checks::{Checks, STILL_TICKS};
use super::fault_policy::{After, Latched, POLICY, Response};
use super::{Events, Inputs, Rig, State};
use crate::adaptation::Adaptation;
use crate::sensors::LvdtReading;
use rig_link::messages::{Accepted, EventKind, Fault, Refusal, Request, Sensor, Setting};

impl Rig<'_> {
    /// Takes a request up or says why not; nothing for those that the link answers.
    pub(super) fn request(
        &mut self,
        request: &Request,
        inputs: &Inputs,
        lvdt: LvdtReading,
        shaft_rad: f32,
        events: &mut Events,
    ) -> Option<Result<Accepted, Refusal>> {
        Some(match *request {
            // The link answers these itself.
            Request::Hello { .. }
            | Request::Heartbeat
            | Request::Status
            | Request::GetSettings
            | Request::ReadSensors => {
                return None;
            }
            Request::Stop | Request::Hold => {
                self.stop(shaft_rad);
                Ok(Accepted::Done)
            }
            Request::Clear => self.clear(inputs, lvdt, shaft_rad, events),
            Request::Home => self.idle().and_then(|()| self.start_homing(lvdt, shaft_rad)),
            Request::Jog { twist_speed_rad_per_s } => self.start_jog(twist_speed_rad_per_s, shaft_rad),
            // The firmware makes it; it is used when nothing moves.
            Request::Rebuild(_) => self.idle().map(|()| Accepted::Started),
            Request::Move { target_m, speed_m_per_s, load } => self.start_move(target_m, speed_m_per_s, load),
            // The firmware keeps them.
            Request::SetSetting { setting, value } => self.configure(&self.settings.with(setting, value)),
            Request::SetSettings(ref values) => self.configure(values),
        })
    }

    /// Whether a new motion may begin from rest.
    pub(super) fn idle(&self) -> Result<(), Refusal> {
        match self.state {
            State::Unhomed | State::Ready | State::Holding => Ok(()),
            State::Fault => Err(Refusal::InFault { fault: self.fault().unwrap_or(Fault::NotFinite) }),
            State::EStop => Err(Refusal::EStop),
            State::Boot => Err(Refusal::DriveNotReady),
            state => Err(Refusal::Busy { state }),
        }
    }

    fn start_homing(&mut self, lvdt: LvdtReading, shaft_rad: f32) -> Result<Accepted, Refusal> {
        let LvdtReading::Valid { gap_m, .. } = lvdt else {
            return Err(Refusal::SensorInvalid { sensor: Sensor::Lvdt });
        };
        self.homed = None;
        self.homing.begin(shaft_rad, gap_m, self.settings.get(Setting::TwistScale));
        self.state = State::Homing;
        Ok(Accepted::Started)
    }

    fn clear(
        &mut self,
        inputs: &Inputs,
        lvdt: LvdtReading,
        shaft_rad: f32,
        events: &mut Events,
    ) -> Result<Accepted, Refusal> {
        match self.state {
            State::EStop if inputs.estop_open => return Err(Refusal::EStop),
            State::EStop | State::Fault => {}
            State::Boot | State::Unhomed | State::Homing | State::Ready | State::Moving | State::Holding => {
                return Ok(Accepted::Done);
            }
        }
        let faults = self.latched.all();
        for row in POLICY.iter().filter(|row| faults.contains(row.fault)) {
            if self.cause_remains(row.fault, inputs, lvdt) {
                return Err(Refusal::CauseRemains { fault: row.fault });
            }
        }
        // The gravest fault says that the load is held, and it is not: that is told first.
        let said_held = self.latched.response().is_some_and(|response| response < Response::LetGo);
        if said_held && self.checks.still_ticks < STILL_TICKS {
            return Err(Refusal::ShaftTurns);
        }
        for row in POLICY.iter().filter(|row| faults.contains(row.fault)) {
            let _ = events.push(EventKind::FaultCleared(row.fault));
        }
        let lost = self.state == State::EStop || !self.matched;
        let after = if lost { After::Restart } else { self.latched.after() };
        self.latched = Latched::NONE;
        if after == After::Restart {
            self.restart();
            return Ok(Accepted::Done);
        }
        if after == After::Home {
            // The drive need not let go: its twist is good, but the gap no longer goes with it.
            self.homed = None;
            self.adaptation = Adaptation::new(1.0);
        }
        let twist_rad = self.homed.map(|h| shaft_rad - h.zero_rad);
        self.checks = Checks::cleared(inputs, lvdt.gap_m(), twist_rad);
        self.state = if self.homed.is_some() { State::Ready } else { State::Unhomed };
        Ok(Accepted::Done)
    }

    fn cause_remains(&self, fault: Fault, inputs: &Inputs, lvdt: LvdtReading) -> bool {
        match fault {
            Fault::TableCorrupt => true,
            Fault::CanBusOff => inputs.bus_off,
            Fault::Supply => self.supply_is_off(inputs),
            _ => lvdt == LvdtReading::Invalid(fault),
        }
    }

    /// Begins again as after power-up, without moving.
    fn restart(&mut self) {
        self.homed = None;
        self.drive_offset = None;
        self.matched = false;
        self.restart_drive = true;
        self.awaiting_restart = true;
        self.checks = Checks::new();
        self.standing_ticks = 0;
        self.state = State::Boot;
    }
}
