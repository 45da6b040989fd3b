//! Motion under limits of speed and acceleration, for turning the strings. Target and limits may change at any time.

use crate::TICK_S;

/// Position and speed of a ramp. Unit-free: metres of load or radians of twist.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ramp {
    /// Where it is.
    pub position: f32,
    /// How fast it goes (per second).
    pub speed: f32,
}

/// Maximum speed in this tick from which a ramp still stops within a distance `left`: v²/2a + v·dt/2 = left, in whole ticks.
pub fn braking_speed(left: f32, acceleration: f32) -> f32 {
    let unit = acceleration * TICK_S;
    let brake = 0.5 * unit * (libm::sqrtf(1.0 + 8.0 * left / (unit * TICK_S)) - 1.0);
    brake.min(left / TICK_S)
}

impl Ramp {
    /// At rest.
    pub const fn at(position: f32) -> Self {
        Self { position, speed: 0.0 }
    }

    /// One tick towards `target`, at most `speed_limit`, changing speed by at most `acceleration`.
    pub fn step(&mut self, target: f32, speed_limit: f32, acceleration: f32) {
        let left = target - self.position;
        let unit = acceleration * TICK_S;
        let wanted = libm::copysignf(braking_speed(left.abs(), acceleration).min(speed_limit), left);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks until it stands at a target, and its maximum speed on the way.
    fn run(ramp: &mut Ramp, target: f32, speed: f32, acceleration: f32) -> (u16, f32) {
        let mut fastest = 0f32;
        for ticks in 1..10_000 {
            let before = ramp.speed;
            ramp.step(target, speed, acceleration);
            assert!((ramp.speed - before).abs() <= 1.001 * acceleration * TICK_S || *ramp == Ramp::at(target));
            fastest = fastest.max(ramp.speed.abs());
            if *ramp == Ramp::at(target) {
                return (ticks, fastest);
            }
        }
        panic!("{ramp:?} does not arrive at {target}");
    }

    #[test]
    fn a_ramp_takes_the_time_that_is_told() {
        for (distance, speed, acceleration) in
            [(10.0f32, 4.0f32, 25.0f32), (-10.0, 4.0, 25.0), (0.3, 16.0, 25.0), (40.0, 16.0, 500.0)]
        {
            let mut ramp = Ramp::at(2.0);
            let (ticks, fastest) = run(&mut ramp, 2.0 + distance, speed, acceleration);
            let (took_s, reported_s) = (TICK_S * f32::from(ticks), Ramp::duration_s(distance, speed, acceleration));
            assert!((took_s - reported_s).abs() < 2.5 * TICK_S, "{distance}: {took_s} s, told {reported_s} s");
            assert!(fastest <= 1.0001 * speed, "{fastest}");
        }
        assert_eq!(Ramp::duration_s(0.0, 1.0, 1.0), 0.0);
    }

    #[test]
    fn a_ramp_that_brakes_stops_where_it_says() {
        let mut ramp = Ramp::at(0.0);
        (0..30).for_each(|_| ramp.step(100.0, 8.0, 25.0));
        let stop = ramp.stopping_point(25.0);
        let (ticks, _) = run(&mut ramp, stop, 8.0, 25.0);
        // 7.5 rad/s at 25 rad/s² is 0.3 s.
        assert!((29..=33).contains(&ticks) && ramp.position == stop, "{ticks}");
        // It turns round without a jump.
        (0..30).for_each(|_| ramp.step(100.0, 8.0, 25.0));
        run(&mut ramp, -1.0, 8.0, 25.0);
    }
}
