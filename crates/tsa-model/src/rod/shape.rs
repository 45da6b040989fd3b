//! The integrals over a rod whose amplitude is given, with their derivatives.

use super::{Line, Partial, Rod, RodModel, RodShape, TipForce};
use crate::error::SolveError;
use crate::quadrature::Rule;
use crate::scalar::Scalar;
use crate::section::{Demand, Section};

/// A point of the rod at h = S t.
#[derive(Clone, Copy)]
pub(super) struct Place<T> {
    pub sinh: T,
    pub cosh: T,
    /// sin(ψ/2)
    pub sin: T,
    pub cos_psi: T,
    /// N_l − N over A·E.
    pub less: T,
}

impl<T: Scalar> Place<T> {
    pub fn demand(&self, model: RodModel, p: T, tip_stretch: T) -> Demand<T> {
        if model == RodModel::Full {
            Demand { n: p * self.cos_psi, n_tip_less_n: self.less, axial_less: self.less, tip_stretch }
        } else {
            let zero = T::of(0.0);
            Demand { n: zero, n_tip_less_n: self.less, axial_less: zero, tip_stretch: zero }
        }
    }
}

impl<T: Scalar> Rod<T> {
    /// Shape of the rod with this amplitude (above 0) under `force`, by a rule.
    pub(crate) fn shape(&self, force: TipForce<T>, amplitude: T, rule: &Rule) -> Result<RodShape<T>, SolveError> {
        if self.model == RodModel::Elastica {
            return Ok(self.elastica(force, amplitude, rule));
        }
        let full = self.model == RodModel::Full;
        let line = self.line(force);
        let p = line.p;
        let (sinh_s, cosh_s) = amplitude.sinh_cosh();
        // m = sin(ψ_l/2) and its derivatives by amplitude, px, py.
        let m = line.sin_half / cosh_s;
        let m_by = [-(m * sinh_s / cosh_s), line.sin_half_by[0] / cosh_s, line.sin_half_by[1] / cosh_s];
        let n_tip = p * (-(m * m * 2.0) + 1.0);
        let zero = T::of(0.0);
        let e_tip = if full { self.section.stretch(n_tip)? } else { zero };
        let p_by = [zero, line.by[0], line.by[1]];
        let n_tip_by: [T; 3] = core::array::from_fn(|k| p_by[k] * (-(m * m * 2.0) + 1.0) - p * m * m_by[k] * 4.0);
        // dψ/κ = element dh, element = R √(2/p) / (cos(ψ/2) √Y), Y = y/(N_l − N).
        let scale = amplitude * self.radius_m * (T::of(2.0) / p).sqrt();
        // Length, and tip position along and across the force, each with its derivatives.
        let mut sums = [[zero; 4]; 3];
        let mut evaluations = 0;
        // (e_l − e)/(N_l − N) and Y are smooth: the next node's are extrapolated from the last two.
        let mut last: [Option<(f64, f64, T, T)>; 2] = [None; 2];
        let at = |t: f64| {
            let (sinh, cosh) = (amplitude * t).sinh_cosh();
            let sin = m * cosh;
            Place { sinh, cosh, sin, cos_psi: -(sin * sin * 2.0) + 1.0, less: p * m * m * sinh * sinh * 2.0 }
        };
        let (grading, power) = (self.model.grading(), self.model.power());
        for (node, share) in rule.iter() {
            let (t, weight) = if grading == 1.0 {
                (node, share)
            } else {
                let t = Scalar::powf(node, grading);
                (t, share * grading * t / node)
            };
            let here = at(t);
            let Place { sinh, cosh, sin, cos_psi, less } = here;
            let cos = (-(sin * sin) + 1.0).sqrt();
            let demand = here.demand(self.model, p, e_tip);
            let start = match last {
                // Far ahead a straight line means nothing.
                [Some((_, l1, e1, y1)), Some((_, l2, e2, y2))] if less.value() < 4.0 * l1 => {
                    let ahead = (less.value() - l1) / (l1 - l2);
                    ((e1 + (e1 - e2) * ahead) * less, (y1 + (y1 - y2) * ahead) * less)
                }
                [Some((_, _, e1, y1)), _] => (e1 * less, y1 * less),
                _ => Section::linear_guess(demand),
            };
            let section = match (self.model, last[0]) {
                // κM − W = m/(m+1) κM, so that (κR)² = ((N_l − N) 4 (m+1)/m)^(2/(m+1)).
                (RodModel::PowerLaw { .. }, _) => None,
                (_, before) => Some(self.section.solve(demand, start).or_else(|stopped| {
                    // A strongly curved law between two nodes far apart: in smaller steps from the last one.
                    let Some((t0, _, e0, y0)) = before else { return Err(stopped) };
                    let mut march = |steps: u32| {
                        let (mut ratios, mut found) = ((e0, y0), Err(stopped));
                        for k in 1..=steps {
                            let near = at(t0 + (t - t0) * (f64::from(k) / f64::from(steps)));
                            let start = (ratios.0 * near.less, ratios.1 * near.less);
                            found = self.section.solve(near.demand(self.model, p, e_tip), start);
                            let Ok(s) = &found else { break };
                            evaluations += s.iterations;
                            ratios = (s.less_stretch / near.less, s.strain.bending_squared / near.less);
                        }
                        found
                    };
                    march(16).or_else(|_| march(256))
                })?),
            };
            let (e, less_stretch, y) = match &section {
                Some(s) => (s.strain.axial, s.less_stretch, s.strain.bending_squared),
                None => (zero, zero, (less * (8.0 / (2.0 - power))).powf(T::of(power))),
            };
            let ratio = y / less;
            last = [Some((t, less.value(), less_stretch / less, ratio)), last[0]];
            evaluations += section.as_ref().map_or(1, |s| s.iterations);
            let element = scale * weight / (cos * ratio.sqrt());
            let sin_psi = sin * cos * 2.0;
            let stretch = if full { e + 1.0 } else { T::of(1.0) };
            let (along, across) = (stretch * cos_psi, stretch * sin_psi);
            sums[0][0] += element;
            sums[1][0] += along * element;
            sums[2][0] += across * element;
            let (inv_y, inv_m, tan_half) = (T::of(0.5) / y, T::of(1.0) / m, sin / cos);
            for k in 0..3 {
                let mut sin_by = m_by[k] * cosh;
                let mut less_by = p_by[k] * m * m * sinh * sinh * 2.0 + p * m * m_by[k] * sinh * sinh * 4.0;
                let mut own = m_by[k] * inv_m;
                if k == 0 {
                    sin_by += m * sinh * t;
                    less_by += p * m * m * sinh * cosh * (4.0 * t);
                    own += cosh / sinh * t + T::of(1.0) / amplitude;
                }
                let (e_by, y_by) = match &section {
                    Some(s) if full => {
                        let n_by = p_by[k] * cos_psi - p * sin * sin_by * 4.0;
                        s.derivative(n_by, less_by + e_tip * n_tip_by[k] - e * n_by)
                    }
                    Some(s) => (zero, s.derivative(zero, less_by).1),
                    None => (zero, y * power * less_by / less),
                };
                let cos_by = -(tan_half * sin_by);
                let element_by = element * (own - y_by * inv_y - cos_by / cos);
                let along_by = e_by * cos_psi - stretch * sin * sin_by * 4.0;
                let across_by = e_by * sin_psi + stretch * (sin_by * cos + sin * cos_by) * 2.0;
                sums[0][k + 1] += element_by;
                sums[1][k + 1] += along_by * element + along * element_by;
                sums[2][k + 1] += across_by * element + across * element_by;
            }
        }
        Ok(self.turned(&line, sums, evaluations))
    }

    /// Euler's elastica: y = 8 (N_l − N) and no stretch, so that nothing is left to solve at the nodes.
    fn elastica(&self, force: TipForce<T>, amplitude: T, rule: &Rule) -> RodShape<T> {
        let line = self.line(force);
        let (sinh_s, cosh_s) = amplitude.sinh_cosh();
        let m = line.sin_half / cosh_s;
        let m_by = [-(m * sinh_s / cosh_s), line.sin_half_by[0] / cosh_s, line.sin_half_by[1] / cosh_s];
        let zero = T::of(0.0);
        let scale = amplitude * self.radius_m / (line.p.sqrt() * 2.0);
        let half = T::of(-0.5) / line.p;
        let own = [T::of(1.0) / amplitude, line.by[0] * half, line.by[1] * half];
        let mut sums = [[zero; 4]; 3];
        for (t, weight) in rule.iter() {
            let (sinh, cosh) = (amplitude * t).sinh_cosh();
            let sin = m * cosh;
            let cos2 = -(sin * sin) + 1.0;
            let cos = cos2.sqrt();
            let element = scale * weight / cos;
            let (along, across) = (cos2 * 2.0 - 1.0, sin * cos * 2.0);
            sums[0][0] += element;
            sums[1][0] += along * element;
            sums[2][0] += across * element;
            for k in 0..3 {
                let mut sin_by = m_by[k] * cosh;
                if k == 0 {
                    sin_by += m * sinh * t;
                }
                let element_by = element * (own[k] + sin * sin_by / cos2);
                sums[0][k + 1] += element_by;
                sums[1][k + 1] += along * element_by - sin * sin_by * element * 4.0;
                // d(sin ψ) = 2 cos ψ d sin(ψ/2)/cos(ψ/2)
                sums[2][k + 1] += across * element_by + along * sin_by / cos * element * 2.0;
            }
        }
        self.turned(&line, sums, rule.count() as u32)
    }

    /// The shape from length and position along and across the force, each with derivatives by amplitude and px, py.
    fn turned(&self, line: &Line<T>, sums: [[T; 4]; 3], evaluations: u32) -> RodShape<T> {
        let (zero, p) = (T::of(0.0), line.p);
        let [length, along, across] = sums;
        let [q, r] = line.by;
        let (mut reach, mut deflection) = ([zero; 4], [zero; 4]);
        for k in 0..4 {
            reach[k] = across[k] * r - along[k] * q;
            deflection[k] = along[k] * r + across[k] * q;
        }
        // The line of the force turns with px and py.
        for (k, turn) in [(2, r / p), (3, -(q / p))] {
            reach[k] -= deflection[0] * turn;
            deflection[k] += reach[0] * turn;
        }
        let mut shape = RodShape {
            length: Partial::of(length),
            reach: Partial::of(reach),
            deflection: Partial::of(deflection),
            evaluations,
        };
        for partial in [&mut shape.length, &mut shape.reach, &mut shape.deflection] {
            partial.by_inward = partial.by_inward / self.stiffness_n;
            partial.by_sideways = partial.by_sideways / self.stiffness_n;
        }
        shape
    }
}
