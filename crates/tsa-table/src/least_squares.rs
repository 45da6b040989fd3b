//! Weighted least squares by the normal equations.

/// Normal equations of a linear fit with up to N unknowns: Σ w² v vᵀ and Σ w² v t.
#[derive(Clone)]
pub struct Normal<const N: usize> {
    matrix: [[f64; N]; N],
    right: [f64; N],
}

impl<const N: usize> Default for Normal<N> {
    fn default() -> Self {
        Self { matrix: [[0.0; N]; N], right: [0.0; N] }
    }
}

impl<const N: usize> Normal<N> {
    /// Adds an equation Σ v_k c_k = target, both sides already weighted.
    pub fn add(&mut self, v: &[f64; N], target: f64) {
        for (k, a) in v.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            self.right[k] += a * target;
            for (m, b) in self.matrix[k].iter_mut().zip(v).take(k + 1) {
                *m += a * b;
            }
        }
    }

    /// Solves for the unknowns in `kept`, in that order, with all others zero; `None` if the equations do not determine
    /// them.
    pub fn solve(&self, kept: &[usize]) -> Option<[f64; N]> {
        let n = kept.len();
        let at = |i: usize, j: usize| {
            let (a, b) = (*kept.get(i)?, *kept.get(j)?);
            self.matrix.get(a.max(b))?.get(a.min(b)).copied()
        };
        // Cholesky of the matrix scaled to a unit diagonal.
        let mut scale = [0.0; N];
        for (i, s) in scale.iter_mut().enumerate().take(n) {
            *s = 1.0 / libm::sqrt(at(i, i)?);
        }
        let mut l = [[0.0; N]; N];
        for i in 0..n {
            for j in 0..=i {
                let known: f64 = l[i].iter().zip(&l[j]).take(j).map(|(a, b)| a * b).sum();
                let sum = at(i, j)? * scale[i] * scale[j] - known;
                if i == j {
                    if sum.is_nan() || sum <= 1e-14 {
                        return None;
                    }
                    l[i][i] = libm::sqrt(sum);
                } else {
                    l[i][j] = sum / l[j][j];
                }
            }
        }
        let mut c = [0.0; N];
        for i in 0..n {
            let known: f64 = l[i].iter().zip(&c).take(i).map(|(a, b)| a * b).sum();
            c[i] = (self.right[*kept.get(i)?] * scale[i] - known) / l[i][i];
        }
        for i in (0..n).rev() {
            let known: f64 = l.iter().zip(&c).take(n).skip(i + 1).map(|(row, c)| row[i] * c).sum();
            c[i] = (c[i] - known) / l[i][i];
        }
        for (c, s) in c.iter_mut().zip(scale) {
            *c *= s;
        }
        Some(c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_is_recovered_and_undetermined_unknowns_are_refused() {
        let mut normal = Normal::<4>::default();
        for k in 0..9 {
            let x = f64::from(k) / 4.0 - 1.0;
            let w = 1.0 + x * x;
            normal.add(&[w, w * x, w * x * x, w * x * x * x], w * (0.5 - 2.0 * x + 3.0 * x * x));
        }
        let c = normal.solve(&[0, 1, 2, 3]).unwrap();
        for (found, expected) in c.iter().zip([0.5, -2.0, 3.0, 0.0]) {
            assert!((found - expected).abs() < 1e-12, "{c:?}");
        }
        // The solution has the order of `kept`.
        assert!((normal.solve(&[2, 0, 1]).unwrap()[0] - 3.0).abs() < 1e-12);
        let mut poor = Normal::<4>::default();
        poor.add(&[1.0, 2.0, 0.0, 0.0], 1.0);
        assert!(poor.solve(&[0, 1]).is_none());
        assert!(poor.solve(&[0]).is_some());
        assert!(poor.solve(&[3]).is_none());
    }
}
