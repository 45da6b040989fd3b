//! How the load moves on its elastic strings: gap, speed and weight, each tick, and where it will be when a command acts.
//!
//! The load hangs by the pull S(G, θ) of the mechanism, `m G'' = W − S(G, θ)` with `m = W/g`; S comes from the table. The
//! observer knows no friction and no damping: friction becomes a part of W, which therefore is the weight that the load
//! *seems* to have, and gives the position loop its integral action. What it says of the load itself, [`crate::observer`] works
//! out.
//!
//! The innovation e, measured less expected gap at the time of the measurement, corrects all three. With a step Δt since the
//! measurement before and z = exp(−λ Δt) (docs/explanation/control.md 2):
//! `G += (1 − z³) e`, `G' += (1.5 (1 − z²)(1 − z)/Δt − ω² Δt) e`, `W += m (1 − z)³/Δt² e`.

use crate::mechanism::Mechanism;
use crate::sensors::OLD_US;
use crate::{TICK_S, seconds};
use rig_link::STANDARD_GRAVITY;

/// Decay λ of the observer's errors (1/s): slow enough for 10 ms of delay that is not known, and for the noise of the gap.
pub const OBSERVER_PER_S: f32 = 65.0;
/// Time from the readings of a tick to the middle of what its command does (s): half of the tick for which a speed holds, and
/// what bus and speed loop of the drive take (crates/rmds405/README.md 2.7, assumed). The lag of its position loop is
/// measured while homing and made up for in the command.
pub const AHEAD_S: f32 = 0.5 * TICK_S + 4e-3;
/// Minimum weight that a load seems to have, as a fraction of the table's lightest load: on the way down friction carries a part of it.
const LIGHTEST_FRACTION: f32 = 0.3;

/// One measurement of the gap.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Gap (m).
    pub gap_m: f32,
    /// Time since the measurement before (s); 0 if this is that one again.
    pub step_s: f32,
}

/// Motion of the load, and the pull of its strings about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadMotion {
    /// Gap (m).
    pub gap_m: f32,
    /// Its speed (m/s); positive sinks.
    pub speed_m_per_s: f32,
    /// What the load seems to weigh (N).
    pub weight_n: f32,
    /// Pull of the strings (N) at this gap and twist.
    pub pull_n: f32,
    /// Its stiffness ∂S/∂G (N/m), and ∂S/∂θ (N/rad).
    stiffness_n_per_m: f32,
    by_twist_n_per_rad: f32,
    twist_rad: f32,
}

impl LoadMotion {
    /// Of a load that hangs at rest, weighing about so much (N).
    pub fn at_rest(mechanism: &Mechanism<'_>, gap_m: f32, twist_rad: f32, load_n: f32) -> Self {
        let mut motion = Self {
            gap_m,
            speed_m_per_s: 0.0,
            weight_n: load_n,
            pull_n: load_n,
            stiffness_n_per_m: 1.0,
            by_twist_n_per_rad: 0.0,
            twist_rad,
        };
        for _ in 0..4 {
            motion.look_up(mechanism);
        }
        motion.weight_n = motion.pull_n.max(lightest_n(mechanism));
        motion
    }

    /// Takes a measurement at a twist (rad).
    pub fn step(&mut self, mechanism: &Mechanism<'_>, twist_rad: f32, measured: &Measured) {
        let Measured { gap_m, step_s } = *measured;
        if step_s > seconds(OLD_US) {
            *self = Self::at_rest(mechanism, gap_m, twist_rad, self.weight_n);
        } else if step_s > 0.0 {
            *self = self.after(step_s, twist_rad);
            self.correct(gap_m - self.gap_m, step_s);
            self.weight_n = self.weight_n.max(lightest_n(mechanism));
            self.look_up(mechanism);
        }
    }

    /// Pull and stiffness at this gap and twist: one Newton step from the pull before.
    fn look_up(&mut self, mechanism: &Mechanism<'_>) {
        let point = mechanism.at(self.pull_n, self.twist_rad);
        let stiffness = 1.0 / point.dgap_dload_m_per_n;
        self.pull_n += stiffness * (self.gap_m - point.gap_m);
        self.stiffness_n_per_m = stiffness;
        self.by_twist_n_per_rad = -stiffness * point.dgap_dtwist_m_per_rad;
    }

    /// Mass of the load (kg).
    fn mass_kg(&self) -> f32 {
        self.weight_n / STANDARD_GRAVITY as f32
    }

    /// Square of the frequency at which the load oscillates here ((rad/s)²).
    pub fn frequency_squared(&self) -> f32 {
        self.stiffness_n_per_m / self.mass_kg()
    }

    /// Takes an innovation (m) of a measurement that came some time (s) after the one before.
    fn correct(&mut self, error_m: f32, step_s: f32) {
        let z = libm::expf(-OBSERVER_PER_S * step_s);
        let left = 1.0 - z;
        // The spring does a part of it; one that is faster than the observer needs no help.
        let speed_gain = 1.5 * (1.0 - z * z) * left / step_s - self.frequency_squared() * step_s;
        let weight_gain = self.mass_kg() * left * left * left / (step_s * step_s);
        self.gap_m += (1.0 - z * z * z) * error_m;
        self.speed_m_per_s += speed_gain.max(0.0) * error_m;
        self.weight_n += weight_gain * error_m;
    }

    /// The same after a time (s), while the strings turn evenly to a twist (rad): one implicit mid-point step on the linearised
    /// pull, which neither feeds nor damps an oscillation.
    #[must_use]
    pub fn after(&self, seconds: f32, twist_rad: f32) -> Self {
        let (h, k, inertia) = (0.5 * seconds, self.stiffness_n_per_m, 2.0 * self.mass_kg());
        let turned_n = self.by_twist_n_per_rad * (twist_rad - self.twist_rad);
        let push_n = self.weight_n - self.pull_n - 0.5 * turned_n;
        // Mean speed v: inertia (v − v₀) = (push − k h v) · seconds.
        let mean = (inertia * self.speed_m_per_s + push_n * seconds) / (inertia + k * h * seconds);
        Self {
            gap_m: self.gap_m + seconds * mean,
            speed_m_per_s: 2.0 * mean - self.speed_m_per_s,
            pull_n: self.pull_n + turned_n + k * seconds * mean,
            twist_rad,
            ..*self
        }
    }
}

/// Minimum weight (N) that a load seems to have.
fn lightest_n(mechanism: &Mechanism<'_>) -> f32 {
    LIGHTEST_FRACTION * mechanism.table.metadata.load_min_n
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A load that swings at a frequency (rad/s), displaced from rest (m).
    fn swinging(frequency: f32, displaced_m: f32) -> LoadMotion {
        let (weight_n, mass) = (5.0, 5.0 / STANDARD_GRAVITY as f32);
        let k = frequency * frequency * mass;
        LoadMotion {
            gap_m: 0.05 + displaced_m,
            speed_m_per_s: 0.0,
            weight_n,
            pull_n: weight_n + k * displaced_m,
            stiffness_n_per_m: k,
            by_twist_n_per_rad: k / 3000.0,
            twist_rad: 20.0,
        }
    }

    #[test]
    fn a_load_swings_about_where_its_strings_let_it_rest() {
        for frequency in [5.0f32, 20.0, 40.0] {
            let mut motion = swinging(frequency, 1e-3);
            for k in 1..=100u8 {
                motion = motion.after(2e-3, 20.0);
                let exact_m = 1e-3 * libm::cosf(frequency * 2e-3 * f32::from(k));
                assert!((motion.gap_m - 0.05 - exact_m).abs() < 2e-5, "{frequency} rad/s, step {k}");
            }
        }
    }

    #[test]
    fn turned_strings_let_it_rest_elsewhere() {
        // Ten radians at 3000 rad/m, slowly: it comes to rest 3.3 mm higher.
        let mut motion = swinging(20.0, 0.0);
        for k in 1..=2000u16 {
            motion = motion.after(5e-3, 20.0 + 5e-3 * f32::from(k));
        }
        assert!((motion.gap_m - 0.05 + 10.0 / 3000.0).abs() < 3e-5, "{}", motion.gap_m);
        assert!((motion.pull_n - 5.0).abs() < 0.02);
    }

    #[test]
    fn a_tick_in_one_step_is_as_a_tick_in_many() {
        let start = swinging(20.0, 0.0);
        let one = start.after(0.01, 20.1);
        let many = (1..=100u8).fold(start, |motion, k| motion.after(1e-4, 20.0 + 1e-3 * f32::from(k)));
        let pairs = [(one.speed_m_per_s, many.speed_m_per_s), (one.pull_n - 5.0, many.pull_n - 5.0)];
        assert!(pairs.iter().all(|(a, b)| (a / b - 1.0).abs() < 0.02), "{pairs:?}");
        assert!(one.gap_m < start.gap_m && many.gap_m < start.gap_m, "twisted strings draw the load up");
    }

    #[test]
    fn an_innovation_corrects_gap_speed_and_weight_by_the_gains() {
        let (step_s, error_m) = (0.01, 1e-4);
        let z = libm::expf(-OBSERVER_PER_S * step_s);
        for frequency in [10.0f32, 40.0, 120.0] {
            let before = swinging(frequency, 0.0);
            assert!((before.frequency_squared() / (frequency * frequency) - 1.0).abs() < 1e-5);
            let mut after = before;
            after.correct(error_m, step_s);
            let speed = 1.5 * (1.0 - z * z) * (1.0 - z) / step_s - frequency * frequency * step_s;
            let weight = 5.0 / STANDARD_GRAVITY as f32 * (1.0 - z).powi(3) / (step_s * step_s);
            let gained = [after.gap_m - before.gap_m, after.speed_m_per_s, after.weight_n - before.weight_n];
            for (got, gain) in gained.into_iter().zip([1.0 - z.powi(3), speed.max(0.0), weight]) {
                assert!((got - gain * error_m).abs() < 1e-3 * gain * error_m + 1e-8, "{frequency} rad/s: {got} {gain}");
            }
        }
    }

    /// Errors of gap (m) and weight (N) that are left some time (s) after a load has become another.
    fn left_after(frequency: f32, seconds: f32) -> [f32; 2] {
        let mut load = swinging(frequency, 0.0);
        let mut observed = load;
        load.weight_n += 1.0;
        for _ in 0..(seconds / 0.01) as u16 {
            load = load.after(0.01, 20.0);
            observed = observed.after(0.01, 20.0);
            observed.correct(load.gap_m - observed.gap_m, 0.01);
            observed.pull_n = load.pull_n + load.stiffness_n_per_m * (observed.gap_m - load.gap_m);
        }
        [(load.gap_m - observed.gap_m).abs(), (load.weight_n - observed.weight_n).abs()]
    }

    #[test]
    fn a_changed_weight_is_known_within_ten_time_constants() {
        for frequency in [5.0, 15.0, 25.0, 35.0] {
            let [gap_m, weight_n] = left_after(frequency, 10.0 / OBSERVER_PER_S);
            assert!(weight_n < 0.1 && gap_m < 2e-4, "{frequency} rad/s: {weight_n} N, {gap_m} m");
        }
    }

    #[test]
    fn the_observer_is_stable_under_loads_that_swing_faster_than_itself() {
        for frequency in [60.0, 90.0, 125.0, 200.0] {
            let [gap_m, weight_n] = left_after(frequency, 3.0);
            assert!(gap_m < 1e-4 && weight_n < 0.3, "{frequency} rad/s: {weight_n} N, {gap_m} m");
        }
    }
}
