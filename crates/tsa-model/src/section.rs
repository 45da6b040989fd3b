//! A round section of the rod in tension and bending (eqs 16, 17), and its inversion.
//!
//! Stresses are divided by Young's modulus at zero strain, forces by A·E. With b = κR and y = b², the energy of the
//! section is w(e, y) = w0(e) + w2(e) y + w4(e) y² + w6 y³, where integrating eq. 12 over the circle gives
//! w2 = σ'/8, w4 = (a3 + 4 a4 e + 10 a5 e²)/32, w6 = 5 a5/384 (the paper's B0, B1, I0, I1 are misprinted; model.md 3).
//! y rather than κ is the unknown: near the rod's tip κ vanishes like a square root, y linearly.

use crate::error::SolveError;
use crate::scalar::Scalar;

/// A round section, normalised by its modulus at zero strain.
#[derive(Clone, Copy, Debug)]
pub struct Section<T = f64> {
    /// a_i / a_1.
    a: [T; 5],
}

/// Axial strain and squared bending strain of a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strain<T = f64> {
    /// Stretch of the axis e.
    pub axial: T,
    /// (κR)².
    pub bending_squared: T,
}

impl<T: Scalar> Strain<T> {
    /// Largest fibre strain |e| + κR.
    pub fn fibre(&self) -> f64 {
        self.axial.value().abs() + Scalar::sqrt(self.bending_squared.value())
    }
}

/// σ and its derivatives at the axis, and the bending terms of the energy.
struct Terms<T> {
    stress: T,
    tangent: T,
    second: T,
    third: T,
    w4: T,
    w4_e: T,
    w4_ee: T,
    w6: T,
}

/// The section equations at a strain: axial force n, q = κm − (w − w0), and their derivatives.
struct Equations<T> {
    /// What bending adds to the axial force: apart from the stress at the axis, beside which it may be a rounding.
    bent: T,
    n_e: T,
    n_y: T,
    q: T,
    q_e: T,
    q_y: T,
    stress: T,
}

/// What the first integral asks of a section.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Demand<T> {
    /// Axial force over A·E.
    pub n: T,
    /// Axial force at the tip less the one here, over A·E (given apart, so that no digit cancels).
    pub n_tip_less_n: T,
    /// The part of it that stretches the axis: all, or nothing for an inextensible rod.
    pub axial_less: T,
    /// Stretch of the axis at the tip.
    pub tip_stretch: T,
}

/// A solved section with the Jacobian of its two equations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solved<T> {
    pub strain: Strain<T>,
    /// Stretch at the tip less the one here: small near the tip, and kept apart so that no digit cancels.
    pub less_stretch: T,
    pub iterations: u32,
    jacobian: [T; 4],
}

impl<T: Scalar> Solved<T> {
    /// Derivative of (e, y) when the right-hand sides of the two equations move by (r1, r2).
    pub(crate) fn derivative(&self, r1: T, r2: T) -> (T, T) {
        let [a, b, c, d] = self.jacobian;
        let det = a * d - b * c;
        ((r1 * d - r2 * b) / det, (a * r2 - c * r1) / det)
    }
}

/// The section's tangent is not positive at this bending strain κR.
fn singular(bending_strain: f64) -> SolveError {
    SolveError::SectionSingular { bending_strain }
}

impl<T: Scalar> Equations<T> {
    /// Derivatives of the axial force and of the first integral by e and y.
    fn jacobian(&self, n: T) -> [T; 4] {
        [self.n_e, self.n_y, self.q_e + n - self.stress, self.q_y]
    }
}

impl<T: Scalar> Section<T> {
    /// The section of a rod with these coefficients a1…a5 of eq. 12 (Pa).
    pub fn new(stress_coefficients_pa: &[T; 5]) -> Self {
        Self { a: stress_coefficients_pa.map(|a| a / stress_coefficients_pa[0]) }
    }

    /// The same section in another kind of number.
    pub fn map<U>(&self, f: impl Fn(T) -> U) -> Section<U> {
        Section { a: self.a.map(f) }
    }

    fn terms(&self, e: T) -> Terms<T> {
        let [a1, a2, a3, a4, a5] = self.a;
        let w4_ee = a5 * (20.0 / 32.0);
        Terms {
            stress: e * (a1 + e * (a2 + e * (a3 + e * (a4 + e * a5)))),
            tangent: a1 + e * (a2 * 2.0 + e * (a3 * 3.0 + e * (a4 * 4.0 + e * a5 * 5.0))),
            second: a2 * 2.0 + e * (a3 * 6.0 + e * (a4 * 12.0 + e * a5 * 20.0)),
            third: a3 * 6.0 + e * (a4 * 24.0 + e * a5 * 60.0),
            w4: (a3 + e * (a4 * 4.0 + e * a5 * 10.0)) * (1.0 / 32.0),
            w4_e: a4 * (1.0 / 8.0) + w4_ee * e,
            w4_ee,
            w6: a5 * (5.0 / 384.0),
        }
    }

    /// Energy of pure stretch over A·E.
    pub(crate) fn stretch_energy(&self, e: T) -> T {
        let [a1, a2, a3, a4, a5] = self.a;
        e * e * (a1 / 2.0 + e * (a2 / 3.0 + e * (a3 / 4.0 + e * (a4 / 5.0 + e * a5 / 6.0))))
    }

    fn equations(&self, e: T, y: T) -> Equations<T> {
        let t = self.terms(e);
        Equations {
            bent: y * (t.second * 0.125 + y * t.w4_e),
            n_e: t.tangent + y * (t.third * 0.125 + y * t.w4_ee),
            n_y: t.second * 0.125 + y * t.w4_e * 2.0,
            q: y * (t.tangent * 0.125 + y * (t.w4 * 3.0 + y * t.w6 * 5.0)),
            q_e: y * (t.second * 0.125 + y * t.w4_e * 3.0),
            q_y: t.tangent * 0.125 + y * (t.w4 * 6.0 + y * t.w6 * 15.0),
            stress: t.stress,
        }
    }

    /// Bending moment over A·E·R at a strain (eq. 17).
    pub fn moment(&self, strain: Strain<T>) -> T {
        let t = self.terms(strain.axial);
        let y = strain.bending_squared;
        y.sqrt() * (t.tangent * 0.25 + y * (t.w4 * 4.0 + y * t.w6 * 6.0))
    }

    /// Axial force over A·E at a strain (eq. 16).
    pub fn axial_force(&self, strain: Strain<T>) -> T {
        let eq = self.equations(strain.axial, strain.bending_squared);
        eq.stress + eq.bent
    }

    /// Strain energy over A·E at a strain.
    pub fn energy(&self, strain: Strain<T>) -> T {
        let t = self.terms(strain.axial);
        let y = strain.bending_squared;
        self.stretch_energy(strain.axial) + y * (t.tangent * 0.125 + y * (t.w4 + y * t.w6))
    }

    /// Stretch of a section without bending under the axial force n (over A·E).
    pub(crate) fn stretch(&self, n: T) -> Result<T, SolveError> {
        let mut e = n;
        let mut left = T::EXTRA_STEPS;
        for _ in 0..50 {
            let t = self.terms(e);
            if t.tangent.value() <= 0.0 || t.tangent.value().is_nan() {
                return Err(singular(0.0));
            }
            let step = (t.stress - n) / t.tangent;
            e -= step;
            if step.value().abs() <= 4.0 * T::EPSILON * e.value().abs() {
                if left == 0 {
                    return Ok(e);
                }
                left -= 1;
            }
        }
        // Rounding may keep the last bit moving; anything worse is a flat curve.
        let miss = self.terms(e).stress - n;
        if miss.value().abs() <= T::PRECISION * n.value().abs() { Ok(e) } else { Err(singular(0.0)) }
    }

    /// σ(e1) − σ(e0) over e1 − e0, and w0(e1) − w0(e0) over e1 − e0, without cancellation.
    fn divided_differences(&self, e1: T, e0: T) -> (T, T) {
        let (mut stress, mut energy) = (T::of(0.0), T::of(0.0));
        // complete = Σ e1^(i−k) e0^k
        let (mut complete, mut power) = (T::of(1.0), T::of(1.0));
        for (a, share) in self.a.into_iter().zip([1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0, 1.0 / 6.0]) {
            stress += a * complete;
            power = power * e0;
            complete = complete * e1 + power;
            energy += a * complete * share;
        }
        (stress, energy)
    }

    /// Stretch (less the tip's) and squared bending strain of a straight-line material, exactly.
    pub(crate) fn linear_guess(demand: Demand<T>) -> (T, T) {
        (demand.axial_less, demand.n_tip_less_n * ((demand.tip_stretch + demand.n) * 4.0 + 8.0))
    }

    /// Strain at which the axial force is `demand.n` and the first integral has the tip's value (subscript l):
    /// q(e, y) + e n − w0(e) = (n_l − n) + e_l n_l − w0(e_l). Both are written in e_l − e, so that no digit cancels
    /// near the tip. `start` is a guess of (e_l − e, y).
    pub(crate) fn solve(&self, demand: Demand<T>, start: (T, T)) -> Result<Solved<T>, SolveError> {
        let Demand { n, n_tip_less_n, axial_less, tip_stretch } = demand;
        let (mut less, mut y) = start;
        let mut iterations = 0;
        let mut left = T::EXTRA_STEPS;
        loop {
            let e = tip_stretch - less;
            let eq = self.equations(e, y);
            let [a, b, c, d] = eq.jacobian(n);
            let det = a * d - b * c;
            let stopped = singular(Scalar::sqrt(y.value().max(0.0)));
            if !(det.value() > 0.0 && a.value() > 0.0) {
                return Err(stopped);
            }
            let (slope, mean) = self.divided_differences(tip_stretch, e);
            let r1 = less * slope - eq.bent - axial_less;
            let r2 = n_tip_less_n * (tip_stretch + 1.0) + less * (n - mean) - eq.q;
            let (mut de, mut dy) = ((r1 * d - r2 * b) / det, (a * r2 - c * r1) / det);
            // y must stay positive: shorten a step that would leave.
            let leaves = y.value() + dy.value() <= 0.1 * y.value();
            if leaves {
                let scale = 0.9 * y.value() / -dy.value();
                de = de * scale;
                dy = dy * scale;
            }
            less -= de;
            y += dy;
            iterations += 1;
            if !leaves
                && dy.value().abs() <= T::LAST_STEP_TOLERANCE * y.value()
                && de.value().abs() <= T::LAST_STEP_TOLERANCE * (less.value().abs() + y.value())
            {
                if left == 0 {
                    let strain = Strain { axial: tip_stretch - less, bending_squared: y };
                    let jacobian = self.equations(strain.axial, y).jacobian(n);
                    return Ok(Solved { strain, less_stretch: less, iterations, jacobian });
                }
                left -= 1;
            }
            if iterations >= 60 {
                return Err(stopped);
            }
        }
    }

    /// Stretch e and bending strain b = κR at an axial force (over A·E) and a bending moment (over A·E·R), as an integration
    /// along the rod needs them, and the Jacobian of force and moment. `start` is a guess of (e, b).
    ///
    /// # Errors
    /// [`SolveError::SectionSingular`].
    pub fn invert(&self, n: T, m: T, start: (T, T)) -> Result<(T, T, [T; 4]), SolveError> {
        let (mut e, mut b) = start;
        let mut left = T::EXTRA_STEPS;
        for _ in 0..60 {
            let t = self.terms(e);
            let y = b * b;
            let n_now = t.stress + y * (t.second * 0.125 + y * t.w4_e);
            let m_now = b * (t.tangent * 0.25 + y * (t.w4 * 4.0 + y * t.w6 * 6.0));
            let n_e = t.tangent + y * (t.third * 0.125 + y * t.w4_ee);
            let n_b = b * (t.second * 0.25 + y * t.w4_e * 4.0);
            let m_b = t.tangent * 0.25 + y * (t.w4 * 12.0 + y * t.w6 * 30.0);
            let det = n_e * m_b - n_b * n_b;
            if !(det.value() > 0.0 && n_e.value() > 0.0) {
                return Err(singular(b.value().abs()));
            }
            let (r1, r2) = (n - n_now, m - m_now);
            let (de, db) = ((r1 * m_b - r2 * n_b) / det, (n_e * r2 - n_b * r1) / det);
            e += de;
            b += db;
            if de.value().abs() + db.value().abs() <= T::LAST_STEP_TOLERANCE * (e.value().abs() + b.value().abs()) {
                if left == 0 {
                    return Ok((e, b, [n_e, n_b, n_b, m_b]));
                }
                left -= 1;
            }
        }
        Err(singular(b.value().abs()))
    }

    /// Least bending stiffness over that of the unbent section, from no bending up to y = (κR)², the axis unstretched.
    pub fn softest(&self, bending_squared: f64) -> f64 {
        let [_, a2, a3, _, a5] = self.a.map(Scalar::value);
        let at = |y: f64| 1.0 + y * (1.5 * a3 - a2 * a2 + y * (25.0 / 16.0) * a5);
        let ends = at(bending_squared).min(1.0);
        let vertex = (a2 * a2 - 1.5 * a3) / (2.0 * (25.0 / 16.0) * a5);
        if vertex > 0.0 && vertex < bending_squared { ends.min(at(vertex)) } else { ends }
    }

    /// κM + (1 + e)N − W over A·E: constant along the rod (model.md section 3).
    pub fn first_integral(&self, strain: Strain<T>) -> T {
        let b = strain.bending_squared.sqrt();
        b * self.moment(strain) + (strain.axial + 1.0) * self.axial_force(strain) - self.energy(strain)
    }
}
