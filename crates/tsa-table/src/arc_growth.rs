//! The growth of the arc (eqs 6, 25) from the mechanism's constants, and a table's numbers evaluated, in double precision.

use crate::arc::{ArcSeries, Growth, POWERS};
use crate::least_squares::Normal;
use core::f64::consts::PI;
use tsa_model::{Parameters, RadiusLaw};

/// Arc (m) and its derivative by twist (m/rad) in f64, from the coefficients as they are rounded to f32.
pub(crate) fn arc_at(growth: &Growth, load_n: f64, twist_rad: f64) -> (f64, f64) {
    let per_twist = f64::from(growth.per_load_m_n) / load_n;
    let (mut value, mut slope) = (0.0, 0.0);
    for c in &growth.powers {
        slope = slope * twist_rad + value;
        value = value * twist_rad + f64::from(*c);
    }
    let log = f64::from(growth.per_log_m);
    let (value, rise) = (value + log * libm::log(twist_rad / PI), twist_rad * slope + log);
    (twist_rad * (per_twist + value), per_twist + value + rise)
}

/// The radius model, with the power of the twist in it fitted in whole powers over the range `twist_rad`.
pub(crate) fn growth(p: &Parameters, twist_rad: [f64; 2]) -> Option<Growth> {
    let per_load_m_n = (p.diameter_m / p.k1_per_n) as f32;
    if p.radius_law == RadiusLaw::LengthRatio {
        // X0/X varies slowly: it counts as 1 here, and the polynomials in F and a take up its variation.
        let mut powers = [0.0; POWERS];
        powers[POWERS - 1] = (p.diameter_m * (p.k2 + p.k3)) as f32;
        return Some(Growth { per_load_m_n, powers, per_log_m: (p.diameter_m * p.k4) as f32 });
    }
    let top = twist_rad[1];
    let mut normal = Normal::<POWERS>::default();
    for k in 0..=200 {
        let twist = twist_rad[0] + (top - twist_rad[0]) * f64::from(k) / 200.0;
        let mut v = [1.0; POWERS];
        for i in 1..POWERS {
            v[i] = v[i - 1] * twist / top;
        }
        normal.add(&v, p.diameter_m * (p.k2 + p.k3 * libm::pow(twist / PI, p.twist_exponent)));
    }
    let kept: [usize; POWERS] = core::array::from_fn(|i| i);
    let c = normal.solve(&kept)?;
    let powers = core::array::from_fn(|i| (c[POWERS - 1 - i] / libm::pow(top, (POWERS - 1 - i) as f64)) as f32);
    Some(Growth { per_load_m_n, powers, per_log_m: 0.0 })
}

/// A polynomial, the highest power first.
fn descend<'a>(coefficients: impl IntoIterator<Item = &'a f32>, x: f64) -> f64 {
    coefficients.into_iter().fold(0.0, |value, c| value * x + f64::from(*c))
}

/// Gap (m) and ∂G/∂θ (m/rad) in f64: the difference to the f32 lookup is the rounding of its arithmetic.
pub(crate) fn evaluate(series: &ArcSeries<'_>, load_n: f64, twist_rad: f64) -> [f64; 2] {
    let (arc, arc_by_twist) = arc_at(&series.growth, load_n, twist_rad);
    let last = series.patches.len() - 1;
    let k = series.patches.iter().position(|p| load_n <= f64::from(p.load_max_n)).unwrap_or(last);
    let [load_0, arc_0] = series.patches[k].centre.map(f64::from);
    let terms = series.shape.terms();
    let (mut square, mut by_arc) = (0.0, 0.0);
    for column in series.coefficients[k * terms..(k + 1) * terms].chunks(usize::from(series.shape.rows)) {
        by_arc = by_arc * (arc - arc_0) + square;
        square = square * (arc - arc_0) + descend(column, load_n - load_0);
    }
    [square.sqrt(), 0.5 * by_arc / square.sqrt() * arc_by_twist]
}

/// Constants for the tests of this crate.
#[cfg(test)]
pub(crate) mod example {
    use super::*;

    pub(crate) const PARAMETERS: Parameters = Parameters {
        string_length_m: 0.1,
        rod_span_m: 0.02,
        clamp_width_m: 0.005,
        rod_radius_m: 0.0005,
        diameter_m: 0.0007,
        stiffness_n_per_m: 2e4,
        k1_per_n: 0.8,
        k2: 0.4,
        k3: 0.3,
        k4: 0.1,
        twist_exponent: 0.5,
        stress_coefficients_pa: [1e10, 0.0, 0.0, 0.0, 0.0],
        radius_law: RadiusLaw::LengthRatio,
        correction: None,
    };
}

#[cfg(test)]
mod tests {
    use super::example::PARAMETERS;
    use super::*;

    const TWIST_RAD: [f64; 2] = [PI, 16.0 * PI];

    /// ρ/θ, the radius at an infinite load (m), and its maximum deviation from eq. 6.
    fn worst(p: &Parameters, radius_m: impl Fn(f64) -> f64) -> f64 {
        let growth = growth(p, TWIST_RAD).unwrap();
        assert!((f64::from(growth.per_load_m_n) - p.diameter_m / p.k1_per_n).abs() < 1e-9);
        let error = |k: i32| {
            let twist = TWIST_RAD[0] + (TWIST_RAD[1] - TWIST_RAD[0]) * f64::from(k) / 500.0;
            (arc_at(&growth, f64::INFINITY, twist).0 / twist - radius_m(twist)).abs()
        };
        (0..=500).map(error).fold(0.0, f64::max)
    }

    #[test]
    fn the_radius_law_becomes_powers_and_a_logarithm_of_the_twist() {
        let Parameters { diameter_m, k2, k3, k4, twist_exponent, .. } = PARAMETERS;
        let by_length = worst(&PARAMETERS, |twist| diameter_m * (k2 + k3 + k4 * (twist / PI).ln()));
        assert!(by_length < 1e-7 * diameter_m, "{by_length:e}: rounding only");
        let power = Parameters { radius_law: RadiusLaw::TwistPower, k4: 0.0, ..PARAMETERS };
        let by_power = worst(&power, |twist| diameter_m * (k2 + k3 * (twist / PI).powf(twist_exponent)));
        assert!(by_power < 0.01 * diameter_m, "{by_power:e}: six powers for a root");
        // A whole exponent is one of the powers.
        let square = Parameters { twist_exponent: 2.0, ..power };
        let by_square = worst(&square, |twist| diameter_m * (k2 + k3 * (twist / PI).powi(2)));
        assert!(by_square < 1e-4 * diameter_m, "{by_square:e}");
    }
}
