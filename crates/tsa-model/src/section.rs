//! A round section of the rod in tension and bending (eqs 16, 17), and its inversion.
//!
//! Stresses are divided by Young's modulus at zero strain, forces by A·E. With b = κR and y = b², the energy of the
//! section is w(e, y) = w0(e) + w2(e) y + w4(e) y² + w6 y³, where integrating eq. 12 over the circle gives
//! w2 = σ'/8, w4 = (a3 + 4 a4 e + 10 a5 e²)/32, w6 = 5 a5/384 (the paper's B0, B1, I0, I1 are misprinted; model.md 3).
//! y rather than κ is the unknown: near the rod's tip κ vanishes like a square root, y linearly.

use crate::material::Material;

/// A round section, normalised by its modulus at zero strain.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// a_i / a_1.
    a: [f64; 5],
}

/// Axial strain and squared bending strain of a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strain {
    /// Stretch of the axis e.
    pub axial: f64,
    /// (κR)².
    pub bending_squared: f64,
}

/// σ and its derivatives at the axis, and the bending terms of the energy.
struct Terms {
    stress: f64,
    tangent: f64,
    second: f64,
    third: f64,
    w4: f64,
    w4_e: f64,
    w4_ee: f64,
}

/// The section equations at a strain: axial force n, q = κm − (w − w0), and their derivatives.
struct Equations {
    n: f64,
    n_e: f64,
    n_y: f64,
    q: f64,
    q_e: f64,
    q_y: f64,
    stress: f64,
}

/// What the first integral asks of a section.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Demand {
    /// Axial force over A·E.
    pub n: f64,
    /// Axial force at the tip less the one here, over A·E (given apart, so that no digit cancels).
    pub n_tip_less_n: f64,
    /// Stretch of the axis at the tip.
    pub tip_stretch: f64,
}

/// A solved section with the Jacobian of its two equations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solved {
    pub strain: Strain,
    pub iterations: u32,
    jacobian: [f64; 4],
}

impl Solved {
    /// Derivative of (e, y) when the right-hand sides of the two equations move by (r1, r2).
    pub(crate) fn derivative(&self, r1: f64, r2: f64) -> (f64, f64) {
        let [a, b, c, d] = self.jacobian;
        let det = a * d - b * c;
        ((r1 * d - r2 * b) / det, (a * r2 - c * r1) / det)
    }
}

/// The inversion stopped here: the section's tangent is not positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Singular {
    pub bending_strain: f64,
}

impl Equations {
    /// Derivatives of the axial force and of the first integral by e and y.
    fn jacobian(&self, n: f64) -> [f64; 4] {
        [self.n_e, self.n_y, self.q_e + n - self.stress, self.q_y]
    }
}

impl Section {
    /// The section of a rod of this material.
    pub fn new(material: &Material) -> Self {
        let e = material.stress_coefficients_pa[0];
        Self { a: material.stress_coefficients_pa.map(|a| a / e) }
    }

    fn terms(&self, e: f64) -> Terms {
        let [a1, a2, a3, a4, a5] = self.a;
        Terms {
            stress: e * (a1 + e * (a2 + e * (a3 + e * (a4 + e * a5)))),
            tangent: a1 + e * (2.0 * a2 + e * (3.0 * a3 + e * (4.0 * a4 + e * 5.0 * a5))),
            second: 2.0 * a2 + e * (6.0 * a3 + e * (12.0 * a4 + e * 20.0 * a5)),
            third: 6.0 * a3 + e * (24.0 * a4 + e * 60.0 * a5),
            w4: (a3 + e * (4.0 * a4 + e * 10.0 * a5)) / 32.0,
            w4_e: (4.0 * a4 + 20.0 * a5 * e) / 32.0,
            w4_ee: 20.0 * a5 / 32.0,
        }
    }

    /// Energy of pure stretch over A·E.
    pub(crate) fn stretch_energy(&self, e: f64) -> f64 {
        let [a1, a2, a3, a4, a5] = self.a;
        e * e * (a1 / 2.0 + e * (a2 / 3.0 + e * (a3 / 4.0 + e * (a4 / 5.0 + e * a5 / 6.0))))
    }

    fn equations(&self, e: f64, y: f64) -> Equations {
        let t = self.terms(e);
        let w6 = 5.0 * self.a[4] / 384.0;
        Equations {
            n: t.stress + y * (t.second / 8.0 + y * t.w4_e),
            n_e: t.tangent + y * (t.third / 8.0 + y * t.w4_ee),
            n_y: t.second / 8.0 + 2.0 * y * t.w4_e,
            q: y * (t.tangent / 8.0 + y * (3.0 * t.w4 + y * 5.0 * w6)),
            q_e: y * (t.second / 8.0 + 3.0 * y * t.w4_e),
            q_y: t.tangent / 8.0 + y * (6.0 * t.w4 + y * 15.0 * w6),
            stress: t.stress,
        }
    }

    /// Bending moment over A·E·R at a strain (eq. 17).
    pub fn moment(&self, strain: Strain) -> f64 {
        let t = self.terms(strain.axial);
        let y = strain.bending_squared;
        let w6 = 5.0 * self.a[4] / 384.0;
        crate::math::sqrt(y) * (t.tangent / 4.0 + y * (4.0 * t.w4 + y * 6.0 * w6))
    }

    /// Axial force over A·E at a strain (eq. 16).
    pub fn axial_force(&self, strain: Strain) -> f64 {
        self.equations(strain.axial, strain.bending_squared).n
    }

    /// Strain energy over A·E at a strain.
    pub fn energy(&self, strain: Strain) -> f64 {
        let t = self.terms(strain.axial);
        let y = strain.bending_squared;
        let w6 = 5.0 * self.a[4] / 384.0;
        self.stretch_energy(strain.axial) + y * (t.tangent / 8.0 + y * (t.w4 + y * w6))
    }

    /// Stretch of a section without bending under the axial force n (over A·E).
    pub(crate) fn stretch(&self, n: f64) -> Result<f64, Singular> {
        let mut e = n;
        for _ in 0..50 {
            let t = self.terms(e);
            if t.tangent <= 0.0 {
                return Err(Singular { bending_strain: 0.0 });
            }
            let step = (t.stress - n) / t.tangent;
            e -= step;
            if step.abs() <= 4.0 * f64::EPSILON * e.abs() {
                return Ok(e);
            }
        }
        // Rounding may keep the last bit moving; anything worse is a flat curve.
        if (self.terms(e).stress - n).abs() <= 1e-14 * n.abs() { Ok(e) } else { Err(Singular { bending_strain: 0.0 }) }
    }

    /// σ(e1) − σ(e0) over e1 − e0, and w0(e1) − w0(e0) over e1 − e0, without cancellation.
    fn divided_differences(&self, e1: f64, e0: f64) -> (f64, f64) {
        let (mut stress, mut energy) = (0.0, 0.0);
        // complete[i] = Σ e1^(i−k) e0^k
        let (mut complete, mut power) = (1.0, 1.0);
        for (i, a) in self.a.iter().enumerate() {
            stress += a * complete;
            power *= e0;
            complete = complete * e1 + power;
            energy += a * complete / (i as f64 + 2.0);
        }
        (stress, energy)
    }

    /// Strain at which the axial force is `demand.n` and the first integral has the tip's value (subscript l):
    /// q(e, y) + e n − w0(e) = (n_l − n) + e_l n_l − w0(e_l). Both are written in e_l − e, so that no digit cancels
    /// near the tip. `start` is a neighbour's strain, or `None` to begin from the straight line.
    pub(crate) fn solve(&self, demand: Demand, start: Option<Strain>) -> Result<Solved, Singular> {
        let Demand { n, n_tip_less_n, tip_stretch } = demand;
        let (mut less, mut y) = match start {
            Some(s) => (tip_stretch - s.axial, s.bending_squared),
            None => (n_tip_less_n, 8.0 * n_tip_less_n),
        };
        let mut iterations = 0;
        loop {
            let e = tip_stretch - less;
            let eq = self.equations(e, y);
            let [a, b, c, d] = eq.jacobian(n);
            let det = a * d - b * c;
            let singular = Singular { bending_strain: crate::math::sqrt(y.max(0.0)) };
            // `!(… > 0)` also catches NaN.
            if !(det > 0.0 && a > 0.0) {
                return Err(singular);
            }
            let (slope, mean) = self.divided_differences(tip_stretch, e);
            let bent = eq.n - eq.stress;
            let r1 = less * slope - bent - n_tip_less_n;
            let r2 = n_tip_less_n * (1.0 + tip_stretch) + less * (n - mean) - eq.q;
            let (mut de, mut dy) = ((r1 * d - r2 * b) / det, (a * r2 - c * r1) / det);
            // y must stay positive: shorten a step that would leave.
            let scale = if y + dy <= 0.1 * y { 0.9 * y / -dy } else { 1.0 };
            de *= scale;
            dy *= scale;
            less -= de;
            y += dy;
            iterations += 1;
            // Quadratic convergence: a step of 1e-9 leaves 1e-18.
            if scale == 1.0 && dy.abs() <= 1e-9 * y && de.abs() <= 1e-9 * (less.abs() + y) {
                let strain = Strain { axial: tip_stretch - less, bending_squared: y };
                let jacobian = self.equations(strain.axial, y).jacobian(n);
                return Ok(Solved { strain, iterations, jacobian });
            }
            if iterations >= 60 {
                return Err(singular);
            }
        }
    }
}
