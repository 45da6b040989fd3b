//! The growth of the arc (eqs 6, 25) from the mechanism's constants, in double precision for a fit.

use crate::arc::{Growth, POWERS};
use crate::least_squares::Normal;
use tsa_model::{Parameters, RadiusLaw};

/// Arc (m) and its derivative by twist (m/rad) in f64, from the coefficients as they are rounded to f32.
pub(crate) fn arc_at(growth: &Growth, load_n: f64, twist_rad: f64) -> (f64, f64) {
    let per_twist = f64::from(growth.per_load_m_n) / load_n;
    let (mut value, mut slope) = (0.0, 0.0);
    for c in &growth.powers {
        slope = slope * twist_rad + value;
        value = value * twist_rad + f64::from(*c);
    }
    (twist_rad * (per_twist + value), per_twist + value + twist_rad * slope)
}

/// The radius law, with r0 times its terms without the load fitted in powers of the twist over the range `twist_rad`.
pub(crate) fn growth(p: &Parameters, twist_rad: [f64; 2]) -> Option<Growth> {
    // X0/X varies slowly: it counts as 1 here, and the polynomials in F and a take up its variation.
    let constant = p.radius_law == RadiusLaw::LengthRatio && p.k4 == 0.0;
    let degree = if constant { 1 } else { POWERS };
    let radius = |twist: f64| {
        let half_turns = twist / core::f64::consts::PI;
        match p.radius_law {
            RadiusLaw::TwistPower => p.k2 + p.k3 * libm::pow(half_turns, p.twist_exponent),
            RadiusLaw::LengthRatio => p.k2 + p.k3 + p.k4 * libm::log(half_turns),
        }
    };
    let top = twist_rad[1];
    let mut normal = Normal::<POWERS>::default();
    for k in 0..=200 {
        let twist = twist_rad[0] + (top - twist_rad[0]) * f64::from(k) / 200.0;
        let mut v = [1.0; POWERS];
        for i in 1..POWERS {
            v[i] = v[i - 1] * twist / top;
        }
        normal.add(&v, p.diameter_m * radius(twist));
    }
    let kept: [usize; POWERS] = core::array::from_fn(|i| i);
    let c = normal.solve(kept.get(..degree)?)?;
    let powers = core::array::from_fn(|i| (c[POWERS - 1 - i] / libm::pow(top, (POWERS - 1 - i) as f64)) as f32);
    Some(Growth { per_load_m_n: (p.diameter_m / p.k1_per_n) as f32, powers })
}
