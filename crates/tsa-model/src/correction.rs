//! What a law misses of one rig's gap, as measured: a smooth surface over load and twist (docs/explanation/model.md
//! section 4).

use crate::error::{ParameterError, require};
use crate::scalar::ln;
use crate::string::MINIMUM_LOAD_N;
use crate::twist_from_turns;
use core::f64::consts::LN_2;

/// Terms in the load, and in the twist.
pub const TERMS: usize = 3;
/// Maximum sum of the coefficients' sizes (m): a law that misses more is not the law of this mechanism.
pub const LARGEST_M: f64 = 5e-3;
/// Minimum width of the fade beyond the loads of the data, in ln F: data of one load have no width of their own.
const MIN_FADE: f64 = LN_2;

/// The measured correction of the gap. It is a sum of products of Legendre polynomials in ln F and in |θ| where it was
/// measured, and fades to zero outside, twice continuously differentiable.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(deny_unknown_fields))]
pub struct Correction {
    /// Minimum and maximum load of the data (N); the same twice for data of one load.
    pub load_n: [f64; 2],
    /// Minimum and maximum motor turns of the data past the half-turn pre-twist.
    pub turns: [f64; 2],
    /// Coefficients (m): a row for each power of ln F, a column for each power of the twist.
    pub coefficients_m: [[f64; TERMS]; TERMS],
}

/// The correction at a load and a twist.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shift {
    /// What is added to the gap (m).
    pub gap_m: f64,
    /// Its derivative by |θ| (m/rad).
    pub by_twist: f64,
    /// Its derivative by the load (m/N).
    pub by_load: f64,
}

impl Correction {
    /// Checks ranges and sizes.
    ///
    /// # Errors
    /// [`ParameterError`] naming the scene-file key.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let [min_n, max_n] = self.load_n;
        let (loads, twists, sizes) = ("correction.load_n", "correction.turns", "correction.coefficients_m");
        // NaN fails every comparison.
        require(min_n >= MINIMUM_LOAD_N && min_n.is_finite(), loads, min_n, "must start at 0.05 N or above")?;
        require(max_n >= min_n && max_n.is_finite(), loads, max_n, "must not end below its start")?;
        let [first, last] = self.turns;
        let reason = "must start above -0.5, which is zero twist";
        require(first > -0.5 && first.is_finite(), twists, first, reason)?;
        require(last > first && last.is_finite(), twists, last, "must end above its start")?;
        let sum: f64 = self.coefficients_m.as_flattened().iter().map(|c| c.abs()).sum();
        require((0.0..=LARGEST_M).contains(&sum), sizes, sum, "must be finite and 5 mm or less in sum")?;
        let curve = self.coefficients_m.iter().skip(1).all(|row| *row == [0.0; TERMS]);
        let reason = "must have one row that is not zero where there is one load";
        require(min_n < max_n || curve, sizes, sum, reason)
    }

    /// The correction at a load (N) and a twist |θ| (rad).
    pub fn at(&self, load_n: f64, twist_rad: f64) -> Shift {
        let ([loads, by_loads], [twists, by_twists]) = self.basis(load_n, twist_rad);
        let mut shift = Shift::default();
        for (i, row) in self.coefficients_m.iter().enumerate() {
            for (j, c) in row.iter().enumerate() {
                shift.gap_m += c * loads[i] * twists[j];
                shift.by_twist += c * loads[i] * by_twists[j];
                shift.by_load += c * by_loads[i] * twists[j] / load_n;
            }
        }
        shift
    }

    /// The functions of ln F and of |θ| by which the coefficients are multiplied, each with its derivatives. The first of
    /// either is the fade.
    pub fn basis(&self, load_n: f64, twist_rad: f64) -> ([[f64; TERMS]; 2], [[f64; TERMS]; 2]) {
        let loads = self.load_n.map(ln);
        let twists = self.turns.map(twist_from_turns);
        // A table's polynomials in F follow no shorter fade.
        let of_load = (loads[1] - loads[0]).max(MIN_FADE);
        let of_twist = 0.5 * (twists[1] - twists[0]);
        (
            terms(ln(load_n), loads, [of_load; 2]),
            // The gap is even in the twist: only what has faded at zero has no kink there.
            terms(twist_rad, twists, [of_twist.min(twists[0]), of_twist]),
        )
    }
}

/// Legendre polynomials over a range, and their derivatives, which fade over a width below the range and one above it.
/// Outside, the polynomials' argument goes on with the same slope and comes back to the end of the range, so that they
/// are never far beyond the values that the data determined.
fn terms(at: f64, [low, high]: [f64; 2], widths: [f64; 2]) -> [[f64; TERMS]; 2] {
    let half = 0.5 * (high - low);
    let scale = if half > 0.0 { 1.0 / half } else { 0.0 };
    let (edge, sign, width) = if at < low { (low, -1.0, widths[0]) } else { (high, 1.0, widths[1]) };
    let outside = (sign * (at - edge)).max(0.0);
    if outside >= width {
        return [[0.0; TERMS]; 2];
    }
    let t = outside / width;
    let left = 1.0 - t * t * t;
    let (fade, by_fade) = (left * left * left, -9.0 * t * t * left * left / width * sign);
    let (u, by_u) = if outside > 0.0 {
        let reach = half.min(width);
        let (s, rest) = if outside < reach { (outside / reach, 1.0 - outside / reach) } else { (1.0, 0.0) };
        let q = s * (1.0 + 3.0 * s) * rest * rest * rest;
        let by_q = (1.0 + 6.0 * s) * rest * rest * rest - 3.0 * s * (1.0 + 3.0 * s) * rest * rest;
        (sign * (half + reach * q) * scale, by_q * scale)
    } else {
        ((at - low - half) * scale, scale)
    };
    let (value, slope) = ([1.0, u, 1.5 * u * u - 0.5], [0.0, by_u, 3.0 * u * by_u]);
    [value.map(|v| v * fade), core::array::from_fn(|i| slope[i] * fade + value[i] * by_fade)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Geometry, Material, Mechanism, Parameters, RadiusLaw, StringParameters};

    const MEASURED: Correction = Correction {
        load_n: [2.0, 15.0],
        turns: [0.2, 7.0],
        coefficients_m: [[2e-4, -1e-4, 5e-5], [-8e-5, 6e-5, -3e-5], [4e-5, 3e-5, 2e-5]],
    };

    fn law() -> Parameters {
        let geometry =
            Geometry { string_length_m: 0.097, rod_span_m: 0.032, clamp_width_m: 0.006, rod_radius_m: 0.0005 };
        let string = StringParameters {
            diameter_m: 0.0015,
            stiffness_n_per_m: 1370.0,
            k1_per_n: 8.718,
            k2: 0.162,
            k3: 0.081,
            k4: 0.0995,
            radius_law: RadiusLaw::LengthRatio,
            twist_exponent: None,
        };
        let material = Material { stress_coefficients_pa: [3.4e10, 0.0, 0.0, 0.0, 0.0] };
        Parameters::new(&geometry, &string, &material).expect("constants")
    }

    #[test]
    fn the_derivatives_are_those_of_the_value_inside_on_the_way_out_and_beyond() {
        for i in 0..60 {
            for j in 0..60 {
                let (load_n, twist_rad) = (0.3 * 1.09f64.powi(i), 0.5 + f64::from(j));
                let (df, dt) = (1e-6 * load_n, 1e-5);
                let at = |f: f64, t: f64| MEASURED.at(f, t).gap_m;
                let here = MEASURED.at(load_n, twist_rad);
                let by_load = (at(load_n + df, twist_rad) - at(load_n - df, twist_rad)) / (2.0 * df);
                let by_twist = (at(load_n, twist_rad + dt) - at(load_n, twist_rad - dt)) / (2.0 * dt);
                assert!((here.by_load - by_load).abs() < 1e-9, "{load_n} {twist_rad}: {here:?} {by_load}");
                assert!((here.by_twist - by_twist).abs() < 1e-9, "{load_n} {twist_rad}: {here:?} {by_twist}");
            }
        }
    }

    #[test]
    fn it_is_the_polynomial_inside_and_nothing_far_outside() {
        let [low, high] = MEASURED.turns.map(twist_from_turns);
        // At a corner of the data every polynomial is one.
        let sum: f64 = MEASURED.coefficients_m.as_flattened().iter().sum();
        assert!((MEASURED.at(15.0, high).gap_m - sum).abs() < 1e-12);
        // In the middle they are 1, 0 and -1/2.
        let c = MEASURED.coefficients_m;
        let middle = c[0][0] - 0.5 * (c[0][2] + c[2][0]) + 0.25 * c[2][2];
        assert!((MEASURED.at(30f64.sqrt(), 0.5 * (low + high)).gap_m - middle).abs() < 1e-12);
        let beyond = 15.0f64 / 2.0;
        for (load_n, twist_rad) in [
            (2.0 / beyond * 0.999, 20.0),
            (15.0 * beyond * 1.001, 20.0),
            (5.0, high + 0.5 * (high - low) + 1e-3),
            (5.0, 0.0),
        ] {
            assert_eq!(MEASURED.at(load_n, twist_rad), Shift::default(), "{load_n} {twist_rad}");
        }
        // It fades over all of that way.
        let half = 0.5 * (high - low);
        for (load_n, twist_rad) in
            [(2.0 / beyond * 1.01, 20.0), (15.0 * beyond * 0.99, 20.0), (5.0, high + 0.99 * half), (5.0, 0.01 * low)]
        {
            assert_ne!(MEASURED.at(load_n, twist_rad).gap_m, 0.0, "{load_n} {twist_rad}");
        }
        // On the way out it never is much more than at the edge.
        let max = MEASURED.coefficients_m.as_flattened().iter().map(|c| c.abs()).sum::<f64>();
        for k in 0..200 {
            let load_n = 15.0 * (beyond * f64::from(k) / 100.0).exp();
            assert!(MEASURED.at(load_n, high).gap_m.abs() <= 1.3 * max, "{load_n}");
        }
    }

    #[test]
    fn one_load_has_a_curve_over_the_twist_that_fades_within_an_octave() {
        let mut one = Correction { load_n: [5.0, 5.0], ..MEASURED };
        assert!(one.validate().is_err(), "rows in the load");
        (one.coefficients_m[1], one.coefficients_m[2]) = ([0.0; 3], [0.0; 3]);
        one.validate().expect("a curve");
        assert!(one.at(5.0, 30.0).gap_m != 0.0 && one.at(6.0, 30.0).gap_m.is_finite());
        assert_eq!((one.at(2.49, 30.0), one.at(10.01, 30.0)), Default::default());
    }

    #[test]
    fn an_equilibrium_has_it_in_gap_slope_and_transmission_and_nowhere_else() {
        let plain = law();
        let corrected = Mechanism::of(Parameters { correction: Some(MEASURED), ..plain });
        let plain = Mechanism::of(plain);
        for (load_n, twist_rad) in [(5.0, 20.0), (5.0, -20.0), (1.2, 40.0), (0.3, 30.0)] {
            let (with, without) =
                (corrected.solve(load_n, twist_rad).expect("solved"), plain.solve(load_n, twist_rad).expect("solved"));
            let shift = MEASURED.at(load_n, twist_rad.abs());
            assert!((with.gap_m - without.gap_m - shift.gap_m).abs() < 1e-15);
            let gap = |f: f64, t: f64| corrected.solve(f, t).expect("solved").gap_m;
            let slope = (gap(load_n, twist_rad + 1e-4) - gap(load_n, twist_rad - 1e-4)) / 2e-4;
            assert!((with.dgap_dtwist_m_per_rad / slope - 1.0).abs() < 1e-6, "{load_n} {twist_rad}");
            assert!((with.tr_rad_per_m() * slope + 1.0).abs() < 1e-6);
            let by_load = (gap(load_n * 1.0001, twist_rad) - gap(load_n * 0.9999, twist_rad)) / (2e-4 * load_n);
            assert!((with.dgap_dload_m_per_n / by_load - 1.0).abs() < 1e-5, "{load_n} {twist_rad}");
            assert_eq!((with.x_m, with.w_m, with.torque_nm), (without.x_m, without.w_m, without.torque_nm));
            if shift == Shift::default() {
                assert_eq!(with, without);
            }
        }
    }

    #[test]
    fn what_is_no_correction_is_refused_by_its_key() {
        type Change = fn(&mut Correction);
        let wrong: [(Change, &str); 7] = [
            (|c| c.load_n = [0.0, 5.0], "correction.load_n"),
            (|c| c.load_n = [5.0, 2.0], "correction.load_n"),
            (|c| c.turns = [-0.5, 7.0], "correction.turns"),
            (|c| c.turns = [1.0, f64::NAN], "correction.turns"),
            (|c| c.coefficients_m[1][2] = f64::NAN, "correction.coefficients_m"),
            (|c| c.coefficients_m[0][0] = 6e-3, "correction.coefficients_m"),
            (|c| c.load_n[1] = f64::INFINITY, "correction.load_n"),
        ];
        MEASURED.validate().expect("valid");
        for (change, key) in wrong {
            let mut correction = MEASURED;
            change(&mut correction);
            assert_eq!(correction.validate().map_err(|e| e.parameter), Err(key));
        }
    }
}
