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
    let [low, top] = twist_rad;
    let mut normal = Normal::<POWERS>::default();
    for k in 0..=200 {
        let share = f64::from(k) / 200.0;
        let half_turns = |twist: f64| twist / core::f64::consts::PI;
        // The polynomials in F and a take up what this fit misses best if the error of a power of the twist is small in
        // the radius, and that of its logarithm in the arc and at both ends. Found by trial.
        let (twist, weight, radius) = match p.radius_law {
            RadiusLaw::TwistPower => {
                let twist = low + (top - low) * share;
                (twist, 1.0, p.k2 + p.k3 * libm::pow(half_turns(twist), p.twist_exponent))
            }
            RadiusLaw::LengthRatio => {
                let twist = low + (top - low) * (0.5 - 0.5 * libm::cos(core::f64::consts::PI * share));
                (twist, twist / top, p.k2 + p.k3 + p.k4 * libm::log(half_turns(twist)))
            }
        };
        let mut v = [weight; POWERS];
        for i in 1..POWERS {
            v[i] = v[i - 1] * twist / top;
        }
        normal.add(&v, weight * p.diameter_m * radius);
    }
    let kept: [usize; POWERS] = core::array::from_fn(|i| i);
    let c = normal.solve(kept.get(..degree)?)?;
    let powers = core::array::from_fn(|i| (c[POWERS - 1 - i] / libm::pow(top, (POWERS - 1 - i) as f64)) as f32);
    Some(Growth { per_load_m_n: (p.diameter_m / p.k1_per_n) as f32, powers })
}
