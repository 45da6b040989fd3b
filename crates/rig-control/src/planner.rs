//! Motion of the load under limits of speed, acceleration and jerk. Target and limits may change at any time: each tick is planned
//! from the present motion.

use crate::TICK_S;
use crate::limits::Limits;
use crate::load_state::LoadState;
use tsa_table::Point;

/// Gain (1/s) by which a set-point follows a target that moves. Its speed follows three times as fast.
const FOLLOWS_PER_S: f32 = 8.0;
/// Minimum fraction of the acceleration with which it catches up while the target accelerates.
const MIN_LEFT: f32 = 0.2;

/// Pieces of the way for which its time is told.
const PIECES: u8 = 16;
/// Steps of the search for the acceleration that just still stops at the target.
const SEARCH_STEPS: u8 = 7;
/// Motion of a set-point, or of a target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Where it is (m).
    pub position: f32,
    /// How fast it moves (m/s).
    pub speed: f32,
    /// How fast that changes (m/s²).
    pub acceleration: f32,
}

impl Motion {
    /// At rest at a position (m).
    pub const fn at(position: f32) -> Self {
        Self { position, speed: 0.0, acceleration: 0.0 }
    }

    /// One tick on, arriving at an acceleration.
    fn after(&self, acceleration: f32) -> Self {
        let mean = (2.0 * self.acceleration + acceleration) / 3.0;
        Self {
            position: self.position + TICK_S * (self.speed + 0.5 * TICK_S * mean),
            speed: self.speed + 0.5 * TICK_S * (self.acceleration + acceleration),
            acceleration,
        }
    }

    /// Acceleration after a tick from which a speed is reached and not passed: taken back at full jerk, it ends there.
    fn keeps(&self, speed: f32, limits: &Limits) -> f32 {
        let left = speed - self.speed - 0.5 * TICK_S * self.acceleration;
        let reach = libm::sqrtf(0.25 * TICK_S * TICK_S + 2.0 * left.abs() / limits.jerk) - 0.5 * TICK_S;
        libm::copysignf((limits.jerk * reach).min(limits.acceleration), left)
    }

    /// Where it comes to rest at the soonest.
    fn stop(&self, limits: &Limits) -> f32 {
        let jerk = limits.jerk;
        // Once the acceleration has been taken back it goes this way, and is braked the other way.
        let coasting = self.speed + 0.5 * self.acceleration * self.acceleration.abs() / jerk;
        let way = if coasting < 0.0 { -1.0 } else { 1.0 };
        let (v, a) = (way * self.speed, way * self.acceleration);
        let square = jerk * v + 0.5 * a * a;
        let free = if square > 0.0 { libm::sqrtf(square) } else { 0.0 };
        let max = if free > limits.acceleration { limits.acceleration } else { free };
        let (rise, fall) = ((a + max) / jerk, max / jerk);
        let mut distance = rise * (v + rise * (0.5 * a - jerk * rise / 6.0));
        let mut speed = v + rise * (a - 0.5 * jerk * rise);
        if free > max {
            let hold = (square - max * max) / (jerk * max);
            distance += hold * (speed - 0.5 * max * hold);
            speed -= max * hold;
        }
        distance += fall * (speed - max * fall / 3.0);
        self.position + way * distance
    }

    /// The same with positions counted the other way where `way` is −1.
    fn mirrored(&self, way: f32) -> Self {
        Self { position: way * self.position, speed: way * self.speed, acceleration: way * self.acceleration }
    }

    /// The maximum acceleration of `low` to `high` after which it still stops before a target ahead. By halves: where
    /// the jerk turns over, how far short it stops has a kink that faster methods stumble over.
    fn still_stops(&self, target: f32, mut low: f32, mut high: f32, limits: &Limits) -> f32 {
        let stops = |a: f32| self.after(a).stop(limits) <= target;
        if stops(high) {
            return high;
        }
        for _ in 0..SEARCH_STEPS {
            let middle = 0.5 * (low + high);
            if stops(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

/// How fast a difference is made up, and by how much faster for each unit of it more: in proportion where it is small, and never
/// faster than half of the `limit` of how fast that may change can still end it: v² = a |x|. The other half is for the time that it takes
/// to build up.
fn made_up(difference: f32, per_s: f32, limit: f32) -> (f32, f32) {
    let max = libm::sqrtf(limit * difference.abs());
    if per_s * difference.abs() <= max {
        (per_s * difference, per_s)
    } else {
        (libm::copysignf(max, difference), 0.5 * max / difference.abs())
    }
}

/// Jerk-limited motion, time-optimal but for the tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Planner {
    now: Motion,
    /// Target (m).
    pub target_m: f32,
}

/// Set-point of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoint {
    /// Where the load is to be, and how it is to move.
    pub motion: Motion,
    /// How fast its acceleration changes (m/s³).
    pub jerk: f32,
    /// Whether the target is reached.
    pub done: bool,
}

impl SetPoint {
    /// At rest at its target (m).
    pub const fn at(position_m: f32) -> Self {
        Self { motion: Motion::at(position_m), jerk: 0.0, done: true }
    }
}

impl Planner {
    /// At rest at a position (m).
    pub const fn at(position_m: f32) -> Self {
        Self { now: Motion::at(position_m), target_m: position_m }
    }

    /// Speed of the set-point (m/s).
    pub fn speed_m_per_s(&self) -> f32 {
        self.now.speed
    }

    /// Present set-point of the load (m).
    pub fn set_point_m(&self) -> f32 {
        self.now.position
    }

    /// Whether the set-point stands at its target.
    pub fn is_at_rest(&self) -> bool {
        self.now == Motion::at(self.target_m)
    }

    /// Direction (±1) of a move that is about to leave rest; 0 under way and at the target.
    pub fn setting_out(&self) -> f32 {
        let at_rest = self.now.speed == 0.0 && self.now.acceleration == 0.0;
        if at_rest && self.target_m != self.now.position {
            libm::copysignf(1.0, self.target_m - self.now.position)
        } else {
            0.0
        }
    }

    /// The set-point of one tick without motion.
    pub fn wait(&self) -> SetPoint {
        SetPoint { done: self.is_at_rest(), ..SetPoint::at(self.now.position) }
    }

    /// At rest: goes on from another place (m), if that lies on the way.
    pub fn set_out_from(&mut self, position_m: f32) {
        let (low, high) = (self.now.position.min(self.target_m), self.now.position.max(self.target_m));
        self.now.position = position_m.clamp(low, high);
    }

    /// How long (s) until the set-point is at its target, at a speed (m/s) at most, before the move has begun. Where the motor
    /// limits the speed, the speed follows TR along the way, which no closed formula gives. So the way is divided into pieces;
    /// TR at the middle of each piece gives its speed limit and the twist at its end.
    pub fn time_to_target_s(&self, asked_m_per_s: f32, load: &LoadState<'_>) -> f32 {
        let distance_m = self.target_m - self.set_point_m();
        let direction = libm::copysignf(1.0, distance_m);
        let piece_m = distance_m.abs() / f32::from(PIECES);
        // What the strings pull on the way: they carry friction upwards, and friction carries the load downwards.
        let load_n = load.observation.mechanism_load_n + direction * load.observation.friction_n;
        let limits = |point: &Point| Limits::for_motor(asked_m_per_s, point, load_n, load.rig).0;
        let mut twist_rad = load.twist_rad;
        let mut point = load.observation.point;
        let first = limits(&point);
        let mut cruise_s = 0.0;
        for _ in 0..PIECES {
            let middle_rad = twist_rad + direction * 0.5 * piece_m * point.tr_rad_per_m();
            point = load.mechanism.at(load_n, middle_rad);
            twist_rad += direction * piece_m * point.tr_rad_per_m();
            cruise_s += piece_m / limits(&point).speed;
        }
        first.duration_from_s(direction * self.speed_m_per_s(), distance_m.abs(), cruise_s, &limits(&point))
    }

    /// Comes to rest as soon as the limits allow.
    pub fn brake(&mut self, limits: &Limits) {
        self.target_m = self.now.stop(limits);
    }

    /// One tick after a target that moves, and whether the speed limit holds it back. Speed, acceleration and jerk stay within
    /// their limits; the set-point comes to the target without an overshoot from wherever it is.
    pub fn follow(&mut self, target: &Motion, limits: &Limits) -> (SetPoint, bool) {
        let before = self.now;
        // The target is that of the end of the tick.
        let ahead = before.after(before.acceleration);
        let behind_m = target.position - ahead.position;
        // What the target's own acceleration leaves of the limit.
        let left = limits.acceleration - target.acceleration.abs();
        let (catches_up, per_s) = made_up(behind_m, FOLLOWS_PER_S, left.max(MIN_LEFT * limits.acceleration));
        let wanted = target.speed + catches_up;
        let held_back = wanted.abs() > limits.speed;
        let slower = wanted.clamp(-limits.speed, limits.speed) - ahead.speed;
        // How the wanted speed itself changes.
        let rises = target.acceleration + per_s * (target.speed - ahead.speed);
        let given = if held_back { 0.0 } else { rises };
        let wanted = given + made_up(slower, 3.0 * FOLLOWS_PER_S, limits.jerk).0;
        let within = wanted.max(before.keeps(-limits.speed, limits)).min(before.keeps(limits.speed, limits));
        let unit = limits.jerk * TICK_S;
        self.now = before.after(within.clamp(before.acceleration - unit, before.acceleration + unit));
        self.target_m = target.position;
        if target.speed == 0.0 {
            self.arrive(unit);
        }
        (self.set_point(before.acceleration), held_back)
    }

    /// After a tick that began with an acceleration.
    fn set_point(&self, before: f32) -> SetPoint {
        let jerk = (self.now.acceleration - before) / TICK_S;
        SetPoint { motion: self.now, jerk, done: self.is_at_rest() }
    }

    /// One tick.
    pub fn step(&mut self, limits: &Limits) -> SetPoint {
        if self.is_at_rest() {
            return SetPoint::at(self.now.position);
        }
        let before = self.now.acceleration;
        // Counted towards the target: both directions are alike, and the maximum acceleration is tried first.
        let way = libm::copysignf(1.0, self.target_m - self.now.position);
        let now = self.now.mirrored(way);
        let unit = limits.jerk * TICK_S;
        let within = |a: f32| a.clamp(now.acceleration - unit, now.acceleration + unit);
        let (high, low) = (within(now.keeps(limits.speed, limits)), within(now.keeps(-limits.speed, limits)));
        self.now = now.after(now.still_stops(way * self.target_m, low.min(high), high, limits)).mirrored(way);
        self.arrive(unit);
        self.set_point(before)
    }

    /// Stands at the target if it is nearer than half of what the jerk moves it by in a tick, in which the acceleration changes
    /// by `unit` (m/s²).
    fn arrive(&mut self, unit: f32) {
        let near = (self.target_m - self.now.position).abs() <= 0.5 * unit * TICK_S * TICK_S + f32::EPSILON;
        let slow = self.now.speed.abs() <= unit * TICK_S && self.now.acceleration.abs() <= 1.01 * unit;
        if near && slow {
            *self = Self::at(self.target_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_is_made_up_in_proportion_and_never_faster_than_half_of_the_limit_can_end_it() {
        // At 10/s and a limit of 0.4/s² the two meet at 0.4/10² = 4 mm.
        for difference in [1e-3f32, -2e-3, 3.99e-3, 4.01e-3, -0.02, 0.3] {
            let (speed, slope) = made_up(difference, 10.0, 0.4);
            let (small, large) = (10.0 * difference.abs(), libm::sqrtf(0.4 * difference.abs()));
            assert!((speed - libm::copysignf(small.min(large), difference)).abs() < 1e-7, "{difference}: {speed}");
            let [low, high] = [0.999, 1.001].map(|part| made_up(part * difference, 10.0, 0.4).0);
            assert!((slope * 0.002 * difference / (high - low) - 1.0).abs() < 1e-2, "{difference}: {slope}");
        }
    }
}
