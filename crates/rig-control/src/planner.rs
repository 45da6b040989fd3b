//! Motion: a ramp that respects speed and acceleration and can be told anything at any time, and the same ramp
//! smoothed over a fixed window, which limits the jerk.

use crate::TICK_S;

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

    /// Where it would come to rest if it braked now.
    pub fn stopping_point(&self, acceleration: f32) -> f32 {
        self.position + 0.5 * self.speed * self.speed.abs() / acceleration + 0.5 * self.speed * TICK_S
    }
}

/// Ticks of the smoothing window: 0.3 s, one period of the load on its strings at the heavy, deeply twisted end
/// (20 rad/s), so that a move does not set it swinging.
pub const WINDOW: usize = 30;

/// A ramp and its moving average.
#[derive(Clone, Copy, Debug)]
pub struct Planner {
    ramp: Ramp,
    window: [f32; WINDOW],
    next: usize,
    target: f32,
    settled_ticks: usize,
    set_point_m: f32,
}

/// What the planner wants now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoint {
    /// Position of the load (m).
    pub position_m: f32,
    /// Its speed (m/s).
    pub speed_m_per_s: f32,
    /// Whether the target is reached and the window empty.
    pub done: bool,
}

impl Planner {
    /// At rest at a position (m).
    pub const fn at(position_m: f32) -> Self {
        Self {
            ramp: Ramp::at(position_m),
            window: [position_m; WINDOW],
            next: 0,
            target: position_m,
            settled_ticks: WINDOW,
            set_point_m: position_m,
        }
    }

    /// Where it goes (m).
    pub fn target_m(&self) -> f32 {
        self.target
    }

    /// Where it wants the load now (m).
    pub fn set_point_m(&self) -> f32 {
        self.set_point_m
    }

    /// Goes somewhere else from here on.
    pub fn go_to(&mut self, target_m: f32) {
        self.target = target_m;
        self.settled_ticks = 0;
    }

    /// Comes to rest as soon as the acceleration allows.
    pub fn brake(&mut self, acceleration: f32) {
        self.go_to(self.ramp.stopping_point(acceleration));
    }

    /// One tick.
    pub fn step(&mut self, speed_limit_m_per_s: f32, acceleration_m_per_s2: f32) -> SetPoint {
        self.ramp.step(self.target, speed_limit_m_per_s, acceleration_m_per_s2);
        let oldest = core::mem::replace(&mut self.window[self.next], self.ramp.position);
        self.next = (self.next + 1) % WINDOW;
        let arrived = self.ramp == Ramp::at(self.target);
        self.settled_ticks = if arrived { (self.settled_ticks + 1).min(WINDOW) } else { 0 };
        let done = self.settled_ticks >= WINDOW;
        // Summed anew each tick: a running sum would keep its rounding errors for ever.
        let mean = self.window.iter().sum::<f32>() / WINDOW as f32;
        self.set_point_m = if done { self.target } else { mean };
        SetPoint {
            position_m: self.set_point_m,
            speed_m_per_s: (self.ramp.position - oldest) / (WINDOW as f32 * TICK_S),
            done,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn run(planner: &mut Planner, speed: f32, acceleration: f32) -> (f32, u32) {
        let (mut fastest, mut ticks) = (0f32, 0);
        loop {
            let s = planner.step(speed, acceleration);
            fastest = fastest.max(s.speed_m_per_s.abs());
            ticks += 1;
            if s.done || ticks > 100_000 {
                return (fastest, ticks);
            }
        }
    }

    #[test]
    fn a_move_arrives_in_the_time_its_limits_need() {
        let mut p = Planner::at(0.0);
        p.go_to(0.012);
        let (fastest, ticks) = run(&mut p, 0.002, 0.02);
        assert!(fastest <= 0.002 * 1.0001);
        // 6 s at speed, one ramp of 0.1 s, the window of 0.3 s.
        let seconds = ticks as f32 * TICK_S;
        assert!((6.35..6.5).contains(&seconds), "{seconds}");
        assert_eq!(p.step(0.002, 0.02).position_m, 0.012);
    }

    #[test]
    fn braking_stops_where_it_says_and_turning_round_works() {
        let mut p = Planner::at(0.0);
        p.go_to(0.02);
        for _ in 0..200 {
            p.step(0.004, 0.02);
        }
        p.brake(0.02);
        let stop = p.target_m();
        let (_, ticks) = run(&mut p, 0.004, 0.02);
        assert!(ticks < 70 && stop < 0.02);
        p.go_to(-0.001);
        run(&mut p, 0.004, 0.02);
        assert_eq!(p.step(0.004, 0.02).position_m, -0.001);
    }

    proptest! {
        #[test]
        fn any_command_respects_the_limits(
            targets in proptest::collection::vec((-0.05f32..0.05, 1u32..300), 1..8),
            speed in 1e-4f32..0.02,
            acceleration in 1e-3f32..0.1,
        ) {
            let mut p = Planner::at(0.0);
            let mut last = p.step(speed, acceleration);
            for (target, ticks) in targets {
                p.go_to(target);
                for _ in 0..ticks {
                    let s = p.step(speed, acceleration);
                    prop_assert!(s.speed_m_per_s.abs() <= speed * 1.001 + 1e-6);
                    // Averaged over the window, speed changes no faster than the ramp's.
                    prop_assert!((s.speed_m_per_s - last.speed_m_per_s).abs() <= acceleration * TICK_S * 1.01 + 2e-6);
                    prop_assert!((s.position_m - last.position_m).abs() <= speed * TICK_S * 1.01 + 1e-7);
                    last = s;
                }
            }
            let (_, ticks) = run(&mut p, speed, acceleration);
            prop_assert!(ticks < 100_000);
        }
    }
}
