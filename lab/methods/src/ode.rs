//! The rod's differential equations (eqs 13–24) along x/l, for every method that integrates them.

use tsa_model::SolveError;
use tsa_model::rod::{Compliance, Rod, RodResponse, TipForce};
use tsa_model::scalar::{Dual, Scalar};
use tsa_model::section::{Section, Strain};

/// Right-hand side of φ, M/(A·E·R), X/l and w/l by x/l.
pub(crate) struct RodOde<T> {
    pub section: Section<T>,
    /// l/R
    pub slenderness: T,
    /// Px and Py over A·E.
    pub inward: T,
    pub sideways: T,
}

/// Rotation, moment, and position along and across.
pub(crate) type Point<T> = [T; 4];

/// The equations at a point, with the derivatives that a Newton iteration needs.
pub(crate) struct Slope<T> {
    pub by_length: Point<T>,
    pub strain: (T, T),
    /// Derivatives of the first two slopes by rotation and moment, row by row.
    pub jacobian: [T; 4],
}

impl<T: Scalar> RodOde<T> {
    /// The same equations in another kind of number.
    pub fn map<U>(&self, f: impl Fn(T) -> U) -> RodOde<U> {
        RodOde {
            section: self.section.map(&f),
            slenderness: f(self.slenderness),
            inward: f(self.inward),
            sideways: f(self.sideways),
        }
    }

    /// `start` is a guess of (e, κR), from a neighbour.
    pub fn slope(&self, point: Point<T>, start: (T, T)) -> Result<Slope<T>, SolveError> {
        let [phi, moment, ..] = point;
        let (sin, cos) = phi.sin_cos();
        let axial = self.sideways * sin - self.inward * cos;
        let across = self.inward * sin + self.sideways * cos;
        let (e, b, [n_e, n_b, _, m_b]) = self.section.invert(axial, moment, start)?;
        let det = n_e * m_b - n_b * n_b;
        let l = self.slenderness;
        let stretch = e + 1.0;
        let (e_by_phi, b_by_phi) = (across * m_b / det, -(across * n_b / det));
        let (e_by_moment, b_by_moment) = (-(n_b / det), n_e / det);
        Ok(Slope {
            by_length: [b * l, -(stretch * across * l), stretch * cos, stretch * sin],
            strain: (e, b),
            jacobian: [
                b_by_phi * l,
                b_by_moment * l,
                (stretch * axial - e_by_phi * across) * l,
                -(e_by_moment * across * l),
            ],
        })
    }
}

/// The rod under a force whose components are the two parameters of the derivatives.
pub(crate) fn with_compliance(rod: &Rod, force: TipForce) -> RodOde<Dual<2>> {
    let parameter = |value: f64, k| Dual::parameter(value, k) / rod.stiffness_n;
    RodOde {
        section: rod.section.map(Dual::of),
        slenderness: Dual::of(rod.length_m / rod.radius_m),
        inward: parameter(force.inward_n, 0),
        sideways: parameter(force.sideways_n, 1),
    }
}

/// The rod under a force.
pub(crate) fn plain(rod: &Rod, force: TipForce) -> RodOde<f64> {
    RodOde {
        section: rod.section,
        slenderness: rod.length_m / rod.radius_m,
        inward: force.inward_n / rod.stiffness_n,
        sideways: force.sideways_n / rod.stiffness_n,
    }
}

/// A rod's response from the tip of an integrated rod and the strain (e, κR) at its clamp.
pub(crate) fn response(rod: &Rod, tip: Point<Dual<2>>, clamp: (f64, f64)) -> RodResponse {
    let compliance = |x: Dual<2>| Compliance {
        value: x.value * rod.length_m,
        by_inward: x.by[0] * rod.length_m,
        by_sideways: x.by[1] * rod.length_m,
    };
    RodResponse {
        reach: compliance(tip[2]),
        deflection: compliance(tip[3]),
        tip_angle_rad: tip[0].value,
        clamp: Strain { axial: clamp.0, bending_squared: clamp.1 * clamp.1 },
    }
}
