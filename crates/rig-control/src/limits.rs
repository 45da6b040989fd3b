//! Limits of a move: speed, acceleration and jerk of the load that follow from the motor's limits at a transmission ratio
//! and a pull; and how long moves within them take.
//!
//! Tension and strain need no limit of their own: a solve past either is refused, so no table covers it, and neither
//! travel nor load leave the table.

use crate::RigConstants;
use rig_link::STANDARD_GRAVITY;
use rig_link::messages::Limit;
use tsa_table::Point;

/// Fraction of the motor's acceleration that moves are planned with: where the acceleration of the load turns over, the strings
/// change their speed all at once.
const ACCELERATION_FRACTION: f32 = 0.5;
/// Minimum fraction of the motor's current that is taken to be left for accelerating.
const MIN_SPARE: f32 = 0.1;
/// Minimum time (s) in which a move gets up to its speed, and the same in 1/ω of the load's oscillation.
const RISE_S: f32 = 0.09;
const RISE_OSCILLATIONS: f32 = 4.0;
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

/// Time (s) in which a move gets up to its speed under a load (N) where the gap grows with the load by so much (m/N): so long that
/// the load hardly oscillates.
pub fn rise_s(load_n: f32, dgap_dload_m_per_n: f32) -> f32 {
    // ω² = k/m, k = 1/(∂G/∂F), m = F/g.
    let frequency = libm::sqrtf(STANDARD_GRAVITY as f32 / (load_n * dgap_dload_m_per_n));
    RISE_S.max(RISE_OSCILLATIONS / frequency)
}

impl Limits {
    /// For a speed (m/s), an acceleration (m/s²), and the time (s) that the acceleration takes to rise and to fall again.
    pub fn new(speed: f32, acceleration: f32, rise_s: f32) -> Self {
        Self { speed, acceleration, jerk: 2.0 * acceleration / rise_s }
    }

    /// Limits for a speed (m/s) that is asked for, where the mechanism is at a point and pulls a load (N), and which of the
    /// motor's limits holds the load back, if any does.
    pub fn for_motor(asked: f32, point: &Point, pull_n: f32, rig: &RigConstants) -> (Self, Option<Limit>) {
        let tr_rad_per_m = point.tr_rad_per_m();
        // Torque = pull/TR; what is left of the current is for accelerating.
        let torque_per_a = rig.motor_torque_constant_nm_per_a * rig.gear_ratio;
        let holding = pull_n / (tr_rad_per_m * torque_per_a * 1e-3 * f32::from(rig.current_limit_ma));
        let spare = (1.0 - holding).clamp(MIN_SPARE, 1.0);
        let fastest = rig.twist_speed_max() / tr_rad_per_m;
        let unloaded = ACCELERATION_FRACTION * rig.twist_limits().acceleration / tr_rad_per_m;
        let hardest = spare * unloaded;
        let speed = asked.min(fastest);
        let rise_s = rise_s(pull_n, point.dgap_dload_m_per_n);
        let enough = 2.0 * speed / rise_s;
        let limit = if hardest < enough && unloaded >= enough {
            Some(Limit::MotorCurrent)
        } else if fastest < asked {
            Some(Limit::MotorSpeed)
        } else if hardest < enough {
            Some(Limit::MotorAcceleration)
        } else {
            None
        };
        (Self::new(speed, enough.min(hardest), rise_s), limit)
    }

    /// Way (m) on which a speed (m/s) is braked to rest.
    pub fn stopping_m(&self, speed: f32) -> f32 {
        0.5 * speed * self.rise_s(speed)
    }

    /// The same, with no more acceleration and jerk than where the load will come to rest: on the way down TR rises while the
    /// load is braked.
    #[must_use]
    pub fn braking_into(self, rest: &Self) -> Self {
        Self { acceleration: self.acceleration.min(rest.acceleration), jerk: self.jerk.min(rest.jerk), ..self }
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

    /// Time (s) over a distance (m), beginning at a speed (m/s) and with these limits, ending at rest with the limits
    /// `last`. `cruise_s` is the time that the whole distance takes at the speed limits along it.
    pub fn duration_from_s(&self, from: f32, distance_m: f32, cruise_s: f32, last: &Self) -> f32 {
        // Forwards is towards the target, or the other way where the load passes the target and has to turn back.
        let forwards = if self.stopping_m(from) > distance_m { -1.0 } else { 1.0 };
        let (from, distance) = (forwards * from, forwards * distance_m);
        let way = |to: f32| 0.5 * self.rise_s(to - from) * (to + from);
        if way(self.speed) + last.stopping_m(last.speed) <= distance {
            let begin_s = self.rise_s(self.speed - from) - way(self.speed) / self.speed;
            return forwards * cruise_s + begin_s + 0.5 * last.rise_s(last.speed);
        }
        // Too short for its speed: the peak speed by halves.
        let (mut low, mut high) = (from.max(0.0), self.speed);
        for _ in 0..PEAK_STEPS {
            let middle = 0.5 * (low + high);
            if way(middle) + self.stopping_m(middle) > distance { high = middle } else { low = middle }
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
            motor_speed_max_rad_per_s: 1000.0,
            motor_torque_constant_nm_per_a: 0.02,
            motor_resistance_ohm: 10.0,
            ..crate::constants::tests::RIG
        };
        // Half a kilogram on 1 N/mm swings at 44 rad/s.
        let at = |tr_rad_per_m: f32| Point {
            gap_m: 0.1,
            dgap_dtwist_m_per_rad: -1.0 / tr_rad_per_m,
            dgap_dload_m_per_n: 1e-3,
        };
        let (easy, none) = Limits::for_motor(0.002, &at(2000.0), 5.0, &rig);
        let rise = 4.0 / (9.80665f32 / 5e-3).sqrt();
        assert!(none.is_none() && (easy.acceleration * rise / 0.004 - 1.0).abs() < 1e-5, "{easy:?} {none:?}");
        assert!((easy.rise_s(0.002) / rise - 1.0).abs() < 1e-5);
        let (fast, limit) = Limits::for_motor(0.02, &at(2000.0), 5.0, &rig);
        let fastest = 1000.0 / 60.0 / 2000.0;
        assert!(limit == Some(Limit::MotorSpeed) && (fast.speed / fastest - 1.0).abs() < 1e-5, "{fast:?}");
        let slow = RigConstants { motor_acceleration_max_rad_per_s2: 1000.0, ..rig };
        let (steep, limit) = Limits::for_motor(0.004, &at(2000.0), 5.0, &slow);
        assert!(limit == Some(Limit::MotorAcceleration) && steep.acceleration < 0.0042, "{steep:?}");
        // A pull of 480 N takes 0.8 of the current; half of what is left of 12 000/60 rad/s² is for the move.
        let (max, limit) = Limits::for_motor(0.02, &at(1000.0), 480.0, &rig);
        assert!(limit == Some(Limit::MotorCurrent) && (max.acceleration / 0.02 - 1.0).abs() < 1e-3, "{max:?}");
        // 0.6 N m is what half an ampere gives: 560 N at 1000 rad/m leaves less than a tenth.
        let (heavy, limit) = Limits::for_motor(0.02, &at(1000.0), 560.0, &rig);
        assert!(limit == Some(Limit::MotorCurrent) && (heavy.acceleration / 0.01 - 1.0).abs() < 1e-3, "{heavy:?}");
    }

    #[test]
    fn a_move_that_is_too_short_for_its_acceleration_takes_the_time_of_its_jerk() {
        // 0.02 m/s² after 0.1 s. Four parts of T/4 with a jerk j make a way of j T³/32.
        let limits = Limits::new(0.002, 0.02, 0.2);
        for distance in [1e-5f32, 1e-4, 1.5e-4] {
            let expected_s = libm::cbrtf(32.0 * distance / limits.jerk);
            let told_s = limits.duration_from_s(0.0, distance, distance / limits.speed, &limits);
            assert!((told_s / expected_s - 1.0).abs() < 1e-4, "{distance}: {told_s} s");
        }
    }

    #[test]
    fn braking_takes_the_limits_of_where_it_ends() {
        let (here, rest) = (Limits::new(0.008, 0.08, 0.2), Limits::new(0.004, 0.03, 0.3));
        assert_eq!(here.braking_into(&rest), Limits { speed: 0.008, ..rest });
        assert_eq!(rest.braking_into(&here), rest);
        // 0.08 m/s² after 0.1 s, and back: 8 mm/s in 0.2 s.
        assert!((here.stopping_m(-0.008) + 0.5 * 0.008 * 0.2).abs() < 1e-6);
    }

    #[test]
    fn a_light_load_gets_up_to_speed_in_no_less_than_the_least_time() {
        assert_eq!(rise_s(1.0, 1e-4), RISE_S);
        assert!((rise_s(10.0, 2e-3) - 4.0 / (9.80665f32 / 0.02).sqrt()).abs() < 1e-6);
    }
}
