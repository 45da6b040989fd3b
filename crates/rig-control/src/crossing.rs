//! Across the friction band: before a load that last moved the other way can move, the strings' pull has to go from
//! W ∓ f to W ± f.
//!
//! How far that is in twist is roughly known, and is turned at once instead of being left to the error to build up. A
//! move that sets out waits for it with its set-point where it is: the rest of the way is crept along until the load is
//! seen to move, because a table that is off by a hair of the gap is off by a tenth of a light load's pull.

use crate::TICK_S;
use crate::mechanism::Mechanism;
use crate::observer::Observation;
use crate::planner::{Ramp, SetPoint};

/// Share of the way that is turned ahead, as a move begins and at rest: what friction is wrong by must not push the load,
/// least of all back and forth about its target.
const SHARE: [f32; 2] = [0.95, 0.8];
/// Share of that under a light load, whose band is known to a sixth only: the rest is crept.
const LIGHT_SHARE: f32 = 0.92;
/// Set-point speed (m/s) that is a move and not the last rounding of one.
const MOVING_M_PER_S: f32 = 8e-6;
/// Smoothed error (m) at rest that friction must be crossed for.
const STUCK_M: f32 = 20e-6;
/// Share of the motor's speed and acceleration for that; the rest is the move's.
const LIMITS_SHARE: f32 = 0.7;
/// Speed of the load (m/s) that the strings creep by in the end, unless the move is slower.
const CREEP_M_PER_S: f32 = 1e-3;
/// Farthest that they creep: in gap (m) and as a share of the friction band.
const CREEP_M: f32 = 0.1e-3;
const CREEP_BAND: f32 = 0.5;
/// Friction as a share of the load above which they creep at all: under a light load the pull is known too badly.
const CREEP_FRICTION: f32 = 0.15;
/// Motion (m) that is no noise: four times that of two LVDT blocks at their worst.
const MOVED_M: f32 = 20e-6;
/// Readings before that can be told.
const LEAST_READINGS: f32 = 4.0;

/// Limits of the twist: speed (rad/s) and acceleration (rad/s²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwistLimits {
    /// Greatest speed (rad/s).
    pub speed: f32,
    /// Greatest acceleration (rad/s²).
    pub acceleration: f32,
}

/// What a load that is still stuck looked like.
#[derive(Clone, Copy, Debug)]
struct Watch {
    sum_m: f32,
    count: f32,
    last_m: f32,
    creep_left_rad: f32,
}

impl Watch {
    const NEW: Self = Self { sum_m: 0.0, count: 0.0, last_m: 0.0, creep_left_rad: 0.0 };

    /// Whether the load has moved this way; takes in one position (m).
    fn moved(&mut self, way: f32, position_m: f32) -> bool {
        let recent_m = 0.5 * (self.last_m + position_m);
        let moved = self.count >= LEAST_READINGS && way * (recent_m - self.sum_m / self.count) > MOVED_M;
        self.sum_m += position_m;
        self.count += 1.0;
        self.last_m = position_m;
        moved
    }
}

/// State of the crossing.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Twist ahead of the set-point (rad).
    ramp: Ramp,
    end_rad: f32,
    /// Sign of the move for which it was last set.
    direction: f32,
    /// The twist for that move has been worked out.
    planned: bool,
    watch: Watch,
    /// The load waits for the crossing.
    waiting: bool,
    /// What is left of the planned part (s).
    left_s: f32,
}

impl Default for Crossing {
    fn default() -> Self {
        Self {
            ramp: Ramp::at(0.0),
            end_rad: 0.0,
            direction: 0.0,
            planned: true,
            watch: Watch::NEW,
            waiting: false,
            left_s: 0.0,
        }
    }
}

impl Crossing {
    /// A move sets out from rest, and has to wait.
    pub fn set_out(&mut self, way: f32) {
        self.turn(way);
        self.waiting = way != 0.0;
        self.watch = Watch::NEW;
    }

    /// Whether a move that has set out still waits.
    pub fn is_waiting(&self) -> bool {
        self.waiting
    }

    /// How long it still waits (s), as planned.
    pub fn left_s(&self) -> f32 {
        self.left_s
    }

    fn turn(&mut self, direction: f32) {
        self.direction = direction;
        self.end_rad = self.ramp.position;
        self.planned = direction == 0.0;
        self.left_s = 0.0;
    }

    /// Twist speed (rad/s) that the crossing takes in this tick. `setting_out` is the speed (m/s) of a move that
    /// has not begun, `error_m` the smoothed one.
    #[allow(clippy::too_many_arguments)]
    pub fn step(
        &mut self,
        set_point: &SetPoint,
        setting_out: Option<f32>,
        position_m: f32,
        error_m: f32,
        seen: &Observation,
        mechanism: &Mechanism<'_>,
        twist_rad: f32,
        limits: &TwistLimits,
    ) -> f32 {
        self.waiting &= setting_out.is_some();
        let (wanted, share) = match (set_point.speed_m_per_s, error_m) {
            (v, _) if v.abs() > MOVING_M_PER_S => (v, SHARE[0]),
            // About to begin or to end.
            _ if !set_point.done => (self.direction, SHARE[0]),
            (_, e) if e.abs() > STUCK_M => (e, SHARE[1]),
            _ => (0.0, 0.0),
        };
        let direction = if wanted == 0.0 { 0.0 } else { libm::copysignf(1.0, wanted) };
        let fast = Ramp { position: LIMITS_SHARE * limits.speed, speed: LIMITS_SHARE * limits.acceleration };
        if direction != self.direction {
            self.turn(direction);
        }
        if !core::mem::replace(&mut self.planned, true) {
            self.plan(share, seen, mechanism, twist_rad);
            self.left_s = Ramp::duration_s(self.end_rad - self.ramp.position, fast.position, fast.speed);
        }
        self.left_s = (self.left_s - TICK_S).max(0.0);
        let before_rad = self.ramp.position;
        self.ramp.step(self.end_rad, fast.position, fast.speed);
        let mut travelled = self.ramp.position - before_rad;
        if self.ramp.speed == 0.0 {
            self.ramp = Ramp::at(0.0);
            self.end_rad = 0.0;
        }
        if let (true, Some(asked_m_per_s)) = (self.waiting, setting_out) {
            if self.watch.moved(direction, position_m) {
                self.end_rad = self.ramp.stopping_point(fast.speed);
                self.waiting = false;
            } else if self.ramp.speed == 0.0 {
                self.waiting = self.watch.creep_left_rad > 0.0;
                if self.waiting {
                    let creep = seen.point.tr_rad_per_m() * asked_m_per_s.min(CREEP_M_PER_S) * TICK_S;
                    self.watch.creep_left_rad -= creep;
                    travelled += direction * creep;
                }
            }
        }
        travelled / TICK_S
    }

    /// Works out how far it is.
    fn plan(&mut self, share: f32, seen: &Observation, mechanism: &Mechanism<'_>, twist_rad: f32) {
        let (direction, friction_n) = (self.direction, seen.friction_n);
        // Twisted this far, the same gap goes with the pull at the other end.
        let end = mechanism.at(seen.load_n + direction * friction_n, twist_rad);
        let band_m = 2.0 * friction_n * end.dgap_dload_m_per_n.max(seen.point.dgap_dload_m_per_n);
        let tr = end.tr_rad_per_m();
        let light = friction_n > CREEP_FRICTION * seen.load_n;
        let (share, creep_m) = if light { (share * LIGHT_SHARE, CREEP_M + CREEP_BAND * band_m) } else { (share, 0.0) };
        self.watch.creep_left_rad = tr * creep_m;
        // Against the move it may only be stopped: there the pull is already past the end of the band.
        if direction * (seen.load_n + direction * friction_n - seen.pull_n) > 0.0 {
            let missing_m = (end.gap_m - seen.modelled_gap_m) * direction;
            self.end_rad += share * direction * tr * missing_m.clamp(0.0, 1.25 * band_m);
        }
    }
}
