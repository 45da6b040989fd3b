//! Motion. [`Ramp`] respects speed and acceleration, for turning the strings; [`Planner`] limits the jerk too, for moving
//! the load. Target and limits of both may change at any time: each tick is planned from the present motion.

use crate::TICK_S;
use crate::limits::Limits;

/// Position and speed of a ramp. Unit-free: metres of load or radians of twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    /// Where it is.
    pub position: f32,
    /// How fast it goes (per second).
    pub speed: f32,
}

impl Ramp {
    /// At rest.
    pub const fn at(position: f32) -> Self {
        Self { position, speed: 0.0 }
    }

    /// One tick towards `target`, at most `speed_limit`, changing speed by at most `acceleration`.
    pub fn step(&mut self, target: f32, speed_limit: f32, acceleration: f32) {
        let left = target - self.position;
        // Largest whole-tick speed from which the ramp still stops at the target: v²/2a + v·dt/2 = |left|.
        let unit = acceleration * TICK_S;
        let brake = 0.5 * unit * (libm::sqrtf(1.0 + 8.0 * left.abs() / (unit * TICK_S)) - 1.0);
        let wanted = libm::copysignf(brake.min(speed_limit).min(left.abs() / TICK_S), left);
        self.speed += (wanted - self.speed).clamp(-unit, unit);
        self.position += self.speed * TICK_S;
        if (target - self.position).abs() <= 1e-6 * unit * TICK_S + f32::EPSILON * target.abs()
            && self.speed.abs() <= unit
        {
            *self = Self::at(target);
        }
    }

    /// Shortest time (s) from rest to rest over a distance, tick by tick.
    pub fn duration_s(distance: f32, speed_limit: f32, acceleration: f32) -> f32 {
        let distance = distance.abs();
        let at_speed = distance - speed_limit * speed_limit / acceleration;
        let moving_s = if at_speed >= 0.0 {
            2.0 * speed_limit / acceleration + at_speed / speed_limit
        } else {
            2.0 * libm::sqrtf(distance / acceleration)
        };
        if distance > 0.0 { moving_s + TICK_S } else { 0.0 }
    }

    /// Where it would come to rest if it braked now.
    pub fn stopping_point(&self, acceleration: f32) -> f32 {
        self.position + 0.5 * self.speed * self.speed.abs() / acceleration + 0.5 * self.speed * TICK_S
    }
}

/// Gains (1/s) by which a set-point follows a target that moves: of position, speed and acceleration, each two and more times as
/// fast as the one before.
const FOLLOWS_PER_S: [f32; 3] = [12.0, 30.0, 60.0];
/// Distance (m) and speed (m/s) within which a set-point stands at a target that stands.
const STANDS_M: f32 = 1e-6;
const STANDS_M_PER_S: f32 = 20e-6;

/// Steps of the search for the acceleration that just still stops at the target.
const SEARCH_STEPS: u8 = 7;
/// Position, speed and acceleration of the set-point.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Motion {
    position: f32,
    speed: f32,
    acceleration: f32,
}

impl Motion {
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
        let most = if free > limits.acceleration { limits.acceleration } else { free };
        let (rise, fall) = ((a + most) / jerk, most / jerk);
        let mut distance = rise * (v + rise * (0.5 * a - jerk * rise / 6.0));
        let mut speed = v + rise * (a - 0.5 * jerk * rise);
        if free > most {
            let hold = (square - most * most) / (jerk * most);
            distance += hold * (speed - 0.5 * most * hold);
            speed -= most * hold;
        }
        distance += fall * (speed - most * fall / 3.0);
        self.position + way * distance
    }

    /// The same with positions counted the other way where `way` is −1.
    fn mirrored(&self, way: f32) -> Self {
        Self { position: way * self.position, speed: way * self.speed, acceleration: way * self.acceleration }
    }

    /// The greatest acceleration of `low` to `high` after which it still stops before a target ahead. By halves: where
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

/// Jerk-limited motion, time-optimal but for the tick.
#[derive(Clone, Copy, Debug)]
pub struct Planner {
    now: Motion,
    target: f32,
}

/// A target that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingTarget {
    /// Where it is (m).
    pub position_m: f32,
    /// How fast it moves (m/s).
    pub speed_m_per_s: f32,
    /// How fast that changes (m/s²).
    pub acceleration_m_per_s2: f32,
}

/// Set-point of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoint {
    /// Position of the load (m).
    pub position_m: f32,
    /// Its speed (m/s).
    pub speed_m_per_s: f32,
    /// Its acceleration (m/s²) and jerk (m/s³).
    pub acceleration_m_per_s2: f32,
    /// Its jerk (m/s³).
    pub jerk_m_per_s3: f32,
    /// Whether the target is reached.
    pub done: bool,
}

impl SetPoint {
    /// At rest at its target (m).
    pub const fn at(position_m: f32) -> Self {
        Self { position_m, speed_m_per_s: 0.0, acceleration_m_per_s2: 0.0, jerk_m_per_s3: 0.0, done: true }
    }
}

impl Planner {
    /// At rest at a position (m).
    pub const fn at(position_m: f32) -> Self {
        Self { now: Motion { position: position_m, speed: 0.0, acceleration: 0.0 }, target: position_m }
    }

    /// Target (m).
    pub fn target_m(&self) -> f32 {
        self.target
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
        self.now == Self::at(self.target).now
    }

    /// Direction (±1) of a move that is about to leave rest; 0 under way and at the target.
    pub fn setting_out(&self) -> f32 {
        let at_rest = self.now.speed == 0.0 && self.now.acceleration == 0.0;
        if at_rest && self.target != self.now.position {
            libm::copysignf(1.0, self.target - self.now.position)
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
        let (low, high) = (self.now.position.min(self.target), self.now.position.max(self.target));
        self.now.position = position_m.clamp(low, high);
    }

    /// Sets another target (m).
    pub fn go_to(&mut self, target_m: f32) {
        self.target = target_m;
    }

    /// Comes to rest as soon as the limits allow.
    pub fn brake(&mut self, limits: &Limits) {
        self.go_to(self.now.stop(limits));
    }

    /// One tick after a target that moves, and whether the speed limit holds it back. Speed, acceleration and jerk stay within
    /// their limits; the set-point comes to the target without an overshoot from wherever it is.
    pub fn follow(&mut self, target: &MovingTarget, limits: &Limits) -> (SetPoint, bool) {
        let before = self.now;
        let [of_position, of_speed, of_acceleration] = FOLLOWS_PER_S;
        // The target is that of the end of the tick.
        let ahead = before.after(before.acceleration);
        let behind = target.position_m - ahead.position;
        // Half of the acceleration is for braking, the rest for the time that it takes to build up: v² = a |x|.
        let brakes_from = libm::sqrtf(limits.acceleration * behind.abs());
        let wanted = target.speed_m_per_s + (of_position * behind).clamp(-brakes_from, brakes_from);
        let held_back = wanted.abs() > limits.speed;
        let given = if held_back { 0.0 } else { target.acceleration_m_per_s2 };
        let wanted = given + of_speed * (wanted.clamp(-limits.speed, limits.speed) - ahead.speed);
        let wanted = before.acceleration + of_acceleration * TICK_S * (wanted - before.acceleration);
        let within = wanted.max(before.keeps(-limits.speed, limits)).min(before.keeps(limits.speed, limits));
        let unit = limits.jerk * TICK_S;
        self.now = before.after(within.clamp(before.acceleration - unit, before.acceleration + unit));
        self.target = target.position_m;
        let near = behind.abs() < STANDS_M && self.now.speed.abs() < STANDS_M_PER_S;
        if near && target.speed_m_per_s == 0.0 {
            *self = Self::at(target.position_m);
        }
        (self.set_point(before.acceleration), held_back)
    }

    /// After a tick that began with an acceleration.
    fn set_point(&self, before: f32) -> SetPoint {
        let Motion { position, speed, acceleration } = self.now;
        SetPoint {
            position_m: position,
            speed_m_per_s: speed,
            acceleration_m_per_s2: acceleration,
            jerk_m_per_s3: (acceleration - before) / TICK_S,
            done: self.is_at_rest(),
        }
    }

    /// One tick.
    pub fn step(&mut self, limits: &Limits) -> SetPoint {
        if self.is_at_rest() {
            return SetPoint::at(self.now.position);
        }
        let before = self.now.acceleration;
        // Counted towards the target: both directions are alike, and the greatest acceleration is tried first.
        let way = libm::copysignf(1.0, self.target - self.now.position);
        let now = self.now.mirrored(way);
        let unit = limits.jerk * TICK_S;
        let within = |a: f32| a.clamp(now.acceleration - unit, now.acceleration + unit);
        let (high, low) = (within(now.keeps(limits.speed, limits)), within(now.keeps(-limits.speed, limits)));
        self.now = now.after(now.still_stops(way * self.target, low.min(high), high, limits)).mirrored(way);
        // Nearer than half of what the jerk moves it by in a tick: it has arrived.
        let near = (self.target - self.now.position).abs() <= 0.5 * unit * TICK_S * TICK_S + f32::EPSILON;
        let slow = self.now.speed.abs() <= unit * TICK_S && self.now.acceleration.abs() <= 1.01 * unit;
        if near && slow {
            *self = Self::at(self.target);
        }
        self.set_point(before)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;

    const TICK: f64 = TICK_S as f64;
    /// Time (s) in which the acceleration rises and falls again.
    const RISE_S: f32 = 0.2;

    fn run(planner: &mut Planner, limits: &Limits) -> (f32, u32) {
        let (mut fastest, mut ticks) = (0f32, 0);
        loop {
            let s = planner.step(limits);
            fastest = fastest.max(s.speed_m_per_s.abs());
            ticks += 1;
            if s.done || ticks > 100_000 {
                return (fastest, ticks);
            }
        }
    }

    /// The time-optimal profile under limits of speed, acceleration and jerk, by its seven segments in f64: how far the
    /// bang-bang jerk goes for a peak speed, and the peak speed for a distance by bisection.
    fn optimum_s(distance: f64, l: &Limits) -> f64 {
        let (speed, acceleration, jerk) = (f64::from(l.speed), f64::from(l.acceleration), f64::from(l.jerk));
        let segments = |peak: f64| {
            let rise = (peak / jerk).sqrt().min(acceleration / jerk);
            (rise, (peak / (jerk * rise) - rise).max(0.0))
        };
        let way_up = |peak: f64| {
            let (rise, hold) = segments(peak);
            // Integrated segment by segment: +jerk, none, -jerk.
            let (mut p, mut v, mut a) = (0.0, 0.0, 0.0);
            for (j, t) in [(jerk, rise), (0.0, hold), (-jerk, rise)] {
                p += v * t + a * t * t / 2.0 + j * t * t * t / 6.0;
                v += a * t + j * t * t / 2.0;
                a += j * t;
            }
            assert!((v - peak).abs() < 1e-12 && a.abs() < 1e-12);
            (p, 2.0 * rise + hold)
        };
        let (mut low, mut high) = (1e-9, speed);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if 2.0 * way_up(middle).0 < distance { low = middle } else { high = middle }
        }
        let (way, time) = way_up(low);
        2.0 * time + (distance - 2.0 * way).max(0.0) / low
    }

    #[test]
    fn a_move_takes_the_shortest_time_that_its_limits_allow() {
        let mut worst = 0f64;
        for (distance, speed, acceleration) in [
            (0.012f32, 0.002f32, 0.02f32),
            (0.012, 0.006, 0.02),
            (0.012, 0.05, 0.02),
            (0.001, 0.002, 0.02),
            (0.0005, 0.002, 0.02),
            (0.003, 0.01, 0.005),
            (-0.01, 0.003, 0.1),
        ] {
            let limits = Limits::new(speed, acceleration, RISE_S);
            let mut p = Planner::at(0.0);
            p.go_to(distance);
            let (fastest, ticks) = run(&mut p, &limits);
            let optimum = optimum_s(f64::from(distance.abs()), &limits);
            let seconds = f64::from(ticks) * TICK;
            assert!(fastest <= speed * 1.001, "{fastest}");
            assert!((f64::from(limits.duration_s(distance)) / optimum - 1.0).abs() < 1e-3, "{distance}");
            assert!(
                seconds > optimum - 1.5 * TICK && seconds < 1.05 * optimum,
                "{distance}: {seconds} s of {optimum} s"
            );
            assert_eq!(p.step(&limits).position_m, distance);
            worst = worst.max(seconds / optimum);
        }
        std::println!("worst: {worst:.4} of the optimum");
    }

    #[test]
    fn the_time_from_under_way_is_known() {
        let limits = Limits::new(0.002, 0.02, RISE_S);
        for target in [0.02f32, 0.006, 0.0042, 0.0040, 0.001, -0.004] {
            let mut p = Planner::at(0.0);
            p.go_to(0.02);
            for _ in 0..220 {
                p.step(&limits);
            }
            let way = target - p.set_point_m();
            p.go_to(target);
            let sign = way.signum();
            let expected =
                limits.duration_from_s(sign * p.speed_m_per_s(), way.abs(), way.abs() / limits.speed, &limits);
            let took = run(&mut p, &limits).1 as f32 * TICK_S;
            std::println!("{target} m: {expected:.3} s expected, {took:.3} s taken");
            assert!((expected - took).abs() < 0.05, "{target}: {expected} s expected, {took} s taken");
        }
    }

    #[test]
    fn braking_stops_where_it_says_and_turning_round_works() {
        let limits = Limits::new(0.004, 0.02, RISE_S);
        let mut p = Planner::at(0.0);
        p.go_to(0.02);
        for _ in 0..200 {
            p.step(&limits);
        }
        p.brake(&limits);
        let stop = p.target_m();
        let (_, ticks) = run(&mut p, &limits);
        assert!(ticks < 70 && stop < 0.02 && p.set_point_m() == stop);
        p.go_to(-0.001);
        run(&mut p, &limits);
        assert_eq!(p.step(&limits).position_m, -0.001);
    }

    #[test]
    fn a_stream_is_followed_within_micrometres_and_a_jump_without_overshoot() {
        let limits = Limits::new(0.008, 0.08, RISE_S);
        let (mut p, omega) = (Planner::at(0.0), core::f32::consts::TAU);
        let mut most = 0f32;
        for k in 1u16..400 {
            let t = f32::from(k) * TICK_S;
            // 1 mm at 1 Hz, from rest.
            let rise = (t / 1.0).min(1.0);
            let target = MovingTarget {
                position_m: 1e-3 * rise * libm::sinf(omega * t),
                speed_m_per_s: 1e-3 * rise * omega * libm::cosf(omega * t),
                acceleration_m_per_s2: -1e-3 * rise * omega * omega * libm::sinf(omega * t),
            };
            let (s, held_back) = p.follow(&target, &limits);
            if t > 1.5 {
                most = most.max((s.position_m - target.position_m).abs());
                assert!(!held_back);
            }
        }
        assert!(most < 25e-6, "{most}");
        let stands = MovingTarget { position_m: 5e-3, speed_m_per_s: 0.0, acceleration_m_per_s2: 0.0 };
        let mut p = Planner::at(0.0);
        let ticks = (0..400).take_while(|_| {
            let (s, _) = p.follow(&stands, &limits);
            assert!(s.position_m < 5e-3 + 20e-6 && s.speed_m_per_s < 0.008 * 1.01, "{s:?}");
            !s.done
        });
        assert!(ticks.count() < 200, "it arrives, and stands");
        assert!(p.is_at_rest());
    }

    proptest! {
        #[test]
        fn a_stream_of_whatever_is_followed_within_the_limits(
            targets in proptest::collection::vec((-0.02f32..0.02, -0.05f32..0.05, 1u32..60), 1..10),
            speed in 1e-3f32..0.02,
        ) {
            let limits = Limits::new(speed, 2.0 * speed / RISE_S, RISE_S);
            let mut p = Planner::at(0.0);
            let (mut last_speed, mut last_rise) = (0.0, 0.0);
            for (position_m, speed_m_per_s, ticks) in targets {
                let mut target = MovingTarget { position_m, speed_m_per_s, acceleration_m_per_s2: 0.0 };
                for _ in 0..ticks {
                    target.position_m += TICK_S * speed_m_per_s;
                    let (s, _) = p.follow(&target, &limits);
                    prop_assert!(s.speed_m_per_s.abs() <= 1.05 * speed, "{s:?}");
                    let rise = (s.speed_m_per_s - last_speed) / TICK_S;
                    prop_assert!(s.acceleration_m_per_s2.abs() <= limits.acceleration * 1.001);
                    prop_assert!(s.done || (rise - last_rise).abs() <= 2.0 * limits.jerk * TICK_S * 1.05 + 4e-3);
                    (last_speed, last_rise) = (s.speed_m_per_s, if s.done { 0.0 } else { rise });
                }
            }
        }

        #[test]
        fn any_command_respects_the_limits(
            targets in proptest::collection::vec((-0.05f32..0.05, 1u32..300), 1..8),
            speed in 1e-4f32..0.02,
            acceleration in 1e-3f32..0.1,
        ) {
            // As `Limits::for_motor` makes them: no more acceleration than gets up to speed in the rise time.
            let limits = Limits::new(speed, acceleration.min(2.0 * speed / RISE_S), RISE_S);
            let mut p = Planner::at(0.0);
            let mut last = p.step(&limits);
            let mut last_rise = 0.0;
            for (target, ticks) in targets {
                p.go_to(target);
                for _ in 0..ticks {
                    let s = p.step(&limits);
                    prop_assert!(s.speed_m_per_s.abs() <= speed * 1.001 + 1e-6);
                    let rise = (s.speed_m_per_s - last.speed_m_per_s) / TICK_S;
                    prop_assert!(rise.abs() <= acceleration * 1.01 + 2e-4, "{rise}");
                    // Twice what the jerk allows in a tick, half as much again where it has just arrived and sets out anew.
                    prop_assert!((rise - last_rise).abs() <= 2.5 * limits.jerk * TICK_S * 1.05 + 4e-4);
                    prop_assert!((s.position_m - last.position_m).abs() <= speed * TICK_S * 1.01 + 1e-7);
                    (last, last_rise) = (s, rise);
                }
            }
            let (_, ticks) = run(&mut p, &limits);
            prop_assert!(ticks < 100_000);
        }

        /// Limits that fall under way, as they do where TR rises, are met as soon as the jerk allows.
        #[test]
        fn limits_may_change_under_way(fall in 0.2f32..1.0, at in 1u32..250) {
            let mut p = Planner::at(0.0);
            p.go_to(0.02);
            let (before, after) = (Limits::new(0.006, 0.02, RISE_S), Limits::new(0.006 * fall, 0.02, RISE_S));
            for _ in 0..at {
                p.step(&before);
            }
            let soon = (0.006 / 0.02 + RISE_S) / TICK_S;
            for tick in 0..4000 {
                let s = p.step(&after);
                prop_assert!(tick < soon as u32 || s.speed_m_per_s <= after.speed * 1.001);
                prop_assert!(s.position_m <= 0.02 + 1e-6);
            }
            prop_assert_eq!(p.set_point_m(), 0.02);
        }
    }
}
