//! A stream of set-points: the load follows a target that somebody else moves, for as long as the next one comes in time.

use super::load_control::{LoadControl, Move};
use crate::limits::Limits;
use crate::load_state::LoadState;
use crate::planner::Motion;
use crate::{RigConstants, TICK_S};
use rig_link::messages::{Limit, StreamEnd};

/// How long a set-point may hold without the next one (s).
pub const HOLDS_FOR_S: [f32; 2] = [0.02, 0.5];

/// One set-point of a stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StreamPoint {
    pub(super) position_m: f32,
    pub(super) speed_m_per_s: f32,
    pub(super) for_s: f32,
}

/// A stream that is being followed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stream {
    pub(super) control: LoadControl,
    target: Motion,
    /// How fast the target's acceleration changes (m/s³).
    jerk_m_per_s3: f32,
    /// Speed of the newest set-point (m/s), and mean acceleration of the way to it from the one before (m/s²).
    given_m_per_s: f32,
    given_m_per_s2: f32,
    /// Time since the newest set-point, how long it holds, and how long its acceleration does (s).
    age_s: f32,
    for_s: f32,
    accelerates_s: f32,
    /// Where the set-point was (m) when the load last moved.
    moved_at_m: f32,
    /// Speed (m/s) that is not exceeded.
    speed_max_m_per_s: f32,
    /// Those of the last tick.
    limits: Option<Limits>,
}

/// How far (m) from the present set-point the next one may be, with the strings at a transmission ratio (rad/m): as far as the load
/// comes at full speed while a set-point may hold.
pub(super) fn reach_m(tr_rad_per_m: f32, rig: &RigConstants) -> f32 {
    HOLDS_FOR_S[1] * rig.twist_speed_max() / tr_rad_per_m
}

impl Stream {
    /// Begins with a first set-point, going on from the present motion.
    pub(super) fn new(control: LoadControl, first: &StreamPoint, speed_max_m_per_s: f32) -> Self {
        let (given_m_per_s, moved_at_m) = (first.speed_m_per_s, control.planner.set_point_m());
        let mut stream = Self { control, given_m_per_s, moved_at_m, speed_max_m_per_s, ..Self::default() };
        stream.take(first);
        stream
    }

    /// The next set-point. The speeds of the last ones tell the mean acceleration of the way to it, and how fast that changes. A
    /// smooth trajectory goes on changing so; a change faster than the jerk that the load may have is a step of the speed.
    pub(super) fn take(&mut self, next: &StreamPoint) {
        let since_s = self.age_s.max(TICK_S);
        let acceleration = (next.speed_m_per_s - self.given_m_per_s) / since_s;
        let jerk = (acceleration - self.given_m_per_s2) / since_s;
        self.jerk_m_per_s3 = if self.limits.is_some_and(|limits| jerk.abs() < limits.jerk) { jerk } else { 0.0 };
        self.target = Motion {
            position: next.position_m,
            speed: next.speed_m_per_s,
            // The mean is that of the middle of the way.
            acceleration: acceleration + 0.5 * since_s * self.jerk_m_per_s3,
        };
        (self.given_m_per_s, self.given_m_per_s2) = (next.speed_m_per_s, acceleration);
        (self.age_s, self.for_s, self.accelerates_s) = (0.0, next.for_s, since_s);
    }

    /// Why the stream ends now, if it does. Call it once in each tick.
    pub(super) fn ends(&mut self, tr_rad_per_m: f32, rig: &RigConstants) -> Option<StreamEnd> {
        self.age_s += TICK_S;
        let ahead_m = self.target.position - self.control.planner.set_point_m();
        if self.age_s > self.for_s {
            Some(StreamEnd::Late)
        } else if ahead_m.abs() > reach_m(tr_rad_per_m, rig) {
            Some(StreamEnd::TooFast)
        } else {
            None
        }
    }

    /// The move that comes to rest from here.
    pub(super) fn brake(&self) -> Move {
        Move::braking(self.control, self.limits)
    }

    /// The target goes on by one tick.
    fn advance(&mut self) {
        let target = &mut self.target;
        // It is known from two set-points, and goes on for as long as lay between them.
        if self.age_s > self.accelerates_s + 0.5 * TICK_S {
            (target.acceleration, self.jerk_m_per_s3) = (0.0, 0.0);
        }
        let change = TICK_S * self.jerk_m_per_s3;
        let gained = TICK_S * (target.acceleration + 0.5 * change);
        target.position += TICK_S * (target.speed + 0.5 * gained);
        target.speed += gained;
        target.acceleration += change;
    }

    /// One tick: twist speed (rad/s), and what holds the load back.
    pub(super) fn step(&mut self, load: &LoadState<'_>) -> (f32, Option<Limit>) {
        self.advance();
        let observation = &load.observation;
        let (limits, _) = Limits::for_motor(self.speed_max_m_per_s, &observation.point, observation.pull_n, load.rig);
        self.limits = Some(limits);
        let (set_point, held_back) = self.control.planner.follow(&self.target, &limits);
        let twist_speed_rad_per_s = self.control.position_loop.step(&set_point, false, load);
        if observation.moved_m > 0.0 {
            self.moved_at_m = set_point.motion.position;
        }
        let sticks = (set_point.motion.position - self.moved_at_m).abs() > load.moved_m();
        (twist_speed_rad_per_s, held_back.then_some(Limit::MotorSpeed).or(sticks.then_some(Limit::Friction)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { speed: 0.01, acceleration: 0.05, jerk: 0.8 };
    const EVERY_TICKS: u8 = 5;

    /// A stream whose speed (m/s) is that of a time (s), a set-point every five ticks, after the given number of set-points.
    fn streamed(speed: impl Fn(f32) -> f32, count: u8) -> Stream {
        let point = |k: u8| {
            let t_s = f32::from(k * EVERY_TICKS) * TICK_S;
            StreamPoint { position_m: 0.0, speed_m_per_s: speed(t_s), for_s: 0.2 }
        };
        let mut stream = Stream::new(LoadControl::at(0.0), &point(0), LIMITS.speed);
        stream.limits = Some(LIMITS);
        for k in 1..count {
            stream.age_s = f32::from(EVERY_TICKS) * TICK_S;
            stream.take(&point(k));
        }
        stream
    }

    fn near(found: f32, expected: f32) -> bool {
        (found - expected).abs() < 1e-5
    }

    #[test]
    fn an_even_acceleration_is_that_of_the_speeds() {
        let stream = streamed(|t_s| 0.02 * t_s, 4);
        assert!(near(stream.target.acceleration, 0.02), "{stream:?}");
        assert!(stream.jerk_m_per_s3.abs() < 1e-3);
    }

    /// v = j t²/2 has the acceleration j t, of which two set-points show only that of the middle between them.
    #[test]
    fn an_acceleration_that_changes_evenly_is_that_of_now_and_goes_on_changing() {
        let stream = streamed(|t_s| 0.5 * 0.4 * t_s * t_s, 5);
        assert!(near(stream.target.acceleration, 0.4 * 0.2), "{stream:?}");
        assert!((stream.jerk_m_per_s3 - 0.4).abs() < 1e-3);
    }

    /// x = v t + a t²/2 + j t³/6 for as long as lay between the last two set-points; then the speed stays.
    #[test]
    fn a_target_goes_on_as_its_set_points_did_for_as_long_as_lay_between_them() {
        let mut stream = streamed(|t_s| 0.5 * 0.4 * t_s * t_s, 5);
        let at = |t_s: f32| (0.4 * t_s * t_s * t_s / 6.0, 0.5 * 0.4 * t_s * t_s, 0.4 * t_s);
        let began_s = 0.2;
        for tick in 1..=9u8 {
            stream.age_s = f32::from(tick) * TICK_S;
            stream.advance();
            let accelerates_s = f32::from(tick.min(EVERY_TICKS)) * TICK_S;
            let (position_m, speed_m_per_s, acceleration) = at(began_s + accelerates_s);
            let coasts_s = f32::from(tick.saturating_sub(EVERY_TICKS)) * TICK_S;
            let distance_m = position_m - at(began_s).0 + coasts_s * speed_m_per_s;
            assert!((stream.target.position - distance_m).abs() < 2e-7, "{tick}: {stream:?}");
            assert!((stream.target.speed - speed_m_per_s).abs() < 1e-6, "{tick}: {stream:?}");
            let left = if tick > EVERY_TICKS { 0.0 } else { acceleration };
            assert!((stream.target.acceleration - left).abs() < 1e-4, "{tick}: {stream:?}");
        }
    }

    #[test]
    fn a_step_of_the_speed_is_not_taken_for_the_beginning_of_more() {
        let stream = streamed(|t_s| if t_s < 0.18 { 0.004 } else { 0.0 }, 5);
        assert!(near(stream.target.acceleration, -0.08), "{stream:?}");
        assert_eq!(stream.jerk_m_per_s3, 0.0);
    }
}
