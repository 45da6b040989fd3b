//! A round section of the rod in tension and bending (eqs 16, 17), and its inversion.
//!
//! Stresses are divided by Young's modulus at zero strain, forces by A·E. With b = κR and y = b², the energy of the
//! section is w(e, y) = w0(e) + w2(e) y + w4(e) y² + w6 y³, where integrating eq. 12 over the circle gives
//! w2 = σ'/8, w4 = (a3 + 4 a4 e + 10 a5 e²)/32, w6 = 5 a5/384 (the paper's B0, B1, I0, I1 are misprinted;
//! docs/explanation/model.md 3). y rather than κ is the unknown: near the rod's tip κ vanishes like a square root, y
//! linearly.

use crate::error::SolveError;
use crate::scalar::{LAST_STEP_TOLERANCE, PRECISION, Scalar};

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

/// The section's tangent is not positive at this bending strain κR.
pub(crate) fn singular(bending_strain: f64) -> SolveError {
    SolveError::SectionSingular { bending_strain }
}

impl<T: Scalar> Section<T> {
    /// The section of a rod with these coefficients a1…a5 of eq. 12 (Pa).
    pub fn new(stress_coefficients_pa: &[T; 5]) -> Self {
        Self { a: stress_coefficients_pa.map(|a| a / stress_coefficients_pa[0]) }
    }

    /// Whether stress is proportional to strain. A coefficient that is zero but has derivatives counts.
    pub(crate) fn is_straight(&self) -> bool {
        self.a[1..] == [T::of(0.0); 4]
    }

    /// The same section in another kind of number.
    pub fn map<U>(&self, f: impl Fn(T) -> U) -> Section<U> {
        Section { a: self.a.map(f) }
    }

    /// Taylor coefficients of σ at a stretch: σ, σ', σ''/2 … σ⁽⁵⁾/120.
    pub(crate) fn taylor(&self, e: T) -> [T; 6] {
        let [a1, a2, a3, a4, a5] = self.a;
        let mut s = [T::of(0.0), a1, a2, a3, a4, a5];
        for first in 0..5 {
            for k in (first..5).rev() {
                s[k] += e * s[k + 1];
            }
        }
        s
    }

    /// Energy of pure stretch over A·E.
    pub(crate) fn stretch_energy(&self, e: T) -> T {
        let [a1, a2, a3, a4, a5] = self.a;
        e * e * (a1 / 2.0 + e * (a2 / 3.0 + e * (a3 / 4.0 + e * (a4 / 5.0 + e * a5 / 6.0))))
    }

    /// Bending moment over A·E·R at a strain (eq. 17).
    pub fn moment(&self, strain: Strain<T>) -> T {
        let [_, s1, _, s3, _, s5] = self.taylor(strain.axial);
        let y = strain.bending_squared;
        y.sqrt() * (s1 * 0.25 + y * (s3 * 0.125 + y * s5 * (5.0 / 64.0)))
    }

    /// Axial force over A·E at a strain (eq. 16).
    pub fn axial_force(&self, strain: Strain<T>) -> T {
        let [s0, _, s2, _, s4, _] = self.taylor(strain.axial);
        let y = strain.bending_squared;
        s0 + y * (s2 * 0.25 + y * s4 * 0.125)
    }

    /// Strain energy over A·E at a strain.
    pub fn energy(&self, strain: Strain<T>) -> T {
        let [_, s1, _, s3, _, s5] = self.taylor(strain.axial);
        let y = strain.bending_squared;
        self.stretch_energy(strain.axial) + y * (s1 * 0.125 + y * (s3 * (1.0 / 32.0) + y * s5 * (5.0 / 384.0)))
    }

    /// Stretch of a section without bending under the axial force n (over A·E).
    pub(crate) fn stretch(&self, n: T) -> Result<T, SolveError> {
        let mut e = n;
        let mut left = T::EXTRA_STEPS;
        for _ in 0..50 {
            let [stress, tangent, ..] = self.taylor(e);
            if tangent.value() <= 0.0 || tangent.value().is_nan() {
                return Err(singular(0.0));
            }
            let step = (stress - n) / tangent;
            e -= step;
            if step.value().abs() <= 4.0 * f64::EPSILON * e.value().abs() {
                if left == 0 {
                    return Ok(e);
                }
                left -= 1;
            }
        }
        // Rounding may prevent convergence to the last bit; a larger error means a flat curve.
        let miss = self.taylor(e)[0] - n;
        if miss.value().abs() <= PRECISION * n.value().abs() { Ok(e) } else { Err(singular(0.0)) }
    }

    /// Stretch e and bending strain b = κR at an axial force (over A·E) and a bending moment (over A·E·R), as an
    /// integration along the rod needs them, and the Jacobian of force and moment. `start` is a guess of (e, b).
    ///
    /// # Errors
    /// [`SolveError::SectionSingular`].
    pub fn invert(&self, n: T, m: T, start: (T, T)) -> Result<(T, T, [T; 4]), SolveError> {
        let (mut e, mut b) = start;
        let mut left = T::EXTRA_STEPS;
        for _ in 0..60 {
            let [s0, s1, s2, s3, s4, s5] = self.taylor(e);
            let y = b * b;
            let n_now = s0 + y * (s2 * 0.25 + y * s4 * 0.125);
            let m_now = b * (s1 * 0.25 + y * (s3 * 0.125 + y * s5 * (5.0 / 64.0)));
            let n_e = s1 + y * (s3 * 0.75 + y * s5 * 0.625);
            let n_b = b * (s2 * 0.5 + y * s4 * 0.5);
            let m_b = s1 * 0.25 + y * (s3 * 0.375 + y * s5 * (25.0 / 64.0));
            let det = n_e * m_b - n_b * n_b;
            if !(det.value() > 0.0 && n_e.value() > 0.0) {
                return Err(singular(b.value().abs()));
            }
            let (r1, r2) = (n - n_now, m - m_now);
            let (de, db) = ((r1 * m_b - r2 * n_b) / det, (n_e * r2 - n_b * r1) / det);
            e += de;
            b += db;
            if de.value().abs() + db.value().abs() <= LAST_STEP_TOLERANCE * (e.value().abs() + b.value().abs()) {
                if left == 0 {
                    return Ok((e, b, [n_e, n_b, n_b, m_b]));
                }
                left -= 1;
            }
        }
        Err(singular(b.value().abs()))
    }

    /// Minimum bending stiffness over that of the unbent section, from no bending up to y = (κR)², the axis unstretched.
    pub fn softest(&self, bending_squared: f64) -> f64 {
        let [_, a2, a3, _, a5] = self.a.map(Scalar::value);
        let at = |y: f64| 1.0 + y * (1.5 * a3 - a2 * a2 + y * (25.0 / 16.0) * a5);
        let ends = at(bending_squared).min(1.0);
        let vertex = (a2 * a2 - 1.5 * a3) / (2.0 * (25.0 / 16.0) * a5);
        if vertex > 0.0 && vertex < bending_squared { ends.min(at(vertex)) } else { ends }
    }

    /// κM + (1 + e)N − W over A·E: constant along the rod (docs/explanation/model.md section 3).
    pub fn first_integral(&self, strain: Strain<T>) -> T {
        let b = strain.bending_squared.sqrt();
        b * self.moment(strain) + (strain.axial + 1.0) * self.axial_force(strain) - self.energy(strain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Material;
    use crate::scalar::Dual;

    /// A law that is neither even nor odd.
    const SECTION: Section = Section { a: [1.0, -2.0, -150.0, 300.0, 3e4] };

    fn close(found: f64, expected: f64) -> bool {
        (found - expected).abs() < 1e-12 * (1.0 + expected.abs())
    }

    /// As eqs 16 and 17 follow from it: ∂W/∂e is the force, ∂W/∂(κR) the moment.
    #[test]
    fn force_and_moment_are_the_derivatives_of_the_energy_and_lead_back_to_the_strain() {
        for [stretch, bending] in [[0.0, 0.01], [0.004, 0.03], [-0.006, 0.05], [0.002, 0.08]] {
            let (e, b) = (Dual::<2>::parameter(stretch, 0), Dual::parameter(bending, 1));
            let (section, strain) = (SECTION.map(Dual::of), Strain { axial: e, bending_squared: b * b });
            let [n, m, w] = [section.axial_force(strain), section.moment(strain), section.energy(strain)];
            assert!(close(w.by[0], n.value) && close(w.by[1], m.value), "{w:?} {n:?} {m:?}");
            // Of a rod that is only stretched, every fibre has the stress of eq. 12.
            let stretched = SECTION.axial_force(Strain { axial: stretch, bending_squared: 0.0 });
            assert!(close(Material { stress_coefficients_pa: SECTION.a }.stress_pa(stretch), stretched));
            let (e, b, tangent) = SECTION.invert(n.value, m.value, (0.0, 0.9 * bending)).unwrap();
            assert!(close(e, stretch) && close(b, bending), "{e} for {stretch}, {b} for {bending}");
            for (found, expected) in tangent.into_iter().zip(n.by.into_iter().chain(m.by)) {
                assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            }
        }
    }

    #[test]
    fn the_softest_bending_is_the_least_from_none_up_to_that_of_the_clamp() {
        // A plateau, one that the axis softens further, and a law that only softens.
        for (a2, a5) in [(0.0, 4e5), (10.0, 4e5), (0.0, -1e4)] {
            let section = Section { a: [1.0, a2, -1000.0, 0.0, a5] };
            // The moment's slope along the bending while the force stays.
            let stiffness = |y: f64| {
                let (e, b) = (Dual::<2>::parameter(0.0, 0), Dual::parameter(y.sqrt(), 1));
                let (section, strain) = (section.map(Dual::of), Strain { axial: e, bending_squared: b * b });
                let [_, n_b] = section.axial_force(strain).by;
                4.0 * (section.moment(strain).by[1] - n_b * n_b)
            };
            for y in [4e-4, 1.1e-3, 1.7e-3] {
                let least = (1..=2000).map(|k| stiffness(y * f64::from(k) / 2000.0)).fold(1.0, f64::min);
                assert!((section.softest(y) - least).abs() < 1e-6, "{} {least} up to {y}", section.softest(y));
            }
        }
    }
}
