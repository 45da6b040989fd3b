//! The table's numbers: the arc of the strings in closed form, and short polynomials for the rest.
//!
//! Twist changes the equilibrium only through the arc a = θ r that the strings add to the horizontal run (eq. 25), and
//! eq. 6 says how r depends on load and twist: a = κ θ/F + ρ(θ). As a function of load and arc the gap has neither the
//! 1/F of a light load nor the power or logarithm of the radius model, and its square is smoother still:
//! G² ≈ L0² − (D + a)². So G² is a short polynomial in F and a on each of a few ranges of the load.

/// The mechanism at a load and a twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Gap G between the clamps (m).
    pub gap_m: f32,
    /// ∂G/∂θ at constant load (m/rad), negative.
    pub dgap_dtwist_m_per_rad: f32,
    /// ∂G/∂F at constant twist (m/N), positive.
    pub dgap_dload_m_per_n: f32,
}

impl Point {
    /// TR = −1/(∂G/∂θ) (rad/m), eq. 29.
    #[inline]
    pub fn tr_rad_per_m(&self) -> f32 {
        -1.0 / self.dgap_dtwist_m_per_rad
    }
}

/// Name of this form of table in messages and reports.
pub const FORM: &str = "arc-series";

/// a(F, θ) = κ θ/F + ρ(θ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// κ = r0/k1 (m N).
    pub per_load_m_n: f32,
    /// Coefficients of ρ in powers of the twist (m/rad^i), from the highest power down to the first; ρ(0) = 0.
    pub powers: [f32; POWERS],
    /// Coefficient of θ ln(θ/π) in ρ (m/rad), beside which ρ has its first power only; 0: none.
    pub per_log_m: f32,
}

/// Powers of the twist in ρ. The number is fixed, so that the loop over them is unrolled.
pub const POWERS: usize = 6;

impl Growth {
    /// Bytes of numbers.
    pub const BYTES: usize = 8 + 4 * POWERS;

    /// Arc (m) and its derivatives by twist (m/rad) and load (m/N).
    #[inline]
    pub fn arc(&self, load_n: f32, twist_rad: f32) -> [f32; 3] {
        let per_newton = 1.0 / load_n;
        let per_twist = self.per_load_m_n * per_newton;
        // ρ = θ · value, and what the value adds to the slope of ρ.
        let (value, rise) = if self.per_log_m == 0.0 {
            let (value, slope) = descend(&self.powers, twist_rad);
            (value, twist_rad * slope)
        } else {
            (self.powers[POWERS - 1] + self.per_log_m * log_of_half_turns(twist_rad), self.per_log_m)
        };
        let total = per_twist + value;
        [twist_rad * total, total + rise, -per_twist * twist_rad * per_newton]
    }
}

/// Logarithm of θ/π for a twist θ up to 100 rad, positive and normal, to 1e-6, in some 15 operations and with the same bits on every
/// machine.
#[inline]
fn log_of_half_turns(twist_rad: f32) -> f32 {
    // ln((1.5 + x)/π) for x from −0.5 to 0.5, interpolated at eight Chebyshev points: 2.6e-7 off at most.
    const LOG: [f32; 8] = [
        0.010_009_29,
        -0.017_405_023,
        0.026_069_587,
        -0.048_932_416,
        0.098_779_03,
        -0.222_245_08,
        0.666_666_56,
        -0.739_264_6,
    ];
    let bits = twist_rad.to_bits();
    let octaves = (bits >> 23) as i32 - 127;
    let mantissa = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000);
    octaves as f32 * core::f32::consts::LN_2 + LOG.iter().fold(0.0, |sum, c| sum * (mantissa - 1.5) + c)
}

/// One range of the load: G² = Σ_j (a − a₀)^j Σ_i c_ij (F − F₀)^i.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Maximum load of the range (N).
    pub load_max_n: f32,
    /// F₀ (N) and a₀ (m).
    pub centre: [f32; 2],
}

impl Patch {
    /// Bytes of numbers beside the coefficients.
    pub const BYTES: usize = 12;
}

/// Maximum powers of the load in a patch.
pub const MAX_ROWS: usize = 6;
/// Maximum powers of the arc in a patch.
pub const MAX_COLUMNS: usize = 9;

/// The number of powers in every patch of a table, and the evaluation that is unrolled for that number.
#[derive(Clone, Copy)]
pub struct Shape {
    /// Powers of the load.
    pub rows: u8,
    /// Powers of the arc.
    pub columns: u8,
    evaluate: fn(&ArcSeries<'_>, f32, f32) -> Point,
}

impl Shape {
    /// The shape with these numbers of powers; `None` above [`MAX_ROWS`] and [`MAX_COLUMNS`], or below 2. Where it is
    /// called in a constant, an image contains the code of that shape only.
    pub const fn of(rows: usize, columns: usize) -> Option<Self> {
        macro_rules! shapes {
            ($($rows:literal: $($columns:literal)*;)*) => {
                match (rows, columns) {
                    // Closures, so that the code is generated in this crate, which is optimised for speed.
                    $($(($rows, $columns) => Some(Self {
                        rows: $rows,
                        columns: $columns,
                        evaluate: |series, load_n, twist_rad| evaluate::<$rows, $columns>(series, load_n, twist_rad),
                    }),)*)*
                    _ => None,
                }
            };
        }
        shapes! {
            2: 2 3 4 5 6 7 8 9;
            3: 2 3 4 5 6 7 8 9;
            4: 2 3 4 5 6 7 8 9;
            5: 2 3 4 5 6 7 8 9;
            6: 2 3 4 5 6 7 8 9;
        }
    }

    /// Coefficients of a patch.
    pub fn terms(&self) -> usize {
        usize::from(self.rows) * usize::from(self.columns)
    }
}

impl PartialEq for Shape {
    fn eq(&self, other: &Self) -> bool {
        [self.rows, self.columns] == [other.rows, other.columns]
    }
}

impl core::fmt::Debug for Shape {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}x{}", self.rows, self.columns)
    }
}

/// Value and slope of a polynomial of at least two coefficients, the highest power first.
#[inline(always)]
fn descend<const N: usize>(coefficients: &[f32; N], x: f32) -> (f32, f32) {
    // The first two terms apart: the compiler may not simplify 0·x + c to c, because x may be NaN.
    let (mut value, mut slope) = (coefficients[0] * x + coefficients[1], coefficients[0]);
    for c in &coefficients[2..] {
        slope = slope * x + value;
        value = value * x + c;
    }
    (value, slope)
}

/// The numbers of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArcSeries<'a> {
    /// How the arc grows.
    pub growth: Growth,
    /// Powers in every range.
    pub shape: Shape,
    /// Ranges of the load, ascending.
    pub patches: &'a [Patch],
    /// Coefficients, range by range: the highest power of the arc first, within it the highest power of the load.
    pub coefficients: &'a [f32],
}

impl ArcSeries<'_> {
    /// Bytes of numbers.
    pub fn bytes(&self) -> usize {
        Growth::BYTES + Patch::BYTES * self.patches.len() + 4 * self.coefficients.len()
    }

    /// Whether the number of coefficients fits ranges and shape.
    pub fn is_consistent(&self) -> bool {
        !self.patches.is_empty() && self.coefficients.len() == self.patches.len() * self.shape.terms()
    }

    /// Gap and gradient at a load (N) and a twist (rad) inside the range. Inconsistent numbers give NaN.
    #[inline]
    pub(crate) fn evaluate(&self, load_n: f32, twist_rad: f32) -> Point {
        (self.shape.evaluate)(self, load_n, twist_rad)
    }
}

/// A polynomial of x and y and its derivatives.
struct Value {
    value: f32,
    by_x: f32,
    by_y: f32,
}

impl Value {
    /// What inconsistent numbers give.
    const NONE: Self = Self { value: f32::NAN, by_x: f32::NAN, by_y: f32::NAN };
}

/// Horner's rule in x within each column and in y across the columns, all powers descending.
#[inline(always)]
fn polynomial<const ROWS: usize, const COLUMNS: usize>(columns: &[[f32; ROWS]; COLUMNS], x: f32, y: f32) -> Value {
    let ((first, by_x), (second, second_by_x)) = (descend(&columns[0], x), descend(&columns[1], x));
    let mut total = Value { value: first * y + second, by_x: by_x * y + second_by_x, by_y: first };
    for column in &columns[2..] {
        let (value, slope) = descend(column, x);
        total.by_y = total.by_y * y + total.value;
        total.by_x = total.by_x * y + slope;
        total.value = total.value * y + value;
    }
    total
}

/// 1/√x of a normal, positive number to a relative 8e-7 (60 nm of a gap), in 11 operations. It replaces a root and a
/// division, and gives the same bits on every machine.
#[inline]
fn inverse_root(x: f32) -> f32 {
    let half = 0.5 * x;
    // Newton's method from the well-known guess by the exponent, which is 3.5 % off. A step turns a relative error e
    // into −1.5 e²; adding half of the maximum such error makes the remaining error symmetric about zero.
    let guess = f32::from_bits(0x5f37_59df_u32.wrapping_sub(x.to_bits() >> 1));
    let root = guess * (1.500_876 - half * guess * guess);
    root * (1.500_000_6 - half * root * root)
}

// Not inlined: its callers are optimised for size, this crate for speed.
#[inline(never)]
fn evaluate<const ROWS: usize, const COLUMNS: usize>(series: &ArcSeries<'_>, load_n: f32, twist_rad: f32) -> Point {
    let [arc_m, arc_by_twist, arc_by_load] = series.growth.arc(load_n, twist_rad);
    // A load that rounding puts beyond the last range is evaluated there.
    let mut left = series.coefficients;
    let mut place = ([0.0; 2], None);
    for patch in series.patches {
        let Some((part, rest)) = left.split_at_checked(ROWS * COLUMNS) else { break };
        place = (patch.centre, part.as_chunks::<ROWS>().0.first_chunk::<COLUMNS>());
        if load_n <= patch.load_max_n {
            break;
        }
        left = rest;
    }
    let v = match place {
        (centre, Some(columns)) => polynomial(columns, load_n - centre[0], arc_m - centre[1]),
        _ => Value::NONE,
    };
    let root = inverse_root(v.value);
    let half = 0.5 * root;
    let by_arc = v.by_y * half;
    Point {
        gap_m: v.value * root,
        dgap_dtwist_m_per_rad: by_arc * arc_by_twist,
        dgap_dload_m_per_n: v.by_x * half + by_arc * arc_by_load,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arc_growth::{self, arc_at};
    use std::f64::consts::PI;

    /// Each power of the twist adds about 1 mm at 20 rad.
    const POWER_LAW: Growth =
        Growth { per_load_m_n: 2e-4, powers: [1.6e-11, -3.1e-10, 6.3e-9, -1.25e-7, 2.5e-6, 5e-5], per_log_m: 0.0 };
    const LOG_LAW: Growth = Growth { per_load_m_n: 2e-4, powers: [0.0, 0.0, 0.0, 0.0, 0.0, 4e-4], per_log_m: 1e-4 };

    /// a(F, θ) = κ θ/F + ρ(θ), as [`Growth`] describes it.
    fn arc(growth: &Growth, load_n: f64, twist_rad: f64) -> f64 {
        let powers = (1..).zip(growth.powers.iter().rev());
        let rho: f64 = powers.map(|(power, c)| f64::from(*c) * twist_rad.powi(power)).sum();
        let log = f64::from(growth.per_log_m) * twist_rad * (twist_rad / PI).ln();
        f64::from(growth.per_load_m_n) * twist_rad / load_n + rho + log
    }

    /// Slope of a function by differences.
    fn slope(of: impl Fn(f64) -> f64, at: f64) -> f64 {
        let step = 1e-4 * at;
        (of(at + step) - of(at - step)) / (2.0 * step)
    }

    fn close(found: f64, expected: f64, relative: f64) -> bool {
        (found - expected).abs() <= relative * expected.abs()
    }

    #[test]
    fn the_arc_and_its_slopes_are_those_of_the_law() {
        for growth in [POWER_LAW, LOG_LAW] {
            for (load_n, twist_rad) in [(0.8, 4.0), (3.0, 20.0), (17.0, 45.0)] {
                let expected = [
                    arc(&growth, load_n, twist_rad),
                    slope(|twist| arc(&growth, load_n, twist), twist_rad),
                    slope(|load| arc(&growth, load, twist_rad), load_n),
                ];
                let found = growth.arc(load_n as f32, twist_rad as f32);
                for (found, expected) in found.into_iter().zip(expected) {
                    assert!(
                        close(f64::from(found), expected, 2e-5),
                        "{found} {expected} at {load_n} N, {twist_rad} rad"
                    );
                }
                let (value, by_twist) = arc_at(&growth, load_n, twist_rad);
                assert!(close(value, expected[0], 1e-12) && close(by_twist, expected[1], 1e-7), "{value} {by_twist}");
            }
        }
    }

    const PATCHES: [Patch; 2] =
        [Patch { load_max_n: 5.0, centre: [3.0, 0.02] }, Patch { load_max_n: 18.0, centre: [11.0, 0.01] }];
    /// Two ranges of two powers of the load and three of the arc; G² falls with the arc and rises with the load.
    const COEFFICIENTS: [f32; 12] = [1e-3, -1.0, 2e-3, -6e-2, 1.1e-4, 6e-3, -2e-3, -0.9, 1e-3, -5e-2, 9e-5, 7e-3];

    fn series() -> ArcSeries<'static> {
        let shape = Shape::of(2, 3).unwrap();
        ArcSeries { growth: POWER_LAW, shape, patches: &PATCHES, coefficients: &COEFFICIENTS }
    }

    /// G = √(Σ_j (a − a₀)^j Σ_i c_ij (F − F₀)^i), as [`Patch`] and [`ArcSeries`] describe it.
    fn gap(patch: usize, load_n: f64, twist_rad: f64) -> f64 {
        let [load_0, arc_0] = PATCHES[patch].centre.map(f64::from);
        let arc_m = arc(&POWER_LAW, load_n, twist_rad);
        let mut square = 0.0;
        for (k, c) in COEFFICIENTS[6 * patch..][..6].iter().enumerate() {
            let (j, i) = (2 - k / 2, 1 - k % 2);
            square += f64::from(*c) * (arc_m - arc_0).powi(j as i32) * (load_n - load_0).powi(i as i32);
        }
        square.sqrt()
    }

    #[test]
    fn gap_and_gradient_are_those_of_the_polynomial_of_the_load_s_range() {
        // At the end of a range, and beyond the last one, where rounding may put a load.
        for (patch, load_n, twist_rad) in
            [(0, 1.5, 6.0), (0, 5.0, 20.0), (1, 5.01, 20.0), (1, 18.0, 30.0), (1, 18.01, 30.0)]
        {
            let expected = [
                gap(patch, load_n, twist_rad),
                slope(|twist| gap(patch, load_n, twist), twist_rad),
                slope(|load| gap(patch, load, twist_rad), load_n),
            ];
            let p = series().evaluate(load_n as f32, twist_rad as f32);
            let found = [p.gap_m, p.dgap_dtwist_m_per_rad, p.dgap_dload_m_per_n].map(f64::from);
            for (found, expected) in found.into_iter().zip(expected) {
                assert!(close(found, expected, 3e-5), "{found} {expected} at {load_n} N, {twist_rad} rad");
            }
            assert!(close(f64::from(p.tr_rad_per_m()), -1.0 / expected[1], 3e-5));
            let [gap_m, by_twist] = arc_growth::evaluate(&series(), load_n, twist_rad);
            assert!(close(gap_m, expected[0], 1e-12) && close(by_twist, expected[1], 1e-6), "{gap_m} {by_twist}");
        }
    }

    #[test]
    fn numbers_that_do_not_fit_together_are_told_and_give_no_gap() {
        assert!(series().is_consistent());
        assert_eq!(series().bytes(), 4 * (8 + 2 * 3 + 12), "κ, log, six powers; three for each range; coefficients");
        let short = ArcSeries { coefficients: &COEFFICIENTS[..11], ..series() };
        assert!(!short.is_consistent() && !short.evaluate(1.0, 10.0).gap_m.is_nan());
        for (load_n, twist_rad) in [(6.0, 10.0), (18.0, 40.0)] {
            assert!(
                ArcSeries { coefficients: &COEFFICIENTS[..5], ..series() }.evaluate(load_n, twist_rad).gap_m.is_nan()
            );
        }
        assert!(!ArcSeries { patches: &[], coefficients: &[], ..series() }.is_consistent());
    }

    #[test]
    fn every_shape_from_2_to_6_and_2_to_9_powers_is_known() {
        for rows in 0..10 {
            for columns in 0..12 {
                let shape = Shape::of(rows, columns);
                let known = (2..=MAX_ROWS).contains(&rows) && (2..=MAX_COLUMNS).contains(&columns);
                assert_eq!(shape.is_some(), known, "{rows} {columns}");
                let Some(shape) = shape else { continue };
                assert_eq!((shape.terms(), format!("{shape:?}")), (rows * columns, format!("{rows}x{columns}")));
                assert!(shape == Shape::of(rows, columns).unwrap());
                assert!(Some(shape) != Shape::of(rows, columns + 1) && Some(shape) != Shape::of(rows + 1, columns));
            }
        }
    }

    #[test]
    fn the_logarithm_is_good_to_1e_6_up_to_100_rad() {
        let error = |twist: f32| f64::from(log_of_half_turns(twist)) - (f64::from(twist) / std::f64::consts::PI).ln();
        let bits = 1.0f32.to_bits()..100.0f32.to_bits();
        let worst = bits.step_by(101).map(|b| error(f32::from_bits(b)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6, "{worst:e}");
    }

    #[test]
    fn the_inverse_root_is_good_to_8e_7_everywhere() {
        // Two octaves contain every case: other numbers differ from these by the exponent alone.
        let bits = 1.0f32.to_bits()..4.0f32.to_bits();
        let error = |x: f32| f64::from(inverse_root(x)) * f64::from(x).sqrt() - 1.0;
        let worst = bits.step_by(7).map(|b| error(f32::from_bits(b)).abs()).fold(0.0, f64::max);
        assert!(worst < 8e-7, "{worst:e}");
        assert!(error(0.0064).abs() < 8e-7 && error(1e-30).abs() < 8e-7);
    }
}
