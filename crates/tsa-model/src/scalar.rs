//! The numbers that the solver computes with: f64, or f64 with its derivatives by some parameters ([`Dual`]).
//!
//! Elementary functions are std's on a desktop and libm's on the board.

use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

#[cfg(feature = "std")]
mod imp {
    pub fn sqrt(x: f64) -> f64 {
        x.sqrt()
    }
    pub fn sin_cos(x: f64) -> (f64, f64) {
        x.sin_cos()
    }
    pub fn asin(x: f64) -> f64 {
        x.asin()
    }
    pub fn exp_m1(x: f64) -> f64 {
        x.exp_m1()
    }
    pub fn ln(x: f64) -> f64 {
        x.ln()
    }
    pub fn powf(x: f64, y: f64) -> f64 {
        x.powf(y)
    }
}

#[cfg(not(feature = "std"))]
mod imp {
    pub use libm::{asin, expm1 as exp_m1, log as ln, pow as powf, sincos as sin_cos, sqrt};
}

pub(crate) use imp::ln;

/// Scaled residual of an equilibrium that counts as solved.
pub const RESIDUAL: f64 = 1e-12;
/// Scaled residual below which there is only rounding.
pub const PRECISION: f64 = 1e-14;
/// Relative step, or residual at twice the nodes, after which one more Newton step leaves only rounding.
pub(crate) const LAST_STEP_TOLERANCE: f64 = 3e-8;

/// Coefficients of x², x⁴ … in sinh² x, 2²ᵏ⁻¹/(2k)!, as many as f64 resolves for x ≤ 1.
const SINH_SQUARED: [f64; 12] = {
    let mut all = [1.0; 12];
    let mut k = 1;
    while k < all.len() {
        let n = (2 * k + 2) as f64;
        all[k] = all[k - 1] * 4.0 / (n * (n - 1.0));
        k += 1;
    }
    all
};

/// A number that the solver can compute with.
pub trait Scalar:
    Copy
    + PartialEq
    + core::fmt::Debug
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
{
    /// Newton steps after the value has settled until the derivatives have, too.
    const EXTRA_STEPS: u32;
    /// A constant.
    fn of(value: f64) -> Self;
    /// The number without its derivatives.
    fn value(self) -> f64;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Sine and cosine.
    fn sin_cos(self) -> (Self, Self);
    /// Arc sine.
    fn asin(self) -> Self;
    /// e^x − 1.
    fn exp_m1(self) -> Self;
    /// x^y for x ≥ 0.
    fn powf(self, exponent: Self) -> Self;

    /// sinh² x, without cancellation near zero.
    fn sinh_squared(self) -> Self {
        let square = self * self;
        if square.value() > 1.0 {
            let grown = (self * 2.0).exp_m1();
            return grown * grown / ((grown + 1.0) * 4.0);
        }
        // ½ Σ (2x)²ᵏ/(2k)!
        SINH_SQUARED.iter().rev().fold(Self::of(0.0), |sum, c| (sum + *c) * square)
    }

    /// Hyperbolic sine and cosine, without cancellation near zero.
    fn sinh_cosh(self) -> (Self, Self) {
        let grown = self.exp_m1();
        let shrunk = grown / (grown + 1.0);
        ((grown + shrunk) * 0.5, (grown - shrunk) * 0.5 + 1.0)
    }
}

impl Scalar for f64 {
    const EXTRA_STEPS: u32 = 0;
    fn of(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
    fn sqrt(self) -> Self {
        imp::sqrt(self)
    }
    fn sin_cos(self) -> (Self, Self) {
        imp::sin_cos(self)
    }
    fn asin(self) -> Self {
        imp::asin(self)
    }
    fn exp_m1(self) -> Self {
        imp::exp_m1(self)
    }
    fn powf(self, exponent: Self) -> Self {
        imp::powf(self, exponent)
    }
}

/// A number with its derivatives by N parameters: forward differentiation, exact to rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const N: usize> {
    /// The number.
    pub value: f64,
    /// Its derivatives.
    pub by: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// The k-th parameter itself.
    pub fn parameter(value: f64, k: usize) -> Self {
        let mut by = [0.0; N];
        by[k] = 1.0;
        Self { value, by }
    }

    /// f(x) where `value` is f and `slope` f' at x.
    fn chain(self, value: f64, slope: f64) -> Self {
        Self { value, by: self.by.map(|d| slope * d) }
    }

    fn blend(self, other: Self, value: f64, mine: f64, theirs: f64) -> Self {
        let mut by = self.by;
        for (d, e) in by.iter_mut().zip(other.by) {
            *d = mine * *d + theirs * e;
        }
        Self { value, by }
    }
}

impl<const N: usize> Scalar for Dual<N> {
    const EXTRA_STEPS: u32 = 1;
    fn of(value: f64) -> Self {
        Self { value, by: [0.0; N] }
    }
    fn value(self) -> f64 {
        self.value
    }
    fn sqrt(self) -> Self {
        let root = imp::sqrt(self.value);
        self.chain(root, 0.5 / root)
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = imp::sin_cos(self.value);
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    fn asin(self) -> Self {
        self.chain(imp::asin(self.value), 1.0 / imp::sqrt(1.0 - self.value * self.value))
    }
    fn exp_m1(self) -> Self {
        let grown = imp::exp_m1(self.value);
        self.chain(grown, grown + 1.0)
    }
    fn powf(self, exponent: Self) -> Self {
        let value = imp::powf(self.value, exponent.value);
        if self.value == 0.0 {
            // x^y and its derivatives vanish with x for y > 1; below, only the value is of use.
            return Self::of(value);
        }
        self.blend(exponent, value, exponent.value * value / self.value, value * imp::ln(self.value))
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.blend(other, self.value + other.value, 1.0, 1.0)
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.blend(other, self.value - other.value, 1.0, -1.0)
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.blend(other, self.value * other.value, other.value, self.value)
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        self.blend(other, value, 1.0 / other.value, -value / other.value)
    }
}

impl<const N: usize> Add<f64> for Dual<N> {
    type Output = Self;
    fn add(self, other: f64) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl<const N: usize> Sub<f64> for Dual<N> {
    type Output = Self;
    fn sub(self, other: f64) -> Self {
        Self { value: self.value - other, ..self }
    }
}

impl<const N: usize> Mul<f64> for Dual<N> {
    type Output = Self;
    fn mul(self, other: f64) -> Self {
        self.chain(self.value * other, other)
    }
}

impl<const N: usize> Div<f64> for Dual<N> {
    type Output = Self;
    fn div(self, other: f64) -> Self {
        self.chain(self.value / other, 1.0 / other)
    }
}

impl<const N: usize> AddAssign for Dual<N> {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const N: usize> SubAssign for Dual<N> {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each function against a sixth-order difference.
    #[test]
    fn derivatives_are_those_of_the_functions() {
        type D = Dual<1>;
        let functions: [fn(D) -> D; 10] = [
            |x| x.sqrt(),
            |x| x.sin_cos().0,
            |x| x.sin_cos().1,
            |x| x.asin(),
            |x| x.exp_m1(),
            |x| x.powf(D::of(0.43)),
            |x| D::of(0.7).powf(x),
            |x| x.sinh_cosh().0 / x.sinh_cosh().1,
            |x| x.sinh_squared(),
            |x| -(x * 2.0 - x / 3.0 + 1.0) * x / (x + 4.0 - x * x),
        ];
        for (k, f) in functions.iter().enumerate() {
            for x in [0.1, 0.4, 0.8] {
                let value = |x: f64| f(D::of(x)).value;
                let h = 1e-3;
                let d = |n: f64| value(x + n * h) - value(x - n * h);
                let slope = (45.0 * d(1.0) - 9.0 * d(2.0) + d(3.0)) / (60.0 * h);
                let exact = f(D::parameter(x, 0)).by[0];
                assert!((exact - slope).abs() < 1e-9 * (1.0 + slope.abs()), "function {k} at {x}: {exact}, {slope}");
            }
        }
    }
}
