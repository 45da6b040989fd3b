//! The sections along a rod, solved one after the other from the tip on.
//!
//! With x = N_l − N over A·E, stretch and squared bending strain are e_l − e = x D and (κR)² = x Y, where D and Y change
//! slowly and do not vanish at the tip. Force and first integral, divided by x, are two equations for them in which no
//! digit cancels. Stresses are expanded about the tip's stretch.

use super::{Rod, RodModel};
use crate::error::SolveError;
use crate::scalar::{LAST_STEP_TOLERANCE, Scalar};
use crate::section::{Strain, singular};

/// How a section is solved.
enum Law {
    /// In closed form.
    Straight,
    Polynomial,
}

/// The sections of a rod whose tip carries a given axial force.
pub(super) struct Sections<T> {
    law: Law,
    /// 1 if the axial force stretches the axis, else 0.
    axial: f64,
    /// Stretch at the tip.
    pub stretch: T,
    /// Taylor coefficients of σ there.
    taylor: [T; 6],
    /// x, D and Y at the last section and at the one before it.
    known: [(f64, T, T); 2],
    /// Whether the derivatives must be as exact as the values.
    exact: bool,
    /// Evaluations of a section.
    pub evaluations: u32,
}

/// A solved section.
pub(super) struct Solved<T> {
    pub strain: Strain<T>,
    /// Stretch of the axis, 0 for an inextensible rod.
    pub stretch: T,
    /// Stretch at the tip less the one here.
    pub less_stretch: T,
    /// Y.
    pub ratio: T,
    /// ∂(κR)²/∂x over Y, with the tip's force constant.
    pub growth: T,
    /// ∂Y/∂N_l over Y and ∂e/∂N_l, with x constant.
    pub ratio_by_tip: T,
    pub stretch_by_tip: T,
    /// ∂e/∂x with the tip's force constant.
    pub stretch_by_x: T,
}

/// The two equations at a guess of D and Y: what is left of them, and their derivatives by e and (κR)².
struct Equations<T> {
    left: [T; 2],
    jacobian: [T; 4],
    /// The third derivative over x.
    third: T,
}

impl<T: Scalar> Sections<T> {
    pub fn new(rod: &Rod<T>, tip_force: T, exact: bool) -> Result<Self, SolveError> {
        let full = rod.model == RodModel::Full;
        let law = match rod.model {
            RodModel::Elastica => Law::Straight,
            _ if rod.section.is_straight() => Law::Straight,
            RodModel::Full | RodModel::Inextensible => Law::Polynomial,
        };
        let stretch = if full { rod.section.stretch(tip_force)? } else { T::of(0.0) };
        let axial = if full { 1.0 } else { 0.0 };
        let taylor = rod.section.taylor(stretch);
        // Both equations at x = 0.
        let ratio = (stretch + 1.0) * 8.0 / taylor[1];
        let tip = (0.0, (ratio * taylor[2] * 0.25 + axial) / taylor[1], ratio);
        Ok(Self { law, axial, stretch, taylor, known: [tip; 2], exact, evaluations: 0 })
    }

    /// The section at x, which must be larger than that of the section before.
    pub fn next(&mut self, x: T) -> Result<Solved<T>, SolveError> {
        match self.law {
            Law::Straight => Ok(self.straight(x)),
            Law::Polynomial => self.polynomial(x),
        }
    }

    /// σ proportional to ε: D is 1 or nothing is stretched, and Y = 8 (1 + e_l − x/2).
    fn straight(&mut self, x: T) -> Solved<T> {
        self.evaluations += 1;
        let (less, tip) = (x * self.axial, self.stretch + 1.0);
        let ratio = (tip - less * 0.5) * 8.0;
        let over = T::of(8.0) / ratio;
        Solved {
            strain: Strain { axial: self.stretch - less, bending_squared: x * ratio },
            stretch: self.stretch - less,
            less_stretch: less,
            ratio,
            growth: (tip - less) * over,
            ratio_by_tip: over * self.axial,
            stretch_by_tip: T::of(self.axial),
            stretch_by_x: T::of(-self.axial),
        }
    }

    fn polynomial(&mut self, x: T) -> Result<Solved<T>, SolveError> {
        let [(x1, d1, y1), (x2, d2, y2)] = self.known;
        let to = x.value();
        // Linear extrapolation is limited to short distances.
        let ahead = if x2 < x1 && to < 4.0 * x1 { (to - x1) / (x1 - x2) } else { 0.0 };
        let start = (d1 + (d1 - d2) * ahead, y1 + (y1 - y2) * ahead);
        let direct = self.solve(x, start);
        // A strongly curved law between two sections far apart: in smaller steps from the last one.
        direct.or_else(|_| self.march(x, 16)).or_else(|_| self.march(x, 256))
    }

    /// The section at x, reached in the given number of steps from the last one.
    fn march(&mut self, x: T, steps: u32) -> Result<Solved<T>, SolveError> {
        let before = self.known;
        let from = before[0].0;
        for k in 1..steps {
            let [(_, d, y), _] = self.known;
            let part = f64::from(k) / f64::from(steps);
            if let Err(e) = self.solve(x * part + from * (1.0 - part), (d, y)) {
                self.known = before;
                return Err(e);
            }
        }
        let [(_, d, y), _] = self.known;
        self.solve(x, (d, y)).inspect_err(|_| self.known = before)
    }

    fn equations(&self, x: T, (d, y): (T, T)) -> Equations<T> {
        let (less, bent) = (x * d, x * y);
        let [_, t1, t2, t3, t4, t5] = self.taylor;
        // Moved to the stretch here, which is less; the first pass leaves (σ_l − σ)/(e_l − e).
        let mut s = self.taylor;
        let mut shift = |first: usize| {
            for k in (first..5).rev() {
                s[k] -= less * s[k + 1];
            }
            s[first]
        };
        let slope = shift(1);
        let _ = [shift(1), shift(2), shift(3), shift(4)];
        let [_, s1, s2, s3, s4, s5] = s;
        let first = s2 * 0.25;
        let fourth = bent * s4 * 0.125;
        let sixth = bent * s5;
        let n_e = s1 + bent * (s3 * 0.75 + sixth * 0.625);
        let n_y = first + fourth * 2.0;
        let third = y * (first + fourth * 3.0) + d * slope - self.axial;
        let q_y = s1 * 0.125 + bent * (s3 * (3.0 / 16.0) + sixth * (25.0 / 128.0));
        // ((w0(e_l) − w0(e))/(e_l − e) − σ_l)
        let mean = less
            * (t1 * 0.5 - less * (t2 * (1.0 / 3.0) - less * (t3 * 0.25 - less * (t4 * 0.2 - less * t5 * (1.0 / 6.0)))));
        let left_force = d * slope - y * (first + fourth) - self.axial;
        let left_integral = self.stretch + 1.0 + d * (mean - x * self.axial)
            - y * (s1 * 0.125 + bent * (s3 * (3.0 / 32.0) + sixth * (25.0 / 384.0)));
        Equations { left: [left_force, left_integral], jacobian: [n_e, n_y, third * x, q_y], third }
    }

    /// Solves the two equations from a guess of D and Y.
    fn solve(&mut self, x: T, start: (T, T)) -> Result<Solved<T>, SolveError> {
        let (mut d, mut y) = start;
        let mut left = T::EXTRA_STEPS;
        let mut settled = false;
        for _ in 0..60 {
            let now = self.equations(x, (d, y));
            let [a, b, c, q] = now.jacobian;
            let det = a * q - b * c;
            if !(det.value() > 0.0 && a.value() > 0.0) {
                break;
            }
            let over = T::of(1.0) / det;
            if settled {
                return Ok(self.solved(x, (d, y), &now, over));
            }
            let [r1, r2] = now.left;
            let (mut de, mut dy) = ((r1 * q - r2 * b) * over, (a * r2 - c * r1) * over);
            // Y must stay positive: shorten a step that would leave.
            let leaves = y.value() + dy.value() <= 0.1 * y.value();
            if leaves {
                let scale = 0.9 * y.value() / -dy.value();
                de = de * scale;
                dy = dy * scale;
            }
            d -= de;
            y += dy;
            self.evaluations += 1;
            let size = dy.value().abs().max(de.value().abs());
            if !leaves && size <= LAST_STEP_TOLERANCE * y.value() {
                if left == 0 {
                    // After a step of rounding the derivatives are as good as after another one.
                    if !self.exact || T::EXTRA_STEPS == 0 && size <= 4.0 * f64::EPSILON * y.value() {
                        return Ok(self.solved(x, (d, y), &now, over));
                    }
                    settled = true;
                } else {
                    left -= 1;
                }
            }
        }
        Err(singular(Scalar::sqrt((x * y).value().max(0.0))))
    }

    fn solved(&mut self, x: T, (d, y): (T, T), now: &Equations<T>, over: T) -> Solved<T> {
        self.known = [(x.value(), d, y), self.known[0]];
        let [a, b, c, q] = now.jacobian;
        let less = x * d;
        let axial = self.axial;
        let strain = Strain { axial: self.stretch - less, bending_squared: x * y };
        Solved {
            strain,
            stretch: strain.axial * axial,
            less_stretch: less * axial,
            ratio: y,
            growth: (a * (strain.axial * axial + 1.0) + c * axial) * over / y,
            ratio_by_tip: (a * d - now.third) * over * axial / y,
            stretch_by_tip: (q - b * less) * over * axial,
            stretch_by_x: -(q * axial + b * (strain.axial * axial + 1.0)) * over * axial,
        }
    }
}
