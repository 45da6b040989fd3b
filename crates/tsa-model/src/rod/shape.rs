//! The integrals over a rod whose amplitude is given, with their derivatives.

use super::sections::Sections;
use super::{Line, Partial, Rod, RodModel, RodShape, TipForce};
use crate::error::SolveError;
use crate::quadrature::Rule;
use crate::scalar::Scalar;
use crate::section::Strain;

impl<T: Scalar> Rod<T> {
    /// Shape of the rod with this amplitude (above 0) under `force`, by a rule.
    ///
    /// Length and position along the force are integrals over h; the position across the force is M(0)/P. All are
    /// functions of P, of P − N_l (with which x = (P − N_l) sinh² h) and of the amplitude. The derivatives are those of
    /// the rule's sum, also where its nodes do not resolve the integrand, so that Newton's method converges there too.
    pub(crate) fn shape(
        &self,
        force: TipForce<T>,
        amplitude: T,
        rule: &Rule,
        exact: bool,
    ) -> Result<RodShape<T>, SolveError> {
        let line = self.line(force);
        let (p, [q, r]) = (line.p, line.by);
        let (sinh, cosh) = amplitude.sinh_cosh();
        let (growth, cosh2) = (sinh * sinh, cosh * cosh);
        let (zero, one) = (T::of(0.0), T::of(1.0));
        // P − N_l over A·E, and its derivatives by amplitude, px and py.
        let drop = p * (q + 1.0) / cosh2;
        let drop_by = [-(drop * sinh / cosh * 2.0), (q + 1.0) / cosh2, r / cosh2];
        let p_by = [zero, q, r];
        let n_tip = p - drop;
        let mut sections = Sections::new(self, n_tip, exact)?;
        let over_drop = one / drop;
        let (mut length, mut length_by_p, mut length_by_drop) = (zero, zero, zero);
        let (mut along, mut along_by_p, mut along_by_drop) = (zero, zero, zero);
        let (mut length_by_h, mut along_by_h) = (zero, zero);
        for (t, weight) in rule.iter() {
            let g = (amplitude * t).sinh_squared();
            let x = drop * g;
            let s = sections.next(x)?;
            let n = n_tip - x;
            let over = one / (p + n);
            // dψ/κ = 2R element dh
            let element = (over / s.ratio).sqrt() * weight;
            let by_p = -(over + s.ratio_by_tip * 0.5);
            let by_drop = ((g + 1.0) * over + (-s.growth + 1.0) * over_drop + s.ratio_by_tip) * 0.5;
            let stretched = s.stretch + 1.0;
            length += element;
            length_by_p += element * by_p;
            length_by_drop += element * by_drop;
            along += element * stretched * n;
            along_by_p += element * (stretched * (n * by_p + 1.0) + n * s.stretch_by_tip);
            let stretch_by_drop = s.stretch_by_x * g - s.stretch_by_tip;
            along_by_drop += element * (stretched * (n * by_drop - g - 1.0) + n * stretch_by_drop);
            // With the amplitude h = S t and g = sinh² h change.
            let g_by = (g * (g + 1.0)).sqrt() * t;
            let by_h = g_by * (drop * over + (-s.growth + 1.0) / g);
            length_by_h += element * by_h;
            along_by_h += element * (stretched * n * by_h + g_by * drop * 2.0 * (n * s.stretch_by_x - stretched));
        }
        let scale = amplitude * self.radius_m * 2.0;
        let all = [&mut length, &mut length_by_p, &mut length_by_drop, &mut length_by_h, &mut along, &mut along_by_p];
        for sum in all.into_iter().chain([&mut along_by_drop, &mut along_by_h]) {
            *sum = *sum * scale;
        }
        let clamp = sections.next(drop * growth)?;
        let bending = clamp.strain.bending_squared.sqrt();
        // The moment over A·E·R.
        let moment = match self.model {
            RodModel::Elastica => bending * 0.25,
            RodModel::Full | RodModel::Inextensible => self.section.moment(clamp.strain),
        };
        let stretched = clamp.stretch + 1.0;
        let arm = self.radius_m / (bending * p);
        let length_by_end = length / amplitude + length_by_h;
        let along_by_end = (along / amplitude + along_by_h) / p;
        along = along / p;
        along_by_p = (along_by_p - along) / p;
        along_by_drop = along_by_drop / p;
        let across = self.radius_m * moment / p;
        let across_by_p = arm * clamp.less_stretch - across / p;
        let across_by_drop = arm * (stretched * growth - clamp.less_stretch);
        let mut sums = [[zero; 4]; 3];
        let totals = [
            (length, length_by_end, length_by_p, length_by_drop),
            (along, along_by_end, along_by_p, along_by_drop),
            (across, arm * stretched * drop * sinh * cosh * 2.0, across_by_p, across_by_drop),
        ];
        for (sum, (value, by_end, by_p, by_drop)) in sums.iter_mut().zip(totals) {
            *sum = [value, by_end + by_drop * drop_by[0], zero, zero];
            for k in 1..3 {
                sum[k + 1] = by_p * p_by[k] + by_drop * drop_by[k];
            }
        }
        Ok(self.turned(&line, sums, clamp.strain, sections.evaluations))
    }

    /// The shape from length and position along and across the force, each with derivatives by amplitude and px, py.
    fn turned(&self, line: &Line<T>, sums: [[T; 4]; 3], clamp: Strain<T>, evaluations: u32) -> RodShape<T> {
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
            clamp,
            evaluations,
        };
        for partial in [&mut shape.length, &mut shape.reach, &mut shape.deflection] {
            partial.by_inward = partial.by_inward / self.stiffness_n;
            partial.by_sideways = partial.by_sideways / self.stiffness_n;
        }
        shape
    }
}
