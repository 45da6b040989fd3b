//! One period of the firmware's loop, linearised: the observer of gap, speed and weight, the prediction to when a command acts,
//! and the feedback that places three poles (docs/explanation/control.md). The equations are those of
//! `rig_control::load_motion` and `rig_control::position_loop` in deviations from an equilibrium, in double precision
//! and without limits or friction.
//!
//! Differences of the real step would not do in its place: in single precision some derivatives are wrong by a percent whatever the
//! step, while a loop is told from an unstable one by the last digits of an eigenvalue; and it rests, takes up friction and looks
//! its stiffness up in a table.

use super::margin::OperatingPoint;
use rig_control::load_motion::{AHEAD_S, OBSERVER_PER_S};
use rig_control::position_loop::{FULL_PER_S, GAINS, damping_fraction};

/// Numbers that the loop keeps from one period to the next.
pub(super) const KEPT: usize = 7;

/// What the firmware believes of the load.
#[derive(Clone, Copy)]
struct Motion {
    /// Gap (m), its speed (m/s), weight (N), pull of the strings (N), twist (rad).
    gap_m: f64,
    speed: f64,
    weight_n: f64,
    pull_n: f64,
    twist_rad: f64,
}

impl Motion {
    /// As `LoadMotion::after`.
    fn after(self, believed: &OperatingPoint, seconds: f64, twist_rad: f64) -> Self {
        let (h, k, inertia) = (0.5 * seconds, believed.stiffness_n_per_m, 2.0 * believed.mass_kg);
        let turned_n = k / believed.tr_rad_per_m * (twist_rad - self.twist_rad);
        let push_n = self.weight_n - self.pull_n - 0.5 * turned_n;
        let mean = (inertia * self.speed + push_n * seconds) / (inertia + k * h * seconds);
        Self {
            gap_m: self.gap_m + seconds * mean,
            speed: 2.0 * mean - self.speed,
            pull_n: self.pull_n + turned_n + k * seconds * mean,
            twist_rad,
            ..self
        }
    }

    /// As `LoadMotion::correct`, and the pull looked up again.
    fn corrected(self, believed: &OperatingPoint, error_m: f64, step_s: f64) -> Self {
        let z = (-f64::from(OBSERVER_PER_S) * step_s).exp();
        let left = 1.0 - z;
        let spring = believed.stiffness_n_per_m / believed.mass_kg;
        let speed_gain = (1.5 * (1.0 - z * z) * left / step_s - spring * step_s).max(0.0);
        let gap_m = self.gap_m + (1.0 - z.powi(3)) * error_m;
        Self {
            gap_m,
            speed: self.speed + speed_gain * error_m,
            weight_n: self.weight_n + believed.mass_kg * left.powi(3) / step_s.powi(2) * error_m,
            pull_n: believed.stiffness_n_per_m * (gap_m + self.twist_rad / believed.tr_rad_per_m),
            ..self
        }
    }
}

/// What the loop sees in a period.
pub(super) struct Seen {
    /// Position (m) when it was measured.
    pub position_m: f64,
    /// Twist (rad) then, now, and how long ago it was measured (s).
    pub twist_then_rad: f64,
    pub twist_rad: f64,
    pub age_s: f64,
    /// Control period (s).
    pub period_s: f64,
}

/// One period with a fraction of the feedback: the next target of the drive (rad) with a lead (s), and what is kept.
pub(super) fn step(
    kept: &[f64],
    seen: &Seen,
    believed: &OperatingPoint,
    [loop_gain, lead_s]: [f64; 2],
) -> (f64, Vec<f64>) {
    let [shaft_rad, speed] = [kept[0], kept[1]];
    let motion = Motion { gap_m: kept[2], speed: kept[3], weight_n: kept[4], pull_n: kept[5], twist_rad: kept[6] };
    let at_measurement = motion.after(believed, seen.period_s, seen.twist_then_rad);
    let now = at_measurement.corrected(believed, -seen.position_m - at_measurement.gap_m, seen.period_s);
    let ahead_s = f64::from(AHEAD_S);
    let commanded_rad = shaft_rad + ahead_s * speed;
    let ahead = now.after(believed, seen.age_s, seen.twist_rad).after(believed, ahead_s, commanded_rad);
    let frequency = believed.resonance_rad_per_s();
    let rest_m = now.weight_n / believed.stiffness_n_per_m - commanded_rad / believed.tr_rad_per_m;
    let [by_position, by_speed, by_rest] = GAINS.map(f64::from);
    let place = frequency.min(f64::from(FULL_PER_S)) * (by_position + by_rest) * rest_m;
    let damping = frequency * by_position * (ahead.gap_m - rest_m) + by_speed * ahead.speed;
    let feedback = loop_gain * (place + f64::from(damping_fraction(frequency as f32)) * damping);
    let speed = believed.tr_rad_per_m * feedback;
    let shaft_rad = shaft_rad + speed * seen.period_s;
    let kept = vec![shaft_rad, speed, now.gap_m, now.speed, now.weight_n, now.pull_n, now.twist_rad];
    (shaft_rad + lead_s * speed, kept)
}
