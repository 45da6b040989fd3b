//! What moves or holds the load, from its observed state to the set-point of the shaft: a planned move and the hold after it, planner and
//! position loop, tick by tick, and when a move is over.

use super::guard::{LONG_TICKS, SHORT_TICKS, supply};
use super::modes::Mode;
use super::{Controller, Events, Inputs, lasts};
use crate::TICK_S;
use crate::limits::Limits;
use crate::load_motion::AHEAD_S;
use crate::load_state::LoadState;
use crate::planner::{Planner, SetPoint};
use crate::position_loop::PositionLoop;
use crate::sensors::LVDT_COUNT_M;
use rig_link::messages::{EventKind, Limit};

/// Set-point of the load, and the loop that keeps the load there.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LoadControl {
    pub(super) planner: Planner,
    pub(super) position_loop: PositionLoop,
}

impl LoadControl {
    /// At rest at a position (m).
    pub(super) fn at(position_m: f32) -> Self {
        Self { planner: Planner::at(position_m), position_loop: PositionLoop::default() }
    }

    /// Position 0 is called another height: at rest, every position is `higher_m` greater.
    pub(super) fn shift_position(&mut self, higher_m: f32) {
        self.planner = Planner::at(self.planner.set_point_m() + higher_m);
    }

    /// One tick at the target: twist speed (rad/s).
    pub(super) fn hold(&mut self, load: &LoadState<'_>) -> f32 {
        self.position_loop.step(&SetPoint::at(self.planner.set_point_m()), false, load)
    }
}

/// A move.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Move {
    pub(super) control: LoadControl,
    speed_m_per_s: f32,
    /// Those of the last tick.
    limits: Option<Limits>,
    pub(super) stopping: bool,
    /// Time until the set-point is at its target, friction compensation aside (s); `None` before the first tick and in a stop.
    run_s: Option<f32>,
    /// Ticks that the set-point has been at its target, and of these in a row that the load was near it, or the strings at the
    /// end of their travel.
    rest_ticks: u16,
    near_ticks: u16,
}

impl Move {
    /// To a position (m) at a speed (m/s) at most, going on from the present set-point.
    pub(super) fn new(mut control: LoadControl, target_m: f32, speed_m_per_s: f32) -> Self {
        control.planner.target_m = target_m;
        control.position_loop.compensation.set_out(control.planner.setting_out());
        Self { control, speed_m_per_s, ..Self::default() }
    }

    /// Comes to rest as soon as these limits allow, which were those of the last tick.
    pub(super) fn braking(control: LoadControl, limits: Option<Limits>) -> Self {
        let mut braking = Self::new(control, control.planner.set_point_m(), f32::INFINITY);
        braking.limits = limits;
        braking.stop();
        braking
    }

    /// Ramps down.
    pub(super) fn stop(&mut self) {
        if !self.stopping {
            self.stopping = true;
            self.run_s = None;
            match &self.limits {
                Some(limits) => self.control.planner.brake(limits),
                // Before its first tick it stands.
                None => self.control.planner.target_m = self.control.planner.set_point_m(),
            }
        }
    }

    /// Time until the set-point is at its target (s): friction compensation, then the way. `None` before a move's first tick, and
    /// while it stops.
    pub(super) fn time_left_s(&self) -> Option<f32> {
        let compensation = &self.control.position_loop.compensation;
        let wait_s = if compensation.waiting { compensation.left_s } else { 0.0 };
        self.run_s.map(|run_s| wait_s + run_s)
    }

    /// One tick: twist speed (rad/s), what holds the load back, and whether the set-point is at its target.
    pub(super) fn step(&mut self, load: &LoadState<'_>) -> (f32, Option<Limit>, bool) {
        let Self { control, speed_m_per_s, .. } = self;
        let (here, pull_n) = (load.observation.point, load.observation.pull_n);
        let (limits, limit) = Limits::for_motor(*speed_m_per_s, &here, pull_n, load.rig);
        let stopping_rad = here.tr_rad_per_m() * limits.stopping_m(control.planner.speed_m_per_s());
        let rest = load.mechanism.at(pull_n, load.twist_rad + stopping_rad);
        let limits = limits.braking_into(&Limits::for_motor(*speed_m_per_s, &rest, pull_n, load.rig).0);
        self.limits = Some(limits);
        // Until the strings have taken up friction the load cannot move: the set-point waits for it.
        let waiting = control.position_loop.compensation.waiting;
        if !self.stopping {
            let run_s = self.run_s.get_or_insert_with(|| control.planner.time_to_target_s(*speed_m_per_s, load));
            if !waiting {
                *run_s = (*run_s - TICK_S).max(0.0);
            }
        }
        let set_point = if waiting { control.planner.wait() } else { control.planner.step(&limits) };
        let twist_speed_rad_per_s = control.position_loop.step(&set_point, waiting, load);
        if waiting && !control.position_loop.compensation.waiting {
            // The load has broken loose, and may have jumped.
            control.planner.set_out_from(load.position_m);
        }
        // A stop has no target: the load stays where it is, and no friction is taken up for the rest of a way.
        if self.stopping && (waiting || set_point.done) {
            *control = LoadControl::at(load.position_m);
        }
        (twist_speed_rad_per_s, limit, set_point.done)
    }

    /// One tick with the set-point at its target: whether the move is over. It may end where the strings' travel ends; the
    /// event then says how far off that is, and the limit stays in the telemetry.
    pub(super) fn is_over(&mut self, load: &LoadState<'_>, at_end: bool) -> bool {
        let error_m = self.control.planner.target_m - load.position_m;
        // What stiction leaves.
        let left_m = self.control.position_loop.rest.left_alone_m(load.found);
        // Half an LVDT count, or what is no motion; the loop goes on holding after that.
        let near = error_m.abs() < (0.5 * LVDT_COUNT_M).max(load.moved_m()).max(left_m);
        let arrived = lasts(&mut self.near_ticks, near || at_end, SHORT_TICKS);
        self.rest_ticks += 1;
        arrived || self.rest_ticks >= 2 * LONG_TICKS
    }
}

impl Controller {
    /// One tick of a move, a stream or a hold; what held the load back. Without a gap, or outside the table's twists, the strings
    /// are kept still; a lasting loss is a fault of its own.
    pub(super) fn control_load(&mut self, inputs: &Inputs, events: &mut Events) -> Option<Limit> {
        let readings = &self.sensing.readings;
        let (Some(tracking), Some(_)) = (&mut self.tracking, readings.lvdt.gap_m()) else {
            self.shaft.speed = 0.0;
            return None;
        };
        let twist_rad = tracking.twist_rad(self.shaft.position + AHEAD_S * self.shaft.speed);
        let (Some(observation), Some(motion)) = (tracking.observation, tracking.motion_ahead(readings, twist_rad))
        else {
            self.shaft.speed = 0.0;
            return None;
        };
        if let Mode::Streaming(stream) = &mut self.mode
            && let Some(end) = stream.ends(observation.point.tr_rad_per_m(), &self.constants)
        {
            let _ = events.push(EventKind::StreamEnded(end));
            self.mode = Mode::Moving(stream.brake());
        }
        let rig =
            supply(inputs).and_then(|supply| supply.volts).map_or(self.constants, |v| self.constants.on_supply(v));
        let load = LoadState {
            mechanism: tracking.mechanism(self.table.table()),
            observation,
            position_m: tracking.position_m,
            motion,
            twist_rad,
            found: &tracking.homed.found,
            rig: &rig,
        };
        let (twist_speed_rad_per_s, limit, planned) = match &mut self.mode {
            Mode::Moving(planned) => {
                let (twist_speed_rad_per_s, limit, arrived) = planned.step(&load);
                (twist_speed_rad_per_s, limit, Some((planned, arrived)))
            }
            Mode::Streaming(stream) => {
                let (twist_speed_rad_per_s, limit) = stream.step(&load);
                (twist_speed_rad_per_s, limit, None)
            }
            Mode::Holding(control) => (control.hold(&load), None, None),
            _ => return None,
        };
        let (shaft, at_end) = load.turned(self.shaft, tracking.homed.zero_rad, twist_speed_rad_per_s);
        self.shaft = shaft;
        let limit = at_end.then_some(Limit::Travel).or(limit);
        let Some((planned, arrived)) = planned else { return limit };
        let over = arrived && planned.is_over(&load, at_end);
        let (scale, observer) = (&mut tracking.homed.found.twist_scale, &mut tracking.observer);
        tracking.adaptation.step(scale, observer, &observation, twist_rad, arrived);
        if over {
            let error_m = tracking.position_m - planned.control.planner.target_m;
            let _ = events.push(if planned.stopping { EventKind::Stopped } else { EventKind::MoveDone { error_m } });
            self.mode = Mode::Holding(planned.control);
        }
        limit
    }
}
