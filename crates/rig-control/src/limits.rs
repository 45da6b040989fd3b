//! Limits of a move: speed, acceleration and jerk of the load that follow from the motor's limits at a transmission ratio
//! and a pull; and how long moves within them take.
//!
//! Tension and strain need no limit of their own: a solve past either is refused, so no table covers it, and neither
//! travel nor load leave the table.

use crate::RigConstants;
use rig_link::messages::{Limit, Setting};

/// Greatest speed that can be asked of the load (m/s); a setting may lower it.
pub const SPEED_MAX_M_PER_S: f32 = Setting::SpeedMax.spec().range[1];
/// Acceleration of the load (m/s²), unless the motor allows less.
pub const LOAD_ACCELERATION: f32 = 0.02;
/// Share of the motor's limits that moves are planned with; the rest is for the loop.
pub const PLANNED_SHARE: f32 = 0.9;
/// Least share of the motor's current that is taken to be left for accelerating.
const LEAST_SPARE: f32 = 0.1;

/// Shortest time (s) in which the planner reaches its acceleration: one period of the load on its strings at the heavy,
/// deeply twisted end (20 rad/s), so that a move does not set it swinging.
pub const RISE_S: f32 = 0.3;
/// Halvings of the search for the peak speed of a move that is too short for its speed: to a millionth of that speed.
const PEAK_STEPS: u8 = 20;

/// Limits of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Speed (m/s).
    pub speed: f32,
    /// Acceleration (m/s²).
    pub acceleration: f32,
    /// Jerk (m/s³).
    pub jerk: f32,
}

impl Limits {
    /// For a speed (m/s) and an acceleration (m/s²); the jerk is what keeps the load from swinging.
    pub fn new(speed: f32, acceleration: f32) -> Self {
        Self { speed, acceleration, jerk: acceleration / RISE_S }
    }

    /// Limits for a speed (m/s) that is asked for, at a transmission ratio (rad/m) and a pull (N), and which of the motor's
    /// limits holds the load back, if any does.
    pub fn for_motor(asked: f32, tr_rad_per_m: f32, pull_n: f32, rig: &RigConstants) -> (Self, Option<Limit>) {
        // Torque = pull/TR; what is left of the current is for accelerating.
        let torque_per_a = rig.motor_torque_constant_nm_per_a * rig.gear_ratio;
        let holding = pull_n / (tr_rad_per_m * torque_per_a * 1e-3 * f32::from(rig.current_limit_ma));
        let spare = (1.0 - holding).clamp(LEAST_SPARE, 1.0);
        let fastest = PLANNED_SHARE * rig.twist_speed_max() / tr_rad_per_m;
        let hardest = PLANNED_SHARE * spare * rig.twist_acceleration_max() / tr_rad_per_m;
        let limit = if hardest < LOAD_ACCELERATION && spare < PLANNED_SHARE {
            Some(Limit::MotorCurrent)
        } else if hardest < LOAD_ACCELERATION {
            Some(Limit::MotorAcceleration)
        } else if fastest < asked {
            Some(Limit::MotorSpeed)
        } else {
            None
        };
        (Self::new(asked.min(fastest), LOAD_ACCELERATION.min(hardest)), limit)
    }

    /// Shortest time (s) in which a speed changes by so much (m/s). The profile is symmetric, so the mean speed on the
    /// way is the mean of both ends.
    fn rise_s(&self, change: f32) -> f32 {
        let Self { acceleration, jerk, .. } = *self;
        let v = change.abs();
        if v * jerk < acceleration * acceleration {
            2.0 * libm::sqrtf(v / jerk)
        } else {
            v / acceleration + acceleration / jerk
        }
    }

    /// Shortest time (s) from rest to rest over a distance (m).
    pub fn duration_s(&self, distance_m: f32) -> f32 {
        let Self { speed, acceleration, jerk } = *self;
        let distance = distance_m.abs();
        let at_speed = distance - speed * self.rise_s(speed);
        if at_speed >= 0.0 {
            return 2.0 * self.rise_s(speed) + at_speed / speed;
        }
        // Greatest speed v: v · rise(v) = distance.
        let slow = libm::cbrtf(0.25 * distance * distance * jerk);
        let peak = if slow * jerk < acceleration * acceleration {
            slow
        } else {
            let half = 0.5 * acceleration * acceleration / jerk;
            libm::sqrtf(half * half + acceleration * distance) - half
        };
        2.0 * self.rise_s(peak)
    }

    /// Distance (m) from one speed (m/s) to another and then to rest.
    fn by_way_of(&self, from: f32, peak: f32) -> f32 {
        0.5 * (self.rise_s(peak - from) * (peak + from) + self.rise_s(peak) * peak)
    }

    /// Time (s) over a distance (m), beginning at a speed (m/s) and with these limits, ending at rest with the limits
    /// `last`. `cruise_s` is the time that the whole distance takes at the speed limits along it.
    pub fn duration_from_s(&self, from: f32, distance_m: f32, cruise_s: f32, last: &Self) -> f32 {
        // Forwards is towards the target, or the other way where the load passes the target and has to turn back.
        let forwards = if self.by_way_of(from, from.max(0.0)) > distance_m { -1.0 } else { 1.0 };
        let (from, distance) = (forwards * from, forwards * distance_m);
        let way = |to: f32| 0.5 * self.rise_s(to - from) * (to + from);
        if way(self.speed) + 0.5 * last.speed * last.rise_s(last.speed) <= distance {
            let begin_s = self.rise_s(self.speed - from) - way(self.speed) / self.speed;
            return cruise_s + begin_s + 0.5 * last.rise_s(last.speed);
        }
        if from == 0.0 {
            return self.duration_s(distance);
        }
        // Too short for its speed: the peak speed by halves.
        let (mut low, mut high) = (from.max(0.0), self.speed);
        for _ in 0..PEAK_STEPS {
            let middle = 0.5 * (low + high);
            if self.by_way_of(from, middle) > distance { high = middle } else { low = middle }
        }
        self.rise_s(low - from) + self.rise_s(low)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_motor_limits_a_move_by_ratio_and_pull() {
        let rig = RigConstants {
            gear_ratio: 60.0,
            counts_per_rad: 40_000.0,
            motor_speed_max_rad_per_s: 1000.0,
            motor_acceleration_max_rad_per_s2: 12_000.0,
            motor_torque_constant_nm_per_a: 0.02,
            current_limit_ma: 500,
            lvdt_gap_at_code_zero_m: 0.0,
            lvdt_metres_per_code: 5e-5,
            lvdt_curve: None,
            lvdt_gain: 1.0,
            lvdt_offset_m: 0.0,
            lvdt_linearity_m: 0.5e-3,
            lvdt_stroke_m: 0.2,
            drive_group: 0,
            drive_number: 1,
            supply_limits_v: [20.0, 28.0],
            supply_divider: None,
        };
        let (easy, none) = Limits::for_motor(0.002, 2000.0, 5.0, &rig);
        assert_eq!((easy, none), (Limits::new(0.002, LOAD_ACCELERATION), None));
        let (fast, limit) = Limits::for_motor(0.02, 2000.0, 5.0, &rig);
        assert!(limit == Some(Limit::MotorSpeed) && (fast.speed / 0.0075 - 1.0).abs() < 1e-5, "{fast:?}");
        let (steep, limit) = Limits::for_motor(1e-4, 20_000.0, 5.0, &rig);
        assert!(limit == Some(Limit::MotorAcceleration) && steep.acceleration < 0.009, "{steep:?}");
        // 0.6 N m is what half an ampere gives: 540 N at 1000 rad/m leaves a tenth.
        let (heavy, limit) = Limits::for_motor(0.002, 1000.0, 560.0, &rig);
        assert!(limit == Some(Limit::MotorCurrent) && (heavy.acceleration / 0.018 - 1.0).abs() < 1e-3, "{heavy:?}");
    }
}
