//! Stability in time: how much more gain, delay or sampling time the position loop tolerates before it is unstable.
//!
//! The loop is linearised at an equilibrium and taken over one control period exactly: the rig between two ticks by the
//! matrix exponential, the controller by its own difference equations. The loop is stable while no eigenvalue of that map
//! is outside the unit circle.
//!
//! The rig: `m p'' = −k (p − θ/TR) − (c + β k) p'` for the load's position p, and a drive that follows its target with
//! the two lags assumed in crates/rmds405/README.md 2.7 (emulated, not measured). Friction is left out: it only damps.

use super::damped;
use anyhow::Result;
use nalgebra::{Complex, DMatrix, DVector};
use rig_config::Scene;
use rig_plant::units::STANDARD_GRAVITY as STANDARD_GRAVITY_M_PER_S2;
use tsa_model::{Mechanism, SolveError};

/// Gain of the drive's position loop and crossover of its velocity loop (1/s), as the emulated drive has them. Assumed.
pub const DRIVE_PER_S: [f64; 2] = [20.0, 150.0];
/// Gain (1/s) and smoothing (rad/s) of a loop that stays below the load's resonance and does not damp it.
const BELOW_RESONANCE: [f64; 2] = [3.0, 9.0];
/// Lead that the firmware gives the drive (s): the lag that homing finds on the emulated drive, 56 ms, less a tick.
const LEAD_S: f64 = 0.046;
/// Age of the averaged LVDT block when it is used (s).
const AGE_S: f64 = 0.006;
/// Viscous damping of the rail (N s/m) and of string and rods (s of stiffness), as the emulated plant has them. Assumed.
pub const DAMPING: [f64; 2] = [1.0, 2e-3];

/// The loop as it is run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearLoop {
    /// The firmware's: it damps the load's oscillation (docs/explanation/control.md). Others multiply the smoothed error by a
    /// gain.
    pub damps: bool,
    /// Transmission ratio that it assumes (rad/m); `None`: the true one, as the table gives it.
    pub tr_rad_per_m: Option<f64>,
    /// The same of the stiffness (N/m), which a loop that damps needs.
    pub stiffness_n_per_m: Option<f64>,
    /// Fraction of its feedback that a loop that damps uses: the setting `loop-gain`.
    pub loop_gain: f64,
    /// Gain (1/s); of a loop that damps, a factor on what it measures, which multiplies the gain of the open loop.
    pub gain_per_s: f64,
    /// Corner of its two smoothing poles (rad/s).
    pub corner_rad_per_s: f64,
    /// Control period (s).
    pub period_s: f64,
    /// Additional delay (s).
    pub delay_s: f64,
}

impl LinearLoop {
    /// The firmware's.
    pub fn damped() -> Self {
        Self { damps: true, gain_per_s: 1.0, ..Self::scheduled() }
    }

    /// The same on a rig that it takes for another one.
    pub fn damped_for(believed: &OperatingPoint) -> Self {
        Self {
            tr_rad_per_m: Some(believed.tr_rad_per_m),
            stiffness_n_per_m: Some(believed.stiffness_n_per_m),
            ..Self::damped()
        }
    }

    /// With TR at the load, below its resonance.
    pub fn scheduled() -> Self {
        Self {
            damps: false,
            tr_rad_per_m: None,
            stiffness_n_per_m: None,
            loop_gain: 1.0,
            gain_per_s: BELOW_RESONANCE[0],
            corner_rad_per_s: BELOW_RESONANCE[1],
            period_s: rig_control::TICK_S.into(),
            delay_s: 0.0,
        }
    }

    /// The same with one ratio (rad/m) for everything.
    pub fn fixed(tr_rad_per_m: f64) -> Self {
        Self { tr_rad_per_m: Some(tr_rad_per_m), ..Self::scheduled() }
    }
}

/// The constants of a plant that is not what the table was made for are off by so much, each either way.
pub const OFF: f64 = 0.1;

/// Mechanisms that are not the scene's: every combination of k2, k3, K and the modulus off by [`OFF`] either way.
///
/// # Errors
/// If a scene cannot be made.
pub fn with_constants_off(scene: &Scene) -> Result<Vec<Mechanism>> {
    let off = |bits: u32| {
        let factor = |bit: u32| if bits >> bit & 1 == 0 { 1.0 - OFF } else { 1.0 + OFF };
        let mut other = scene.clone();
        other.string.k2 *= factor(0);
        other.string.k3 *= factor(1);
        other.string.stiffness_n_per_m *= factor(2);
        other.material.stress_coefficients_pa.iter_mut().for_each(|a| *a *= factor(3));
        Ok(other.mechanism()?)
    };
    (0..16).map(off).collect()
}

/// The mechanism with its load at one state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OperatingPoint {
    /// Transmission ratio (rad/m).
    pub tr_rad_per_m: f64,
    /// Stiffness ∂F/∂G (N/m).
    pub stiffness_n_per_m: f64,
    /// Mass (kg).
    pub mass_kg: f64,
}

impl OperatingPoint {
    /// Of the equilibrium under a load (N) at a twist (rad).
    ///
    /// # Errors
    /// If there is none.
    pub fn at(mechanism: &Mechanism, load_n: f64, twist_rad: f64) -> Result<Self, SolveError> {
        let e = mechanism.solve(load_n, twist_rad)?;
        Ok(Self {
            tr_rad_per_m: e.tr_rad_per_m(),
            stiffness_n_per_m: 1.0 / e.dgap_dload_m_per_n,
            mass_kg: load_n / STANDARD_GRAVITY_M_PER_S2,
        })
    }

    /// Its natural frequency (rad/s).
    pub fn resonance_rad_per_s(&self) -> f64 {
        (self.stiffness_n_per_m / self.mass_kg).sqrt()
    }

    /// Position, speed, twist and twist speed some time (s) later: their dependence on themselves, and on the drive's
    /// target.
    fn flow(&self, seconds: f64) -> (DMatrix<f64>, DVector<f64>) {
        let [position, velocity] = DRIVE_PER_S;
        let spring = self.stiffness_n_per_m / self.mass_kg;
        let damper = (DAMPING[0] + DAMPING[1] * self.stiffness_n_per_m) / self.mass_kg;
        let rates = [
            [0.0, 1.0, 0.0, 0.0, 0.0],
            [-spring, -damper, spring / self.tr_rad_per_m, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, -velocity * position, -velocity, velocity * position],
            [0.0; 5],
        ];
        let whole = (DMatrix::from_row_slice(5, 5, rates.as_flattened()) * seconds).exp();
        (whole.view((0, 0), (4, 4)).into(), whole.view((0, 4), (4, 1)).column(0).into())
    }

    /// The loop over one control period: its map, what one unit (m) more of the measured position adds to it, and what the
    /// measured position is of each state.
    fn period(&self, loop_: &LinearLoop) -> (DMatrix<f64>, DVector<f64>, DVector<f64>) {
        let period = loop_.period_s;
        let tr = loop_.tr_rad_per_m.unwrap_or(self.tr_rad_per_m);
        let blend = loop_.corner_rad_per_s * period / (1.0 + loop_.corner_rad_per_s * period);
        // A block is at most a period old; what is older waits in whole periods.
        let age = AGE_S.min(period) + loop_.delay_s;
        let waiting = (age / period).ceil() as usize - 1;
        let (now, by_target) = self.flow(period);
        let (seen, seen_by_target) = self.flow((period - (age - waiting as f64 * period)).max(0.0));
        let believed = Self {
            tr_rad_per_m: tr,
            stiffness_n_per_m: loop_.stiffness_n_per_m.unwrap_or(self.stiffness_n_per_m),
            ..*self
        };
        // Rig (4), target of the drive, what the loop keeps (shaft and two smoothed errors, or more), positions under way.
        let kept = 5 + if loop_.damps { damped::KEPT } else { 3 };
        let size = kept + waiting;
        // The next state, and the position that the loop was given.
        let step = |state: &[f64], beside_m: f64| {
            let rig = DVector::from_column_slice(&state[..4]);
            let target = state[4];
            let measured = (seen.row(0) * &rig)[0] + seen_by_target[0] * target;
            let rig = &now * &rig + &by_target * target;
            let mut under_way = vec![measured];
            under_way.extend(&state[kept..]);
            let given_m = under_way[waiting] + beside_m;
            under_way.truncate(waiting);
            let (target, kept) = if loop_.damps {
                // The firmware knows the age of the block, but not a further delay.
                let (age_s, twist_rad) = (AGE_S.min(period), rig[2]);
                let twist_then_rad = twist_rad - (twist_rad - state[2]) * age_s / period;
                let position_m = loop_.gain_per_s * given_m;
                let seen = damped::Seen { position_m, twist_then_rad, twist_rad, age_s, period_s: period };
                damped::step(&state[5..kept], &seen, &believed, [loop_.loop_gain, LEAD_S])
            } else {
                let first = state[6] + blend * (-given_m - state[6]);
                let second = state[7] + blend * (first - state[7]);
                let speed = tr * loop_.gain_per_s * second;
                let shaft = state[5] + speed * period;
                (shaft + LEAD_S * speed, vec![shaft, first, second])
            };
            (rig.iter().copied().chain([target]).chain(kept).chain(under_way).collect::<Vec<f64>>(), given_m)
        };
        let (mut map, mut given) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for column in 0..size {
            let mut unit = vec![0.0; size];
            unit[column] = 1.0;
            let (next, given_m) = step(&unit, 0.0);
            map.set_column(column, &DVector::from_vec(next));
            given[column] = given_m;
        }
        (map, DVector::from_vec(step(&vec![0.0; size], 1.0).0), given)
    }

    /// Largest eigenvalue of the loop over one control period: below 1 every disturbance decays.
    pub fn growth(&self, loop_: &LinearLoop) -> f64 {
        self.period(loop_).0.complex_eigenvalues().iter().map(|value| value.norm()).fold(0.0, f64::max)
    }

    /// Peak sensitivity: how many times the loop enlarges an error of the measured position at most, over all frequencies. Its
    /// inverse is the shortest distance of the open loop from −1. Infinite where the loop is unstable.
    pub fn peak_sensitivity(&self, loop_: &LinearLoop) -> f64 {
        if self.growth(loop_) > 1.0 + ROUNDING {
            return f64::INFINITY;
        }
        let (map, by_error, given) = self.period(loop_);
        let complex = |x: f64| Complex::new(x, 0.0);
        let (map, by_error) = (map.map(complex), by_error.map(complex));
        let at = |k: usize| {
            let phase = std::f64::consts::PI * (k as f64 / FREQUENCIES as f64).powi(2);
            let turned = DMatrix::identity(map.nrows(), map.nrows()) * Complex::from_polar(1.0, phase) - &map;
            let state = turned.lu().solve(&by_error)?;
            Some((state.iter().zip(&given).map(|(x, g)| x * g).sum::<Complex<f64>>() + complex(1.0)).norm())
        };
        (1..=FREQUENCIES).filter_map(at).fold(0.0, f64::max)
    }

    /// By how much the gain may be multiplied before the loop is unstable; below 1 it already is. At most [`MAX`].
    pub fn gain_margin(&self, loop_: &LinearLoop) -> f64 {
        let grows =
            |factor: f64| self.growth(&LinearLoop { gain_per_s: factor * loop_.gain_per_s, ..*loop_ }) > 1.0 + ROUNDING;
        last_good(grows, MIN, MAX)
    }

    /// Longest additional delay (s) before the loop is unstable; at most `max_s`.
    pub fn delay_margin(&self, loop_: &LinearLoop, max_s: f64) -> f64 {
        let grows = |delay_s: f64| self.growth(&LinearLoop { delay_s, ..*loop_ }) > 1.0 + ROUNDING;
        if grows(0.0) { 0.0 } else { last_good(grows, 1e-3, max_s) }
    }
}

/// Minimum factor that is considered.
pub const MIN: f64 = 0.02;
/// Maximum factor that is considered.
pub const MAX: f64 = 20.0;
/// Frequencies at which the sensitivity is computed, up to that of half the sampling: denser where they are low.
const FREQUENCIES: usize = 200;
/// An eigenvalue this far outside the circle is rounding.
const ROUNDING: f64 = 1e-9;
/// Steps in which the limit is looked for, each by the same factor; then halved.
const STEPS: i32 = 24;
const HALVINGS: usize = 12;

/// The maximum value before the first that is bad, between two limits.
fn last_good(is_bad: impl Fn(f64) -> bool, min: f64, max: f64) -> f64 {
    let at = |k: i32| min * (max / min).powf(f64::from(k) / f64::from(STEPS));
    let Some(first_bad) = (0..=STEPS).find(|k| is_bad(at(*k))) else { return max };
    let (mut good, mut bad) = (if first_bad == 0 { 0.0 } else { at(first_bad - 1) }, at(first_bad));
    for _ in 0..HALVINGS {
        let middle = 0.5 * (good + bad);
        if is_bad(middle) { bad = middle } else { good = middle }
    }
    good
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0.6 kg that oscillate at 25 rad/s.
    const OSCILLATIONS: OperatingPoint =
        OperatingPoint { tr_rad_per_m: 3000.0, stiffness_n_per_m: 375.0, mass_kg: 0.6 };

    #[test]
    fn the_firmwares_loop_is_as_fast_as_its_slowest_pole_and_calms_the_swing() {
        let c = LinearLoop::damped();
        // Poles 0.55 and 0.39 ± 0.86 i times 25 rad/s: the oscillation decays with 10 per second, were the drive without lag.
        let per_s = -OSCILLATIONS.growth(&c).ln() / c.period_s;
        assert!((7.0..14.0).contains(&per_s), "{per_s} per second");
        let oscillation_alone = OSCILLATIONS.growth(&LinearLoop { gain_per_s: 0.0, ..c });
        assert!((oscillation_alone - 1.0).abs() < 1e-9, "without feedback the place of the shaft stays");
        assert!(OSCILLATIONS.gain_margin(&c) > 1.9, "{}", OSCILLATIONS.gain_margin(&c));
        assert!(OSCILLATIONS.delay_margin(&c, 0.5) > 0.02, "{}", OSCILLATIONS.delay_margin(&c, 0.5));
        // A load that the table takes for half or twice as stiff is still held.
        for factor in [0.6, 1.6] {
            let off = LinearLoop { stiffness_n_per_m: Some(factor * OSCILLATIONS.stiffness_n_per_m), ..c };
            assert!(OSCILLATIONS.growth(&off) < 1.0, "{factor}");
        }
    }

    /// The sensitivity 1/(1 + L) of an integrator with a delay τ, L = K e^(−sτ)/s, is computed by that formula beside it. Every loop
    /// with a gain margin M has a peak of at least M/(M − 1).
    #[test]
    fn the_peak_of_the_sensitivity_is_that_of_the_formula_and_no_less_than_its_gain_margin_asks() {
        let c = LinearLoop { corner_rad_per_s: 2000.0, gain_per_s: 2.0, ..LinearLoop::scheduled() };
        let delay_s = 0.125 - AGE_S - 1.5 * c.period_s;
        let peak = STIFF.peak_sensitivity(&LinearLoop { delay_s, ..c });
        let formula = (1..2000).map(|k| {
            let w = 0.01 * f64::from(k);
            1.0 / (Complex::from_polar(2.0 / w, -0.125 * w - std::f64::consts::FRAC_PI_2) + 1.0).norm()
        });
        let formula = formula.fold(0.0, f64::max);
        assert!((peak / formula - 1.0).abs() < 0.03, "{peak} {formula}");
        let (c, margin) = (LinearLoop::damped(), OSCILLATIONS.gain_margin(&LinearLoop::damped()));
        let peak = OSCILLATIONS.peak_sensitivity(&c);
        assert!(peak > 0.999 * margin / (margin - 1.0) && peak < 3.0, "{peak} {margin}");
        let unstable = LinearLoop { gain_per_s: 1.1 * margin, ..c };
        assert_eq!(OSCILLATIONS.peak_sensitivity(&unstable), f64::INFINITY);
    }

    /// So stiff that the load is where the strings are.
    const STIFF: OperatingPoint = OperatingPoint { tr_rad_per_m: 2000.0, stiffness_n_per_m: 1e6, mass_kg: 0.5 };

    #[test]
    fn a_stiff_rig_has_the_margin_of_its_lags() {
        // 1/s · 1/(1 + s/a)²: unstable from K = 2 a on; drive and delay take a little of that.
        let c = LinearLoop { corner_rad_per_s: 2.0, gain_per_s: 1.0, ..LinearLoop::scheduled() };
        let margin = STIFF.gain_margin(&c);
        assert!((3.2..4.0).contains(&margin), "{margin}");
        // A wrong ratio is a wrong gain.
        let doubled = STIFF.gain_margin(&LinearLoop { tr_rad_per_m: Some(4000.0), ..c });
        assert!((doubled / margin - 0.5).abs() < 1e-3, "{doubled} {margin}");
    }

    #[test]
    fn a_delay_takes_the_phase_that_it_should() {
        // With poles far off: K e^(−sτ)/s is unstable from τ = π/(2K) on; what is there already counts.
        let c = LinearLoop { corner_rad_per_s: 2000.0, gain_per_s: 2.0, ..LinearLoop::scheduled() };
        let delay = STIFF.delay_margin(&c, 2.0);
        let expected = std::f64::consts::FRAC_PI_2 / 2.0 - AGE_S - 1.5 * c.period_s;
        assert!((delay - expected).abs() < 0.03, "{delay} {expected}");
    }

    #[test]
    fn the_resonance_bounds_the_gain() {
        let hung = OperatingPoint { tr_rad_per_m: 2000.0, stiffness_n_per_m: 600.0, mass_kg: 1.5 };
        let c = LinearLoop::scheduled();
        let faster = LinearLoop { corner_rad_per_s: 30.0, ..c };
        assert!(hung.gain_margin(&c) > 1.5 * hung.gain_margin(&faster), "smoothing below the resonance helps");
        assert!(hung.growth(&c) < 1.0);
    }
}
