//! Moves, jogs and stops.

use super::checks::lasts;
use super::{EventKind, Events, Homed, JOG_SPEED_MAX, Motion, Rig, SPEED_MAX_M_PER_S, Setting, ticks};
use crate::TICK_S;
use crate::crossing::TwistLimits;
use crate::limits::{LOAD_ACCELERATION, Limits};
use crate::mechanism::Mechanism;
use crate::observer::{Confidence, LoadSource, Observation};
use crate::planner::{Planner, Ramp};
use crate::position_loop::PositionLoop;
use crate::time_to_target::time_to_target_s;
use rig_link::messages::{Accepted, Limit, LoadChoice, Parameter, Refusal, State};

/// Error (m) within which a load counts as arrived: half an LVDT count. The loop goes on holding after that.
const ARRIVED_M: f32 = 25e-6;
/// Time within that error, and at the end of the strings' travel, after which a move is done, and longest wait for either.
const ARRIVED_TICKS: u16 = ticks(30);
const END_TICKS: u16 = ticks(100);
const PATIENCE_TICKS: u16 = ticks(600);
/// How far below the half-turn pre-twist the strings may be untwisted by the loop (rad).
const BELOW_PRETWIST: f32 = 0.15;
/// How far (m) a load may hang lower at the pre-twist than its estimate says: 0.19 mm was the most of 128 changed loads. As
/// many hung up to 0.17 mm higher, and moves below that end where the strings do.
const HANGS_M: f32 = 0.2e-3;
/// How far outside the table's range a move may begin, and a load is still told (rad): the pre-twist is the end of the
/// range, and homing finds it within less.
pub(super) const OUTSIDE_RAD: f32 = 0.2;
/// Acceleration of a jog (rad/s²).
const JOG_ACCELERATION: f32 = 20.0;

fn check(parameter: Parameter, given: f32, min: f32, max: f32) -> Result<f32, Refusal> {
    if !given.is_finite() {
        Err(Refusal::NotFinite { parameter })
    } else if (min..=max).contains(&given) {
        Ok(given)
    } else {
        Err(Refusal::OutOfRange { parameter, min, max, given })
    }
}

impl Rig<'_> {
    /// How far the strings can bring this load up, or let it down (m). A lighter one than at homing hangs higher at the
    /// half-turn pre-twist and cannot come down to it.
    fn travel_end_m(&self, homed: &Homed, load_n: f32, up: bool) -> f32 {
        let mechanism = Mechanism { table: self.table, twist_scale: homed.twist_scale };
        let (pull_n, twist_rad) = if up {
            (load_n + homed.friction_n, mechanism.twist_max_rad())
        } else {
            (load_n, self.table.metadata.twist_min_rad)
        };
        let end = homed.reference_gap_m - homed.gap_offset_m - mechanism.at(pull_n, twist_rad).gap_m;
        if up { end } else { end.max(self.pretwist_m()) }
    }

    /// The half-turn pre-twist under the load at homing (m): no load is let down farther.
    fn pretwist_m(&self) -> f32 {
        // Not −x, which would tell a −0.
        0.0 - self.settings.get(Setting::PositionZero)
    }

    pub(super) fn start_move(
        &mut self,
        target_m: f32,
        speed_m_per_s: f32,
        load: LoadChoice,
    ) -> Result<Accepted, Refusal> {
        let moving = self.state == State::Moving && matches!(self.motion, Motion::Load { .. });
        if !moving {
            self.idle()?;
        }
        let homed = self.homed.ok_or(Refusal::NotHomed)?;
        let m = &self.table.metadata;
        // From outside only a jog leads back: a planned move would jump to the end of the range.
        let twist_rad = self.shaft.position - homed.zero_rad;
        check(Parameter::Twist, twist_rad, m.twist_min_rad - OUTSIDE_RAD, m.twist_max_rad + OUTSIDE_RAD)?;
        let source = match load {
            LoadChoice::Auto => LoadSource::Estimate,
            LoadChoice::Known(load_n) => LoadSource::Known(check(Parameter::Load, load_n, m.load_min_n, m.load_max_n)?),
        };
        let load_n = match source {
            LoadSource::Estimate => self.observer.load_n(),
            LoadSource::Known(load_n) => load_n,
        };
        let speed_m_per_s = check(Parameter::Speed, speed_m_per_s, 1e-5, self.settings.get(Setting::SpeedMax))?;
        let [lowest_m, highest_m] = [false, true].map(|up| self.travel_end_m(&homed, load_n, up));
        // Targets within the uncertain band at the lower end are attempted; a refusal names the certain end.
        let up = target_m > self.last_position_m;
        let reached =
            if up { target_m <= highest_m } else { target_m >= (lowest_m - HANGS_M).max(self.pretwist_m()) };
        if !reached {
            check(Parameter::Target, target_m, lowest_m.min(highest_m), lowest_m.max(highest_m))?;
        }
        if self.state == State::Ready {
            // The load may have settled a little beside the reference: begin where it is.
            self.planner = Planner::at(self.last_position_m);
            self.position_loop = PositionLoop::default();
        }
        self.observer.source = source;
        self.adaptation.forget_move();
        self.run_s = None;
        self.planner.go_to(target_m);
        self.position_loop.crossing.set_out(self.planner.setting_out());
        self.motion = Motion::Load { speed_m_per_s, stopping: false };
        self.state = State::Moving;
        (self.arrived_ticks, self.end_ticks, self.at_rest_ticks) = (0, 0, 0);
        Ok(Accepted::Started)
    }

    pub(super) fn start_jog(&mut self, speed: f32, shaft_rad: f32) -> Result<Accepted, Refusal> {
        let jogging = self.state == State::Moving && matches!(self.motion, Motion::Jog { .. });
        if !jogging {
            self.idle()?;
            self.shaft = Ramp::at(shaft_rad);
        }
        let speed_rad_per_s = check(Parameter::TwistSpeed, speed, -JOG_SPEED_MAX, JOG_SPEED_MAX)?;
        self.motion = Motion::Jog { speed_rad_per_s };
        self.state = State::Moving;
        Ok(Accepted::Started)
    }

    /// Ramps down whatever moves. Never refused.
    pub(super) fn stop(&mut self, shaft_rad: f32) {
        match (self.state, &mut self.motion) {
            (State::Moving, Motion::Load { stopping, .. }) if !*stopping => {
                *stopping = true;
                self.run_s = None;
                self.planner.brake(&Limits::new(SPEED_MAX_M_PER_S, LOAD_ACCELERATION));
            }
            (State::Moving, Motion::Jog { speed_rad_per_s }) => *speed_rad_per_s = 0.0,
            (State::Homing, _) => {
                self.shaft = Ramp::at(shaft_rad);
                self.state = State::Unhomed;
            }
            _ => {}
        }
    }

    pub(super) fn step_motion(
        &mut self,
        observed: Option<&(Homed, Observation)>,
        gap_m: Option<f32>,
        events: &mut Events,
    ) {
        match (self.motion, observed, gap_m) {
            (Motion::Jog { speed_rad_per_s }, ..) => self.step_jog(speed_rad_per_s, events),
            (Motion::Load { speed_m_per_s, stopping }, Some((homed, seen)), Some(gap_m)) => {
                self.step_load(speed_m_per_s, stopping, homed, seen, gap_m, events);
            }
            // No gap this tick: keep the strings still; a lasting loss is a fault of its own.
            _ => self.shaft.speed = 0.0,
        }
    }

    fn step_jog(&mut self, speed_rad_per_s: f32, events: &mut Events) {
        if self.state != State::Moving {
            self.shaft.speed = 0.0;
            return;
        }
        let unit = JOG_ACCELERATION * TICK_S;
        self.shaft.speed += (speed_rad_per_s - self.shaft.speed).clamp(-unit, unit);
        let next = self.shaft.position + self.shaft.speed * TICK_S;
        let outside = self.homed.is_some_and(|h| {
            // A homed rig knows how far the strings may be twisted, either way.
            let twist = next - h.zero_rad;
            twist.abs() > self.table.metadata.twist_max_rad && twist * self.shaft.speed > 0.0
        });
        if outside {
            self.limit = Some(Limit::Travel);
            self.shaft.speed = 0.0;
        } else {
            self.shaft.position = next;
        }
        if speed_rad_per_s == 0.0 && self.shaft.speed == 0.0 {
            self.state = if self.homed.is_some() { State::Ready } else { State::Unhomed };
            let _ = events.push(EventKind::Stopped);
        }
    }

    fn step_load(
        &mut self,
        speed_m_per_s: f32,
        stopping: bool,
        homed: &Homed,
        seen: &Observation,
        gap_m: f32,
        events: &mut Events,
    ) {
        let tr = seen.point.tr_rad_per_m();
        let mechanism = Mechanism { table: self.table, twist_scale: homed.twist_scale };
        let twist_rad = self.shaft.position - homed.zero_rad;
        let (planned, limit) = Limits::for_motor(speed_m_per_s, tr, seen.pull_n, &self.constants);
        if self.state == State::Moving {
            self.limit = limit.or(self.limit);
        }
        if self.state == State::Moving && !stopping {
            self.run_s.get_or_insert_with(|| {
                time_to_target_s(&self.planner, speed_m_per_s, seen.load_n, twist_rad, tr, &mechanism, &self.constants)
            });
        }
        // Until the strings have taken up friction the load cannot move: no set-point leaves it behind.
        let waiting = self.position_loop.crossing.is_waiting();
        let set_point = if waiting { self.planner.wait() } else { self.planner.step(&planned) };
        let setting_out = waiting.then_some(speed_m_per_s);
        if let (Some(run_s), false) = (&mut self.run_s, waiting) {
            *run_s = (*run_s - TICK_S).max(0.0);
        }
        let position_m = homed.reference_gap_m - gap_m;
        let limit = self.constants.twist_speed_max();
        let limits = TwistLimits { speed: limit, acceleration: self.constants.twist_acceleration_max() };
        let out = self.position_loop.step(
            &set_point,
            setting_out,
            position_m,
            self.gap_age_s,
            seen,
            &mechanism,
            twist_rad,
            &limits,
        );
        self.shaft.speed = out.twist_speed_rad_per_s.clamp(-limit, limit);
        let next = self.shaft.position + self.shaft.speed * TICK_S;
        let (low, high) = (self.table.metadata.twist_min_rad - BELOW_PRETWIST, self.table.metadata.twist_max_rad);
        let twist = (next - homed.zero_rad).clamp(low, high);
        let at_end = twist != next - homed.zero_rad;
        if at_end {
            self.limit = Some(Limit::Travel);
            self.shaft.speed = 0.0;
        }
        self.shaft.position = homed.zero_rad + twist;
        self.learn(homed, seen, twist_rad, set_point.done);
        if self.state == State::Moving && set_point.done {
            // Or as far as the strings go: the event says how far off that is, and the limit stays in the telemetry.
            let near = out.error_m.abs() < ARRIVED_M;
            let arrived = lasts(&mut self.arrived_ticks, near, ARRIVED_TICKS);
            let ended = lasts(&mut self.end_ticks, at_end, END_TICKS);
            self.at_rest_ticks += 1;
            if arrived || ended || self.at_rest_ticks >= PATIENCE_TICKS {
                self.state = State::Holding;
                let error_m = position_m - set_point.position_m;
                let _ = events.push(if stopping { EventKind::Stopped } else { EventKind::MoveDone { error_m } });
            }
        }
    }

    /// What this tick of a move tells of the twist scale; learned when the set-point has arrived.
    fn learn(&mut self, homed: &Homed, seen: &Observation, twist_rad: f32, done: bool) {
        // What the load seems heavier by (N) for a scale of 1: (∂G/∂s)/(∂G/∂F).
        let x = seen.point.dgap_dtwist_m_per_rad * twist_rad / homed.twist_scale / seen.point.dgap_dload_m_per_n;
        if seen.confidence == Confidence::Changing || self.observer.source != LoadSource::Estimate {
            self.adaptation.forget_move();
        } else if !done && seen.moved_m > 0.0 {
            self.adaptation.record(x, self.observer.load_n());
        } else if done && self.state == State::Moving {
            let finding = self.adaptation.end_move(homed.twist_scale);
            if let Some(agrees) = finding.agrees {
                self.observer.end_move(agrees);
            }
            let change = finding.scale_change;
            if let (true, Some(homed)) = (change != 0.0, self.homed.as_mut()) {
                homed.twist_scale += change;
                self.observer.rescale(-x * change);
            }
        }
    }
}
