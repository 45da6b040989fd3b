//! The controller: one tick of whatever moves or holds the load, from its observed state to the set-point of the shaft.

use super::load_control::MoveStep;
use super::modes::Mode;
use super::{Controller, Events};
use crate::load_motion::AHEAD_S;
use crate::load_state::LoadState;
use rig_link::messages::{EventKind, Limit};

impl Controller {
    /// One tick of a move, a stream or a hold; what held the load back. Without a gap, or outside the table's twists, the strings
    /// are kept still; a lasting loss is a fault of its own.
    pub(super) fn control_load(&mut self, events: &mut Events) -> Option<Limit> {
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
        let found = &tracking.homed.found;
        let load = LoadState {
            mechanism: tracking.mechanism(self.table.table()),
            observation,
            position_m: tracking.position_m,
            motion,
            reference_gap_m: found.reference_gap_m,
            gap_noise_m: found.gap_noise_m,
            jump_m: found.jump_m,
            twist_rad,
            twist_limits: self.constants.twist_limits(),
            loop_gain: self.constants.loop_gain,
        };
        let (output, limit, planned) = match &mut self.mode {
            Mode::Moving(planned) => {
                let MoveStep { output, set_point, limit } = planned.step(&load, &self.constants);
                (output, limit, Some((planned, set_point)))
            }
            Mode::Streaming(stream) => {
                let (output, limit) = stream.step(&load, &self.constants);
                (output, limit, None)
            }
            Mode::Holding(control) => (control.hold(&load), None, None),
            _ => return None,
        };
        let (shaft, at_end) = load.turned(self.shaft, tracking.homed.zero_rad, output.twist_speed_rad_per_s);
        self.shaft = shaft;
        let limit = at_end.then_some(Limit::Travel).or(limit);
        let Some((planned, set_point)) = planned else { return limit };
        tracking.learn(&observation, twist_rad, set_point.done);
        if set_point.done && planned.is_over(&load, at_end) {
            let error_m = load.position_m - planned.control.planner.target_m();
            let _ = events.push(if planned.stopping { EventKind::Stopped } else { EventKind::MoveDone { error_m } });
            self.mode = Mode::Holding(planned.control);
        }
        limit
    }
}
